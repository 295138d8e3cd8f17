"""The report of a calibration: measured curves over simulated ones, with residuals, and what is not reproduced."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.detector import FittedCurve
from rso_lidar.evaluation.camera_calibration.camera_fit import CameraFit
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
}  # heading, factor from SI, and whether the axis is logarithmic


def draw_camera_fit(camera: CameraFit) -> Figure:
    """Draw each measured curve over the simulated ones, and its residuals below."""
    curves = camera.fit.curves
    columns = 2 if len(curves) == 4 else min(_COLUMNS, len(curves))
    rows = math.ceil(len(curves) / columns)
    verdict = "rejected" if camera.fit.is_rejected else "accepted"
    note = (
        f"{verdict}: chi-square {camera.fit.chi2:.1f} with {camera.fit.freedom:.0f} degrees of freedom, "
        f"P {camera.fit.p_value:.2g}"
    )
    small = ("Dots: measured, with 1 sigma. Line: fitted. Dashes: before the fit. Below: residuals [sigma].",)
    width = figures.PAGE_IN if columns > 1 else 0.6 * figures.PAGE_IN
    figure = figures.new_figure(width, 1.0 + 3.7 * rows, f"Calibration of {camera.file.name}", note, small)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2.6, 1.0] * rows})
    for place in range(rows * columns):
        row, column = divmod(place, columns)
        above, below = grid[2 * row, column], grid[2 * row + 1, column]
        if place < len(curves):
            _draw_curve(above, below, curves[place])
        else:
            above.set_visible(False)
            below.set_visible(False)
    return figure


def write_fit_report(camera: CameraFit, scheme: Scheme = LIGHT) -> str:
    """Return the report as an HTML page with the picture, tables of constants, curves and points."""
    fit = camera.fit
    misfits = camera.list_misfits()
    body = [
        f"<h1>Calibration of {escape(camera.file.name)}</h1>",
        f'<p class="quiet">{escape(camera.file.what or "")} Fitted {camera.date_utc:%Y-%m-%d %H:%M} UTC, '
        f"{escape(camera.calibration.versions)}.</p>",
        f"<p><b>{'Rejected' if fit.is_rejected else 'Accepted'}.</b> Chi-square is {fit.chi2:.1f} with {fit.freedom:.1f} "
        f"degrees of freedom: a camera like the fitted one gives a worse fit with probability {fit.p_value:.2g}.</p>",
        html_page.embed_figure(draw_camera_fit(camera), "measured and simulated curves", scheme=scheme),
        "<h2>Constants</h2>",
        _tabulate_constants(camera),
        *_tabulate_correlations(camera),
        "<h2>What the model cannot reproduce</h2>",
        *([f"<p>{escape(line)}.</p>" for line in misfits] or ["<p>Nothing that these curves show.</p>"]),
        "<h2>Curves</h2>",
        _tabulate_curves(camera),
        "<h2>Points</h2>",
        *(part for curve in fit.curves for part in _tabulate_points(curve)),
    ]
    return html_page.write_page(f"Calibration of {camera.file.name}", body, scheme)


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
    figures.style_axes(above, title if curve.name == curve.quantity else curve.name)
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
            escape(table.file),
            f"<code>{sha256[:16]}…</code>",
            str(len(curve.residuals)),
            f"{curve.chi2:.1f}",
            f"{curve.p_value:.2g}",
        )
        for table, sha256, curve in zip(camera.file.curve, camera.hashes, camera.fit.curves, strict=True)
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
