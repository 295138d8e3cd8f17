"""Probability of collision by the method that fits an encounter: in a plane where it is short, else in three dimensions.

Foster's integral holds where the encounter is a small part of a revolution. NASA CARA takes it where the duration of the
encounter is at most 2 % of the shorter period, no end of it is farther from the given instant than 1 %, and a calculation
without its assumptions differs by at most 2 % (CARA Analysis Tools, UsageViolationPc2D and PcMultiStep). The duration is
that of Coppola (AAS 12-248, 2012): what is outside has less than 1e-16 of the probability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.collision.coppola import IntegratedProbability, KnownTooWellError, integrate_collisions
from rso_lidar.orbit.collision.foster import disc_probability
from rso_lidar.orbit.collision.uncertain_state import UncertainSeparation, UncertainState, check_radius

LONGEST_SHARE, FARTHEST_SHARE = 0.02, 0.01  # of the shorter period: CARA's Pc2DExtendedCutoff and Pc2DOffsetCutoff
GREATEST_DIFFERENCE = 0.02  # share by which the methods may differ: CARA's Pc2DInaccurateCutoff
NEGLIGIBLE = 1e-10  # probability below which a difference does not matter: CARA's Pc2DProxyEstimateCutoff
_OUTSIDE_SIGMAS = 8.222  # sqrt(2) erfcinv(1e-16): CARA's ConjDurationGamma
_LEAST_SHARE = 1e-4  # of the radius: least standard deviation of a position that is inverted (CARA's Fclip)
_SCALES = 1e-3, 1e3  # of the standard deviations, between which the greatest probability is looked for
_STEPS = 61  # of the scan over these scales


@dataclass(frozen=True)
class CollisionEstimate:
    """A probability of collision, the method that was chosen for it, and what both methods give.

    `probability` is that of `method`, "Foster" or "3-D"; None and "" where neither exists. `reason` states why the method
    was chosen, or why there is none. `foster` is None where there is no encounter plane. `integral` is None where it was not
    needed, or does not exist; then `missing` states why.

    `duration_share` is the duration of the encounter, and `farthest_share` the distance of its farther end from the given
    instant, both over the shorter period. `mahalanobis` is the distance of the mean from the origin of the encounter plane
    in standard deviations, NaN without a plane. `greatest` is the greatest probability by Foster over all sizes of the
    covariance of the same shape, and `greatest_scale` the factor of the standard deviations that gives it. With a factor
    below 1 the probability is diluted: better knowledge could raise it (Alfano, J. Astronautical Sciences 53, 2005).
    """

    radius_m: float
    foster: float | None
    integral: IntegratedProbability | None
    method: str
    reason: str
    missing: str
    duration_share: float
    farthest_share: float
    mahalanobis: float
    greatest: float
    greatest_scale: float

    @property
    def probability(self) -> float | None:
        """Probability by the chosen method."""
        if self.method == "3-D" and self.integral is not None:
            return self.integral.probability
        return self.foster

    @property
    def differs(self) -> bool:
        """Whether both methods were used, and differ by more than 2 % of the greater one."""
        return self.foster is not None and self.integral is not None and _differ(self.foster, self.integral.probability)

    @property
    def is_diluted(self) -> bool:
        """Whether a smaller covariance of the same shape gives a greater probability, by more than 0.1 %."""
        return self.foster is not None and self.greatest_scale < 1.0 and self.greatest > 1.001 * self.foster


def estimate_collision(
    first: UncertainState,
    second: UncertainState,
    radius_m: float,
    *,
    window_s: float | None = None,
    always_integrate: bool = False,
) -> CollisionEstimate:
    """Compute the probability of collision by the method that fits the encounter.

    Foster's integral serves where the encounter takes at most 2 % of the shorter period, none of it is farther than 1 % from
    the given instant, and the integral in 3-D differs by at most 2 %. Else the one in 3-D does. A difference below 1e-10
    does not count.

    Parameters
    ----------
    first, second : states at about the closest approach, in the same inertial axes
    radius_m : combined hard-body radius, the sum of both objects' [m]
    window_s : time that the integral in 3-D searches on each side [s]; None as for `sample_collisions`
    always_integrate : whether to integrate in 3-D also where a short encounter has less than 1e-10 by Foster

    Returns
    -------
    CollisionEstimate

    Raises
    ------
    ScenarioError
        if the radius or the window makes no sense
    """
    radius = check_radius(radius_m)
    between = UncertainSeparation.between(first, second)
    foster, mahalanobis, greatest, scale, flat = None, math.nan, math.nan, math.nan, ""
    try:
        miss_m, covariance_m2 = between.encounter_plane()
        foster = disc_probability(miss_m, covariance_m2, radius)
        mahalanobis = math.sqrt(float(miss_m @ np.linalg.solve(covariance_m2, miss_m)))
        greatest, scale = _find_greatest(miss_m, covariance_m2, radius)
    except ScenarioError as error:
        flat = str(error)
    duration_share, farthest_share = _measure_duration(first, second, between, radius)
    reason = ""
    if flat:
        reason = "there is no probability in a plane"
    elif duration_share > LONGEST_SHARE:
        reason = f"the encounter takes {duration_share:.2g} of a revolution, over {LONGEST_SHARE:g}"
    elif farthest_share > FARTHEST_SHARE:
        reason = f"it reaches {farthest_share:.2g} of a revolution from the given instant, over {FARTHEST_SHARE:g}"
    integral, missing = None, ""
    if reason or always_integrate or (foster is not None and foster > NEGLIGIBLE):
        try:
            integral = integrate_collisions(first, second, radius, window_s=window_s)
        except (KnownTooWellError, PropagationError) as error:
            missing = str(error)
    if not reason and foster is not None and integral is not None and _differ(foster, integral.probability):
        reason = f"it differs by over {GREATEST_DIFFERENCE:g} from Foster's, whose assumptions fail"
    if integral is not None and reason:
        method = "3-D"
    elif foster is not None:
        method = "Foster"
        reason = f"{reason}, but there is none in 3-D" if reason else "short, on straight lines"
    else:
        method, reason = "", f"{flat}; {missing}"
    return CollisionEstimate(
        radius, foster, integral, method, reason, missing, duration_share, farthest_share, mahalanobis, greatest, scale
    )


def _differ(foster: float, integral: float) -> bool:
    greater = max(foster, integral)
    return greater > NEGLIGIBLE and abs(foster - integral) > GREATEST_DIFFERENCE * greater


def _measure_duration(
    first: UncertainState, second: UncertainState, between: UncertainSeparation, radius_m: float
) -> tuple[float, float]:
    """Return duration of an encounter and the distance of its farther end from the given instant, over the shorter period.

    Both are those of straight lines, at most 1. The relative position counts as known to 1e-4 of the radius at best.
    """
    period_s = min(first.period_s, second.period_s)
    if not between.speed_m_s > 0.0:
        return 1.0, 1.0
    variances, axes = np.linalg.eigh(between.covariance_m2)
    weighted = axes.T / np.sqrt(np.maximum(variances, (_LEAST_SHARE * radius_m) ** 2))[:, None]
    place, rate = weighted @ between.position_m, weighted @ between.velocity_m_s
    peak_s = -float(place @ rate) / float(rate @ rate)
    half_s = _OUTSIDE_SIGMAS / math.sqrt(float(rate @ rate)) + radius_m / between.speed_m_s
    return min(1.0, 2.0 * half_s / period_s), min(1.0, (abs(peak_s) + half_s) / period_s)


def _find_greatest(miss_m: np.ndarray, covariance_m2: np.ndarray, radius_m: float) -> tuple[float, float]:
    """Find the greatest probability over factors of the standard deviations, and its factor.

    Parameters
    ----------
    miss_m, covariance_m2 : (2,) and (2, 2) in the encounter plane [m], [m2]
    """
    from scipy.optimize import minimize_scalar

    if math.hypot(*miss_m) < radius_m:
        return 1.0, 0.0  # known exactly, they collide

    def lack(logarithm: float) -> float:
        return -disc_probability(miss_m, math.exp(2.0 * logarithm) * covariance_m2, radius_m)

    grid = np.linspace(math.log(_SCALES[0]), math.log(_SCALES[1]), _STEPS)
    best = int(np.argmin([lack(logarithm) for logarithm in grid]))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, _STEPS - 1)]
    peak = minimize_scalar(lack, bounds=ends, method="bounded", options={"xatol": 1e-6})
    return -float(peak.fun), math.exp(float(peak.x))
