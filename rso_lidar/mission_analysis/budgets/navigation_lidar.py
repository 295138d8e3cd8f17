"""A scenario's lidar as a sensor of navigation: its noise and its reach by the link budget."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.budgets.inputs import choose_target
from rso_lidar.mission_analysis.budgets.range_budget import budget
from rso_lidar.rpo import NavigationLidar, RangeNoise
from rso_lidar.scenario import Scenario, require_scenario

_RANGES = 40
_LEAST_M = 1e-4


def find_navigation_lidar(
    scenario: Scenario,
    range_m: tuple[float, float],
    *,
    at_s: float = 0.0,
    probability: float = 0.95,
    range_sigma_m: float = 0.05,
    origin_sigma_m: float = 0.0,
) -> NavigationLidar:
    """Make the sensor of a navigation filter from the lidar of a scenario.

    The noise of a range is that of one return from the whole silhouette of the first target, of its dimmest material. The
    noise of a direction is that of a pixel, its width over √12. The greatest range is where a flash detects the target with
    the given probability.

    Parameters
    ----------
    scenario : whose lidar and first target count
    range_m : nearest and farthest range of the table [m]
    at_s : instant of the schedule [s]
    probability : least probability of detection
    range_sigma_m, origin_sigma_m : of the sensor, see `NavigationLidar` [m]

    Returns
    -------
    NavigationLidar
        a part for `sensors` of a `RelativeFilter`

    Raises
    ------
    ScenarioError
        if ranges are no interval, or the target is not detected at the nearest
    """
    require_scenario(scenario, "find_navigation_lidar")
    low, high = (float(limit) for limit in range_m)
    if not (0.0 < low < high and math.isfinite(high)):
        raise ScenarioError(f"range_m: {low:g} m to {high:g} m is no interval of ranges; give two, ascending, above 0")
    lens = scenario.instrument.at(at_s).replace(schedule=None)
    fixed = scenario.replace(lidar=lens)
    grid = np.geomspace(low, high, _RANGES)
    area_m2 = choose_target(None, fixed).area_m2
    link_budget = budget(fixed, range_m=grid, facet_m2=area_m2, target_m=math.sqrt(area_m2))
    curve = link_budget.curves[0]
    detected = curve.detection_probability >= probability
    if not detected[0]:
        raise ScenarioError(
            f"range_m: at {low:g} m a flash detects the target with a probability of {curve.detection_probability[0]:.2g} "
            f"only, not {probability:g}: begin nearer, or take more energy"
        )
    last = _RANGES if detected.all() else int(np.argmin(detected))
    if last < 2:
        raise ScenarioError(f"range_m: beyond {low:g} m the target is not detected: begin nearer")
    sigma = np.maximum(curve.range_precision_m[:last], _LEAST_M)
    return NavigationLidar(
        bearing_sigma_deg=link_budget.pixel_rad / math.sqrt(12.0) / units.DEG,
        range_sigma_m=range_sigma_m,
        range_noise=RangeNoise(range_m=tuple(grid[:last].tolist()), sigma_m=tuple(sigma.tolist())),
        origin_sigma_m=origin_sigma_m,
        most_range_m=float(grid[last - 1]),
    )
