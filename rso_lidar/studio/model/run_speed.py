"""How long a run will take: some frames of a flight are made and timed on this machine, as busy as it is now."""

from __future__ import annotations

import time
from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import numpy as np

from rso_lidar.picture import even_indices
from rso_lidar.scenario import Scenario, parse_frames
from rso_lidar.studio.model.flight import PreviewFlight

_TIMED, _MOST_SPEEDS = 5, 50
_IMPORT_S = 2.0  # assumed: start of Python, and imports of the command line
_speeds: OrderedDict[str, RunSpeed] = OrderedDict()
_lock = Lock()  # of two measurements at once, each would slow the other


@dataclass(frozen=True)
class RunSpeed:
    """Time of some frames of a scenario: their numbers, seconds for each, and seconds before the first."""

    numbers: tuple[int, ...]
    seconds: tuple[float, ...]
    start_s: float

    @classmethod
    def measure(cls, text: str, scenario: Scenario) -> RunSpeed:
        """Time five frames from the first to the last; the speeds of the last texts are kept."""
        with _lock:
            if text not in _speeds:
                flight = PreviewFlight.of(text, scenario)
                flight.frame(0)  # compiles the kernels where they are not on disk yet
                rows = even_indices(len(flight.numbers), _TIMED)
                seconds = tuple(_time_frame(flight, row) for row in rows)
                _speeds[text] = cls(tuple(flight.numbers[row] for row in rows), seconds, _IMPORT_S + flight.built_s)
                while len(_speeds) > _MOST_SPEEDS:
                    _speeds.popitem(last=False)
            return _speeds[text]

    def estimate_s(self, frames: list[int]) -> float:
        """Return the time of a run of some frames [s]; between frames that were timed, it is interpolated."""
        return self.start_s + float(np.interp(frames, self.numbers, self.seconds).sum())


def _time_frame(flight: PreviewFlight, row: int) -> float:
    begin = time.perf_counter()
    flight.frame(row)
    return time.perf_counter() - begin


def estimate_run(scenario: Scenario, frames: str, speed: RunSpeed | None) -> str:
    """Return how many frames a run makes, and about how long it takes, in one line.

    Parameters
    ----------
    frames : which of its frames, as `rso-lidar run` takes them; empty for all
    speed : of this scenario, or None while it is being measured

    Raises
    ------
    ScenarioError
        If the scenario has no such frames.
    """
    chosen = list(scenario.time.choose_frames(parse_frames(frames or None)))
    words = f"{len(chosen):,} of {scenario.time.n_frames:,} frames in all; "
    if speed is None:
        return words + "timing some of them"
    return f"{words}about {_format_duration(speed.estimate_s(chosen))} ({len(speed.numbers)} frames were timed)"


def _format_duration(seconds: float) -> str:
    """Return a duration to two digits, in seconds, minutes or hours."""
    for limit, size, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (np.inf, 3600.0, "h")):
        if seconds < limit:
            count = max(seconds / size, 1.0)
            return f"{count:.0f} {unit}" if count < 100 else f"{round(count, -1):,.0f} {unit}"
    return ""
