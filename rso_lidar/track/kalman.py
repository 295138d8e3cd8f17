"""A Kalman filter on positions: constant velocity, or Clohessy and Wiltshire's relative motion, with its innovations.

Both models are linear with white acceleration as process noise, made discrete exactly (Van Loan 1978). The normalised
innovation squared (NIS) of a consistent filter is chi-square with three degrees of freedom (Bar-Shalom, Li and
Kirubarajan 2001, section 5.4). Its mean is 3, and 95 % of it is between 0.22 and 9.35.

A bias of the sensor and a wandering centroid are errors that are not white. They are further states, Gauss-Markov
processes or constants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.rpo import CentroidWander, SensorBias, SlowErrors

AXES = 3


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates of a filter; NaN before the first measured position.

    Parameters
    ----------
    time_s : instants (time) [s]
    position_m, velocity_m_s : estimates (time, 3) that include the measurement of that instant [m], [m/s]
    covariance : of position and velocity (time, 6, 6)
    innovation_m : measured less predicted position (time, 3) [m]; NaN without a measurement or a prediction
    nis : normalised innovation squared (time); NaN where the innovation is
    slow, slow_sigma : by the name of each slow error, which ends in its unit, the estimates (time) and their standard
        deviations
    """

    time_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance: np.ndarray
    innovation_m: np.ndarray
    nis: np.ndarray
    slow: Mapping[str, np.ndarray] = field(default_factory=dict)
    slow_sigma: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def nis_mean(self) -> float:
        """Mean NIS, 3 for a consistent filter; NaN without an innovation."""
        known = np.isfinite(self.nis)
        return float(self.nis[known].mean()) if known.any() else float("nan")

    @property
    def nis_share(self) -> float:
        """Fraction of NIS inside the two-sided 95 % bounds; NaN without an innovation."""
        known = self.nis[np.isfinite(self.nis)]
        low, high = nis_bounds()
        return float(np.mean((known >= low) & (known <= high))) if known.size else float("nan")


def nis_bounds(count: int = 1, share: float = 0.95) -> tuple[float, float]:
    """Return the two-sided bounds of the mean of several NIS of three degrees of freedom (chi-square distribution).

    Parameters
    ----------
    count : number of NIS in the mean
    share : probability that a consistent filter is within the bounds

    Examples
    --------
    >>> [round(bound, 3) for bound in nis_bounds()]
    [0.216, 9.348]
    """
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - share)
    low, high = (float(chdtri(AXES * count, over)) / count for over in (1.0 - tail, tail))
    return low, high


def filter_positions(
    time_s: np.ndarray,
    position_m: np.ndarray,
    covariance_m2: np.ndarray,
    *,
    mean_motion_rad_s: float | None = None,
    acceleration_m_s2_sqrt_hz: float = 1e-4,
    speed_m_s: float = 30.0,
    kicks: Sequence[tuple[float, np.ndarray]] = (),
    bias: SensorBias | None = None,
    centroid: CentroidWander | None = None,
) -> Track:
    """Filter measured positions with a Kalman filter.

    Parameters
    ----------
    time_s : instants (time) [s], ascending
    position_m : measured (time, 3) [m], NaN rows without a measurement: constant-velocity motion needs axes that do
        not turn, Clohessy and Wiltshire's rtn axes (x out, y along-track, z along the orbit normal)
    covariance_m2 : of each position (time, 3, 3) [m²]
    mean_motion_rad_s : of the orbit [rad/s], for Clohessy and Wiltshire's model (None: constant velocity)
    acceleration_m_s2_sqrt_hz : process noise: the root of the two-sided spectral density of white acceleration, each axis
        [m/s²/√Hz]; velocity then wanders by its product with √t
    speed_m_s : initial standard deviation of the velocity, each axis [m/s]
    kicks : changes of the velocity (xyz) [m/s] that are known, with their instants [s], ascending: the observer's own
        burns, with the sign of their effect on the relative velocity. A burn at an instant is included in its velocity
    bias : of ranges and directions, which the filter estimates; it is in all positions, with the white errors of
        `covariance_m2`
    centroid : wander of the measured point about the target's origin, which the filter estimates, likewise. Both need the
        target's position relative to the sensor. In plane is across the line of sight and the z axis

    Returns
    -------
    estimates, covariances and innovations at all instants

    Raises
    ------
    ScenarioError
        If shapes disagree, the instants do not ascend, or a noise or speed is out of range
    """
    time_s, position_m = np.asarray(time_s, dtype=float), np.asarray(position_m, dtype=float)
    n = time_s.size
    if position_m.shape != (n, AXES) or np.shape(covariance_m2) != (n, AXES, AXES):
        raise ScenarioError(f"kalman: {n} instants need positions ({n}, 3) and covariances ({n}, 3, 3)")
    if np.any(np.diff(time_s) <= 0.0):
        raise ScenarioError("kalman: instants must ascend; sort them")
    if not (acceleration_m_s2_sqrt_hz >= 0.0 and speed_m_s > 0.0):
        raise ScenarioError("kalman: give an acceleration that is not negative and a speed above 0")
    slow = SlowErrors([(bias, centroid, True)])
    size, orbit = 2 * AXES + len(slow), slice(0, 2 * AXES)
    estimates, covariances = np.full((n, size), np.nan), np.full((n, size, size), np.nan)
    innovation_m, nis = np.full((n, AXES), np.nan), np.full(n, np.nan)
    seen = np.isfinite(position_m).all(axis=1)
    state, covariance = np.zeros(size), np.zeros((size, size))
    forward, noise = np.eye(size), np.zeros((size, size))
    measured = np.eye(AXES, size)
    shifts = slow.find_shifts(slow.find_places(0), -position_m.T, np.eye(3)) if len(slow) else np.zeros((AXES, 0, n))
    begun = False
    kick_s = np.array([at for at, _ in kicks], dtype=float)
    for k in range(n):
        measured[:, 2 * AXES :] = shifts[..., k]
        if begun:
            step_s = float(time_s[k] - time_s[k - 1])
            forward[orbit, orbit], noise[orbit, orbit] = _discretize(
                mean_motion_rad_s, acceleration_m_s2_sqrt_hz, step_s
            )
            decay, new_sigma = slow.find_step(step_s)
            forward[2 * AXES :, 2 * AXES :], noise[2 * AXES :, 2 * AXES :] = np.diag(decay), np.diag(new_sigma**2)
            state, covariance = forward @ state, forward @ covariance @ forward.T + noise
            for j in range(*np.searchsorted(kick_s, time_s[k - 1 : k + 1], side="right").tolist()):
                onward, _ = _discretize(mean_motion_rad_s, acceleration_m_s2_sqrt_hz, float(time_s[k] - kick_s[j]))
                state[orbit] += onward[:, AXES:] @ kicks[j][1]
            if seen[k]:
                innovation_m[k] = position_m[k] - measured @ state
                crossed = covariance @ measured.T
                spread = measured @ crossed + covariance_m2[k]
                nis[k] = innovation_m[k] @ np.linalg.solve(spread, innovation_m[k])
                gain = np.linalg.solve(spread, crossed.T).T
                state = state + gain @ innovation_m[k]
                kept = np.eye(size) - gain @ measured
                covariance = (
                    kept @ covariance @ kept.T + gain @ covariance_m2[k] @ gain.T
                )  # Joseph's form stays positive
        elif seen[k]:
            begun = True
            state[:AXES] = position_m[k]
            variance = np.diag(slow.sigma**2)  # the first position is off by the slow errors, too
            covariance[2 * AXES :, 2 * AXES :] = variance
            covariance[:AXES, :AXES] = covariance_m2[k] + shifts[..., k] @ variance @ shifts[..., k].T
            covariance[:AXES, 2 * AXES :] = -shifts[..., k] @ variance
            covariance[2 * AXES :, :AXES] = covariance[:AXES, 2 * AXES :].T
            covariance[AXES : 2 * AXES, AXES : 2 * AXES] = np.eye(AXES) * speed_m_s**2
        if begun:
            estimates[k], covariances[k] = state, covariance
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    places = {error.name: 2 * AXES + number for number, error in enumerate(slow.errors)}
    return Track(
        time_s, estimates[:, :AXES], estimates[:, AXES : 2 * AXES], covariances[:, orbit, orbit], innovation_m, nis,
        {name: estimates[:, place] for name, place in places.items()},
        {name: sigma[:, place] for name, place in places.items()},
    )  # fmt: skip


@lru_cache(maxsize=256)
def _discretize(mean_motion_rad_s: float | None, density: float, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute the transition matrix (6, 6) over a step, and the covariance that white acceleration adds (Van Loan).

    Parameters
    ----------
    mean_motion_rad_s : of the orbit [rad/s]; None for constant velocity
    density : root of the spectral density of white acceleration [m/s²/√Hz]
    step_s : length of the step [s]
    """
    from scipy.linalg import expm

    rates = np.zeros((2 * AXES, 2 * AXES))
    rates[:AXES, AXES:] = np.eye(AXES)
    if mean_motion_rad_s is not None:  # Clohessy and Wiltshire 1960
        n = mean_motion_rad_s
        rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3.0 * n * n, 2.0 * n, -2.0 * n, -n * n
    drive = np.zeros_like(rates)
    drive[AXES:, AXES:] = np.eye(AXES) * density**2
    whole = expm(step_s * np.block([[-rates, drive], [np.zeros_like(rates), rates.T]]))
    forward = whole[2 * AXES :, 2 * AXES :].T
    noise = forward @ whole[: 2 * AXES, 2 * AXES :]
    return forward, 0.5 * (noise + noise.T)
