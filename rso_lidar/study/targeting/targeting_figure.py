"""A solved plan in one picture: the path before and after, range, phase angle, and impulses over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FAR_M = 20_000.0


class DrawnFlight(NamedTuple):
    """A flown path with its phase angles and impulses.

    Parameters
    ----------
    time_s : (time,) [s]
    position_m : (time, 3) in rtn axes [m]
    phase_deg : (time,) [deg]
    pushes : rows (impulse, 2) of instant [s] and delta-v [m/s]
    """

    time_s: np.ndarray
    position_m: np.ndarray
    phase_deg: np.ndarray
    pushes: np.ndarray


def targeting_figure(before: DrawnFlight, after: DrawnFlight, title: str) -> Figure:
    """Draw the flight before and after targeting."""
    figure = figures.new_figure(9.6, 6.8, title, "grey: before   ·   blue: after   ·   dots: impulses")
    (path, range_axes), (phase_axes, push_axes) = figure.subplots(2, 2)
    far = float(np.abs([before.position_m, after.position_m][1]).max()) > _FAR_M
    unit, word = (1e3, "km") if far else (1.0, "m")
    last_s = max(float(before.time_s[-1]), float(after.time_s[-1]))
    clock, hour = (3600.0, "h") if last_s > 20_000.0 else (1.0, "s")
    for leg, colour, width, shift in (
        (before, palette.QUIET, figures.LINE_PT, -1.0),
        (after, palette.BLUE, figures.THICK_PT, 1.0),
    ):
        time = leg.time_s / clock
        path.plot(leg.position_m[:, 1] / unit, leg.position_m[:, 0] / unit, color=colour, lw=width)
        at = np.searchsorted(leg.time_s, leg.pushes[:, 0])
        path.plot(leg.position_m[at, 1] / unit, leg.position_m[at, 0] / unit, "o", ms=3.5, color=colour)
        range_axes.plot(time, np.linalg.norm(leg.position_m, axis=1) / unit, color=colour, lw=width)
        phase_axes.plot(time, leg.phase_deg, color=colour, lw=width)
        bar = 0.006 * last_s / clock
        push_axes.bar(leg.pushes[:, 0] / clock + shift * bar, leg.pushes[:, 1], width=2.0 * bar, color=colour)
    path.plot(0.0, 0.0, "+", ms=8, color=palette.INK)
    push_axes.set_xlim(-0.03 * last_s / clock, 1.03 * last_s / clock)
    figures.style_axes(path, x=f"Along-track [{word}]", y=f"Radial [{word}]")
    figures.style_axes(range_axes, x=f"Time [{hour}]", y=f"Range [{word}]")
    figures.style_axes(phase_axes, x=f"Time [{hour}]", y="Phase angle [deg]")
    figures.style_axes(push_axes, x=f"Time [{hour}]", y="Impulse [m/s]")
    range_axes.set_ylim(bottom=0.0)
    phase_axes.set_ylim(0.0, 180.0)
    return figure
