"""Readers of two listings that Zemax OpticStudio saves as text: a Huygens PSF and a grid distortion.

Lens models are in `psf` and `distortion`. Both listings come in UTF-16 with a byte-order mark,
UTF-8 or Latin-1, with decimal points or commas. Their header lines differ between versions, and unknown header lines
are skipped. An error in the numbers is a `ScenarioError` of one line.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.optics.tables.number_text import (
    cache_by_file,
    convert_decimal_commas,
    parse_matrix,
    parse_numbers,
    read_text,
)

_NUMBER = r"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?"
_UNIT = r"([a-zA-Zµμ�?]+)"
_METRES = {
    **dict.fromkeys(("m", "meters"), 1.0),
    **dict.fromkeys(("cm", "centimeters"), units.CM),
    **dict.fromkeys(("mm", "millimeters"), units.MM),
    "nm": units.NM,
    "inches": 25.4 * units.MM,  # the international inch, exact
}

FileBand = tuple[str, float, float]  # a file, and the shortest and longest wavelength [m] that it was computed for


@dataclass(frozen=True)
class HuygensPsf:
    """Point spread function on a grid: `values` (row, col) sum to 1, rows from the top of the image (+y) down.

    `center` is the point (row, col), counted from 0, where the listing's reference ray lands.
    """

    values: np.ndarray
    spacing_m: float
    center: tuple[float, float]
    field_deg: float | None = None
    wavelength_m: tuple[float, float] | None = None
    strehl: float | None = None


@dataclass(frozen=True)
class GridDistortion:
    """Image of a grid of directions: tangents of the field, paraxial and real image points (point, xy)."""

    field_tangent: np.ndarray
    predicted_m: np.ndarray
    real_m: np.ndarray
    wavelength_m: float | None = None


@cache_by_file(32)
def read_huygens_psf(path: str) -> HuygensPsf:
    """Read the point spread function of a Huygens PSF listing, normalised to a sum of 1.

    Rows are taken from the top of the image down, as the text window lists them. The grid of the ZOS-API starts at the
    bottom left instead, so a listing made from it must be flipped first. Without a `Center point` line the centre is
    point n/2 + 1 of each axis, where the program puts it.

    Raises
    ------
    ScenarioError
        If the file is not such a listing, or is cut off.
    """
    lines = list(enumerate(convert_decimal_commas(read_text(path)).splitlines(), start=1))
    lines = [(number, line) for number, line in lines if line.strip()]
    first = next((k for k, (_, line) in enumerate(lines) if len(parse_numbers(line) or ()) > 1), len(lines))
    header = "\n".join(line for _, line in lines[:first])
    kind = re.search(r"Listing of ([^\r\n]*?)(?: Data)?\s*$", header, re.MULTILINE)
    if kind and ("psf" not in kind[1].lower() or "cross section" in kind[1].lower()):
        raise ScenarioError(f"{path}: is a listing of {kind[1]}, not of a Huygens PSF; save that analysis as text")
    pair = re.search(r"Image grid size\s*:?\s*(\d+)\s*(?:by|x)\s*(\d+)", header, re.IGNORECASE)
    if first == len(lines) and not pair and not re.search(r"spacing|psf", header, re.IGNORECASE):
        raise ScenarioError(f"{path}: is not a Huygens PSF listing; save that analysis as text")
    values = parse_matrix(path, lines[first:])
    n_rows, n_cols = values.shape
    stated = sorted(map(int, pair.groups())) if pair else [n_cols, n_cols]
    if sorted(values.shape) != stated:
        reason = f"its header states {pair[1]} by {pair[2]}" if pair else "a Huygens PSF is square"
        raise ScenarioError(f"{path}: has {n_rows} rows of {n_cols}, but {reason}; the file is cut off, save it again")
    center = re.search(r"Center point is\s*:?\D*(\d+)\D+(\d+)", header, re.IGNORECASE)
    at = (float(center[1]) - 1.0, float(center[2]) - 1.0) if center else (float(n_rows // 2), float(n_cols // 2))
    if not (0 <= at[0] < n_rows and 0 <= at[1] < n_cols):
        raise ScenarioError(f"{path}: its center point is outside its {n_rows} by {n_cols} grid; save it again")
    strehl = re.search(rf"Strehl ratio\s*:?\s*({_NUMBER})", header, re.IGNORECASE)
    values = values / values.sum()
    values.flags.writeable = False
    return HuygensPsf(
        values=values,
        spacing_m=_spacing_m(path, header, n_cols),
        center=at,
        field_deg=_field_deg(header),
        wavelength_m=_wavelength_m(header),
        strehl=_float(strehl[1]) if strehl else None,
    )


def _spacing_m(path: str, header: str, n_cols: int) -> float:
    """Return the distance between points [m], from its own line or from the area and the number of points.

    Raises
    ------
    ScenarioError
        If the header does not state it, or states zero.
    """
    spacing = re.search(rf"Data spacing(?:\s+is)?\s*:?\s*({_NUMBER})\s*{_UNIT}", header, re.IGNORECASE)
    area = re.search(
        rf"Data area(?:\s+is)?\s*:?\s*({_NUMBER})(?:\s*(?:by|x)\s*{_NUMBER})?\s*{_UNIT}", header, re.IGNORECASE
    )
    if spacing:
        metres = _float(spacing[1]) * _metres(spacing[2])
    elif area:
        metres = _float(area[1]) * _metres(area[2]) / n_cols
    else:
        raise ScenarioError(
            f"{path}: has no line 'Data spacing is ... um'; save the Huygens PSF as text with its header"
        )
    if not 1e-12 < metres < 1.0:
        raise ScenarioError(f"{path}: its data spacing is {metres:g} m; check the header's number and unit")
    return metres


def _field_deg(header: str) -> float | None:
    """Return the radial field angle [deg] of ``... at 0.0000, 10.0000 (deg).``; None for other fields than angles."""
    at = re.search(rf"\bat\s+({_NUMBER})(?:\s*[,;]\s+|\s+)?({_NUMBER})?\s*\(?(?:deg|°)", header, re.IGNORECASE)
    return math.hypot(_float(at[1]), _float(at[2] or "0")) if at else None


def _wavelength_m(header: str) -> tuple[float, float] | None:
    """Return the shortest and longest wavelength [m] of ``0.4861 to 0.6563 um at`` or ``1.0640 um at``."""
    waves = re.search(rf"({_NUMBER})(?:\s*to\s*({_NUMBER}))?\s*{_UNIT}\s+at\b", header)
    if not waves:
        return None
    scale = _metres(waves[3])
    return _float(waves[1]) * scale, _float(waves[2] or waves[1]) * scale


@cache_by_file(16)
def read_grid_distortion(path: str) -> GridDistortion:
    """Read the points of a Grid Distortion listing; those whose chief ray failed are left out.

    Raises
    ------
    ScenarioError
        If the file is not such a listing, or is cut off.
    """
    text = convert_decimal_commas(read_text(path))
    if not re.search(r"Grid Distortion|Predicted\s*X", text, re.IGNORECASE):
        raise ScenarioError(f"{path}: is not a Grid Distortion listing; save that analysis as text")
    if re.search(r"Field units are (?!deg)", text, re.IGNORECASE):
        raise ScenarioError(f"{path}: its fields are not angles in degrees; list it with fields of type Angle")
    length = re.search(r"^\s*Units are\s+(\w+)", text, re.IGNORECASE | re.MULTILINE)
    scale = _metres(length[1] if length else "mm")
    indices, rows = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        tokens = line.replace("%", " ").split()
        if len(tokens) < 3 or not all(re.fullmatch(r"[-+]?\d+", token) for token in tokens[:2]):
            continue  # a line of header or footer
        indices.append((int(tokens[0]), int(tokens[1])))
        values = parse_numbers(" ".join(tokens[2:]))
        if values is None:
            continue  # words in place of numbers: this chief ray failed
        if len(values) not in (7, 8):
            raise ScenarioError(
                f"{path}: line {number}: has {len(values) + 2} columns, not i j X-Field Y-Field R-Field, predicted "
                "and real X and Y and distortion; the file is cut off or damaged, save it again"
            )
        if not np.all(np.isfinite(values)):
            raise ScenarioError(f"{path}: line {number}: contains a value that is not finite; save the listing again")
        rows.append(values[:7])
    _check_grid(path, indices)
    if len(rows) < 9:
        raise ScenarioError(f"{path}: has {len(rows)} points that the lens images; list a grid of 3 by 3 or more")
    table = np.array(rows)
    if np.any(np.abs(table[:, :2]) >= 89.0):
        raise ScenarioError(f"{path}: has fields of 89 degrees and more; list those within the camera's field")
    wave = re.search(rf"Wavelength\s*:?\s*({_NUMBER})\s*{_UNIT}", text, re.IGNORECASE)
    return GridDistortion(
        field_tangent=np.tan(table[:, :2] * units.DEG),
        predicted_m=table[:, 3:5] * scale,
        real_m=table[:, 5:7] * scale,
        wavelength_m=_float(wave[1]) * _metres(wave[2]) if wave else None,
    )


def _check_grid(path: str, indices: list[tuple[int, int]]) -> None:
    """Raise `ScenarioError` unless the listing has all points of its grid, whose indices run from -n to n."""
    if not indices:
        raise ScenarioError(f"{path}: contains no points; give a listing with its data, not the header alone")
    side = {i for pair in indices for i in pair}
    expected = (max(side) - min(side) + 1) ** 2
    if min(side) < 0:
        expected = (2 * -min(side) + 1) ** 2
    if len(indices) != expected or len(set(indices)) != expected:
        raise ScenarioError(
            f"{path}: has {len(indices)} points where its grid has {expected}; the file is cut off, save it again"
        )


def _float(number: str) -> float:
    return float(number.replace(",", "."))


def _metres(unit: str) -> float:
    """Return the length of a unit [m]. A unit that no encoding preserved is a micrometre."""
    if unit.lower() in _METRES:
        return _METRES[unit.lower()]
    if re.fullmatch(r"[uµμ�?]+m?|micro\w*|micron\w*", unit.lower()):
        return units.UM
    raise ScenarioError(f"a listing in '{unit}', an unknown unit; export it in micrometres")
