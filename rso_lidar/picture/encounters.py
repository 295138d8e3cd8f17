"""Encounters over time: how near, how fast, and in what light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.picture.figures import dress, new_figure
from rso_lidar.picture.palette import INK, LINE, MARK, QUIET, RANGE_RAMP, hexed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NAMED = 6  # the nearest so many bear their names
_TOGETHER_M = 1.0  # nearer than this are craft that share elements, as docked ones do


def encounter_figure(
    time_utc: np.ndarray,
    range_m: np.ndarray,
    speed_m_s: np.ndarray,
    sunlit: np.ndarray,
    labels: Sequence[str],
    within_m: float,
    reach_m: float | None = None,
    title: str = "Encounters",
    note: str = "",
) -> Figure:
    """Return a figure of ranges at the closest approach over time, coloured by relative speed.

    Parameters
    ----------
    time_utc : (row) numpy datetime64.
    sunlit : (row) whether the object is in sunlight then: a disc; in the Earth's shadow a square with a dark rim.
    reach_m : how far the lidar sees [m], drawn as a line.

    What is nearer than a metre, as docked craft that share elements, is counted and not drawn.
    """
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FuncFormatter

    figure = new_figure(10.5, 5.8, title, note)
    axes = figure.subplots()
    apart = np.asarray(range_m) >= _TOGETHER_M
    time_utc, range_m, speed_m_s, sunlit = (np.asarray(of)[apart] for of in (time_utc, range_m, speed_m_s, sunlit))
    labels = [label for label, kept in zip(labels, apart, strict=True) if kept]
    range_km, speed = range_m / units.KM, speed_m_s / units.KM
    nearest_km = float(range_km.min(initial=within_m / units.KM))
    spread = bool(nearest_km * units.KM < 0.03 * within_m)
    lowest, highest = (float(speed.min()), float(speed.max())) if len(speed) else (0.0, 1.0)
    drawn = None
    for lit, marker, rim in ((True, "o", "white"), (False, "s", hexed(INK))):
        of = np.asarray(sunlit, dtype=bool) == lit
        drawn = axes.scatter(
            np.asarray(time_utc)[of],
            range_km[of],
            c=speed[of],
            cmap=RANGE_RAMP,
            vmin=lowest,
            vmax=max(highest, lowest + 1e-3),
            marker=marker,
            s=34 if len(speed) < 400 else 16,
            lw=0.5 if lit else 1.1,
            edgecolors=rim,
            zorder=3,
        )
    if reach_m is not None and reach_m < within_m:
        axes.axhline(reach_m / units.KM, color=hexed(MARK), lw=1.1, ls="--", zorder=2)
        axes.annotate(
            f"lidar sees to {reach_m / units.KM:.3g} km",
            (1.0, reach_m / units.KM),
            xycoords=("axes fraction", "data"),
            xytext=(-2, 4),
            textcoords="offset points",
            ha="right",
            fontsize=8.5,
            color=hexed(MARK),
        )
    if spread:
        axes.set_yscale("log")
        bottom = max(nearest_km, 1e-4)
        axes.set_ylim(0.6 * (min(bottom, reach_m / units.KM) if reach_m else bottom), 1.1 * within_m / units.KM)
    else:
        axes.set_ylim(0.0, 1.03 * within_m / units.KM)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))
    times = np.asarray(time_utc)
    middle = times.min() + (times.max() - times.min()) * 0.75 if len(times) else None
    placed: list[tuple[float, float]] = []
    for k in np.argsort(range_km)[: _NAMED * 2].tolist():
        here = axes.transData.transform((date2num(times[k]), range_km[k]))  # type: ignore[no-untyped-call]
        if len(placed) >= _NAMED or any(abs(here[0] - x) < 110 and abs(here[1] - y) < 14 for x, y in placed):
            continue
        placed.append((float(here[0]), float(here[1])))
        late = bool(middle is not None and times[k] > middle)
        axes.annotate(
            labels[k],
            (times[k], range_km[k]),
            xytext=(-7 if late else 7, -3),
            textcoords="offset points",
            ha="right" if late else "left",
            fontsize=8,
            color=hexed(INK),
            zorder=4,
        )
    locator = AutoDateLocator()  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    together = int(np.count_nonzero(~apart))
    said = f"{together} more nearer than {_TOGETHER_M:g} m share its elements, as if docked" if together else ""
    dress(axes, said, "UTC", "Range at the closest approach [km]")
    marks = [
        Line2D([], [], ls="", marker=marker, ms=6, mfc=hexed(LINE), mec=hexed(QUIET) if lit else hexed(INK), label=word)
        for lit, marker, word in ((True, "o", "sunlit"), (False, "s", "in the Earth's shadow"))
    ]
    axes.legend(
        handles=marks,
        fontsize=8.5,
        frameon=False,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=2,
        labelcolor=hexed(QUIET),
        borderaxespad=0.1,
    )
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=[axes], fraction=0.035, pad=0.015, aspect=30)
        bar.set_label("Relative speed [km/s]", fontsize=9, color=hexed(QUIET))
        bar.ax.tick_params(labelsize=8, color=hexed(LINE), labelcolor=hexed(QUIET))
        bar.outline.set_visible(False)
    return figure
