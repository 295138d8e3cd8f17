"""The report of a calibration: measured curves over simulated ones, with residuals, and what is not reproduced."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.detector import WAVEFORM_QUANTITIES, FittedCurve, MeanPulse, Pulse, shape_pulse
from rso_lidar.evaluation.camera_calibration.camera_fit import CameraFit
from rso_lidar.evaluation.camera_calibration.map_figures import draw_map_fit, draw_pixel_maps
from rso_lidar.files import check_writable, write_text
from rso_lidar.picture import LIGHT, Scheme, figures, html_page, palette, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIT_REPORT_SUFFIXES = (".html", ".png", ".pdf", ".svg")
_COLUMNS = 3
_LABELS = {
    "detection_rate": ("Detection rate", 1.0, False),
    "range_mean": ("Mean error of range [cm]", 100.0, False),
    "range_scatter": ("Scatter of range [cm]", 100.0, True),
    "counts_mean": ("Mean intensity [counts]", 1.0, True),
    "counts_scatter": ("Scatter of intensity [counts]", 1.0, True),
    "walk": ("Range walk [cm]", 100.0, False),
    "dark_counts": ("Triggers in the dark", 1.0, True),
    "pulse_area": ("Mean area of a pulse [counts ns]", 1.0, True),
    "area_variance": ("Variance of the area [(counts ns)²]", 1.0, True),
    "pulse_width": ("Width of a pulse [ns]", 1e9, False),
}  # heading, factor from SI, and whether the axis is logarithmic


def draw_camera_fit(camera: CameraFit) -> Figure:
    """Draw each measured curve over the simulated ones, and its residuals below; without curves, the maps.

    Single numbers of raw waveforms, such as their noise, are in the tables of the report alone.
    """
    curves = [curve for curve in camera.fit.curves if curve.curve.quantity in _LABELS]
    if not curves and camera.maps is not None:
        return draw_map_fit(camera.maps, camera.file.name)
    panels = len(curves) + bool(camera.pulses)
    columns = 2 if panels == 4 else min(_COLUMNS, max(panels, 1))
    rows = max(math.ceil(panels / columns), 1)
    verdict = "rejected" if camera.is_rejected else "accepted"
    chance = "-" if camera.fit.p_value is None else f"{camera.fit.p_value:.2g}"
    note = f"{verdict}: chi-square {camera.fit.chi2:.1f} with {camera.fit.freedom:.0f} degrees of freedom, P {chance}"
    small = ("Dots: measured, with 1 sigma. Line: fitted. Dashes: before the fit. Below: residuals [sigma].",)
    width = figures.PAGE_IN if columns > 1 else 0.6 * figures.PAGE_IN
    figure = figures.new_figure(width, 1.0 + 3.7 * rows, f"Calibration of {camera.file.name}", note, small)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2.6, 1.0] * rows})
    for place in range(rows * columns):
        row, column = divmod(place, columns)
        above, below = grid[2 * row, column], grid[2 * row + 1, column]
        if place < len(curves):
            _draw_curve(above, below, curves[place])
        elif place < panels:
            _draw_pulses(above, below, camera)
        else:
            above.set_visible(False)
            below.set_visible(False)
    return figure


def _draw_pulses(above: Axes, below: Axes, camera: CameraFit) -> None:
    """Draw the mean pulses of the shots over that of the fitted detector."""
    pulse = camera.lidar.pulse
    for style, detector in (((0, (4, 2)), camera.lidar.detector), ("-", camera.fit.detector)):
        shape = shape_pulse(detector, pulse)
        time_s = np.linspace(*_find_span(camera), 400)
        last = style == "-"
        above.plot(
            1e9 * time_s,
            shape.amplitude(time_s) / shape.peak,
            ls=style,
            color=palette.BLUE if last else palette.QUIET,
            lw=figures.LINE_PT if last else figures.THIN_PT,
        )
    below.axhline(0.0, color=palette.RULE, lw=figures.THIN_PT)
    top = 3.5
    for number, mean in enumerate(camera.pulses):
        colour = palette.LINES[1 + number % (len(palette.LINES) - 1)]
        time_s = mean.time_s - _find_delay_s(mean, shape)
        known = mean.error > 0.0
        residuals = ((mean.value - shape.amplitude(time_s) / shape.peak)[known]) / mean.error[known]
        above.plot(1e9 * time_s, mean.value, ".", ms=4, color=colour, label=f"{mean.photons:.4g} photons")
        below.plot(1e9 * time_s[known], residuals, ".", ms=4, color=colour)
        top = max(top, 1.15 * float(np.abs(residuals).max(initial=0.0)))
    below.set_ylim(-top, top)
    figures.style_axes(above, "Mean pulse over its peak")
    figures.style_axes(below, x="Time after the return [ns]")
    above.tick_params(labelbottom=False)
    figures.draw_legend(above)


def _find_delay_s(mean: MeanPulse, shape: Pulse) -> float:
    """Return the delay of a mean pulse after a shape [s]: its shots were aligned by a pulse of another width."""
    slope = shape.slope(mean.time_s) / shape.peak
    beside = mean.value - shape.amplitude(mean.time_s) / shape.peak
    return -float((beside * slope).sum() / (slope**2).sum())


def _find_span(camera: CameraFit) -> tuple[float, float]:
    """Return the first and the last time of all mean pulses [s]."""
    ends = [(float(mean.time_s.min()), float(mean.time_s.max())) for mean in camera.pulses]
    return min(low for low, _ in ends), max(high for _, high in ends)


def write_fit_report(camera: CameraFit, scheme: Scheme = LIGHT) -> str:
    """Return the report as an HTML page with the picture, tables of constants, curves and points."""
    fit, maps = camera.fit, camera.maps
    misfits = camera.list_misfits()
    total, freedom, p_value = camera.goodness
    worse = "too few to judge the fit" if p_value is None else (
        f"a camera like the fitted one gives a worse fit with probability {p_value:.2g}"
    )  # fmt: skip
    body = [
        f"<h1>Calibration of {escape(camera.file.name)}</h1>",
        f'<p class="quiet">{escape(camera.file.what or "")} Fitted {camera.date_utc:%Y-%m-%d %H:%M} UTC, '
        f"{escape(camera.versions)}.</p>",
        f"<p><b>{'Rejected' if camera.is_rejected else 'Accepted'}.</b> Chi-square is {total:.1f} with {freedom:.1f} "
        f"degrees of freedom: {worse}.</p>",
    ]
    if fit.curves:
        body += [
            html_page.embed_figure(draw_camera_fit(camera), "measured and simulated curves", scheme=scheme),
            "<h2>Constants</h2>",
            _tabulate_constants(camera),
            *_tabulate_correlations(camera),
        ]
    if maps is not None:
        body += [
            "<h2>Pixels</h2>",
            html_page.embed_figure(draw_pixel_maps(maps, camera.file.name), "constants of each pixel", scheme=scheme),
            html_page.embed_figure(draw_map_fit(maps, camera.file.name), "measured and fitted maps", scheme=scheme),
            *(_tabulate(rows) for rows in camera.list_map_rows()),
        ]
    body += [
        "<h2>What the model cannot reproduce</h2>",
        *([f"<p>{escape(line)}.</p>" for line in misfits] or ["<p>Nothing that these measurements show.</p>"]),
    ]
    if fit.curves:
        body += [
            "<h2>Curves</h2>",
            _tabulate_curves(camera),
            "<h2>Points</h2>",
            *(part for curve in fit.curves for part in _tabulate_points(curve)),
        ]
    return html_page.write_page(f"Calibration of {camera.file.name}", body, scheme)


def _tabulate(rows: list[tuple[str, ...]]) -> str:
    """Return rows as a table, the first of which is its heading."""
    heads = [(head, number > 0) for number, head in enumerate(rows[0])]
    return html_page.write_table(heads, [tuple(escape(cell) for cell in row) for row in rows[1:]])


def save_fit_report(camera: CameraFit, path: str | Path, *, overwrite: bool = False, scheme: Scheme = LIGHT) -> Path:
    """Write the report of a calibration as a page (.html), or its picture alone.

    Parameters
    ----------
    camera : the fit
    path : of the output (.html, .png, .pdf, .svg)
    overwrite : whether an existing file may be replaced
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    Path

    Raises
    ------
    RecordingError
        For another suffix, a file that exists already, or a place that may not be written.
    """
    place = check_writable(path, FIT_REPORT_SUFFIXES, overwrite=overwrite)
    if place.suffix.lower() == ".html":
        return write_text(place, write_fit_report(camera, scheme), overwrite=True)
    return save_figure(draw_camera_fit(camera), place, scheme=scheme)


def _draw_curve(above: Axes, below: Axes, fitted: FittedCurve) -> None:
    curve = fitted.curve
    title, factor, is_log = _LABELS[curve.quantity]
    x, label, is_x_log = _find_abscissa(fitted)
    order = np.argsort(x, kind="stable")
    style = "-" if len(x) > 1 else ""
    above.plot(x[order], factor * fitted.before[order], ls=(0, (4, 2)) if style else "", marker="" if style else "x",
               color=palette.QUIET, lw=figures.THIN_PT)  # fmt: skip
    above.plot(x[order], factor * fitted.expected[order], ls=style, marker="" if style else "_", ms=14,
               color=palette.BLUE, lw=figures.LINE_PT)  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.abs(np.where(fitted.residuals == 0.0, 0.0, (curve.value - fitted.expected) / fitted.residuals))
    above.errorbar(x, factor * curve.value, factor * np.nan_to_num(error), fmt="o", ms=4, color=palette.ORANGE,
                   ecolor=palette.ORANGE, elinewidth=figures.THIN_PT)  # fmt: skip
    is_named = curve.name != curve.quantity and curve.quantity not in WAVEFORM_QUANTITIES
    figures.style_axes(above, curve.name if is_named else title)
    below.axhline(0.0, color=palette.RULE, lw=figures.THIN_PT)
    below.vlines(x, 0.0, fitted.residuals, color=palette.ORANGE, lw=figures.THIN_PT)
    below.plot(x, fitted.residuals, "o", ms=4, color=palette.ORANGE)
    figures.style_axes(below, x=label)
    top = max(3.5, 1.15 * float(np.abs(fitted.residuals).max()))
    below.set_ylim(-top, top)
    for axes in (above, below):
        if is_x_log:
            axes.set_xscale("log")
            figures.log_ticks(axes.xaxis, *axes.get_xlim())
    above.tick_params(labelbottom=False)
    if is_log and len(x) > 1:
        above.set_yscale("log")
        figures.log_ticks(above.yaxis, *above.get_ylim())


def _find_abscissa(fitted: FittedCurve) -> tuple[np.ndarray, str, bool]:
    """Return the numbers along the axis of a curve, their label, and whether the axis is logarithmic."""
    curve = fitted.curve
    if curve.quantity != "dark_counts":
        return curve.photons, "Photons on the pixel", len(curve.photons) > 1
    if np.all(np.isfinite(curve.threshold_electrons)):
        return curve.threshold_electrons, "Threshold [electrons]", False
    return np.arange(1.0, len(curve.value) + 1.0), "Measurement", False


def _tabulate_constants(camera: CameraFit) -> str:
    fit = camera.fit
    scale = [fit.photons_scale] if fit.photons_scale else []
    rows = [
        (
            f"<code>{escape(constant.name)}</code>",
            *(f"{value:.6g}" for value in (constant.start, constant.value, constant.low, constant.high)),
        )
        for constant in [*fit.constants, *scale]
    ]
    percent = f"{100.0 * fit.confidence:g} %"
    heads = [
        ("constant", False),
        ("start", True),
        ("fitted", True),
        (f"low {percent}", True),
        (f"high {percent}", True),
    ]
    return html_page.write_table(heads, rows)


def _tabulate_correlations(camera: CameraFit) -> list[str]:
    fit = camera.fit
    names = [constant.name for constant in fit.constants]
    if len(names) < 2:
        return []
    rows = [
        (f"<code>{escape(name)}</code>", *(f"{value:+.2f}" for value in line))
        for name, line in zip(names, fit.correlation, strict=True)
    ]
    hard = [
        f"<p>Hard to tell apart by these curves: <code>{escape(first)}</code> and <code>{escape(second)}</code>.</p>"
        for first, second, _ in fit.hard_to_tell
    ]
    heads = [("correlation", False), *((f"<code>{escape(name)}</code>", True) for name in names)]
    return [html_page.write_table(heads, rows), *hard]


def _tabulate_curves(camera: CameraFit) -> str:
    rows = [
        (
            escape(curve.curve.name),
            escape(table),
            f"<code>{sha256[:16]}…</code>",
            str(len(curve.residuals)),
            f"{curve.chi2:.1f}",
            f"{curve.p_value:.2g}",
        )
        for table, sha256, curve in zip(camera.tables, camera.hashes, camera.fit.curves, strict=True)
    ]
    heads = [("curve", False), ("table", False), ("SHA-256", False), ("points", True), ("chi-square", True)]
    return html_page.write_table([*heads, ("P of a worse fit", True)], rows)


def _tabulate_points(fitted: FittedCurve) -> list[str]:
    curve = fitted.curve
    _, label, _ = _find_abscissa(fitted)
    x = _find_abscissa(fitted)[0]
    rows = [
        tuple(
            f"{value:.5g}" for value in (x[k], curve.trials[k], curve.value[k], fitted.expected[k], fitted.residuals[k])
        )
        for k in range(len(x))
    ]
    heads = [
        (label, True),
        ("trials", True),
        ("measured [SI]", True),
        ("simulated [SI]", True),
        ("residual [sigma]", True),
    ]
    return [
        f"<details><summary>{escape(curve.name)}: {len(rows)} points</summary>",
        html_page.write_table(heads, rows),
        "</details>",
    ]
