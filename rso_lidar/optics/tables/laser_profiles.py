"""Measured beam patterns and pulses of lasers, read from files and checked."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.files import MOST_BYTES, check_regular, explain_unreadable, read_bytes
from rso_lidar.optics.tables.number_text import cache_by_file, convert_decimal_commas

_IMAGES = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg")


@cache_by_file(8)
def read_pattern(file: str) -> np.ndarray:
    """Read a laser's pattern from a grey image or a table of numbers (.csv, .txt).

    Parameters
    ----------
    file : path. The pattern is cached until the file changes

    Returns
    -------
    ndarray
        (row, col) share of the energy in each cell of the square of the beam's full angle, row 0 at the top, as the lidar
        sees it.

    Raises
    ------
    ScenarioError
        If the file is not an image or a table of finite values from 0 up.
    """
    path = Path(file)
    values = _image(path) if path.suffix.lower() in _IMAGES else _table(path)
    if values.ndim != 2 or min(values.shape) < 2:
        raise ScenarioError(
            f"{path.name}: a pattern needs rows and columns, this is {values.shape}; give a larger image"
        )
    if not np.all(np.isfinite(values)) or np.any(values < 0.0) or not np.any(values > 0.0):
        raise ScenarioError(
            f"{path.name}: a pattern needs finite values, none negative and some positive; correct the file"
        )
    pattern: np.ndarray = values / values.max()
    pattern /= pattern.sum()
    pattern.flags.writeable = False
    return pattern


def _image(path: Path) -> np.ndarray:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what Pillow could repair
            check_regular(path, MOST_BYTES, ScenarioError, "picture")
            with Image.open(path) as image:
                grey = image if image.mode in ("L", "F") or image.mode.startswith("I") else image.convert("L")
                return np.asarray(grey, dtype=float)
    # Pillow raises the errors of its decoders as well as its own.
    except (
        OSError,
        ValueError,
        SyntaxError,
        EOFError,
        struct.error,
        zlib.error,
        Image.DecompressionBombError,
    ) as error:
        if isinstance(error, OSError) and error.errno:
            raise ScenarioError(explain_unreadable(path, error)) from None
        reason = " ".join(str(error).split())[:100]
        raise ScenarioError(f"{path.name}: cannot be read as an image ({reason}); give PNG or TIFF") from None


def _table(path: Path) -> np.ndarray:
    """Return the numbers of a text file, separated by commas, semicolons or blanks; lines that begin with # are comments."""
    content = read_bytes(path, MOST_BYTES, ScenarioError, "table")
    try:
        text = content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path.name}: is not text; give numbers in UTF-8, or an image") from None
    rows = [line.replace(",", " ").replace(";", " ").split() for line in convert_decimal_commas(text).splitlines()]
    rows = [row for row in rows if row and not row[0].startswith("#")]
    if rows and any(not _is_number(word) for word in rows[0]):
        rows = rows[1:]  # a heading
    if not rows:
        raise ScenarioError(f"{path.name}: contains no numbers; give a table")
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise ScenarioError(
                f"{path.name}: row {number} has {len(row)} values, the first {len(rows[0])}; correct it"
            )
        bad = next((word for word in row if not _is_number(word)), None)
        if bad is not None:
            raise ScenarioError(f"{path.name}: row {number}: '{bad:.20}' is not a number; correct it")
    return np.array(rows, dtype=float)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


@cache_by_file(8)
def read_pulse(file: str) -> tuple[np.ndarray, np.ndarray]:
    """Read a measured pulse: times [s], zero at its centroid, and powers [1/s], of area 1.

    The file has two columns, time in ns and power in any unit. The power is linear between rows and 0 outside.

    Raises
    ------
    ScenarioError
        If the file is not a table of ascending times and of powers from 0 up.
    """
    path = Path(file)
    values = _table(path)
    if values.shape[1] != 2 or len(values) < 3:
        raise ScenarioError(
            f"{path.name}: a pulse needs two columns, time_ns and power, and three rows; correct the file"
        )
    time_s, power = values[:, 0] * units.NS, values[:, 1]
    if not np.all(np.isfinite(values)) or np.any(np.diff(time_s) <= 0.0):
        raise ScenarioError(f"{path.name}: times must be finite and ascend; sort the file")
    if np.any(power < 0.0) or not np.any(power > 0.0):
        raise ScenarioError(
            f"{path.name}: powers must not be negative, and some must be positive; subtract the baseline"
        )
    power = power / power.max()
    lit = np.flatnonzero(power > 1e-9)
    within = slice(max(int(lit[0]) - 1, 0), int(lit[-1]) + 2)
    time_s, power = time_s[within], power[within]
    if len(time_s) < 2:
        raise ScenarioError(f"{path.name}: the pulse has no energy; give more rows")
    area, moment = (float(np.sum(part)) for part in _straight(time_s, power))
    return time_s - moment / area, power / area


def _straight(time_s: np.ndarray, power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return integral and first moment of each piece of a piecewise linear curve; exact."""
    width, (a, b) = np.diff(time_s), (power[:-1], power[1:])
    area = 0.5 * width * (a + b)
    return area, area * time_s[:-1] + width**2 * (a + 2.0 * b) / 6.0


def find_full_width_s(time_s: np.ndarray, power: np.ndarray) -> float:
    """Find the full width at half maximum [s] of a curve: from its first to its last crossing of half the maximum."""
    above = np.flatnonzero(power >= 0.5 * power.max())
    ends = []
    for inner, outer in ((int(above[0]), int(above[0]) - 1), (int(above[-1]), int(above[-1]) + 1)):
        if 0 <= outer < len(power):
            share = (power[inner] - 0.5 * power.max()) / (power[inner] - power[outer])
            ends.append(time_s[inner] + share * (time_s[outer] - time_s[inner]))
        else:  # the curve begins or ends there with a step
            ends.append(time_s[inner])
    return float(ends[1] - ends[0])
