"""Panels of a figure of one frame: range, intensity, parts, and range minus truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.picture.frames.part_colours import PartKey, colour_parts, find_part_name
from rso_lidar.picture.selection.scale import Scale
from rso_lidar.picture.selection.sequence import choose_camera_window, find_target_returns, pixel_rad
from rso_lidar.picture.selection.stretch import Stretch
from rso_lidar.picture.selection.window import Window
from rso_lidar.picture.style.colour_maps import ERROR_RAMP, INTENSITY_RAMP, RANGE_RAMP, ramp
from rso_lidar.picture.style.figures import (
    HEADING_PT,
    SMALL_PT,
    TEXT_PT,
    THICK_PT,
    THIN_PT,
    WIDE_PT,
    round_down,
    round_up,
    use_minus_sign,
)
from rso_lidar.picture.style.palette import (
    FALSE,
    IMAGE_BLACK,
    IMAGE_MARK,
    IMAGE_WHITE,
    INK,
    MISSED,
    NO_LIGHT,
    NO_RETURN,
    OTHER_PART,
    PAPER,
    PARTS,
    QUIET,
)
from rso_lidar.records import Frame, Reading, specs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Corner = Literal["lower left", "lower right", "upper left", "upper right"]


def _caption(name: str) -> str:
    """Return meaning and unit of an array of the reading, from its statement in the record."""
    spec = specs(Reading)[name]
    meaning = spec.meaning.split(",")[0]
    return f"{meaning[0].upper()}{meaning[1:]} [{spec.unit}]"


def _show(
    axes: Axes, values: np.ndarray, window: Window, colours: Any, low: float, high: float, *, logarithmic: bool = False
) -> Any:
    """Draw an array (row, col) in the window; NaN gets the colour map's colour for bad values.

    Parameters
    ----------
    values : (row, col)
    """
    from matplotlib.colors import LogNorm, Normalize

    extent = (window.left - 0.5, window.right - 0.5, window.bottom - 0.5, window.top - 0.5)
    shown = np.ma.masked_invalid(window.cut(values))
    norm = (LogNorm if logarithmic else Normalize)(low, high)
    return axes.imshow(shown, cmap=colours, norm=norm, extent=extent, interpolation="nearest")


def _draw_bar(axes: Axes, drawn: Any, label: str, extend: str = "neither", *, logarithmic: bool = False) -> None:
    """Draw a colour bar beside a panel.

    Parameters
    ----------
    extend, logarithmic : its open ends ("neither", "both", "min", "max"), and whether its scale is logarithmic
    """
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    place = axes.inset_axes((1.03, 0.0, 0.045, 1.0))
    bar = axes.figure.colorbar(drawn, cax=place, extend=extend)
    bar.ax.tick_params(labelsize=SMALL_PT, colors=QUIET)
    if logarithmic:
        bar.locator, bar.formatter = LogLocator(subs=(1.0, 2.0, 5.0)), StrMethodFormatter("{x:,.0f}")
        bar.minorticks_off()
    else:
        bar.ax.ticklabel_format(useOffset=False, style="plain")
    bar.outline.set_edgecolor(QUIET)
    bar.set_label(label, fontsize=SMALL_PT, color=QUIET)


def _write_heading(axes: Axes, text: str, note: str = "") -> None:
    """Write the heading of a panel."""
    axes.set_title(text, loc="left", fontsize=HEADING_PT, color=INK)
    axes.set_title(note, loc="right", fontsize=SMALL_PT, color=QUIET)


def draw_range(axes: Axes, frame: Frame, window: Window) -> None:
    """Draw the measured range of a frame.

    Parameters
    ----------
    axes : where to draw
    frame : the frame
    window : the part of the field shown
    """
    from matplotlib import colormaps

    scale = Scale.of_frames(frame)
    low, high = scale.low_m, scale.high_m
    colours = colormaps[RANGE_RAMP].with_extremes(bad=NO_RETURN)
    drawn = _show(axes, frame.range_m, window, colours, low, high)
    shown = window.cut(frame.range_m)
    below, above = bool((shown < low).any()), bool((shown > high).any())
    _draw_bar(axes, drawn, _caption("range_m"), ("neither", "min", "max", "both")[below + 2 * above])
    _write_heading(axes, "Range", "dark: no return")
    if not window.whole:
        _draw_locator(axes, window)


def _draw_locator(axes: Axes, window: Window) -> None:
    """Draw the whole field small in a corner, with the window marked in it."""
    from matplotlib.patches import Rectangle

    longest = max(window.n_rows, window.n_cols)
    wide, high = 0.16 * window.n_cols / longest, 0.16 * window.n_rows / longest
    small = axes.inset_axes((0.985 - wide, 0.985 - high, wide, high))
    small.set(xlim=(0, window.n_cols), ylim=(window.n_rows, 0), xticks=[], yticks=[], facecolor=IMAGE_BLACK)
    small.add_patch(Rectangle((window.left, window.top), window.width, window.height, color=IMAGE_MARK, lw=0))
    for spine in small.spines.values():
        spine.set(visible=True, color=IMAGE_WHITE, linewidth=THIN_PT)


def draw_intensity(axes: Axes, frame: Frame, window: Window) -> None:
    """Draw the measured intensity of a frame, with a scale bar at the target's range.

    It is drawn in logarithms where a few glints outshine the rest, as in contact sheets.

    Parameters
    ----------
    axes : where to draw
    frame : the frame
    window : the part of the field shown
    """
    from matplotlib.colors import ListedColormap

    counts, scale = frame.intensity_counts.astype(float), Scale.of_frames(frame)
    low, high, logarithmic = scale.low_counts, scale.high_counts, scale.logarithmic
    shown = window.cut(np.where(counts > 0, counts, np.nan))
    below, above = bool((shown < low).any()), bool((shown > high).any())
    colours = ListedColormap(ramp(INTENSITY_RAMP) / 255.0).with_extremes(bad=NO_LIGHT)
    drawn = _show(axes, np.where(counts > 0, counts, np.nan), window, colours, low, high, logarithmic=logarithmic)
    extend = ("neither", "min", "max", "both")[below + 2 * above]
    _draw_bar(axes, drawn, _caption("intensity_counts"), extend, logarithmic=logarithmic)
    saturated = int(frame.saturated.sum())
    _write_heading(axes, scale.intensity_words[0], f"{saturated:,} saturated" if saturated else "")
    seen = frame.range_m[find_target_returns(frame)]
    pixel_m = pixel_rad(frame) * float(np.median(seen)) if seen.size else 0.0
    if pixel_m > 0:
        length_m = round_down(0.3 * pixel_m * window.width)
        x, y = window.left + 0.04 * window.width - 0.5, window.bottom - 0.05 * window.height - 0.5
        flat: dict[str, Any] = {"scalex": False, "scaley": False}
        ends = [x, x + length_m / pixel_m]
        axes.plot(ends, [y, y], color=IMAGE_BLACK, lw=2.0 * WIDE_PT, solid_capstyle="projecting", **flat)
        axes.plot(ends, [y, y], color=IMAGE_WHITE, lw=THICK_PT, solid_capstyle="butt", **flat)
        axes.annotate(
            f"{length_m:g} m", (x, y), xytext=(0, 6), textcoords="offset points", color=IMAGE_WHITE, fontsize=TEXT_PT,
            bbox={"facecolor": IMAGE_BLACK, "lw": 0, "pad": 1.5},
        )  # fmt: skip


def draw_camera(axes: Axes, frame: Frame, camera: str) -> None:
    """Draw the image of a camera beside the lidar, stretched for a screen: colours of three bands, else the first band.

    Parameters
    ----------
    axes : where to draw
    frame : the frame
    camera : its name
    """
    image, window, stretch = frame.camera[camera], choose_camera_window(camera, frame), Stretch.of(camera, frame)
    extent = (window.left - 0.5, window.right - 0.5, window.bottom - 0.5, window.top - 0.5)
    axes.imshow(window.cut(stretch.paint(image.intensity_counts)), extent=extent)
    low, high = stretch.words
    _write_heading(axes, f"Camera {camera}", f"{1e3 * float(image.exposure_s):,.3g} ms; {low} to {high}")
    if not window.whole:
        _draw_locator(axes, window)


def draw_parts(axes: Axes, frame: Frame, window: Window, parts: Sequence[PartKey]) -> None:
    """Draw the true parts of a frame."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    there = frame.labels.target >= 0
    coloured = colour_parts(frame, parts)
    kinds, counts, colour, named = coloured.kinds, coloured.counts, coloured.colours, len(PARTS)
    order = np.argsort(-counts, kind="stable")
    shown = np.where(there, coloured.image, np.nan)
    colours = ListedColormap([*PARTS, OTHER_PART]).with_extremes(bad=NO_RETURN)
    _show(axes, shown, window, colours, -0.5, named + 0.5)
    entries = [
        Patch(color=PARTS[colour[which]], label=f"{find_part_name(frame, *kinds[which])}  {counts[which]:,}")
        for which in order
        if colour[which] < named
    ]
    rest = colour == named
    if rest.any():
        entries.append(Patch(color=OTHER_PART, label=f"{rest.sum()} more  {counts[rest].sum():,}"))
    if entries:
        axes.legend(
            handles=entries,
            loc="upper left",
            bbox_to_anchor=(1.02, 1.02),
            fontsize=SMALL_PT,
            frameon=False,
            labelcolor=QUIET,
            handlelength=1.0,
            borderpad=0.0,
            labelspacing=0.45,
        )
    _write_heading(
        axes,
        "Parts, by the labels",
        f"{int(there.sum()):,} pixels on a target" if entries else "no target in the field",
    )


def _free_corner(busy: np.ndarray) -> Corner:
    """Return the corner of a panel (row, col) with the fewest busy pixels."""
    high, wide = (max(1, size // 4) for size in busy.shape)
    corners: dict[Corner, np.ndarray] = {
        "lower left": busy[-high:, :wide],
        "lower right": busy[-high:, -wide:],
        "upper left": busy[:high, :wide],
        "upper right": busy[:high, -wide:],
    }
    return min(corners, key=lambda corner: int(corners[corner].sum()))


def draw_error(axes: Axes, frame: Frame, window: Window) -> None:
    """Draw range minus truth."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    there = frame.labels.target >= 0
    error_cm = (frame.range_m.astype(float) - frame.labels.range_m) / units.CM
    single = np.isfinite(error_cm) & (frame.labels.cluster_count == 1)
    judged = error_cm[single] if single.any() else error_cm[np.isfinite(error_cm)]
    limit = round_up(float(np.percentile(np.abs(judged), 99))) if judged.size else 1.0
    colours = colormaps[ERROR_RAMP].with_extremes(bad=NO_RETURN)
    drawn = _show(axes, error_cm, window, colours, -limit, limit)
    missed, false = there & ~frame.valid, frame.valid & ~there & bool(there.any())
    marks = [(missed, MISSED, "missed"), (false, FALSE, "false")]
    for mask, colour, _ in marks:
        _show(
            axes,
            np.where(mask, 1.0, np.nan),
            window,
            ListedColormap([colour]).with_extremes(bad=(0, 0, 0, 0)),
            0,
            2,
        )
    outside = bool((np.abs(window.cut(error_cm)) > limit).any())
    _draw_bar(axes, drawn, "Range minus truth of the brightest cluster [cm]", "both" if outside else "neither")
    entries = [Patch(color=colour, label=f"{word}  {int(mask.sum()):,}") for mask, colour, word in marks if mask.any()]
    if entries:
        axes.legend(
            handles=entries,
            loc=_free_corner(window.cut(there | frame.valid)),
            fontsize=SMALL_PT,
            frameon=True,
            framealpha=0.85,
            facecolor=PAPER,
            edgecolor="none",
            labelcolor=INK,
            handlelength=1.0,
            borderpad=0.5,
            labelspacing=0.25,
        )
    note = ""
    if judged.size:
        middle = float(np.median(judged))
        within = float(np.percentile(np.abs(judged - middle), 68.27))
        note = use_minus_sign(f"median {round(middle, 1) + 0.0:+.1f} cm, 68 % within ± {within:.1f} cm")
    _write_heading(axes, "Error", note)
