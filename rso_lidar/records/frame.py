"""One laser flash: what the spacecraft could know, what was there, where it comes from, and what a controller may ask."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.records.reading import Labels, Reading
from rso_lidar.records.schema import Record, array
from rso_lidar.records.taxonomy import Taxonomy
from rso_lidar.records.truth import Truth

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class TargetEntry:
    """One target of a recording: the number in labels is its place in `Source.targets`."""

    name: str
    model: str
    mesh_sha256: str
    parts: tuple[str, ...]  # the number in the label `part` is the place in this list
    materials: tuple[str, ...]  # one for each part, in words
    facets: int  # in the source file, before repairs
    taxonomy: Taxonomy | None = None  # class, shape, size and how it turns; None where nobody has said


@dataclass(frozen=True)
class Source:
    """Where a frame comes from: enough to fly it again."""

    scenario: str  # resolved TOML, element sets inline
    title: str
    start_utc: str
    seed: int
    versions: Mapping[str, str]
    targets: tuple[TargetEntry, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Observation(Record):
    """What the spacecraft could know of one flash: never truth, never labels."""

    time_s: float
    reading: Reading
    settings: Mapping[str, float]  # what was in force, SI, such as focal_length_m
    line_of_sight: np.ndarray = array("row col xyz", "f8", "1", "unit vector of each pixel's centre in lidar axes")
    pan_tilt_rad: np.ndarray | None = array(
        "pan_tilt", "f8", "rad", "measured pan and tilt; None without a PTU", optional=True
    )

    @cached_property
    def points_m(self) -> np.ndarray:
        """Return the organised point cloud (row, col, xyz) [m] in lidar axes, NaN where nothing came back."""
        points: np.ndarray = self.reading.range_m[..., None].astype(float) * self.line_of_sight
        return points


@dataclass(frozen=True, eq=False, repr=False)
class Frame:
    """One laser flash: what the sensor said, what was there, and where everything was."""

    index: int
    observation: Observation
    labels: Labels
    truth: Truth
    source: Source
    kept: Mapping[str, Record] = dataclasses.field(default_factory=dict)  # intermediate records asked for with `keep`

    def __repr__(self) -> str:
        """Return number, instant, pixels and returns."""
        rows, cols = self.range_m.shape
        returns = int(self.valid.sum())
        return f"<Frame {self.index} of {self.source.title!r}: {self.time_s:g} s, {rows} x {cols} pixels, {returns} returns>"

    @property
    def time_s(self) -> float:
        """Return the instant of emission [s since start_utc]."""
        return self.observation.time_s

    @property
    def range_m(self) -> np.ndarray:
        """Return the measured range (row, col) [m], NaN where nothing came back."""
        return self.observation.reading.range_m

    @property
    def intensity_counts(self) -> np.ndarray:
        """Return the measured intensity (row, col) [counts], 0 where nothing came back."""
        return self.observation.reading.intensity_counts

    @property
    def saturated(self) -> np.ndarray:
        """Return where the intensity clipped (row, col), as bool."""
        return self.observation.reading.saturated.astype(bool)

    @property
    def valid(self) -> np.ndarray:
        """Return where the sensor reported a return (row, col), true or false; the labels tell which."""
        valid: np.ndarray = np.isfinite(self.range_m)
        return valid

    @property
    def line_of_sight(self) -> np.ndarray:
        """Return the unit vectors of the pixels (row, col, xyz) in lidar axes."""
        return self.observation.line_of_sight

    @property
    def points_m(self) -> np.ndarray:
        """Return the organised point cloud (row, col, xyz) [m] in lidar axes, NaN where nothing came back."""
        return self.observation.points_m


@dataclass(frozen=True)
class Command:
    """What a controller may ask of the next flash; None keeps the scenario's demand. Pan left, tilt up positive.

    `focal_length_m` turns a zoom lens, `divergence_rad` (full angle) an actuated diffuser, `energy_j` is that of one pulse
    and `gate_delay_s` the two-way delay at which a range gate opens. `inputs` are the u of state-space models, by the name
    of the body whose motion it is (``follower``), or else whose attitude; where a body has both, its attitude's are
    ``follower.attitude``.
    """

    pan_rad: float | None = None
    tilt_rad: float | None = None
    focal_length_m: float | None = None
    divergence_rad: float | None = None
    energy_j: float | None = None
    gate_delay_s: float | None = None
    inputs: Mapping[str, Sequence[float]] | None = None
