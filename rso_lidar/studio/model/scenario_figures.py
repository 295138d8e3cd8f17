"""Figures of a scenario: link budget, timeline, relative trajectory with its plan, and orbits."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
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


@dataclass(frozen=True)
class CursorAxis:
    """The time axis that the panels of a figure share: its ends in the image [pixels] and in time [s]."""

    left: float
    right: float
    top: float
    bottom: float
    begins_s: float
    ends_s: float

    def draw_cursor(self, time_s: float, colour: str) -> str:
        """Return a line through all panels at a time, as SVG over the image."""
        x = self.left + (self.right - self.left) * (time_s - self.begins_s) / (self.ends_s - self.begins_s)
        ends = f'x1="{x:.1f}" x2="{x:.1f}" y1="{self.top:.1f}" y2="{self.bottom:.1f}"'
        return f'<line {ends} stroke="{colour}" stroke-width="3"/>'

    def find_time_s(self, x: float) -> float:
        """Return the time [s] at a place of the image [pixels]."""
        return self.begins_s + (self.ends_s - self.begins_s) * (x - self.left) / (self.right - self.left)


def draw_figure(name: str, scenario: Scenario, scheme: Scheme) -> tuple[bytes, CursorAxis | None]:
    """Draw a figure of a scenario as PNG, and return it with its time axis if it has one.

    Parameters
    ----------
    name : one of `SCENARIO_FIGURES`
    scheme : `LIGHT` or `DARK`
    """
    with _lock, io.BytesIO() as held:
        figure = SCENARIO_FIGURES[name](scenario)
        picture.recolour(figure, scheme)
        figure.savefig(held, format="png", dpi=figures.PAGE_DPI)
        return held.getvalue(), _measure_time_axis(figure) if name == "timeline" else None


def _measure_time_axis(figure: Any) -> CursorAxis:
    """Measure the time axis of a figure that has been saved."""
    scale = figures.PAGE_DPI / figure.dpi
    height = figure.bbox.height * scale
    boxes = [axes.get_position() for axes in figure.axes]
    width = figure.bbox.width * scale
    top, bottom = (1.0 - max(box.y1 for box in boxes)) * height, (1.0 - min(box.y0 for box in boxes)) * height
    return CursorAxis(boxes[0].x0 * width, boxes[0].x1 * width, top, bottom, *figure.axes[0].get_xlim())
