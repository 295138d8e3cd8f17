"""Figures of a scenario: link budget, timeline, relative trajectory with its plan, and orbits."""

from __future__ import annotations

import io
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np

from rso_lidar import picture
from rso_lidar.mission_analysis.budgets.range_budget import budget
from rso_lidar.mission_analysis.time_history.open_loop import find_mission_plan, fly_open_loop
from rso_lidar.mission_analysis.time_history.timeline import timeline
from rso_lidar.motion import list_commands
from rso_lidar.picture import Scheme, figures
from rso_lidar.records import Truth
from rso_lidar.scenario import Scenario

_lock = Lock()  # matplotlib's caches are not made for threads


def draw_trajectory(scenario: Scenario, flown: Truth, target: str | None = None) -> Any:
    """Draw the relative trajectory, with the impulses, the keep-out sphere and the delta-v of the follower's plan.

    Parameters
    ----------
    scenario : to be drawn.
    flown : its truth at the instants drawn.
    target : a name (None: the first).
    """
    plan = find_mission_plan(scenario, target) if scenario.target else None
    if plan is None:
        return picture.orbit_figure(flown, target, title=scenario.name)
    commands = list_commands(scenario.bodies[-1], scenario.bodies, *scenario.span)
    return picture.orbit_figure(
        flown,
        target,
        impulses=[(one.time_s, one.delta_v_m_s) for one in commands],
        keep_out_m=getattr(scenario.bodies[-1].motion, "keep_out_m", 0.0) or None,
        delta_v_m_s=plan.delta_v_m_s,
        title=scenario.name,
    )


def _fly(scenario: Scenario) -> Any:
    rows = np.array(picture.even_indices(scenario.time.n_frames, 400))
    return fly_open_loop(scenario, rows)[0]


SCENARIO_FIGURES: dict[str, Callable[[Scenario], Any]] = {
    "budget": lambda scenario: budget(scenario).figure(),
    "timeline": lambda scenario: timeline(scenario).figure(),
    "plan": lambda scenario: draw_trajectory(scenario, _fly(scenario)),
    "orbits": lambda scenario: picture.inertial_figure(_fly(scenario), scenario.name),
}


def draw_figure(name: str, scenario: Scenario, scheme: Scheme) -> bytes:
    """Draw a figure of a scenario as PNG.

    Parameters
    ----------
    name : one of `SCENARIO_FIGURES`.
    scenario : to be drawn.
    scheme : `LIGHT` or `DARK`.
    """
    with _lock, io.BytesIO() as held:
        figure = SCENARIO_FIGURES[name](scenario)
        picture.recolour(figure, scheme)
        figure.savefig(held, format="png", dpi=figures.PAGE_DPI)
        return held.getvalue()
