"""One laser flash: observation, labels, truth and source; and the command of a controller."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.records.image import CameraImage, CameraLabels
from rso_lidar.records.part_classes import PartClass
from rso_lidar.records.reading import Labels, Reading
from rso_lidar.records.schema import Record, array
from rso_lidar.records.taxonomy import Keypoint, Taxonomy
from rso_lidar.records.telemetry import SensorSamples
from rso_lidar.records.truth import Truth

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class TargetEntry:
    """One target of a recording; labels refer to it by its index in `Source.targets`."""

    name: str
    model: str
    mesh_sha256: str
    parts: tuple[str, ...]  # the number in the label `part` is the place in this list
    materials: tuple[str, ...]  # one for each part, in words
    facets: int  # in the source file, before repairs
    taxonomy: Taxonomy | None = None  # None if not stated
    part_classes: tuple[PartClass, ...] = ()  # one for each part; empty in recordings older than part classes
    keypoints: tuple[Keypoint, ...] = ()  # in body axes; labels of all targets' keypoints follow one another


@dataclass(frozen=True)
class Source:
    """Origin of a frame: enough to repeat the simulation."""

    scenario: str  # resolved TOML, element sets inline
    title: str
    start_utc: str
    seed: int
    versions: Mapping[str, str]
    targets: tuple[TargetEntry, ...]

    @property
    def keypoints(self) -> tuple[tuple[str, str], ...]:
        """Names of target and keypoint, in the order of the labels of keypoints."""
        return tuple((target.name, point.name) for target in self.targets for point in target.keypoints)

    def find_keypoints(self, target: int) -> slice:
        """Return where the keypoints of a target are among those of all targets.

        Parameters
        ----------
        target : its index
        """
        first = sum(len(entry.keypoints) for entry in self.targets[:target])
        return slice(first, first + len(self.targets[target].keypoints))


@dataclass(frozen=True, eq=False, repr=False)
class Observation(Record):
    """What the spacecraft could know of one flash: no truth and no labels.

    `time_s` is the emission of the flash [s since start_utc]. `settings` holds, by name and in SI, the settings in force at
    the flash, such as ``focal_length_m``. `sensors` holds, by name, the samples of other sensors that became available
    since the flash before. `camera` holds, by name, the images of cameras beside the lidar.
    """

    time_s: float
    reading: Reading
    settings: Mapping[str, float]  # in force at the flash, SI, such as focal_length_m
    line_of_sight: np.ndarray = array("row col xyz", "f8", "1", "unit vector of each pixel's centre in lidar axes")
    pan_tilt_rad: np.ndarray | None = array(
        "pan_tilt", "f8", "rad", "measured pan and tilt; None without a PTU", optional=True
    )
    sensors: Mapping[str, SensorSamples] = dataclasses.field(default_factory=dict)
    camera: Mapping[str, CameraImage] = dataclasses.field(default_factory=dict)

    @cached_property
    def points_m(self) -> np.ndarray:
        """Return the organised point cloud (row, col, xyz) [m] in lidar axes, NaN where nothing came back."""
        points: np.ndarray = self.reading.range_m[..., None].astype(float) * self.line_of_sight
        return points


@dataclass(frozen=True, eq=False, repr=False)
class Frame:
    """One laser flash: the reading of the sensor, its labels, and the poses of all bodies.

    `index` is the number of the frame in its scenario. `observation` is what the spacecraft could know. `labels` hold the
    true content of each pixel, and `truth` the true poses at `time_s`. `source` holds scenario, seed, versions and the
    names of targets and parts. `kept` holds, by name, the intermediate records that were requested with `keep`.
    `camera_labels` hold the true content of the pixels of each camera beside the lidar, by name.
    """

    index: int
    observation: Observation
    labels: Labels
    truth: Truth
    source: Source
    kept: Mapping[str, Record] = dataclasses.field(default_factory=dict)  # intermediate records requested with `keep`
    camera_labels: Mapping[str, CameraLabels] = dataclasses.field(default_factory=dict)

    def __repr__(self) -> str:
        """Return number, time, pixels and returns."""
        rows, cols = self.range_m.shape
        returns = int(self.valid.sum())
        return f"<Frame {self.index} of {self.source.title!r}: {self.time_s:g} s, {rows} x {cols} pixels, {returns} returns>"

    @property
    def time_s(self) -> float:
        """Return the instant of emission [s since start_utc]; of several pulses, the middle of their exposure."""
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
    def camera(self) -> Mapping[str, CameraImage]:
        """Return the images of the cameras beside the lidar, by name."""
        return self.observation.camera

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
    """Settings that a controller requests for the next flash; None keeps those of the scenario.

    `pan_rad` and `tilt_rad` are angles of the PTU, not increments; pan to the left and tilt upward are positive.
    `focal_length_m` sets a zoom lens, `divergence_rad` (full angle) an actuated diffuser. `energy_j` is the energy of one
    pulse. `gate_delay_s` is the two-way delay at which a range gate opens. `inputs` holds the inputs u of state-space
    models. Its keys are names of bodies whose motion, or else attitude, is such a model. Where both are, the key of the
    attitude is ``follower.attitude``.
    """

    pan_rad: float | None = None
    tilt_rad: float | None = None
    focal_length_m: float | None = None
    divergence_rad: float | None = None
    energy_j: float | None = None
    gate_delay_s: float | None = None
    inputs: Mapping[str, Sequence[float]] | None = None
