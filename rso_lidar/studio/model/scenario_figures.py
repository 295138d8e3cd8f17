"""Figures of a scenario: link budget, timeline, relative trajectory with its plan, and orbits."""

from __future__ import annotations

import io
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np

from rso_lidar import picture
from rso_lidar.mission_analysis import budget, draw_trajectory, fly_open_loop, timeline
from rso_lidar.picture import Scheme, figures
from rso_lidar.scenario import Scenario

_lock = Lock()  # matplotlib's caches are not made for threads


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
    name : one of `SCENARIO_FIGURES`
    scheme : `LIGHT` or `DARK`
    """
    with _lock, io.BytesIO() as held:
        figure = SCENARIO_FIGURES[name](scenario)
        picture.recolour(figure, scheme)
        figure.savefig(held, format="png", dpi=figures.PAGE_DPI)
        return held.getvalue()
