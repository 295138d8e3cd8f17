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
    sets, junk = parse_element_sets(text, _PASTED)
    if len(sets) != 1:
        raise CatalogError(f"{_PASTED}: holds {len(sets)} element sets; paste one")
    if problem := sets[0].problem or next(iter(junk), None):
        raise CatalogError(problem)
    return _make_motion(sets[0])


def search_sets(file: Path, words: str, most: int) -> dict[str, Tle | Omm]:
    """Search a catalogue by name or number, and return the motions of the sets by a label; bad sets are left out.

    Parameters
    ----------
    words : part of the name or of the number; empty for all

    Raises
    ------
    CatalogError
        If the file cannot be read, or no good set in it has these words.
    """
    motions: dict[str, Tle | Omm] = {}
    for element_set in read_element_sets(file):
        if element_set.problem is None and words.casefold() in f"{element_set.name} {element_set.norad_id}".casefold():
            label = f"{element_set.name or 'without a name'} ({element_set.norad_id}), "
            label += f"{element_set.epoch_utc:%Y-%m-%d %H:%M}"
            motions[label] = _make_motion(element_set)
            if len(motions) == most:
                break
    if not motions:
        raise CatalogError(f"{file.name}: no set has '{words:.40}' in its name or number; search for less")
    return motions


def _make_motion(element_set: ElementSet) -> Tle | Omm:
    if element_set.line1:
        return Tle(lines=tuple(line for line in (element_set.name, element_set.line1, element_set.line2) if line))
    return Omm.of(element_set)
