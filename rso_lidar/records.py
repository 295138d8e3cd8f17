"""The records that the stages of the walk hand on: frozen, SI, read-only.

Each array field states its dimensions, dtype, unit and meaning once, in `array(...)`; the checks, the attributes in
files, the table in the docs and the labels on screen are made from that statement. Absence: no hit, no row in `Hits`; no
return, NaN in a range and 0 in an intensity; sky in an integer label is -1.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.craft import Taxonomy
from rso_lidar.pose import Link, PoseTree
from rso_lidar.record import ArraySpec, Record, array, locked, specs

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform

__all__ = ["ArraySpec", "Record", "array", "specs"]
SCHEMA_VERSION = 1


# ---------------------------------------------------------------------------------------------- what is being flown


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


# ------------------------------------------------------------------------------------------------ where everything is


@dataclass(frozen=True, eq=False, repr=False)
class BodyState(Record):
    """The state of a body's origin in inertial axes (GCRS, or the root of a local world); single or batched."""

    position_m: np.ndarray = array("… xyz", "f8", "m", "position in inertial axes")
    velocity_m_s: np.ndarray = array("… xyz", "f8", "m s-1", "velocity in inertial axes")

    def __getitem__(self, epoch: int | slice) -> BodyState:
        """Return the state at one epoch of a batch, or at a slice of them."""
        return BodyState(self.position_m[epoch], self.velocity_m_s[epoch])


@dataclass(frozen=True, eq=False, repr=False)
class PtuAngles(Record):
    """Where the PTU points at one flash: asked for, really, and as its encoders say. Pan left, tilt up positive."""

    demand_rad: np.ndarray = array("pan_tilt", "f8", "rad", "demanded pan and tilt")
    actual_rad: np.ndarray = array("pan_tilt", "f8", "rad", "true pan and tilt, jitter and misalignment included")
    measured_rad: np.ndarray = array("pan_tilt", "f8", "rad", "pan and tilt as the encoders report them")
    rate_rad_s: np.ndarray = array("pan_tilt", "f8", "rad s-1", "true pan and tilt rates")


@dataclass(frozen=True, eq=False, repr=False)
class Truth:
    """Where everything is: one epoch, or a batch of epochs that `at` cuts into single ones.

    `time_s` is a float, or an array (time) [s since start_utc]; `poses` the tree of axes; `states` the inertial states of
    bodies; `sun_direction` (…, 3) the unit vector to the Sun in inertial axes, NaN in a local world without a Sun;
    `pointing` the PTU's angles (None without a PTU); `sunlit` by body the share (…) of the Sun's disc that the Earth
    leaves free.
    """

    time_s: Any
    poses: PoseTree
    states: Mapping[str, BodyState]
    sun_direction: np.ndarray
    pointing: PtuAngles | None = None
    sunlit: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sun_direction", locked(self.sun_direction, np.dtype(float)))

    def __repr__(self) -> str:
        """Return the instants and the names of the axes."""
        return f"<Truth: {np.size(self.time_s)} epoch(s), axes {', '.join(self.poses)}>"

    def pose(self, a: str, b: str) -> RigidTransform:
        """Return a_from_b, such as lidar_from_tdrs (Fuller et al., eq. 5): coordinates in b to coordinates in a [m]."""
        return self.poses.pose(a, b)

    def rates(self, a: str, b: str) -> tuple[np.ndarray, np.ndarray]:
        """Return velocity [m/s] of b's origin as a sees it (a's axes), and angular velocity [rad/s] of b in a (b's axes)."""
        link: Link = self.poses.link(a, b)
        return link.velocity_m_s, link.angular_velocity_rad_s

    def at(self, epoch: int) -> Truth:
        """Return the truth at one epoch of a batch."""
        return Truth(
            float(self.time_s[epoch]),
            self.poses.at(epoch),
            {name: state[epoch] for name, state in self.states.items()},
            self.sun_direction[epoch],
            self.pointing,
            {name: float(share[epoch]) for name, share in self.sunlit.items()},
        )


# ------------------------------------------------------------------------------------------------- the photon's life


@dataclass(frozen=True, eq=False, repr=False)
class Extent(Record):
    """Where each target can be seen, as bounds in the tangent plane z = 1 of the lidar; empty where low > high.

    `outlines` are, for each target, the corners (corner, right_down) of convex outlines there, in order around them, that
    together cover all that can be seen of it; None where the target reaches behind the lidar, or is not seen at all.
    Without outlines the bounds stand alone.
    """

    low: np.ndarray = array("target right_down", "f8", "1", "least x/z and y/z of the target in lidar axes")
    high: np.ndarray = array("target right_down", "f8", "1", "greatest x/z and y/z of the target in lidar axes")
    outlines: tuple[tuple[np.ndarray, ...] | None, ...] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Rays(Record):
    """Rays that leave the lens, ordered by pixel. `shape` is (n_rows, n_cols)."""

    shape: tuple[int, int]
    direction: np.ndarray = array("ray xyz", "f8", "1", "unit vector in lidar axes")
    pixel: np.ndarray = array("ray", "i4", "1", "row * n_cols + col, never falling")
    weight: np.ndarray = array("ray", "f8", "1", "share of the pixel's area; made rays of a pixel sum to at most 1")


@dataclass(frozen=True, eq=False, repr=False)
class Hits(Record):
    """First facets that rays meet, ordered as the rays are; a ray that meets nothing has no row."""

    rays: Rays
    ray: np.ndarray = array("hit", "i4", "1", "index of the ray")
    pixel: np.ndarray = array("hit", "i4", "1", "row * n_cols + col")
    weight: np.ndarray = array("hit", "f8", "1", "share of the pixel's area")
    target: np.ndarray = array("hit", "i2", "1", "index of the target")
    facet: np.ndarray = array("hit", "i4", "1", "facet index in the target's source file, before repairs")
    part: np.ndarray = array("hit", "i2", "1", "index of the target's part")
    range_m: np.ndarray = array("hit", "f8", "m", "slant range along the ray from the lidar's origin")
    cos_incidence: np.ndarray = array("hit", "f8", "1", "cosine of the laser's incidence, two-sided; 0 in its shadow")
    brdf_per_sr: np.ndarray = array("hit", "f8", "sr-1", "BRDF toward the lidar, without the cosine")
    sunlight_per_sr: np.ndarray | None = array(
        "hit",
        "f8",
        "sr-1",
        "BRDF from the Sun to the lidar times the cosine of the Sun's incidence and the share of its disc that is seen; "
        "None where no background was asked for",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Photons(Record):
    """Light that comes back to the focal plane, ordered by pixel: one return for each hit, more behind a lens that blurs.

    Returns of a pixel whose ranges leave a gap wider than c * FWHM / 2, beyond what a tilted surface itself spans from ray
    to ray, belong to different clusters; their numbers run through the frame by pixel and, in a pixel, from near to far.
    `pulse_step_s` [s] is the time from tap to tap of the pulse, `late_s` [s] by how much it left later than the receiver's
    clock believes.
    """

    shape: tuple[int, int]
    pulse_fwhm_s: float
    pulse_step_s: float
    late_s: float
    pulse_power_per_s: np.ndarray = array(
        "tap", "f8", "s-1", "power of the pulse over its energy, in time; the middle tap is its time zero"
    )
    pixel: np.ndarray = array("return", "i4", "1", "row * n_cols + col")
    delay_s: np.ndarray = array("return", "f8", "s", "two-way delay since emission")
    photons: np.ndarray = array("return", "f8", "1", "expected photons on the pixel, after the optics, before the APD")
    depth_spread_s: np.ndarray = array(
        "return", "f8", "s", "two-way delay from near to far edge of the sub-ray's footprint"
    )
    coherence_cells: np.ndarray = array(
        "return", "f8", "1", "area of the aperture times solid angle of the return over the squared wavelength"
    )
    hit: np.ndarray = array(
        "return", "i4", "1", "index of the hit that sends it, or most of it behind a lens that blurs"
    )
    cluster: np.ndarray = array("return", "i4", "1", "cluster of the return, counted through the frame")
    cluster_pixel: np.ndarray = array("cluster", "i4", "1", "pixel of each cluster, never falling")
    filled_fraction: np.ndarray | None = array(
        "row col",
        "f8",
        "1",
        "share of each pixel's area that is on a target and lit; None: all that was hit",
        optional=True,
    )
    background_photons_per_s: np.ndarray | None = array(
        "row col", "f8", "s-1", "sunlight on each pixel, after the optics; None without background", optional=True
    )


@dataclass(frozen=True, eq=False, repr=False)
class Waveforms(Record):
    """What the converter made of the pulses: one trace for each pixel that latched, or for all under a range gate.

    Sample k of a trace was taken `start_s` + k `sample_s` [s] after emission.
    """

    shape: tuple[int, int]
    sample_s: float
    baseline_counts: float
    pixel: np.ndarray = array("trace", "i4", "1", "row * n_cols + col, rising")
    start_s: np.ndarray = array("trace", "f8", "s", "two-way delay of the first sample since emission")
    latch_s: np.ndarray = array(
        "trace", "f8", "s", "when the signal passed the comparator's threshold, since emission; NaN under a range gate"
    )
    samples_counts: np.ndarray = array("trace sample", "f4", "count", "output of the converter, baseline included")
    clipped: np.ndarray | None = array(
        "trace sample", "?", "1", "where the converter clipped, in any of the pulses averaged", optional=True
    )
    base_per_s: np.ndarray | None = array(
        "trace", "f8", "s-1", "photoelectrons that no pulse makes, as the pixel's mean current tells", optional=True
    )


@dataclass(frozen=True, eq=False, repr=False)
class Oversampled(Record):
    """The scene on the grid of rays, finer than the pixels (seed figs. 9 and 11): range image and photon image."""

    range_m: np.ndarray = array("fine_row fine_col", "f4", "m", "range where the ray of the cell hit, NaN for sky")
    photons: np.ndarray = array("fine_row fine_col", "f4", "1", "expected photons that the cell sends to its pixel")


@dataclass(frozen=True, eq=False, repr=False)
class Reading(Record):
    """What the sensor said."""

    range_m: np.ndarray = array("row col", "f4", "m", "measured slant range, NaN where nothing was reported")
    intensity_counts: np.ndarray = array(
        "row col", "u2", "count", "fitted pulse amplitude above baseline, 0 where none"
    )
    saturated: np.ndarray = array("row col", "u1", "1", "1 where the amplitude clipped")
    return_range_m: np.ndarray | None = array(
        "row col return", "f4", "m", "measured ranges of all returns, near to far, NaN beyond the last", optional=True
    )
    return_intensity_counts: np.ndarray | None = array(
        "row col return", "u2", "count", "fitted amplitudes of all returns, 0 beyond the last", optional=True
    )


@dataclass(frozen=True, eq=False, repr=False)
class Labels(Record):
    """What was really there, pixel by pixel, as far as it is lit.

    Of several clusters in a pixel the brightest speaks; in it the part that returns most light, and of that the brightest
    return.
    """

    range_m: np.ndarray = array(
        "row col", "f8", "m", "photon-weighted mean range of the brightest cluster, NaN for sky"
    )
    first_range_m: np.ndarray = array(
        "row col", "f8", "m", "photon-weighted mean range of the nearest cluster, NaN for sky"
    )
    cluster_count: np.ndarray = array("row col", "u1", "1", "clusters of returns in the pixel")
    target: np.ndarray = array("row col", "i2", "1", "target index of the brightest part, -1 for sky")
    part: np.ndarray = array("row col", "i2", "1", "index of the part that returns most light, -1 for sky")
    facet: np.ndarray = array(
        "row col", "i4", "1", "facet index in the source file of that part's brightest return, -1 for sky"
    )
    cos_incidence: np.ndarray = array("row col", "f4", "1", "cosine of incidence of that return, NaN for sky")
    photons: np.ndarray = array("row col", "f4", "1", "expected photons of the whole pixel")
    filled_fraction: np.ndarray = array("row col", "f4", "1", "share of the pixel's area that is on a target and lit")
    return_range_m: np.ndarray | None = array(
        "row col return",
        "f8",
        "m",
        "photon-weighted mean range of each cluster, near to far, NaN beyond",
        optional=True,
    )
    return_photons: np.ndarray | None = array(
        "row col return", "f4", "1", "expected photons of each cluster, 0 beyond the last", optional=True
    )


# ---------------------------------------------------------------------------------------------------- what comes out


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
