"""Star trackers: attitudes with errors across and about the boresight, and what blinds them."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.motion import Mount
from rso_lidar.part import NotNegative, Positive
from rso_lidar.pose import (
    dot,
    length,
    matrix_from_quaternion,
    multiply_quaternions,
    quaternion_from_vector,
    rotate_vectors,
)
from rso_lidar.records import BodyMotion, SensorState, StarTrackerSamples
from rso_lidar.sensors.random_errors import ErrorProcess
from rso_lidar.sensors.sensor_part import ErrorTerms, Impairment, SensorPart, gauss_markov

_ACROSS, _ABOUT = (0, 1), (2,)

_ROUNDING = 1e-9  # of a sample: 0.07 s at 100 Hz are 7 samples, and not 8 by rounding

ExclusionAngle = Annotated[NotNegative, Field(le=180.0)]


class StarTracker(SensorPart):
    """A star tracker. Its boresight is the +z axis of its mount; it reports inertial_from_body.

    Errors are small rotations in tracker axes: white noise, a slowly varying part, and a constant misalignment of the
    mount. The slow part is a Gauss-Markov process, for errors that move with the stars over the field of view. A sample
    is not valid above `max_rate_deg_s`, or where the boresight is too near to the Sun, the Moon, or the limb of the
    Earth. After any of these, and after an outage, the tracker needs `acquisition_s` to find its attitude again. It is
    tracking when a run begins.
    """

    _ERRORS: ClassVar[ErrorTerms] = (
        ("white across the boresight", "cross_boresight_arcsec", "arcsec"),
        ("white about the boresight", "boresight_arcsec", "arcsec"),
        ("slow across the boresight", "slow_cross_boresight_arcsec", "arcsec"),
        ("slow about the boresight", "slow_boresight_arcsec", "arcsec"),
        ("misalignment", "misalignment_arcsec", "arcsec"),
        ("rate limit", "max_rate_deg_s", "°/s"),
        ("Sun exclusion", "sun_exclusion_deg", "°"),
        ("Moon exclusion", "moon_exclusion_deg", "°"),
        ("Earth limb exclusion", "earth_exclusion_deg", "°"),
        ("acquisition", "acquisition_s", "s"),
    )
    type: Literal["star_tracker"] = "star_tracker"
    mount: Mount = Field(default=Mount(), description="Pose body_from_tracker on the follower; +z is the boresight.")
    cross_boresight_arcsec: NotNegative = Field(
        default=0.0, description="White error about each axis across the boresight, 1 sigma [arcsec]."
    )
    boresight_arcsec: NotNegative = Field(default=0.0, description="White error about the boresight, 1 sigma [arcsec].")
    slow_cross_boresight_arcsec: NotNegative = Field(
        default=0.0, description="Slowly varying error about each axis across the boresight, 1 sigma [arcsec]."
    )
    slow_boresight_arcsec: NotNegative = Field(
        default=0.0, description="Slowly varying error about the boresight, 1 sigma [arcsec]."
    )
    correlation_s: Positive = Field(
        default=200.0, description="Correlation time of the slowly varying errors [s]. Default: assumed."
    )
    misalignment_arcsec: NotNegative = Field(
        default=0.0, description="Error of the mount about each axis, 1 sigma, constant in a run [arcsec]."
    )
    max_rate_deg_s: Positive | None = Field(
        default=None, description="Rate of the body above which no attitude is found [deg/s]. If omitted, no limit."
    )
    sun_exclusion_deg: ExclusionAngle = Field(
        default=0.0, description="Smallest angle between boresight and Sun [deg]; 0 for none."
    )
    moon_exclusion_deg: ExclusionAngle = Field(
        default=0.0, description="Smallest angle between boresight and Moon [deg]; 0 for none."
    )
    earth_exclusion_deg: ExclusionAngle = Field(
        default=0.0,
        description="Smallest angle between boresight and limb of the Earth [deg]; at 0, the disk itself hides the stars.",
    )
    acquisition_s: Annotated[NotNegative, Field(le=3600.0)] = Field(
        default=0.0,
        description=(
            "Time without valid samples after the tracker was blinded, too fast or in an outage, while it identifies stars "
            "without knowledge of its attitude [s]."
        ),
    )

    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        step_s, across, about = 1.0 / self.rate_hz, self.cross_boresight_arcsec, self.boresight_arcsec
        slow = ((_ACROSS, self.slow_cross_boresight_arcsec), (_ABOUT, self.slow_boresight_arcsec))
        processes = [
            gauss_markov(channels, sigma * units.ARCSEC, self.correlation_s, step_s) for channels, sigma in slow
        ]
        processes.append(ErrorProcess((*_ACROSS, *_ABOUT), 1.0, 0.0, self.misalignment_arcsec * units.ARCSEC))
        return np.array([across, across, about]) * units.ARCSEC, processes

    @cached_property
    def look_back(self) -> int:
        """Number of earlier samples on whose true motion a sample depends: those of an acquisition."""
        return max(0, math.ceil(self.acquisition_s * self.rate_hz - _ROUNDING))

    @cached_property
    def _body_from_tracker(self) -> np.ndarray:
        return np.asarray(self.mount.rotation.as_matrix())

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[StarTrackerSamples, SensorState]:
        """Measure the attitude of the body. Samples that the state skips are taken as not blinded."""
        drawn = None if state is None else SensorState(state.next_sample, state.values[:-1])
        errors, valid, after = self.draw(key, first_sample, motion.time_s, drawn)
        searching = 0 if state is None else int(state.values[-1]) - (first_sample - state.next_sample)
        error = quaternion_from_vector(rotate_vectors(self._body_from_tracker, errors))
        quaternion = multiply_quaternions(motion.quaternion_xyzw, error)
        quaternion = np.where(quaternion[:, 3:] < 0.0, -quaternion, quaternion)
        valid &= ~self.is_blinded(motion)
        valid, searching = find_acquired(valid, max(searching, 0), self.look_back)
        quaternion[~valid] = np.nan
        state = SensorState(after.next_sample, np.append(after.values, searching))
        return StarTrackerSamples(motion.time_s, motion.time_s + self.latency_s, valid, quaternion), state

    def is_blinded(self, motion: BodyMotion) -> np.ndarray:
        """Return where (time) the tracker finds no attitude because of the body's rate, the Sun, the Moon or the Earth.

        Parameters
        ----------
        motion : true motion of the follower
        """
        return _join(self._find_blinding(motion), motion)

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return "attitude"

    def find_impairments(self, motion: BodyMotion) -> list[Impairment]:
        """Find where the tracker is blinded, or the body is too fast for it."""
        causes = self._find_blinding(motion)
        shares = [f"{name} {np.mean(mask):.0%}" for name, mask in causes.items() if mask.any()]
        blinded = _join(causes, motion)
        search = f"; it then searches for {self.acquisition_s:g} s" if self.acquisition_s and not blinded.all() else ""
        cure = "turn its mount or the follower, or add a second tracker"
        return [Impairment(blinded, "no attitude", f"{', '.join(shares)}{search}", cure)]

    def _find_blinding(self, motion: BodyMotion) -> dict[str, np.ndarray]:
        """Return where (time) each cause blinds the tracker, by cause; only causes that the sensor and its world have."""
        causes = {}
        if self.max_rate_deg_s is not None:
            causes["the body's rate"] = length(motion.angular_velocity_rad_s) > self.max_rate_deg_s * units.DEG
        boresight = self._body_from_tracker[:, 2]  # +z of the mount, in body axes
        along = rotate_vectors(matrix_from_quaternion(motion.quaternion_xyzw), boresight)
        sources = (
            ("the Sun", self.sun_exclusion_deg, motion.sun_direction, 0.0),
            ("the Moon", self.moon_exclusion_deg, motion.moon_direction, 0.0),
            ("the Earth", self.earth_exclusion_deg, motion.earth_direction, motion.earth_angle_rad),
        )
        for name, exclusion_deg, direction, radius_rad in sources:
            # The disk of the Earth hides the stars behind it, whatever the exclusion angle.
            hides_stars = exclusion_deg > 0.0 or direction is motion.earth_direction
            if hides_stars and direction is not None and radius_rad is not None:  # None in a local world
                angle = np.arccos(np.clip(dot(along, direction), -1.0, 1.0))
                causes[name] = angle - radius_rad < exclusion_deg * units.DEG
        return causes


def _join(causes: dict[str, np.ndarray], motion: BodyMotion) -> np.ndarray:
    """Return where (time) any of the causes holds."""
    joined = np.zeros(len(motion.time_s), np.bool_)
    for mask in causes.values():
        joined |= mask
    return joined


def find_acquired(clear: np.ndarray, searching: int, look_back: int) -> tuple[np.ndarray, int]:
    """Find the samples at which a tracker has its attitude: those after `look_back` clear samples, or more.

    Parameters
    ----------
    clear : (sample) bool, whether stars can be tracked
    searching : number of the first samples that have no attitude yet because of what was before them
    look_back : number of samples that an acquisition takes

    Returns
    -------
    whether each sample (sample) bool has an attitude, and `searching` for the samples that follow
    """
    if not len(clear):
        return clear, searching
    numbers = np.arange(len(clear))
    before = searching - 1 - look_back  # the last sample that was not clear, counted from the first here
    lost = np.maximum.accumulate(np.where(clear, before, numbers))
    return numbers - lost > look_back, max(0, int(lost[-1]) + look_back + 1 - len(clear))
