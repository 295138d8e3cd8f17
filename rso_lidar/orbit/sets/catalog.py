"""Catalogues of element sets: read, filtered, divided by object, and written."""

from __future__ import annotations

import datetime
import numbers
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

from rso_lidar.errors import CatalogError, quote_value
from rso_lidar.files import write_atomically
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.formats import check_path, parse_element_sets, read_file
from rso_lidar.orbit.sets.omm_text import format_csv, format_json, format_kvn, format_xml
from rso_lidar.orbit.sets.selection import select_object
from rso_lidar.orbit.sets.set_sequence import SetSequence
from rso_lidar.orbit.sets.tle_text import format_tles
from rso_lidar.shipped import find

Regime = Literal["leo", "meo", "geo", "heo", "other"]
_OMM_FORMATS = {".json": format_json, ".csv": format_csv, ".xml": format_xml, ".kvn": format_kvn}
TLE_SUFFIXES = (".tle", ".3le", ".txt")


@dataclass(frozen=True, eq=False)
class Catalog:
    """The good element sets of a catalogue in its order, and the problems of the others.

    Parameters
    ----------
    sets : the good element sets
    problems : one message for each record that is not used
    duplicates : number of records left out because they repeat another of the same object and epoch
    where : name of the source, for messages
    """

    REGIMES: ClassVar[tuple[str, ...]] = get_args(Regime)
    SUFFIXES: ClassVar[tuple[str, ...]] = (*_OMM_FORMATS, *TLE_SUFFIXES)

    sets: tuple[ElementSet, ...]
    problems: tuple[str, ...] = ()
    duplicates: int = 0
    where: str = "catalogue"

    @classmethod
    def from_file(cls, path: str | Path) -> Catalog:
        """Read the catalogue of a file: TLE, 3LE, or OMM in JSON, CSV, XML or KVN.

        Parameters
        ----------
        path : path of the file; a relative one is looked up in the working folder, then among the shipped data

        Returns
        -------
        the catalogue, with the records that it could not use under `problems`

        Raises
        ------
        CatalogError
            if the file cannot be read, or contains no record
        """
        return cls._of(*read_file(find(check_path(path)) or Path(path)), str(path))

    @classmethod
    def from_text(cls, text: str, where: str = "catalogue") -> Catalog:
        """Read the catalogue of a text.

        Parameters
        ----------
        text : element sets in any of the formats of `from_file`
        where : name of the text in messages

        Returns
        -------
        the catalogue, with the records that it could not use under `problems`

        Raises
        ------
        CatalogError
            if the text contains no record
        """
        if not isinstance(text, str):
            raise CatalogError(
                f"{where}: is {quote_value(text)}, not text; give a str, or from_file the path of a file"
            )
        return cls._of(*parse_element_sets(text, where), where)

    @classmethod
    def _of(cls, entries: Sequence[ElementSet], junk: Sequence[str], where: str) -> Catalog:
        """Make a catalogue of the records of a file: good sets without duplicates, and problems.

        Parameters
        ----------
        junk : one line for each part of the text that is not a record
        """
        kept: dict[tuple[object, ...], ElementSet] = {}
        problems: list[str] = []
        duplicates = 0
        for entry in entries:
            if entry.problem is not None:
                problems.append(entry.problem)
                continue
            first = kept.setdefault((entry.identity, entry.epoch_utc, entry.epoch_rest_ns), entry)
            if first is entry:
                continue
            if _elements(first) == _elements(entry):
                duplicates += 1
            else:
                problems.append(
                    f"{entry.where}: {entry.label} has other elements than at {first.where.rpartition(': ')[2]} for "
                    "the same epoch, which are kept; remove one"
                )
        return cls(tuple(kept.values()), (*problems, *junk), duplicates, where)

    def __iter__(self) -> Iterator[ElementSet]:
        return iter(self.sets)

    def __len__(self) -> int:
        return len(self.sets)

    def filter(
        self,
        *,
        name: str | None = None,
        norad_id: int | Iterable[int] | None = None,
        regime: Regime | None = None,
        epoch_within: tuple[datetime.datetime, datetime.datetime] | None = None,
        max_age_days: float | None = None,
        at: datetime.datetime | None = None,
    ) -> Catalog:
        """Select the element sets that meet all conditions given.

        Parameters
        ----------
        name : part of the name in any case or, with * and ?, a pattern of the whole name
        norad_id : catalogue number, or several
        regime : "leo", "meo", "geo", "heo" or "other", see `ElementSet.regime`
        epoch_within : first and last epoch, as aware datetimes
        max_age_days : greatest time between the epoch and `at`, before or after [day]
        at : instant for `max_age_days`

        Returns
        -------
        Catalog

        Raises
        ------
        CatalogError
            if a condition makes no sense
        """
        if name is not None and not isinstance(name, str):
            raise CatalogError(f"name: {quote_value(name)} is not text; give a part of a name")
        if regime is not None and regime not in self.REGIMES:
            raise CatalogError(f"regime: '{regime}' is unknown; use one of {', '.join(self.REGIMES)}")
        if (max_age_days is None) != (at is None):
            raise CatalogError(
                "max_age_days: needs the instant from which it counts; give max_age_days and at together"
            )
        if max_age_days is not None and not (isinstance(max_age_days, numbers.Real) and max_age_days >= 0.0):
            raise CatalogError(f"max_age_days: {quote_value(max_age_days)} is not an age; give 0 or more days")
        if epoch_within is not None:
            if not isinstance(epoch_within, Sequence) or isinstance(epoch_within, str) or len(epoch_within) != 2:
                raise CatalogError(
                    f"epoch_within: {quote_value(epoch_within)} is not a span; give two times, first and last"
                )
            if _check_datetime("epoch_within", epoch_within[0]) > _check_datetime("epoch_within", epoch_within[1]):
                raise CatalogError("epoch_within: ends before it begins; give the earlier time first")
        if at is not None:
            _check_datetime("at", at)
        kept: Iterable[ElementSet] = self.sets
        if name is not None:
            whole = _compile_pattern(name)
            kept = [entry for entry in kept if whole.fullmatch(entry.name)]
        if norad_id is not None:
            wanted = _check_numbers(norad_id)
            kept = [entry for entry in kept if entry.norad_id in wanted]
        if regime is not None:
            kept = [entry for entry in kept if entry.regime == regime]
        if epoch_within is not None:
            kept = [entry for entry in kept if epoch_within[0] <= entry.epoch_utc <= epoch_within[1]]
        if max_age_days is not None and at is not None:
            age_s = float(max_age_days) * 86_400.0
            kept = [entry for entry in kept if abs((entry.epoch_utc - at).total_seconds()) <= age_s]
        return Catalog(tuple(kept), self.problems, self.duplicates, self.where)

    def objects(self) -> dict[int, tuple[ElementSet, ...]]:
        """Return the sets of each object by catalogue number, in the order of their epochs."""
        grouped: dict[int, list[ElementSet]] = {}
        for entry in self.sets:
            grouped.setdefault(entry.norad_id, []).append(entry)
        return {number: tuple(sorted(group, key=_epoch)) for number, group in grouped.items()}

    def trajectory(self, which: int | str) -> SetSequence:
        """Return the trajectory of one object: at each instant the set with the nearest epoch applies.

        Parameters
        ----------
        which : catalogue number or name of the object

        Raises
        ------
        CatalogError
            if there is no such object, or more than one
        """
        name, number = (which, None) if isinstance(which, str) else (None, next(iter(_check_numbers([which]))))
        return SetSequence(tuple(select_object(self.sets, self.where, name, number)))

    def write(self, path: str | Path) -> None:
        """Write the sets as OMM (.json, .csv, .xml, .kvn), or as three-line sets (.tle, .3le, .txt).

        An OMM holds every digit, so what is read again is equal. A three-line set is rounded to the digits of a TLE. A
        warning counts the sets that no TLE can hold.

        Parameters
        ----------
        path : path of the file; its suffix decides the format

        Raises
        ------
        CatalogError
            if the suffix is unknown, or no set can be written
        """
        path = Path(check_path(path))
        suffix = path.suffix.lower()
        if suffix in _OMM_FORMATS:
            text = _OMM_FORMATS[suffix](self.sets)
        elif suffix in TLE_SUFFIXES:
            text = format_tles(self.sets, self.where)
        else:
            known = ", ".join(self.SUFFIXES)
            raise CatalogError(f"{path}: '{suffix}' is not a format of catalogues; use one of {known}")
        with write_atomically(path) as draft:
            draft.write_text(text, encoding="utf-8")


def _check_datetime(what: str, at: Any) -> datetime.datetime:
    if not isinstance(at, datetime.datetime):
        raise CatalogError(f"{what}: {quote_value(at)} is not a time; give a datetime with its time zone")
    if at.tzinfo is None:
        raise CatalogError(f"{what}: a time without an offset is ambiguous; give it a time zone, such as UTC")
    return at


def _check_numbers(wanted: Any) -> set[int]:
    """Check the requested catalogue numbers, one or several."""
    several = isinstance(wanted, Iterable) and not isinstance(wanted, str | bytes) and getattr(wanted, "ndim", 1) != 0
    norad_ids = list(wanted) if several else [wanted]
    for number in norad_ids:
        if isinstance(number, bool) or not isinstance(number, numbers.Integral):
            raise CatalogError(
                f"norad_id: {quote_value(number)} is not a catalogue number; give a whole number, such as 25544"
            )
    return {int(number) for number in norad_ids}


def _epoch(entry: ElementSet) -> tuple[datetime.datetime, float]:
    return entry.epoch_utc, entry.epoch_rest_ns


def _elements(entry: ElementSet) -> tuple[float, ...]:
    return (
        entry.mean_motion_rev_day,
        entry.eccentricity,
        entry.inclination_deg,
        entry.raan_deg,
        entry.argument_of_perigee_deg,
        entry.mean_anomaly_deg,
        entry.bstar_per_earth_radius,
    )


def _compile_pattern(name: str) -> re.Pattern[str]:
    words = name.strip() if any(sign in name for sign in "*?") else f"*{name.strip()}*"
    return re.compile(re.escape(words).replace(r"\*", ".*").replace(r"\?", "."), re.IGNORECASE | re.DOTALL)
