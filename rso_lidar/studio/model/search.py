"""Element sets as motions: one that a user pasted, and those that a search in a catalogue finds."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.errors import CatalogError
from rso_lidar.orbit import ElementSet, Omm, Tle, parse_element_sets, read_element_sets

_PASTED = "the pasted text"


def read_pasted_set(text: str) -> Tle | Omm:
    """Read the one element set that a user pasted, in any format that the package reads, as a motion.

    Raises
    ------
    CatalogError
        If the text is not one element set, or its numbers are not possible.
    """
    found, junk = parse_element_sets(text, _PASTED)
    if len(found) != 1:
        raise CatalogError(f"{_PASTED}: holds {len(found)} element sets; paste one")
    if problem := found[0].problem or next(iter(junk), None):
        raise CatalogError(problem)
    return _make_motion(found[0])


def search_sets(file: Path, words: str, most: int) -> dict[str, Tle | Omm]:
    """Search a catalogue by name or number, and return the motions of the sets by a label; bad sets are left out.

    Parameters
    ----------
    file : catalogue in any format that the package reads
    words : part of the name or of the number; empty for all
    most : greatest number of sets

    Raises
    ------
    CatalogError
        If the file cannot be read, or no good set in it has these words.
    """
    found: dict[str, Tle | Omm] = {}
    for one in read_element_sets(file):
        if one.problem is None and words.casefold() in f"{one.name} {one.norad_id}".casefold():
            label = f"{one.name or 'without a name'} ({one.norad_id}), {one.epoch_utc:%Y-%m-%d %H:%M}"
            found[label] = _make_motion(one)
            if len(found) == most:
                break
    if not found:
        raise CatalogError(f"{file.name}: no set has '{words:.40}' in its name or number; search for less")
    return found


def _make_motion(one: ElementSet) -> Tle | Omm:
    if one.line1:
        return Tle(lines=tuple(line for line in (one.name, one.line1, one.line2) if line))
    return Omm.of(one)
