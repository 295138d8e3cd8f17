"""A data sheet as one HTML page: figures with their origin, the picture, and the curve over light."""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Sequence
from html import escape
from typing import Any

from rso_lidar import units
from rso_lidar.detector import CameraFigure, LightCurve
from rso_lidar.mission_analysis.camera.figure_text import format_interval, format_photons, format_value
from rso_lidar.picture import Scheme, html_page

_FIGURES = (
    ("figure", False),
    ("value", True),
    ("95 % or error", True),
    ("obtained", False),
    ("how", False),
    ("name", False),
)
_CURVE = (
    ("photons", True),
    ("detected", True),
    ("95 %", True),
    ("closed form", True),
    ("sigma [cm]", True),
    ("closed form [cm]", True),
    ("bias [cm]", True),
    ("SNR", True),
    ("counts", True),
)


def write_data_sheet_page(
    camera: str,
    about: str,
    quantities: Sequence[CameraFigure],
    curve: LightCurve,
    notes: Sequence[str],
    picture: Any,
    scheme: Scheme,
) -> str:
    """Return the page of a data sheet.

    Parameters
    ----------
    camera, about, curve, notes : as in `CameraDataSheet`
    quantities : its figures
    picture : its figure of matplotlib
    """
    rows = [
        (
            escape(quantity.meaning),
            escape(format_value(quantity)),
            escape(format_interval(quantity)),
            escape(quantity.how),
            escape(quantity.formula),
            f"<code>{escape(quantity.name)}</code>",
        )
        for quantity in quantities
    ]
    version = importlib.metadata.version("rso-lidar")
    body = [
        f"<h1>Data sheet of {escape(camera)}</h1>",
        f'<p class="quiet">Simulated: {escape(about)}.</p>',
        html_page.write_table(_FIGURES, rows),
        *(f'<p class="quiet">{escape(note)}</p>' for note in notes),
        "<h2>Over light</h2>",
        html_page.embed_figure(picture, f"detection, range and signal over noise of {camera}", scheme=scheme),
        html_page.write_table(_CURVE, _list_levels(curve)),
        f'<p class="quiet">{curve.trials:,} trials of each level, with fixed random seeds. rso-lidar {escape(version)}.</p>',
    ]
    return html_page.write_page(f"Data sheet of {camera}", body, scheme)


def _list_levels(curve: LightCurve) -> list[tuple[str, ...]]:
    """Return the rows of the curve over light."""
    rows: list[tuple[str, ...]] = []
    for k, photons in enumerate(curve.photons.tolist()):
        sigma, error, closed, bias, off = (
            float(values[k]) / units.CM
            for values in (
                curve.range_sigma_m,
                curve.range_sigma_error_m,
                curve.closed_form_sigma_m,
                curve.range_bias_m,
                curve.range_bias_error_m,
            )
        )
        counts, spread = float(curve.intensity_counts[k]), float(curve.intensity_sigma_counts[k])
        rows.append(
            (
                format_photons(photons),
                f"{curve.detected_fraction[k]:.4f}",
                f"{curve.detected_low[k]:.4f} to {curve.detected_high[k]:.4f}",
                _format(float(curve.closed_form_probability[k]), ".4f"),
                _with_error(sigma, error),
                _format(closed, ".2f"),
                _with_error(bias, off),
                _format(float(curve.snr[k]), ".3g"),
                "" if math.isnan(counts) else f"{counts:,.4g} ± {spread:,.3g}",
            )
        )
    return rows


def _format(value: float, how: str) -> str:
    return f"{value:{how}}" if math.isfinite(value) else ""


def _with_error(value: float, error: float) -> str:
    """Return a value with its standard error; empty where it is unknown."""
    return f"{value:.2f} ± {error:.2f}" if math.isfinite(value) else ""
