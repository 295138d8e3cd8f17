"""One encounter over time in one picture: panels over one axis, shaded in shadow and out of the field."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette
from rso_lidar.records import find_shadow_spans_s
from rso_lidar.units import DEG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_IN = 1.42  # height of a panel [inches]
_WHOLE = 0.999  # share of the bounds in the field from which the whole target counts as in it
_SOME = 1e-6  # below this share, none of it does
_DASHED = (0, (4, 3))
_DRIVES = (("pan", palette.BLUE), ("tilt", palette.GREEN))
_LEGEND = 0.22  # height of a legend of one line over that of a panel
Table = Mapping[str, np.ndarray]


def timeline_figure(
    table: Table,
    target: str,
    title: str = "",
    *,
    half_field_rad: float | None = None,
    travel_rad: Sequence[tuple[float, float]] | None = None,
    max_rate_rad_s: float = np.inf,
    shadow_s: Sequence[tuple[float, float]] | None = None,
) -> Figure:
    """Draw an encounter over time: range, rates, Sun, PTU, field, pixels, photons and detection.

    Parameters
    ----------
    table : columns (time) by name, as `rso_lidar.timeline` makes them; without a Sun or a PTU their panels are left
        out
    half_field_rad : half the side of the field of view [rad]
    travel_rad : limits of pan and of tilt [rad], drawn where finite and near
    max_rate_rad_s : greatest rate of the PTU [rad/s], drawn where near
    shadow_s : spans [s] in which the Earth hides the Sun from the target; by default from `sunlit_fraction`
    """
    time_s = table["time_s"]
    panels: list[Callable[[Axes], None]] = [
        lambda axes: _draw_range(axes, table),
        lambda axes: _draw_rates(axes, table),
    ]
    if "phase_rad" in table:
        panels.append(lambda axes: _draw_sun(axes, table))
    if "sky_image_photons_per_s" in table:
        panels.append(lambda axes: _draw_sky_light(axes, table))
    if "pan_demand_rad" in table:
        panels.append(lambda axes: _draw_angles(axes, table, travel_rad))
        panels.append(lambda axes: _draw_drive(axes, table, max_rate_rad_s))
    panels += [
        lambda axes: _draw_field(axes, table, half_field_rad),
        lambda axes: _draw_pixels(axes, table),
        lambda axes: _draw_photons(axes, table),
        lambda axes: _draw_detection(axes, table),
    ]
    if shadow_s is None and "sunlit_fraction" in table:
        shadow_s = find_shadow_spans_s(time_s, table["sunlit_fraction"])
    first_s, last_s = float(time_s[0]), float(time_s[-1])
    dark_s = [(max(a, first_s), min(b, last_s)) for a, b in shadow_s or () if a <= last_s and b >= first_s]
    part_s, outside_s = (
        find_shadow_spans_s(time_s, (table["in_field_fraction"] >= share).astype(float)) for share in (_WHOLE, _SOME)
    )
    note = f"from the lidar to {target}   ·   from {_format_start(table)}   ·   {time_s.size:,} frames"
    shades = [f"grey: {target} in the Earth's shadow"] if dark_s else []
    shades += [f"pale red: {target} not wholly in the field"] if part_s != outside_s else []
    shades += ["red: out of it" if part_s != outside_s else f"red: {target} out of the field"] if outside_s else []
    cast = int(np.sum(table["cast"]))
    shades.append(f"light: rays cast at {cast:,} frames" + (", carried to the others" if cast < time_s.size else ""))
    height_in = 0.9 + 0.25 + _PANEL_IN * len(panels)
    figure = figures.new_figure(9.6, height_in, title or "Timeline", note, ("   ·   ".join(shades),))
    rows = figure.subplots(len(panels), 1, sharex=True)
    for axes, draw in zip(rows, panels, strict=True):
        for begins_s, ends_s in dark_s:
            axes.axvspan(begins_s, ends_s, color=palette.SHADE, lw=0, zorder=0)
        for begins_s, ends_s in (*part_s, *outside_s):  # targets wholly outside are shaded twice, so darker
            axes.axvspan(begins_s, ends_s, color=palette.ALARM_SHADE, lw=0, zorder=0, alpha=0.6)
        draw(axes)
    rows[-1].set_xlabel("Time [s]", fontsize=figures.TEXT_PT, color=palette.QUIET)
    figures.format_thousands(rows[-1].xaxis)
    rows[-1].set_xlim(first_s, last_s if time_s.size > 1 else first_s + 1.0)
    figure.align_ylabels(rows)
    return figure


def _format_start(table: Table) -> str:
    return f"{table['utc'][0]}"[:19].replace("T", " ") + " UTC"


# ------------------------------------------------------------------------------------------------------ the panels


def _draw_range(axes: Axes, table: Table) -> None:
    axes.plot(table["time_s"], table["range_m"], color=palette.BLUE, lw=figures.THICK_PT)
    figures.style_axes(axes, y="Range [m]")
    figures.colour_axis(axes, "left", palette.BLUE)
    axes.set_ylim(0.0, 1.06 * float(table["range_m"].max()) or 1.0)
    figures.format_thousands(axes.yaxis)
    rate = _add_right_axis(axes, "Range rate [m/s]", palette.ORANGE)
    rate.plot(table["time_s"], table["range_rate_m_s"], color=palette.ORANGE, lw=figures.LINE_PT)
    figures.widen_short_axis(rate, 0.01)


def _draw_rates(axes: Axes, table: Table) -> None:
    for name, word, colour, width in (
        ("line_of_sight_rate_rad_s", "line of sight, inertial", palette.QUIET, 2.6),
        ("azimuth_rate_rad_s", "azimuth", palette.BLUE, 1.2),
        ("elevation_rate_rad_s", "elevation", palette.GREEN, 1.2),
    ):
        axes.plot(table["time_s"], table[name] / DEG, color=colour, lw=width, label=word)
    figures.style_axes(axes, y="Rates to the\ntarget [deg/s]")
    figures.widen_short_axis(axes, 1e-4)
    _draw_legend(axes)


def _draw_sun(axes: Axes, table: Table) -> None:
    axes.plot(
        table["time_s"],
        table["phase_rad"] / DEG,
        color=palette.PINK,
        lw=figures.LINE_PT,
        label="phase, Sun-target-lidar",
    )
    axes.plot(
        table["time_s"],
        table["sun_off_boresight_rad"] / DEG,
        color=palette.ORANGE,
        lw=figures.LINE_PT,
        label="Sun off the boresight",
    )
    low_deg, label = 0.0, "Sun [deg]"
    if "sky_image_photons_per_s" in table:  # with stray light, the other bodies count too
        label = "Sun, Earth,\nMoon [deg]"
        for name, word, colour in (
            ("earth_limb_off_boresight_rad", "Earth's limb", palette.BLUE),
            ("moon_off_boresight_rad", "Moon", palette.QUIET),
        ):
            if name in table:
                axes.plot(table["time_s"], table[name] / DEG, color=colour, lw=figures.LINE_PT, label=word)
                low_deg = min(low_deg, float(np.nanmin(table[name], initial=0.0)) / DEG)
    figures.style_axes(axes, y=label)
    axes.set_ylim(low_deg - 7, 187)
    axes.set_yticks(range(0, 181, 60))
    _draw_legend(axes)


def _draw_sky_light(axes: Axes, table: Table) -> None:
    """Draw the stray light of Sun, Earth and Moon in a pixel."""
    for name, word, colour, width in (
        ("sky_image_photons_per_s", "brightest pixel of their images", palette.QUIET, 2.2),
        ("sun_veil_photons_per_s", "veil of the Sun", palette.ORANGE, 1.2),
        ("earth_veil_photons_per_s", "of the Earth", palette.BLUE, 1.2),
        ("moon_veil_photons_per_s", "of the Moon", palette.GREEN, 1.2),
    ):
        axes.plot(table["time_s"], _hide_zeros(table[name]), color=colour, lw=width, label=word)
    figures.style_axes(axes, y="Stray light\n[photons/s]")
    _use_log_scale(axes, "no light of the sky")
    _draw_legend(axes)


def _draw_angles(axes: Axes, table: Table, travel_rad: Sequence[tuple[float, float]] | None) -> None:
    """Draw pan and tilt, demanded and true, with their limits [rad]."""
    for word, colour in _DRIVES:
        _draw_followed(axes, table, word, colour, f"{word}_demand_rad", f"{word}_actual_rad")
        _mark(axes, table, f"{word}_beyond_travel", f"{word}_demand_rad", f"{word} beyond its travel")
    figures.style_axes(axes, y="PTU [deg]\npale: demanded")
    figures.widen_short_axis(axes, 0.01)
    for (low, high), (_, colour) in zip(travel_rad or (), _DRIVES, strict=False):
        _draw_limit(axes, low / DEG, colour)
        _draw_limit(axes, high / DEG, colour)
    _draw_legend(axes)


def _draw_drive(axes: Axes, table: Table, max_rate_rad_s: float) -> None:
    """Draw the rates of pan and tilt, demanded and true, with their limit [rad/s] unless infinite."""
    for word, colour in _DRIVES:
        _draw_followed(axes, table, word, colour, f"{word}_demand_rate_rad_s", f"{word}_rate_rad_s")
        _mark(axes, table, f"{word}_at_greatest_rate", f"{word}_rate_rad_s", f"{word} at its greatest rate")
    most = max_rate_rad_s / DEG
    figures.style_axes(axes, y="PTU rates\n[deg/s]")
    figures.widen_short_axis(axes, 1e-3)
    shown = [_draw_limit(axes, value, palette.INK) for value in (-most, most)]
    if np.isfinite(most):
        beyond = "" if any(shown) else ", beyond the axis"
        axes.plot(
            [], [], color=palette.INK, lw=figures.THIN_PT, ls=_DASHED, label=f"greatest rate ±{most:g}°/s{beyond}"
        )
    _draw_legend(axes)


def _draw_followed(axes: Axes, table: Table, word: str, colour: str, demanded: str, true: str) -> None:
    """Draw a column over the pale one that it follows."""
    axes.plot(table["time_s"], table[demanded] / DEG, color=colour, lw=figures.WIDE_PT, alpha=0.3)
    axes.plot(table["time_s"], table[true] / DEG, color=colour, lw=figures.LINE_PT, label=word)


def _draw_field(axes: Axes, table: Table, half_field_rad: float | None) -> None:
    """Draw the angle of the target off the boresight, half the field [rad], and its share in the field."""
    off_deg = table["off_boresight_rad"] / DEG
    axes.plot(table["time_s"], off_deg, color=palette.RED, lw=figures.LINE_PT, label="target's origin")
    greatest = float(np.nanmax(off_deg))
    if half_field_rad is not None:
        axes.axhline(
            half_field_rad / DEG, color=palette.QUIET, lw=figures.THIN_PT, ls=_DASHED, label="half the field's side"
        )
        greatest = max(greatest, half_field_rad / DEG)
    figures.style_axes(axes, y="Off boresight\n[deg]")
    axes.set_ylim(-0.04 * greatest, 1.5 * greatest or 1.0)  # so that half the field does not lie on 100 %
    share = _add_right_axis(axes, "Of its bounds,\nin the field [%]", palette.BLUE)
    share.plot(table["time_s"], 100.0 * table["in_field_fraction"], color=palette.BLUE, lw=figures.LINE_PT)
    share.set_ylim(-4, 108)
    share.set_yticks(range(0, 101, 25))
    _raise_top(share)
    _draw_legend(axes)


def _draw_pixels(axes: Axes, table: Table) -> None:
    for name, word, colour, width in (
        ("width_pixels", "width of its bounds", palette.QUIET, 2.2),
        ("height_pixels", "height of its bounds", palette.ORANGE, 1.0),
        ("target_pixels", "pixels on the target", palette.BLUE, 1.4),
    ):
        axes.plot(table["time_s"], _hide_zeros(table[name]), color=colour, lw=width, label=word)
    figures.style_axes(axes, y="Pixels")
    _use_log_scale(axes)
    _draw_legend(axes)


def _draw_photons(axes: Axes, table: Table) -> None:
    axes.plot(
        table["time_s"],
        _hide_zeros(table["brightest_photons"]),
        color=palette.RED,
        lw=figures.LINE_PT,
        label="brightest pixel",
    )
    axes.plot(
        table["time_s"],
        _hide_zeros(table["median_photons"]),
        color=palette.BLUE,
        lw=figures.LINE_PT,
        label="median pixel",
    )
    figures.style_axes(axes, y="Expected photons\nin a pixel")
    _use_log_scale(axes)
    _draw_legend(axes)


def _draw_detection(axes: Axes, table: Table) -> None:
    pixels = table["target_pixels"]
    share = np.where(pixels > 0.0, table["expected_returns"] / np.maximum(pixels, 1e-9), np.nan)
    axes.plot(
        table["time_s"],
        table["detection_probability"],
        color=palette.RED,
        lw=figures.LINE_PT,
        label="of the best pixel",
    )
    axes.plot(
        table["time_s"],
        table["found_probability"],
        color=palette.GREEN,
        lw=figures.LINE_PT,
        label="of the whole target",
    )
    axes.plot(table["time_s"], share, color=palette.BLUE, lw=figures.LINE_PT, label="mean over the target's pixels")
    figures.style_axes(axes, y="Probability of\ndetection")
    axes.set_ylim(-0.04, 1.06)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0])
    _draw_legend(axes)


# ------------------------------------------------------------------------------------------------------- the parts


def _add_right_axis(axes: Axes, label: str, colour: str) -> Axes:
    """Add a second axis at the right, with its own colour."""
    twin = axes.twinx()
    figures.style_axes(twin, y=label)
    twin.grid(False)
    figures.colour_axis(twin, "right", colour)
    return twin


def _mark(axes: Axes, table: Table, where: str, value: str, label: str) -> None:
    """Mark where a drive is at a limit, by the column `where`."""
    at = np.flatnonzero(table[where])
    if at.size:
        axes.plot(table["time_s"][at], table[value][at] / DEG, ".", color=palette.FALSE, ms=4, label=label, zorder=4)


def _draw_limit(axes: Axes, value: float, colour: str) -> bool:
    """Draw a limit that is finite and near to what is shown; return whether it is."""
    low, high = axes.get_ylim()
    reach = 0.6 * (high - low)
    near = bool(np.isfinite(value) and low - reach <= value <= high + reach)
    if near:
        axes.axhline(value, color=colour, lw=figures.THIN_PT, ls=_DASHED)
    return near


def _hide_zeros(values: np.ndarray) -> np.ndarray:
    """Return values with NaN where they are not positive, for a logarithmic axis."""
    return np.where(values > 0.0, values, np.nan)


def _use_log_scale(axes: Axes, without: str = "nothing in the field") -> None:
    """Use a logarithmic axis, or write the text `without` into a panel where nothing is positive."""
    lines = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    if any(np.isfinite(values).any() for values in lines):
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        if high < 10.0 * low:
            axes.set_ylim(low / 2.5, high * 2.5)
    else:
        axes.text(0.5, 0.5, without, transform=axes.transAxes, ha="center", va="center", fontsize=figures.TEXT_PT)


def _raise_top(axes: Axes) -> None:
    """Raise the upper end of an axis by the height of a legend of one line, so that no curve crosses it."""
    low, high = axes.get_ylim()
    more = 1.0 + _LEGEND
    axes.set_ylim(low, low * (high / low) ** more if axes.get_yscale() == "log" else low + (high - low) * more)


def _draw_legend(axes: Axes) -> None:
    _raise_top(axes)
    axes.legend(
        fontsize=figures.SMALL_PT, frameon=False, loc="upper left", labelcolor=palette.QUIET, ncols=4, borderaxespad=0.2
    )
