"""Words of a plan's description: columns and lengths."""

from __future__ import annotations

from rso_lidar import units


def format_rows(rows: tuple[tuple[str, ...], ...]) -> list[str]:
    """Return rows of words as indented lines of columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  " + "  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]


def format_length(length_m: float) -> str:
    """Format a length, in metres or from 10 km on in kilometres."""
    return f"{length_m:.2f} m" if length_m < 10.0 * units.KM else f"{length_m / units.KM:.3f} km"
