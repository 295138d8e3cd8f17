"""Selection of one object, or of one of its element sets, by name, catalogue number or instant."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from rso_lidar.errors import CatalogError, did_you_mean
from rso_lidar.orbit.sets.element_set import NO_EPOCH, ElementSet


def select_object(
    sets: Sequence[ElementSet], where: str, name: str | None = None, norad_id: int | None = None
) -> list[ElementSet]:
    """Select the sets of one object.

    Parameters
    ----------
    sets : element sets to choose from
    where : name of their source, for messages
    name : name of the object, in any case; None for any
    norad_id : catalogue number of the object; None for any

    Returns
    -------
    its element sets, in their order

    Raises
    ------
    CatalogError
        if there is no such object, or more than one
    """
    meant = list(sets)
    if not meant:
        raise CatalogError(f"{where}: does not contain a good element set; see its problems")
    if norad_id is not None:
        meant = [entry for entry in meant if entry.norad_id == norad_id]
        if not meant:
            raise CatalogError(f"{where}: no object with norad_id {norad_id}; it holds {_list_labels(sets)}")
    if name is not None:
        named = [entry for entry in meant if entry.name.casefold() == name.strip().casefold()]
        if not named:
            names = {entry.name.casefold(): entry.name for entry in meant if entry.name}
            guess = did_you_mean(name.casefold(), names)
            for folded, written_so in names.items():
                guess = guess.replace(f"'{folded}'", f"'{written_so}'")
            raise CatalogError(f"{where}: no object named '{name}'{guess or '; it holds ' + _list_labels(meant)}")
        meant = named
    if any(entry.norad_id for entry in meant):  # ignore lines too damaged to name their object
        meant = [entry for entry in meant if entry.norad_id]
    if len({entry.norad_id for entry in meant}) > 1:
        key = "norad_id" if name is not None else "name or norad_id"
        raise CatalogError(f"{where}: holds several objects, {_list_labels(meant)}; choose one with {key}")
    return meant


def select_set(
    sets: Sequence[ElementSet],
    where: str,
    name: str | None = None,
    norad_id: int | None = None,
    near_utc: datetime.datetime | None = None,
) -> ElementSet:
    """Select one element set, and check it.

    Parameters
    ----------
    name : name of the object, in any case; None for any
    norad_id : catalogue number of the object; None for any
    near_utc : instant; the set with the nearest epoch is selected. None for the newest set

    Raises
    ------
    CatalogError
        if there is no such object, more than one, or the set is bad
    """

    def rank(entry: ElementSet) -> tuple[bool, float]:
        epoch = entry.epoch_utc
        if epoch == NO_EPOCH:
            return (True, 0.0)
        return (False, abs((epoch - near_utc).total_seconds()) if near_utc else -epoch.timestamp())

    chosen = min(select_object(sets, where, name, norad_id), key=rank)
    if chosen.problem is not None:
        raise CatalogError(chosen.problem)
    return chosen


def _list_labels(sets: Sequence[ElementSet], most: int = 6) -> str:
    labels = list(dict.fromkeys(entry.label for entry in sets))
    more = f" and {len(labels) - most} more" if len(labels) > most else ""
    return ", ".join(labels[:most]) + more
