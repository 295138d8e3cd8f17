"""Tables of numbers saved as text: in any usual encoding, with decimal points or decimal commas."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import TypeVar

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.files import MOST_BYTES, check_regular, read_bytes

Content = TypeVar("Content")

_NOT_A_NUMBER = re.compile(r"[-+]?\d*[.,]?\d*#(?:IND|INF|QNAN|SNAN)\w*", re.IGNORECASE)  # as Windows prints them


def file_stamp(path: str | Path) -> tuple[str, int, int]:
    """Return path, modification time [ns] and size [bytes] of a file: the key of a cache of its content."""
    status = check_regular(Path(path), MOST_BYTES, ScenarioError, "text file")
    return str(path), status.st_mtime_ns, status.st_size


def cache_by_file(most: int) -> Callable[[Callable[[str], Content]], Callable[[str | Path], Content]]:
    """Keep what a function makes of each of the latest files, at most so many, until the file changes."""

    def decorate(read: Callable[[str], Content]) -> Callable[[str | Path], Content]:
        @lru_cache(maxsize=most)
        def keep(file: str, _modified_ns: int, _size: int) -> Content:
            return read(file)

        @wraps(read)
        def read_once(file: str | Path) -> Content:
            return keep(*file_stamp(file))

        return read_once

    return decorate


def read_text(path: str) -> str:
    """Return the text of a file in UTF-16 (with a mark or without), UTF-8 or Latin-1."""
    content = read_bytes(Path(path), MOST_BYTES, ScenarioError, "text file")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif content[:64].count(b"\0") > len(content[:64]) // 4:  # Latin letters in UTF-16: every other byte is zero
        encoding = "utf-16-le" if content[1:2] == b"\0" else "utf-16-be"
    else:
        encoding = "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        if encoding != "utf-8-sig":
            raise ScenarioError(f"{path}: is UTF-16 text that is cut off or damaged; save it again") from None
        text = content.decode("latin-1")
    if not text.strip():
        raise ScenarioError(f"{path}: is empty; give a file of numbers")
    if re.search(r"[\0-\x08\x0e-\x19\x1b-\x1f]", text):
        raise ScenarioError(f"{path}: is not text; give a listing saved as text")
    return text


def convert_decimal_commas(text: str) -> str:
    """Replace decimal commas of a text by points, if its commas are decimal commas.

    They are if each is between digits, another character separates the numbers, and no number has a point.
    """
    rows = "\n".join(line for line in text.splitlines() if not re.search(r"[A-DF-Za-df-z]{2}", line))
    apart = re.search(r"\d[ \t;]+[-+]?\d", rows)
    if apart and re.search(r"\d,\d", rows) and not re.search(r",(?!\d)", rows) and not re.search(r"\d\.\d", rows):
        return re.sub(r"(?<=\d),(?=\d)", ".", text)
    return text


def parse_matrix(path: str, lines: list[tuple[int, str]]) -> np.ndarray:
    """Parse (line number, text) pairs into an array (row, col): all finite, none negative, not all zero."""
    if not lines:
        raise ScenarioError(f"{path}: contains no rows of numbers; give a listing with its data, not the header alone")
    rows: list[list[float]] = []
    for number, line in lines:
        row = parse_numbers(line)
        if row is None:
            raise ScenarioError(f"{path}: line {number}: is not a row of numbers ({line.strip()[:30]!r}); correct it")
        if rows and len(row) != len(rows[0]):
            raise ScenarioError(
                f"{path}: line {number}: has {len(row)} numbers where the first row has {len(rows[0])}: "
                "the file is cut off or damaged, save it again"
            )
        rows.append(row)
    values = np.array(rows)
    if not np.all(np.isfinite(values)):
        number = lines[int(np.argwhere(~np.isfinite(values))[0, 0])][0]
        raise ScenarioError(f"{path}: line {number}: contains a value that is not finite; save the listing again")
    below = -1e-9 * values.max()  # less is the rounding of a transform
    if values.min() < below:
        number = lines[int(np.argwhere(values < below)[0, 0])][0]
        raise ScenarioError(
            f"{path}: line {number}: contains a negative intensity; save the linear intensity, not a field, phase or log"
        )
    if values.max() == 0.0:
        raise ScenarioError(f"{path}: all its values are zero; save a listing with light in it")
    intensity: np.ndarray = values.clip(0.0)
    return intensity


def parse_numbers(line: str) -> list[float] | None:
    """Parse the numbers of a line; None if the line holds anything else."""
    if "#" in line:
        line = _NOT_A_NUMBER.sub("nan", line)
    try:
        return [float(token) for token in line.split()]
    except ValueError:
        return None
