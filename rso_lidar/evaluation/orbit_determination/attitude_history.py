"""The follower's attitude over a recording: from a star tracker, or taken as known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.records import Frame, StarTrackerSamples
from rso_lidar.sensors import StarTracker

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_SAMPLES = 1.5  # sampling intervals between two samples that may be interpolated


@dataclass(frozen=True, eq=False)
class AttitudeHistory:
    """Attitudes at instants, interpolated at a constant rate in between.

    Parameters
    ----------
    source : where they are from, in words
    time_s : (sample) instants, ascending [s]
    inertial_from_body : (sample) attitudes
    longest_s : greatest time between two samples that are interpolated [s]
    white_rad2 : (3, 3) covariance of the white error of a sample, a small rotation in body axes [rad²]
    slow_rad : (3) standard deviations of its slow errors about the body axes [rad]
    """

    source: str
    time_s: np.ndarray
    inertial_from_body: Rotation
    longest_s: float
    white_rad2: np.ndarray
    slow_rad: np.ndarray

    def find(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return attitudes at instants.

        Parameters
        ----------
        time_s : (time) instants [s]

        Returns
        -------
        inertial_from_body (time, 3, 3), NaN where no samples are around; the angular velocity (time, 3) in body axes
        [rad/s]; and the factor (time) that interpolation gives the covariance of a sample.
        """
        from scipy.spatial.transform import Rotation

        known, n = self.time_s, len(time_s)
        attitude, rate, factor = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), np.full(n, np.nan)
        if len(known) < 2:
            return attitude, rate, factor
        before = np.clip(np.searchsorted(known, time_s, side="right") - 1, 0, len(known) - 2)
        # At the last sample before a gap, the interval before it has the rate: over the gap a turn may be ambiguous.
        last = (known[before + 1] - known[before] > self.longest_s) & (time_s == known[before]) & (before > 0)
        before = before - last
        step_s = known[before + 1] - known[before]
        share = (time_s - known[before]) / step_s
        inside = (share >= 0.0) & (share <= 1.0) & (step_s <= self.longest_s)
        inside |= np.isin(time_s, known)  # an instant of a sample needs no neighbours
        places, parts = before[inside], share[inside]
        first = self.inertial_from_body[places]
        turn = (first.inv() * self.inertial_from_body[places + 1]).as_rotvec()
        attitude[inside] = (first * Rotation.from_rotvec(parts[:, None] * turn)).as_matrix()
        rate[inside] = turn / step_s[inside, None]
        factor[inside] = parts**2 + (1.0 - parts) ** 2
        return attitude, rate, factor


def read_star_tracker(samples: StarTrackerSamples, part: StarTracker) -> AttitudeHistory:
    """Return the attitudes of a star tracker."""
    from scipy.spatial.transform import Rotation

    good = np.asarray(samples.valid, dtype=bool)
    mount, model = part.mount.rotation.as_matrix(), part.error_model
    slow = np.zeros(3)
    added = model.channel >= 0
    np.add.at(slow, model.channel[added], model.process[added, 2] ** 2)
    return AttitudeHistory(
        f"star tracker '{part.name}'",
        samples.time_s[good],
        Rotation.from_quat(samples.quaternion_xyzw[good]),
        _SAMPLES / part.rate_hz,
        mount @ np.diag(model.white**2) @ mount.T,
        np.sqrt(np.diag(mount @ np.diag(slow) @ mount.T)),
    )


def take_known_attitude(frames: Sequence[Frame]) -> AttitudeHistory:
    """Return the recorded attitudes of the follower, which then count as known without error."""
    from scipy.spatial.transform import Rotation

    time_s = np.array([frame.time_s for frame in frames])
    known = Rotation.concatenate([frame.truth.pose("inertial", "follower").rotation for frame in frames])
    longest_s = 1.5 * float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    return AttitudeHistory("taken as known", time_s, known, longest_s, np.zeros((3, 3)), np.zeros(3))
