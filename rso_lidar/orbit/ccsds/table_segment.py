"""What segments of ephemerides and of tables of attitudes have in common: their rows and their usable span."""

from __future__ import annotations

import datetime
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.epochs import Epochs

EDGE_S = 1e-8  # an epoch this close outside an edge counts as on it, because dates are rounded


@dataclass(frozen=True, eq=False)
class TableSegment:
    """Rows at `time_s` from `start_utc`, usable from `begin_s` to `end_s`.

    Parameters
    ----------
    where : file and line, for messages
    start_utc : instant from which seconds count, None for the start of the run
    begin_s, end_s : usable span [s]
    time_s : (row,) [s]
    """

    where: str
    start_utc: datetime.datetime | None
    begin_s: float
    end_s: float
    time_s: np.ndarray

    def elapsed_s(self, epochs: Epochs) -> np.ndarray:
        """Return the seconds (time,) from the segment's start to the epochs."""
        return epochs.time_s if self.start_utc is None else epochs.since(self.start_utc)

    def clip_s(self, epochs: Epochs) -> np.ndarray:
        """Return the seconds (time,) from the segment's start to the epochs, clipped to its usable span."""
        clipped: np.ndarray = np.clip(self.elapsed_s(epochs), self.begin_s, self.end_s)
        return clipped


_Segment = TypeVar("_Segment", bound=TableSegment)


def sort_segments(segments: Iterable[_Segment]) -> tuple[_Segment, ...]:
    """Return segments in the order of time; `ScenarioError` if two overlap."""
    ordered = tuple(sorted(segments, key=lambda segment: segment.begin_s))
    for before, after in itertools.pairwise(ordered):
        if after.begin_s < before.end_s - EDGE_S:
            raise ScenarioError(f"{after.where}: overlaps the segment of {before.where}; correct their USEABLE_ times")
    return ordered


def locate_epochs(segments: Sequence[TableSegment], epochs: Epochs) -> np.ndarray:
    """Find the segment that applies at each epoch; where two meet, the later one does.

    Parameters
    ----------
    segments : in the order of time, as `read_attitudes` returns them
    epochs : instants

    Returns
    -------
    (time,) number of a segment, -1 where none applies
    """
    which = np.full(len(epochs), -1)
    for number, segment in enumerate(segments):
        time_s = segment.elapsed_s(epochs)
        which[(time_s >= segment.begin_s - EDGE_S) & (time_s <= segment.end_s + EDGE_S)] = number
    return which
