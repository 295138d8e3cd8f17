"""Relative orbits: where the lidar was about a target, in the target's rtn axes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.picture.selection.sequence import choose_target, pick
from rso_lidar.picture.style.colour_maps import RANGE_RAMP
from rso_lidar.picture.style.figures import (
    HEADROOM,
    LINE_PT,
    TEXT_PT,
    THIN_PT,
    format_thousands,
    new_figure,
    shorten,
    style_axes,
    style_bar,
)
from rso_lidar.picture.style.palette import INK, PAPER, PINK, QUIET, RED, RULE
from rso_lidar.records import Frame, Truth
from rso_lidar.ties import find_first_least

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

DRAWN = 600  # most frames read
ORIGINS = (".rtn", ".origin")  # non-rotating axes at a target's origin
STRETCHED = 12.0  # ratio of the extents above which the axes of a panel have different scales
ARROW = 36.0  # length of the greatest impulse's arrow [points]
CLOSED = 0.05  # ends closer than this share of the path's extent share a label
NEAR, FAR, MARKER = 8.0, 22.0, 6.0  # distances of a label from its marker, and half a marker [points]

_LETTERS = 22  # most letters of a target's name in a panel's title


@dataclass(frozen=True, eq=False)
class RelativePath:
    """Positions (time, xyz) [m] of the lidar at `time_s` (time) [s], in the axes named `axes`; and a title."""

    time_s: np.ndarray
    position_m: np.ndarray
    target: str
    axes: str
    title: str

    @property
    def words(self) -> tuple[str, str, str]:
        """Names of the x, y and z axes."""
        return ("Radial", "Along-track", "Cross-track") if self.axes.endswith(".rtn") else ("x", "y", "z")


def relative_path(source: Truth | Iterable[Frame], target: str | None = None) -> RelativePath:
    """Return the path of the lidar relative to `target` (by default the first), in its rtn axes if it has an orbit.

    `source` is a Truth batched over epochs, or frames: a sequence, a recording or an iterator, thinned to 600.
    """
    if isinstance(source, Truth):
        origins = [name for name in source.poses if name.endswith(ORIGINS) and not name.startswith("follower.")]
        name = choose_target("orbit", target, [origin.rpartition(".")[0] for origin in origins], list(source.poses))
        axes = _choose_axes(source, name)
        times_s = np.atleast_1d(np.asarray(source.time_s, dtype=float))
        position_m = np.broadcast_to(source.pose(axes, "lidar").translation, (times_s.size, 3))
        return RelativePath(times_s, position_m, name, axes, "")

    def look(frame: Frame) -> tuple[float, np.ndarray, str, str, str]:
        entries = [entry.name for entry in frame.source.targets]
        name = choose_target("orbit", target, entries, [*entries, *frame.truth.poses])
        axes = _choose_axes(frame.truth, name)
        return frame.time_s, frame.truth.pose(axes, "lidar").translation, name, axes, frame.source.title

    seen, _ = pick(source, DRAWN, look)
    times_s, positions_m, names, all_axes, titles = zip(*seen, strict=True)
    return RelativePath(np.array(times_s), np.stack(positions_m), names[0], all_axes[0], titles[0])


def _choose_axes(truth: Truth, name: str) -> str:
    """Choose the axes to draw in: those of the orbit, else non-rotating ones at the origin, else the body's."""
    return next((name + suffix for suffix in ORIGINS if name + suffix in truth.poses), name)


def orbit_figure(
    source: Truth | Iterable[Frame],
    target: str | None = None,
    *,
    impulses: Sequence[tuple[float, Any]] = (),
    keep_out_m: float | None = None,
    delta_v_m_s: float | None = None,
    title: str = "",
) -> Figure:
    """Draw the lidar's relative orbit: three planes of the target's rtn axes, and range over time.

    In rtn axes along-track is to the right and radial is up; the target is at the origin.

    Parameters
    ----------
    source : a Truth batched over epochs, or frames
    target : a name (None: the first)
    impulses : (time [s], change of velocity (3) [m/s] in the axes drawn in), each marked by an arrow
    keep_out_m : radius of a keep-out sphere about the target [m]
    delta_v_m_s : change of velocity of the whole plan [m/s], continuous thrust included (None: only the impulses
        count)
    title : the heading (empty: that of the frames)

    Returns
    -------
    Figure
    """
    path = relative_path(source, target)
    range_m = np.linalg.norm(path.position_m, axis=-1)
    nearest = find_first_least(range_m)
    in_rtn = path.axes.endswith(".rtn")
    note = f"lidar in the axes {path.axes}   ·   "
    note += f"nearest {range_m[nearest]:,.1f} m at {path.time_s[nearest]:,.1f} s"
    note += _describe_cost([float(np.linalg.norm(delta_v)) for _, delta_v in impulses], delta_v_m_s)
    figure = new_figure(11.4, 8.4, title or path.title or "Relative orbit", note)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1.0), height_ratios=(1.25, 1.0))
    plane, across, along, ranges = (figure.add_subplot(grid[row, col]) for row, col in ((0, 0), (1, 0), (0, 1), (1, 1)))
    heads = ("In the orbit's plane", "From above", "Along the track")
    planes = ((plane, 1, 0, "z"), (across, 1, 2, "x"), (along, 2, 0, "y"))
    labels = []
    for (axes, right, up, eye), head in zip(planes, heads, strict=True):
        drawn, words = _draw_plane(
            axes, path, right, up, head if in_rtn else f"Seen along {eye} of {shorten(path.target, _LETTERS)}"
        )
        labels.append((axes, words, path.position_m[:, [right, up]]))
        if keep_out_m:
            _draw_keep_out(axes, keep_out_m)
        if impulses:
            _draw_impulses(axes, path, impulses, right, up)
    ranges.plot(path.time_s, range_m, color=QUIET, lw=LINE_PT, zorder=1)
    ranges.scatter(path.time_s, range_m, c=path.time_s, cmap=RANGE_RAMP, s=7, lw=0, zorder=2)
    for time_s, _ in impulses:
        ranges.axvline(time_s, color=PINK, lw=THIN_PT, ls=(0, (2, 2)), zorder=0)
    if keep_out_m:
        ranges.axhspan(0, keep_out_m, color=RED, alpha=0.12, lw=0, zorder=0)
    ranges.set_ylim(0.0, HEADROOM * max(float(range_m.max()), keep_out_m or 0.0) or 1.0)
    format_thousands(ranges.xaxis, ranges.yaxis)
    style_axes(
        ranges,
        "Range over time",
        "Time [s]",
        f"Range to {shorten(path.target, _LETTERS)} [m]",
        "impulses dashed" if impulses else "",
    )
    bar = figure.colorbar(drawn, ax=[plane, across], location="bottom", fraction=0.03, pad=0.02, aspect=55)
    style_bar(bar, "Time [s]")
    format_thousands(bar.ax.xaxis)
    figure.draw_without_rendering()  # settles limits and sizes
    for axes, words, flown in labels:
        _place_labels(axes, words, flown)
    return figure


def _describe_cost(impulses_m_s: Sequence[float], total_m_s: float | None) -> str:
    """Describe the cost of a plan; without a total, thrust between impulses is left out."""
    given_m_s = sum(impulses_m_s)
    count = f"{len(impulses_m_s)} impulse{'s' if len(impulses_m_s) > 1 else ''}"
    if total_m_s is None:
        together = " together" if len(impulses_m_s) > 1 else ""
        return f"   ·   {count}, {given_m_s:.3g} m/s{together}" if impulses_m_s else ""
    if not impulses_m_s:
        return f"   ·   delta-v {total_m_s:.3g} m/s in all" if total_m_s else ""
    if total_m_s <= given_m_s * 1.0005:
        return f"   ·   {count}, {total_m_s:.3g} m/s in all"
    return f"   ·   delta-v {total_m_s:.3g} m/s in all, {given_m_s:.3g} of it in {count}"


def _place_labels(axes: Axes, labels: Sequence[Annotation], flown_m: np.ndarray) -> None:
    """Move labels inside the panel, off one another and off markers, so that they hide least of the path.

    Parameters
    ----------
    flown_m : (time, [x, y]) the path
    """
    pixels = axes.figure.dpi / 72.0
    panel = axes.get_window_extent()
    path = axes.transData.transform(flown_m)
    marks = np.array([axes.transData.transform(label.xy) for label in labels])
    taken = [(x - r, y - r, x + r, y + r) for r in (MARKER * pixels,) for x, y in marks]
    for label, (x, y) in zip(labels, marks, strict=True):
        box = label.get_window_extent()
        best: tuple[float, tuple[float, float], tuple[float, float, float, float]] | None = None
        for far in (NEAR, FAR):
            for right, up in ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1)):
                left = x + (right * far * pixels if right else 0.0) - box.width * (1 - right) / 2
                low = y + up * far * pixels * (0.4 if right else 1.0) - box.height * (1 - up) / 2
                place = (left, low, left + box.width, low + box.height)
                inside = _overlap_area(place, (panel.x0, panel.y0, panel.x1, panel.y1)) / (box.width * box.height)
                wrong = 20.0 * (1.0 - inside) + 10.0 * sum(_overlap_area(place, other) > 0.0 for other in taken)
                hidden = (path > place[:2]).all(axis=-1) & (path < place[2:]).all(axis=-1)
                wrong += 2.0 * bool(hidden.any()) + 0.5 * (far == FAR)
                if best is None or wrong < best[0] - 1e-9:
                    best = wrong, ((left - x) / pixels, (low - y) / pixels), place
        assert best is not None
        label.set(position=best[1], ha="left", va="bottom")
        taken.append(best[2])


def _overlap_area(box: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> float:
    """Return the area shared by two boxes (left, low, right, high)."""
    wide, high = min(box[2], other[2]) - max(box[0], other[0]), min(box[3], other[3]) - max(box[1], other[1])
    return max(wide, 0.0) * max(high, 0.0)


def _draw_keep_out(axes: Axes, radius_m: float) -> None:
    """Draw the outline of a keep-out sphere about the target."""
    from matplotlib.patches import Circle

    axes.add_patch(Circle((0, 0), radius_m, fc=RED, ec="none", alpha=0.12, zorder=0))
    axes.add_patch(Circle((0, 0), radius_m, fc="none", ec=RED, lw=LINE_PT, ls=(0, (4, 3)), zorder=1))


def _draw_impulses(axes: Axes, path: RelativePath, impulses: Sequence[tuple[float, Any]], right: int, up: int) -> None:
    """Draw an arrow for each impulse at its position; the greatest has a fixed length.

    Parameters
    ----------
    right, up : indices of the panel's axes
    """
    most = max(float(np.linalg.norm(delta_v)) for _, delta_v in impulses) or 1.0
    for time_s, delta_v in impulses:
        x, y = (float(np.interp(time_s, path.time_s, path.position_m[:, k])) for k in (right, up))
        axes.plot(x, y, "^", ms=5, color=PINK, zorder=3)
        step = (ARROW * float(delta_v[right]) / most, ARROW * float(delta_v[up]) / most)
        if np.hypot(step[0], step[1]) > ARROW / 8:  # a shorter arrow is seen end on
            arrow = {"arrowstyle": "<|-", "color": PINK, "lw": LINE_PT, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", xy=(x, y), xytext=step, textcoords="offset points", arrowprops=arrow, zorder=3)


def _draw_plane(axes: Axes, path: RelativePath, right: int, up: int, title: str) -> tuple[Any, list[Annotation]]:
    """Draw the path in one plane, with target, start and end, and return its points and the labels.

    Parameters
    ----------
    right, up : indices of the panel's axes
    """
    x, y = path.position_m[:, right], path.position_m[:, up]
    axes.axhline(0, color=RULE, lw=THIN_PT, zorder=0)
    axes.axvline(0, color=RULE, lw=THIN_PT, zorder=0)
    axes.plot(x, y, color=QUIET, lw=LINE_PT, zorder=1)
    drawn = axes.scatter(x, y, c=path.time_s, cmap=RANGE_RAMP, s=11, lw=0, zorder=2)
    closed = np.hypot(x[-1] - x[0], y[-1] - y[0]) <= CLOSED * np.hypot(np.ptp(x), np.ptp(y))
    ends = ((0, "o", "start and end"), (-1, "s", "")) if closed else ((0, "o", "start"), (-1, "s", "end"))
    labels = []

    def label(word: str, x: float, y: float) -> None:
        shown = axes.annotate(
            word, (x, y), xytext=(NEAR, NEAR), textcoords="offset points", fontsize=TEXT_PT, color=INK, zorder=6
        )
        shown.set_in_layout(False)
        labels.append(shown)

    for k, marker, word in ends:
        axes.plot(x[k], y[k], marker, ms=7, mfc=PAPER, mec=INK, mew=1.3, zorder=3)
        if word:
            label(word, x[k], y[k])
    axes.plot(0, 0, "P", ms=9, mfc=RED, mec=PAPER, mew=0.8, zorder=5)
    label(path.target, 0.0, 0.0)
    wide, high = (max(float(np.max(v)), 0.0) - min(float(np.min(v)), 0.0) for v in (x, y))
    stretched = max(wide, high) > STRETCHED * min(wide, high) > 0
    axes.margins(0.12, 0.16)
    if not stretched:
        axes.set_aspect("equal", adjustable="datalim")
    format_thousands(axes.xaxis, axes.yaxis)
    words = path.words
    style_axes(axes, title, f"{words[right]} [m]", f"{words[up]} [m]", "scales differ" if stretched else "")
    return drawn, labels
