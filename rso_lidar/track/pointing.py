"""A controller that keeps the lidar's boresight on a target, from readings and encoders alone."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Mount, lidar_from_ptu
from rso_lidar.records import Command, Observation, Reading, SensorSamples


class Pointing:
    """Controller that points at the densest cluster of returns in each observation.

    A return counts if one of its eight neighbours agrees within `gate_m`. False triggers, isolated and uniform in
    range, rarely do. The range window of `gate_m` with most of these returns is the target, if it has at least
    `min_pixels`.

    The mean direction of the target and the measured pan and tilt give its angles. An alpha-beta filter tracks them,
    with expanding memory in the first steps and beta by Benedict and Bordner 1962. The demand leads by the time since the
    call before, because it acts until the next. Between flashes, `command_at` extrapolates the angles. A constant
    misalignment between encoders and boresight cancels.

    Parameters
    ----------
    gate_m : depth of the range window [m], about that of the target
    min_pixels : fewest returns that make a target
    alpha : share of each new angle in the estimate, over 0 to 1; less is smoother and slower
    lead_s : further lead [s], for the lag of the drive (a second order lags by damping / (pi natural_hz))
    coast_s : how long [s] a lost target is followed at its last rate, before the scenario's demand is kept
    mount : the lidar's mount on the PTU, as in the scenario's [lidar]

    >>> point = Pointing(gate_m=30.0)   # for frame in rl.simulate(scenario, point): ...
    """

    def __init__(
        self,
        *,
        gate_m: float = 20.0,
        min_pixels: int = 4,
        alpha: float = 0.5,
        lead_s: float = 0.0,
        coast_s: float = 2.0,
        mount: Mount | None = None,
    ) -> None:
        if not (gate_m > 0.0 and min_pixels >= 1 and 0.0 < alpha <= 1.0 and coast_s >= 0.0):
            raise ScenarioError("Pointing: needs gate_m > 0, min_pixels >= 1, 0 < alpha <= 1 and coast_s >= 0")
        self.gate_m, self.min_pixels, self.alpha = gate_m, min_pixels, alpha
        self.lead_s, self.coast_s = lead_s, coast_s
        self._ptu_from_lidar = (mount or Mount()).rotation * lidar_from_ptu().inv()
        x, self._boresight_y, z = self._ptu_from_lidar.apply([0.0, 0.0, 1.0])
        self._reach, self._boresight_tilt = math.hypot(x, z), math.atan2(z, x)
        if self._reach < 1e-6:
            raise ScenarioError(
                "Pointing: the mount turns the lidar along the tilt axis, so tilt cannot aim it; turn it"
            )
        self._called_s = math.nan
        self._forget()

    def __call__(self, observation: Observation) -> Command:
        """Return the command for the next flash; it is empty if the target has been lost for longer than `coast_s`."""
        time_s, measured = observation.time_s, observation.pan_tilt_rad
        if measured is None:
            raise ScenarioError("Pointing: the observation has no pan and tilt; give the scenario a [ptu]")
        seen = find_cluster(observation.reading, self.gate_m, self.min_pixels)
        if seen.any():
            toward = observation.line_of_sight[seen].mean(axis=0)
            self._update(time_s, self._aim(self._ptu_from_lidar.apply(toward), *measured.tolist()), measured)
        return self._lead(time_s)

    def command_at(self, time_s: float, samples: Mapping[str, SensorSamples]) -> Command:
        """Return the command between flashes, as `FastController.command_at`, from the angles and rates of the last flash.

        Parameters
        ----------
        time_s : present time [s]
        samples : not used

        Returns
        -------
        Command
            Empty without a target, or if it has been lost for longer than `coast_s`
        """
        return self._lead(time_s)

    def _lead(self, time_s: float) -> Command:
        """Return the command for the time until the next call, which is as long as that since the last."""
        interval_s = time_s - self._called_s if self._called_s < time_s else 0.0
        self._called_s = time_s
        if not self._seen or time_s - self._time_s > self.coast_s:
            self._forget()
            return Command()
        ahead = self._angle + self._rate * (time_s - self._time_s + interval_s + self.lead_s)
        return Command(float(ahead[0]), float(ahead[1]))

    def _forget(self) -> None:
        self._seen, self._time_s = 0, math.nan
        self._angle, self._rate = np.zeros(2), np.zeros(2)

    def _aim(self, toward: np.ndarray, pan: float, tilt: float) -> np.ndarray:
        """Compute the pan and tilt (2,) [rad] that bring the lidar's boresight to a direction.

        In PTU axes, `_boresight_tilt` is the elevation of the boresight above x, `_reach` its length in the plane x-z,
        and `_boresight_y` its y. Tilt brings it to the elevation of the direction, and pan then to its azimuth.

        Parameters
        ----------
        toward : direction (3,) in PTU axes, of any length
        pan, tilt : measured angles [rad]
        """
        x, y, z = (toward / np.linalg.norm(toward)).tolist()
        x, z = x * math.cos(tilt) - z * math.sin(tilt), x * math.sin(tilt) + z * math.cos(tilt)
        x, y = x * math.cos(pan) - y * math.sin(pan), x * math.sin(pan) + y * math.cos(pan)
        raised = math.asin(max(-1.0, min(1.0, z / self._reach)))
        if (
            abs(self._boresight_tilt) > math.pi / 2
        ):  # the elevation of a lidar that looks backward increases as tilt decreases
            raised = math.copysign(math.pi, self._boresight_tilt) - raised
        pan = math.atan2(y, x) - math.atan2(self._boresight_y, self._reach * math.cos(raised))
        return np.array([pan, raised - self._boresight_tilt])

    def _update(self, time_s: float, angle: np.ndarray, measured: np.ndarray) -> None:
        """Update the alpha-beta filter; pan is unwrapped.

        Parameters
        ----------
        angle : pan and tilt (2,) to the target [rad]
        measured : pan and tilt (2,) of the encoders [rad]
        """
        n, dt = self._seen, time_s - self._time_s
        self._seen, self._time_s = n + 1, time_s
        expected = self._angle + self._rate * dt if n else np.asarray(measured)
        angle[0] += 2.0 * math.pi * round((expected[0] - angle[0]) / (2.0 * math.pi))
        if n == 0 or not dt > 0.0:
            self._angle = angle
            return
        alpha = max(self.alpha, 2.0 * (2.0 * n + 1.0) / ((n + 1.0) * (n + 2.0)))
        beta = max(self.alpha**2 / (2.0 - self.alpha), 6.0 / ((n + 1.0) * (n + 2.0)))
        self._angle = expected + alpha * (angle - expected)
        self._rate = self._rate + beta / dt * (angle - expected)


def find_cluster(reading: Reading, gate_m: float, min_pixels: int) -> np.ndarray:
    """Find the returns of the target: the range window with most returns that have a neighbour.

    Parameters
    ----------
    reading : of the sensor
    gate_m : depth of the window, and greatest difference to a neighbour [m]
    min_pixels : fewest returns that make a target

    Returns
    -------
    mask (row, col) of the returns, empty without a target
    """
    ranges = reading.range_m.astype(float)
    framed = np.pad(ranges, 1, constant_values=np.nan)
    rows, cols = ranges.shape
    agrees = np.zeros(ranges.shape, dtype=bool)
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                agrees |= np.abs(framed[down : down + rows, right : right + cols] - ranges) <= gate_m
    sorted_m = np.sort(ranges[agrees])
    counts = np.searchsorted(sorted_m, sorted_m + gate_m, side="right") - np.arange(len(sorted_m))
    if not len(counts) or counts.max() < min_pixels:
        return np.zeros(ranges.shape, dtype=bool)
    nearest_m = sorted_m[np.argmax(counts)]
    mask: np.ndarray = agrees & (ranges >= nearest_m) & (ranges <= nearest_m + gate_m)
    return mask
