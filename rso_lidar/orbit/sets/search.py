"""Two-line element sets as text: pasted lines checked by the reader, and a search in a catalogue."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.errors import CatalogError
from rso_lidar.orbit.sets.formats import parse_lines, read_element_sets
from rso_lidar.orbit.sets.sgp4_motion import Tle


def check_lines(text: str) -> tuple[str, ...]:
    """Return the lines of one element set that a user pasted, without empty ones.

    Raises
    ------
    CatalogError
        If they are not one element set, or its numbers are not possible.
    """
    lines = tuple(line.rstrip() for line in text.splitlines() if line.strip())
    found = parse_lines(lines, "the pasted text")
    if len(found) != 1 or len(lines) not in (2, 3):
        raise CatalogError(f"the pasted text: holds {len(found)} element sets; paste one")
    Tle(lines=lines)
    return lines


def search_sets(file: Path, words: str, most: int) -> dict[str, tuple[str, ...]]:
    """Search a catalogue by name or number, and return the lines of the sets by a label.

    Parameters
    ----------
    file : catalogue in any format that the package reads.
    words : part of the name or of the number; empty for all.
    most : greatest number of sets.

    Raises
    ------
    CatalogError
        If the file cannot be read, or nothing in it has these words and two lines.
    """
    found: dict[str, tuple[str, ...]] = {}
    for one in read_element_sets(file):
        if one.line1 and words.casefold() in f"{one.name} {one.norad_id}".casefold():
            label = f"{one.name or 'without a name'} ({one.norad_id}), {one.epoch_utc:%Y-%m-%d %H:%M}"
            found[label] = tuple(line for line in (one.name, one.line1, one.line2) if line)
            if len(found) == most:
                break
    if not found:
        raise CatalogError(f"{file.name}: no two-line set has '{words:.40}' in its name or number; search for less")
    return found
