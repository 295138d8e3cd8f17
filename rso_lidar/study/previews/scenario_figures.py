"""Figures of a scenario as PNG: link budget, timeline, relative trajectory and orbits."""

from __future__ import annotations

import io
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np

from rso_lidar import picture
from rso_lidar.picture.style.figures import PAGE_DPI
from rso_lidar.picture.style.palette import Scheme
from rso_lidar.scenario import Scenario
from rso_lidar.study.budgets.range_budget import budget
from rso_lidar.study.time_history.open_loop import fly_open_loop
from rso_lidar.study.time_history.timeline import timeline

_lock = Lock()  # matplotlib's caches are not made for threads


def _fly(scenario: Scenario) -> Any:
    rows = np.array(picture.even_indices(scenario.time.n_frames, 400))
    return fly_open_loop(scenario, rows)[0]


FIGURES: dict[str, Callable[[Scenario], Any]] = {
    "budget": lambda scenario: budget(scenario).figure(),
    "timeline": lambda scenario: timeline(scenario).figure(),
    "trajectory": lambda scenario: picture.orbit_figure(_fly(scenario), title=scenario.name),
    "orbits": lambda scenario: picture.inertial_figure(_fly(scenario), scenario.name),
}


def draw_figure(name: str, scenario: Scenario, scheme: Scheme) -> bytes:
    """Draw a figure of a scenario as PNG.

    Parameters
    ----------
    name : one of `FIGURES`.
    scenario : to be drawn.
    scheme : `LIGHT` or `DARK`.
    """
    with _lock, io.BytesIO() as held:
        figure = FIGURES[name](scenario)
        picture.recolour(figure, scheme)
        figure.savefig(held, format="png", dpi=PAGE_DPI)
        return held.getvalue()
