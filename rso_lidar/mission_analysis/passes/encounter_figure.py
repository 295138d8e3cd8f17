"""Encounters over time: how near, how fast, and in what light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.picture import colour_maps, figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

_NAMED = 6  # number of nearest encounters that are named
_PLACES = (
    *((1, 0, 7), (-1, 0, 7), (0, 1, 7), (0, -1, 7), (1, 1, 5), (-1, 1, 5), (1, -1, 5), (-1, -1, 5)),
    *((x, y, far) for far in (18, 30, 44) for x, y in ((0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))),
)  # positions of a name about its point, best first: right (1) or left (-1), above (1) or below (-1), how far [points]
_ROOM = 0.012  # share of the window left free at its ends, for half a mark
_TOGETHER_M = 1.0  # closer than this are craft that share elements, such as docked ones


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
    window_utc: tuple[np.datetime64, np.datetime64] | None = None,
) -> Figure:
    """Draw ranges at the closest approach over time, coloured by relative speed.

    Encounters closer than 1 m, such as docked craft that share elements, are counted and not drawn.

    Parameters
    ----------
    time_utc : (row) numpy datetime64 of the closest approach
    range_m, speed_m_s : (row) range [m] and relative speed [m/s] then
    sunlit : (row) whether the object is in sunlight then: a disc, or a square with a dark rim in the Earth's shadow
    labels : (row) name of each object
    within_m : range limit of the search [m]
    reach_m : range at which the lidar detects a facing plate of 1 m2 [m], drawn as a line
    window_utc : start and end of the search, the span of the time axis; by default from the first row to the last
    """
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FuncFormatter

    figure = figures.new_figure(10.5, 5.8, title, note)
    axes = figure.subplots()
    apart = np.asarray(range_m) >= _TOGETHER_M
    time_utc, range_m, speed_m_s, sunlit = (np.asarray(of)[apart] for of in (time_utc, range_m, speed_m_s, sunlit))
    labels = [label for label, kept in zip(labels, apart, strict=True) if kept]
    slow = float(np.max(speed_m_s, initial=0.0)) < units.KM  # formations fly at metres a second
    range_km, speed = range_m / units.KM, speed_m_s / (1.0 if slow else units.KM)
    within_km = within_m / units.KM
    reach_km = reach_m / units.KM if reach_m is not None and reach_m < within_m else 0.0
    nearest_km, farthest_km = float(range_km.min(initial=within_km)), float(range_km.max(initial=reach_km)) or within_km
    spread = nearest_km < 0.03 * farthest_km
    lowest, highest = (float(speed.min()), float(speed.max())) if len(speed) else (0.0, 1.0)
    drawn = None
    for lit, marker, rim in ((True, "o", palette.PAPER), (False, "s", palette.INK)):
        of = np.asarray(sunlit, dtype=bool) == lit
        drawn = axes.scatter(
            np.asarray(time_utc)[of],
            range_km[of],
            c=speed[of],
            cmap=colour_maps.RANGE_RAMP,
            vmin=lowest,
            vmax=max(highest, 1.02 * lowest, lowest + 1e-3),
            marker=marker,
            s=34 if len(speed) < 400 else 16,
            lw=figures.HAIR_PT if lit else figures.LINE_PT,
            edgecolors=rim,
            zorder=3,
        )
    if reach_km:
        axes.axhline(reach_km, color=palette.MARK, lw=figures.LINE_PT, ls="--", zorder=2)
    if spread:
        axes.set_yscale("log")
        bottom = max(nearest_km, 1e-4)
        axes.set_ylim(0.6 * (min(bottom, reach_km) if reach_km else bottom), min(1.6 * farthest_km, 1.1 * within_km))
    else:
        axes.set_ylim(0.0, min(1.12 * farthest_km, 1.03 * within_km))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))
    locator = AutoDateLocator()  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator, show_offset=False))  # type: ignore[no-untyped-call]
    together = int(np.count_nonzero(~apart))
    said = f"{together} more nearer than {_TOGETHER_M:g} m share its elements, as if docked" if together else ""
    if window_utc is not None:
        first, last = (float(date2num(end)) for end in window_utc)  # type: ignore[no-untyped-call]
        axes.set_xlim(first - _ROOM * (last - first), last + _ROOM * (last - first))
    ends = time_utc if window_utc is None else np.array([window_utc[0], window_utc[1] - np.timedelta64(1, "ms")])
    days = np.unique(ends.astype("datetime64[D]")).astype(str)
    when = ", ".join(["UTC", " to ".join(dict.fromkeys([*days[:1], *days[-1:]]))]) if len(days) else "UTC"
    figures.style_axes(axes, said, when, "Range at the closest approach [km]")
    marks = [
        Line2D(
            [],
            [],
            ls="",
            marker=marker,
            ms=6,
            mfc=palette.RULE,
            mec=rim,
            label=word,
        )
        for marker, rim, word in (("o", palette.PAPER, "sunlit"), ("s", palette.INK, "in the Earth's shadow"))
    ]
    axes.legend(
        handles=marks,
        fontsize=figures.SMALL_PT,
        frameon=False,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=2,
        labelcolor=palette.QUIET,
        borderaxespad=0.1,
    )
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=[axes], fraction=0.035, pad=0.015, aspect=30)
        figures.style_bar(bar, f"Relative speed [{'m/s' if slow else 'km/s'}]")
    figure.draw_without_rendering()  # the colour bar takes its room first
    points = np.stack([date2num(np.asarray(time_utc)), range_km], axis=1)  # type: ignore[no-untyped-call]
    busy = [_write_reach(figure, axes, reach_km, points)] if reach_km else []  # boxes that names must not cover
    named: dict[str, int] = {}  # an object with several encounters is labelled once, at the nearest
    for k in np.argsort(range_km, kind="stable").tolist():
        named.setdefault(labels[k], k)
    _write_names(figure, axes, points, [(k, label) for label, k in named.items()][: _NAMED * 2], busy)
    return figure


def _write_reach(figure: Figure, axes: Axes, reach_km: float, points: np.ndarray) -> Bbox:
    """Write the lidar's reach at the end and side of its line that cover the fewest points, and return the box."""
    on_screen = axes.transData.transform(points) if len(points) else np.empty((0, 2))
    room, margin = axes.get_window_extent(), _dot(figure)
    ends = [(right, above) for above in (True, False) for right in (True, False)]
    labels = [
        axes.annotate(
            f"lidar sees 1 m² to {reach_km:.3g} km",
            (float(right), reach_km),
            xycoords=("axes fraction", "data"),
            xytext=(-2 if right else 2, 4 if above else -4),
            textcoords="offset points",
            ha="right" if right else "left",
            va="baseline" if above else "top",
            fontsize=figures.SMALL_PT,
            color=palette.INK,
            bbox={"facecolor": palette.PAPER, "lw": 0, "pad": 1.0, "alpha": 0.8},
        )
        for right, above in ends
    ]
    boxes = [label.get_window_extent() for label in labels]
    covered = [
        (not (room.y0 <= box.y0 and box.y1 <= room.y1), int(box.padded(margin).count_contains(on_screen)))
        for box in boxes
    ]
    best = covered.index(min(covered))
    for label in labels[:best] + labels[best + 1 :]:
        label.remove()
    return boxes[best]


def _dot(figure: Figure) -> float:
    """Return half the width of a mark [pixels]."""
    return 5.0 * figure.dpi / 72.0


def _write_names(
    figure: Figure, axes: Axes, points: np.ndarray, named: Sequence[tuple[int, str]], busy: Sequence[Bbox]
) -> None:
    """Write the names of the first few points (point, [x, y]) where they cover no point and no other name."""
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    if not len(points):
        return
    on_screen = axes.transData.transform(points)
    dot = _dot(figure)
    taken = [Bbox.from_extents(x - dot, y - dot, x + dot, y + dot) for x, y in on_screen]
    taken += busy
    room = axes.get_window_extent()
    written = 0
    for k, label in named:
        if written == _NAMED:
            return
        others = taken[:k] + taken[k + 1 :]
        for x, y, far in _PLACES:
            text = axes.annotate(
                label,
                (float(points[k, 0]), float(points[k, 1])),
                xytext=(far * x, far * y),
                textcoords="offset points",
                ha={1: "left", 0: "center", -1: "right"}[x],
                va={1: "bottom", 0: "center", -1: "top"}[y],
                fontsize=figures.SMALL_PT,
                color=palette.INK,
                zorder=4,
                arrowprops={
                    "arrowstyle": "-",
                    "lw": figures.HAIR_PT,
                    "color": palette.QUIET,
                    "shrinkA": 0,
                    "shrinkB": 3,
                }
                if far > 7
                else None,
            )
            text.get_window_extent()  # computes its position
            box = Text.get_window_extent(text)  # the text without its leader
            free = room.x0 <= box.x0 and box.x1 <= room.x1 and room.y0 <= box.y0 and box.y1 <= room.y1
            if free and not any(box.overlaps(other) for other in others):
                taken.append(box)
                written += 1
                break
            text.remove()
