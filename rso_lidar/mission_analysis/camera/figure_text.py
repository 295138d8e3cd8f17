"""Figures of a data sheet as text, with SI prefixes and as many digits as their uncertainty allows."""

from __future__ import annotations

import math

from rso_lidar import units
from rso_lidar.detector import CameraFigure

_PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = ("A/√Hz", "W/√Hz", "Hz")
_MOST_DECIMALS = 4
_WORDS = ("photons", "electrons", "counts")  # units that the meaning of a figure names


def format_value(figure: CameraFigure) -> str:
    """Return the value with its unit, such as ``258 fW/√Hz``; words such as photons stand in the meaning of the figure.

    >>> format_value(CameraFigure("nep_w_per_sqrt_hz", "NEP", 2.581e-13, "W/√Hz", "closed form"))
    '258 fW/√Hz'
    >>> format_value(CameraFigure("range_bias_strong_m", "range bias", -0.00239, "m", "trials", -0.00567, 0.00089))
    '-0.24 cm'
    """
    if math.isnan(figure.value):
        return "unknown"
    if math.isinf(figure.value):
        return "never" if "_at_" in figure.name else "no limit"
    scale, unit = _choose_unit(figure)
    return f"{_format_number(figure.value / scale, _count_decimals(figure, scale))} {unit}".rstrip()


def format_interval(figure: CameraFigure) -> str:
    """Return the interval of a value in its unit, such as ``994 to 1,017``; empty without one.

    >>> format_interval(CameraFigure("photons_at_95_percent", "photons", 999.1, "photons", "trials", 993.8, 1016.6))
    '994 to 1,017'
    """
    if figure.low is None or figure.high is None or not math.isfinite(figure.value):
        return ""
    scale, _ = _choose_unit(figure)
    decimals = _count_decimals(figure, scale)
    low, high = (_format_number(end / scale, decimals) for end in (figure.low, figure.high))
    return low if low == high else f"{low} to {high}"


def format_photons(photons: float) -> str:
    """Return a number of photons as text: whole ones from 100 on, else three digits."""
    return f"{photons:,.0f}" if photons >= 100.0 else f"{photons:.3g}"


def _choose_unit(figure: CameraFigure) -> tuple[float, str]:
    """Return a readable unit of a figure, and its size in SI."""
    if figure.unit == "m":
        return units.CM, "cm"
    if figure.unit in _WORDS:
        return 1.0, ""
    if figure.unit not in _PREFIXED or figure.value == 0.0:
        return 1.0, "/s" if figure.unit == "1/s" else figure.unit
    power = min(max(3 * math.floor(math.log10(abs(figure.value)) / 3.0), min(_PREFIXES)), max(_PREFIXES))
    return 10.0**power, f"{_PREFIXES[power]}{figure.unit}"


def _count_decimals(figure: CameraFigure, scale: float) -> int | None:
    """Return the decimals for two digits of the uncertainty; None for a figure without one."""
    if figure.low is None or figure.high is None:
        return None
    half = 0.5 * (figure.high - figure.low) / scale
    return max(0, 1 - math.floor(math.log10(half))) if 0.0 < half < math.inf else None


def _format_number(value: float, decimals: int | None) -> str:
    """Return a number with so many decimals, or with three digits; with none from 1000 on."""
    if math.isinf(value):
        return "∞"
    if abs(value) >= 999.5:
        return f"{value:,.0f}"
    if decimals is not None and decimals <= _MOST_DECIMALS:
        return f"{value:.{decimals}f}"
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0.0 else f"{value:.1e}"
