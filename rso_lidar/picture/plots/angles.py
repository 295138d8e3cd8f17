"""Range and angles over time: the line of sight and the Sun; and what the PTU was asked and how it answered."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.picture.selection.sequence import choose_target, format_start, pick
from rso_lidar.picture.style.figures import (
    HEADROOM,
    LINE_PT,
    SMALL_PT,
    THICK_PT,
    THIN_PT,
    WIDE_PT,
    colour_axis,
    draw_legend,
    format_thousands,
    new_figure,
    style_axes,
    widen_short_axis,
)
from rso_lidar.picture.style.palette import BLUE, GREEN, INK, ORANGE, PINK, QUIET, RED, RULE, SHADE
from rso_lidar.records import (
    Frame,
    PtuAngles,
    Truth,
    ViewingGeometry,
    compute_viewing_geometry,
    find_shadow_spans_s,
)
from rso_lidar.units import DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN = 600  # most frames of a recording read
FINE_DEG = 1e-3  # least span of an axis
SILL = 0.04  # of the height, below zero, so that a line at zero is visible


def angles_figure(
    source: Truth | Iterable[Frame],
    target: str | None = None,
    title: str = "",
    *,
    half_field_rad: float | None = None,
    shadow_s: Iterable[tuple[float, float]] | None = None,
) -> Figure:
    """Draw range and its rate, azimuth and elevation, angle off the boresight and Sun angles over time.

    Panels are shaded grey where the Earth hides the Sun from the target.

    Parameters
    ----------
    source : a Truth batched over epochs, with the lidar in it, or frames
    target : name of the target; by default the first
    title : of the figure; by default that of the recording
    half_field_rad : half the side of the field of view [rad], drawn as a limit
    shadow_s : spans [s] in which the Earth hides the Sun from the target, infinite where they continue. By default
        from the frames, to half a step

    Returns
    -------
    Figure
    """
    seen, heading, note = _find_sight(source, target)
    if not np.isfinite(seen.phase_rad).any():
        note += "   ·   no Sun in this world"
    dark_s = _clip_shadow(seen, shadow_s)
    if dark_s:
        coarse = "" if shadow_s is not None else ", as the frames have it"
        note += f"   ·   grey: the target is in the Earth's shadow{coarse}"
    figure = new_figure(9.0, 9.4, title or heading or "Line of sight", note)
    rows = figure.subplots(4, 1, sharex=True, gridspec_kw={"height_ratios": (1.25, 1.0, 1.0, 1.0)})
    ranges, directions, off, sun = rows
    for axes in rows:
        for begins_s, ends_s in dark_s:
            axes.axvspan(begins_s, ends_s, color=SHADE, lw=0, zorder=0)

    ranges.plot(seen.time_s, seen.range_m, color=BLUE, lw=THICK_PT)
    style_axes(ranges, y="Range [m]")
    colour_axis(ranges, "left", BLUE)
    ranges.set_ylim(0.0, HEADROOM * float(seen.range_m.max()) or 1.0)
    format_thousands(ranges.yaxis)
    rate = ranges.twinx()
    rate.plot(seen.time_s, seen.range_rate_m_s, color=ORANGE, lw=LINE_PT)
    style_axes(rate, y="Range rate [m/s]")
    rate.grid(False)
    colour_axis(rate, "right", ORANGE)

    directions.plot(
        seen.time_s, _break_at_jumps(seen.azimuth_rad) / DEG, color=BLUE, lw=THICK_PT, label="azimuth, left positive"
    )
    directions.plot(seen.time_s, seen.elevation_rad / DEG, color=GREEN, lw=LINE_PT, label="elevation, up positive")
    style_axes(directions, y="To the target, in\nfollower axes [deg]")
    widen_short_axis(directions, 2.0 * FINE_DEG)
    draw_legend(directions)

    off.plot(seen.time_s, seen.off_boresight_rad / DEG, color=RED, lw=LINE_PT, label="target")
    if half_field_rad is not None:
        off.axhline(half_field_rad / DEG, color=QUIET, lw=THIN_PT, ls=(0, (4, 3)), label="half the field's side")
    style_axes(off, y="Off the boresight\n[deg]")
    greatest_deg = max(float(np.nanmax(seen.off_boresight_rad)), half_field_rad or 0.0) / DEG
    top_deg = max(HEADROOM * greatest_deg, FINE_DEG)
    off.set_ylim(-SILL * top_deg, top_deg)
    draw_legend(off)

    sun.plot(seen.time_s, seen.sun_off_boresight_rad / DEG, color=ORANGE, lw=LINE_PT, label="Sun off the boresight")
    sun.plot(seen.time_s, seen.phase_rad / DEG, color=PINK, lw=LINE_PT, label="phase angle, Sun-target-lidar")
    style_axes(sun, x="Time [s]", y="Sun [deg]")
    sun.set_ylim(-SILL * 180, (1 + SILL) * 180)
    sun.set_yticks(range(0, 181, 45))
    draw_legend(sun)
    format_thousands(sun.xaxis)
    sun.set_xlim(seen.time_s[0], seen.time_s[-1] if seen.time_s.size > 1 else seen.time_s[0] + 1.0)
    figure.align_ylabels(rows)
    return figure


def ptu_figure(
    source: tuple[np.ndarray, Sequence[PtuAngles]] | Iterable[Frame],
    title: str = "",
    *,
    travel_rad: Sequence[tuple[float, float]] | None = None,
    max_rate_rad_s: float | None = None,
) -> Figure:
    """Draw pan and tilt over time: demanded, true and measured, the errors of both, and their rates.

    Parameters
    ----------
    title : of the figure; by default that of the recording
    source : instants (time) [s] with the PTU's angles at each, or frames
    travel_rad : the ends of pan and of tilt [rad], drawn where finite and near
    max_rate_rad_s : the drive's greatest rate [rad/s], drawn where finite

    Returns
    -------
    Figure
    """
    time_s, angles, heading, note = _read_ptu(source)
    table = {
        name: np.stack([getattr(angle, name) for angle in angles]) / DEG for name in PtuAngles.__dataclass_fields__
    }
    error_deg = table["actual_rad"] - table["demand_rad"]
    note += f"   ·   greatest error {np.hypot(*error_deg.T).max():.3g}°"
    figure = new_figure(9.0, 9.0, title or heading or "Pan and tilt", note)
    pan, tilt, errors, rates = rows = figure.subplots(4, 1, sharex=True)
    for k, (axes, word) in enumerate(((pan, "Pan"), (tilt, "Tilt"))):
        axes.plot(time_s, table["demand_rad"][:, k], color=RULE, lw=WIDE_PT, label="demanded")
        axes.plot(time_s, table["actual_rad"][:, k], color=BLUE, lw=LINE_PT, label="true", zorder=3)
        axes.plot(time_s, table["measured_rad"][:, k], ".", color=ORANGE, ms=4.0, label="measured")
        style_axes(axes, y=f"{word} [deg]")
        widen_short_axis(axes, 2.0 * FINE_DEG)
        _draw_limits(axes, () if travel_rad is None else [end / DEG for end in travel_rad[k]])
    pan.legend(
        fontsize=SMALL_PT, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, labelcolor=QUIET,
        borderaxespad=0.0,
    )  # fmt: skip
    for k, (word, colour) in enumerate((("pan", BLUE), ("tilt", GREEN))):
        errors.plot(time_s, error_deg[:, k], color=colour, lw=LINE_PT, label=f"{word}, true − demanded")
        measured = table["measured_rad"][:, k] - table["actual_rad"][:, k]
        if np.abs(measured).max() > 1e-9:
            errors.plot(time_s, measured, ".", color=colour, ms=2.0, alpha=0.5, label=f"{word}, measured − true")
        rates.plot(time_s, table["rate_rad_s"][:, k], color=colour, lw=LINE_PT, label=word)
    errors.axhline(0, color=RULE, lw=THIN_PT, zorder=0)
    style_axes(errors, y="Error [deg]")
    widen_short_axis(errors, 2.0 * FINE_DEG)
    draw_legend(errors, columns=2)
    style_axes(rates, x="Time [s]", y="Rate [deg/s]")
    widen_short_axis(rates, 2.0 * FINE_DEG)
    if max_rate_rad_s is not None:
        _draw_limits(rates, (-max_rate_rad_s / DEG, max_rate_rad_s / DEG), rates=True)
    draw_legend(rates)
    format_thousands(rates.xaxis)
    rates.set_xlim(time_s[0], time_s[-1] if time_s.size > 1 else time_s[0] + 1.0)
    figure.align_ylabels(rows)
    return figure


def _find_sight(source: Truth | Iterable[Frame], target: str | None) -> tuple[ViewingGeometry, str, str]:
    """Find the line of sight, a title and a note."""
    if isinstance(source, Truth):
        name = choose_target(
            "angles", target, [body for body in source.states if body != "follower"], list(source.poses)
        )
        return compute_viewing_geometry(source, name), "", f"from the lidar to {name}"
    picked, _ = pick(source, DRAWN, lambda frame: (frame.truth, frame.source.title, format_start(frame), frame))
    first = picked[0][3]
    entries = [entry.name for entry in first.source.targets]
    name = choose_target("angles", target, entries, [*entries, *first.truth.poses])
    note = f"from the lidar to {name}   ·   time since {picked[0][2]}"
    return join_viewing_geometry([truth for truth, *_ in picked], name), picked[0][1], note


def join_viewing_geometry(truths: Iterable[Truth], target: str) -> ViewingGeometry:
    """Compute the viewing geometry of a target at each of several single epochs, and join them in order."""
    seen = [compute_viewing_geometry(truth, target) for truth in truths]
    return ViewingGeometry(
        **{
            field.name: np.concatenate([getattr(geometry, field.name) for geometry in seen])
            for field in dataclasses.fields(ViewingGeometry)
        }
    )


def _read_ptu(
    source: tuple[np.ndarray, Sequence[PtuAngles]] | Iterable[Frame],
) -> tuple[np.ndarray, Sequence[PtuAngles], str, str]:
    """Read instants [s], the angles at each, a title and a note."""
    if isinstance(source, tuple) and len(source) == 2 and isinstance(source[0], np.ndarray):
        times_s, angles = source
        heading, note = "", "pan left, tilt up positive"
    else:
        picked, _ = pick(
            source,
            DRAWN,
            lambda frame: (frame.time_s, frame.truth.pointing, frame.source.title, format_start(frame)),
        )
        angles = [pointing for _, pointing, *_ in picked if pointing is not None]
        times_s = np.array([time_s for time_s, pointing, *_ in picked if pointing is not None])
        heading, note = picked[0][2], f"pan left, tilt up positive   ·   time since {picked[0][3]}"
    if not angles:
        raise RecordingError("ptu: no pan and tilt to draw; give the scenario a [ptu]")
    return np.asarray(times_s, dtype=float), angles, heading, note


def _clip_shadow(seen: ViewingGeometry, given_s: Iterable[tuple[float, float]] | None) -> list[tuple[float, float]]:
    """Clip spans in shadow [s] to the instants drawn; without given spans, find them from the instants."""
    if given_s is None:
        return find_shadow_spans_s(seen.time_s, seen.sunlit)
    first_s, last_s = float(seen.time_s[0]), float(seen.time_s[-1])
    return [(max(low, first_s), min(high, last_s)) for low, high in given_s if low <= last_s and high >= first_s]


def _break_at_jumps(angle_rad: np.ndarray) -> np.ndarray:
    """Return an angle with NaN where it jumps by more than half a turn, so that no line crosses the jump."""
    broken = angle_rad.copy()
    broken[1:][np.abs(np.diff(angle_rad)) > np.pi] = np.nan
    return broken


def _draw_limits(axes: Axes, ends: Iterable[float], *, rates: bool = False) -> None:
    """Draw limits that are near what is shown, and write the far ones at the right.

    Parameters
    ----------
    ends : the limits [deg or deg/s]
    """
    low, high = axes.get_ylim()
    far = []
    for end in ends:
        if not np.isfinite(end):
            continue
        if low - 0.6 * (high - low) <= end <= high + 0.6 * (high - low):
            axes.axhline(end, color=INK, lw=THIN_PT, ls=(0, (4, 3)))
        else:
            far.append(f"{end:g}")
    if far:
        words = f"±{far[-1]}" if len(far) == 2 and far[0] == f"-{far[1]}" else " and ".join(far)
        axes.set_title(
            f"limits off the scale: {words}°" + ("/s" if rates else ""),
            loc="right",
            fontsize=SMALL_PT,
            color=QUIET,
        )
