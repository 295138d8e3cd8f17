"""Catalogues of element sets, read record by record: what is good is kept, what is bad is listed with place and reason.

TLE and 3LE (`tle_text`), OMM in JSON, CSV, XML and KVN (`omm_text`), told apart by their content; TLE and KVN may be mixed
in one file. A bad record of another object does not stop a good one from being chosen.
"""

from __future__ import annotations

import datetime
import functools
import numbers
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rso_lidar.errors import CatalogError, did_you_mean
from rso_lidar.files import MOST_BYTES, beside, read_bytes
from rso_lidar.orbit.sets.element_set import NO_EPOCH, ElementSet, printable, shown
from rso_lidar.orbit.sets.omm_text import Found, Kvn, is_csv, read_csv, read_json, read_xml, written_csv, written_json
from rso_lidar.orbit.sets.set_sequence import SeveralSets
from rso_lidar.orbit.sets.tle_text import checksum, decoded, element_line, read_set, written_text
from rso_lidar.shipped import find

__all__ = ["Catalog", "ElementSet", "checksum", "choose", "parse_lines", "read_element_sets"]

Regime = Literal["leo", "meo", "geo", "heo", "other"]
REGIMES = ("leo", "meo", "geo", "heo", "other")


@dataclass(frozen=True, eq=False)
class Catalog:
    """The good element sets of a catalogue, in its order, and what was wrong with the rest.

    `problems` has a line, place: what, for each record that is not used; `duplicates` counts the records left out because
    they say again what another of the same object and epoch says.
    """

    sets: tuple[ElementSet, ...]
    problems: tuple[str, ...] = ()
    duplicates: int = 0
    where: str = "catalogue"

    @classmethod
    def from_file(cls, path: str | Path) -> Catalog:
        """Return the catalogue of a file: TLE, 3LE, or OMM in JSON, CSV, XML or KVN; without any record it is an error.

        A relative path is looked up in the working folder, then among the shipped data.
        """
        return cls._of(*_contents(find(_path(path)) or Path(path)), str(path))

    @classmethod
    def from_text(cls, text: str, where: str = "catalogue") -> Catalog:
        """Return the catalogue of a text; `where` is its name in messages."""
        if not isinstance(text, str):
            raise CatalogError(f"{where}: is {shown(text)}, no text: give a str, or from_file the path of a file")
        return cls._of(*_parsed(text, where), where)

    @classmethod
    def _of(cls, found: Sequence[ElementSet], junk: Sequence[str], where: str) -> Catalog:
        kept: dict[tuple[object, ...], ElementSet] = {}
        problems: list[str] = []
        duplicates = 0
        for entry in found:
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
                    f"{entry.where}: {entry.label} has other elements here than at {first.where.rpartition(': ')[2]} for "
                    "the same epoch, which are kept: remove one"
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
        """Return the catalogue of the sets that meet all that is given.

        `name` is a part of the name, without regard to case, or with * and ? the whole of it; `regime` is one of leo, meo,
        geo, heo, other (`ElementSet.regime` says what they are); `max_age_days` is counted from `at`, before or after.
        """
        if name is not None and not isinstance(name, str):
            raise CatalogError(f"name: {shown(name)} is no text: give a part of a name")
        if regime is not None and regime not in REGIMES:
            raise CatalogError(f"regime: '{regime}' is unknown: use one of {', '.join(REGIMES)}")
        if (max_age_days is None) != (at is None):
            raise CatalogError("max_age_days: is counted from an instant: give max_age_days and at together")
        if max_age_days is not None and not (isinstance(max_age_days, numbers.Real) and max_age_days >= 0.0):
            raise CatalogError(f"max_age_days: {shown(max_age_days)} is no age: give 0 or more days")
        if epoch_within is not None:
            if not isinstance(epoch_within, Sequence) or isinstance(epoch_within, str) or len(epoch_within) != 2:
                raise CatalogError(f"epoch_within: {shown(epoch_within)} is no span: give two times, first and last")
            if _instant("epoch_within", epoch_within[0]) > _instant("epoch_within", epoch_within[1]):
                raise CatalogError("epoch_within: ends before it begins: give the earlier time first")
        if at is not None:
            _instant("at", at)
        kept: Iterable[ElementSet] = self.sets
        if name is not None:
            whole = _pattern(name)
            kept = [entry for entry in kept if whole.fullmatch(entry.name)]
        if norad_id is not None:
            wanted = _numbers(norad_id)
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
        """Return the sets of each object by catalogue number, each object's in the order of their epochs."""
        grouped: dict[int, list[ElementSet]] = {}
        for entry in self.sets:
            grouped.setdefault(entry.norad_id, []).append(entry)
        return {number: tuple(sorted(group, key=_epoch)) for number, group in grouped.items()}

    def trajectory(self, which: int | str) -> SeveralSets:
        """Return the trajectory of one object, by number or name: the nearest of its sets at each instant."""
        name, number = (which, None) if isinstance(which, str) else (None, next(iter(_numbers([which]))))
        return SeveralSets(tuple(of_one(self.sets, self.where, name, number)))

    def write(self, path: str | Path) -> None:
        """Write the sets as OMM (.json, .csv), or as three-line sets (.tle, .3le, .txt), rounded to what a TLE can hold.

        A warning counts the sets that no TLE can hold; the rest is written. Where none is left, it is a `CatalogError`.
        """
        path = Path(_path(path))
        suffix = path.suffix.lower()
        if suffix == ".json":
            text = written_json(self.sets)
        elif suffix == ".csv":
            text = written_csv(self.sets)
        elif suffix in (".tle", ".3le", ".txt"):
            text = written_text(self.sets, self.where)
        else:
            raise CatalogError(f"{path}: '{suffix}' is no format of catalogues: use .json, .csv or .tle")
        with beside(path) as draft:
            draft.write_text(text, encoding="utf-8")


def _path(path: Any) -> str:
    if not isinstance(path, str | os.PathLike) or not isinstance(os.fspath(path), str):
        raise CatalogError(f"catalogue: {shown(path)} is no path: give the path of a file of element sets")
    return os.fspath(path)


def _instant(what: str, at: Any) -> datetime.datetime:
    if not isinstance(at, datetime.datetime):
        raise CatalogError(f"{what}: {shown(at)} is no time: give a datetime with its time zone")
    if at.tzinfo is None:
        raise CatalogError(f"{what}: a time without an offset is ambiguous: give it a time zone, such as UTC")
    return at


def _numbers(wanted: Any) -> set[int]:
    """Return the catalogue numbers that are asked for, one or several."""
    several = isinstance(wanted, Iterable) and not isinstance(wanted, str | bytes) and getattr(wanted, "ndim", 1) != 0
    found = list(wanted) if several else [wanted]
    for number in found:
        if isinstance(number, bool) or not isinstance(number, numbers.Integral):
            raise CatalogError(f"norad_id: {shown(number)} is no catalogue number: give a whole number, such as 25544")
    return {int(number) for number in found}


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


def _pattern(name: str) -> re.Pattern[str]:
    words = name.strip() if any(sign in name for sign in "*?") else f"*{name.strip()}*"
    return re.compile(re.escape(words).replace(r"\*", ".*").replace(r"\?", "."), re.IGNORECASE | re.DOTALL)


def read_element_sets(path: str | Path) -> list[ElementSet]:
    """Return every element set of a catalogue, bad ones with their `problem`; a file without any is an error."""
    return list(_contents(Path(_path(path)))[0])


def read_object(path: Path, where: str, name: str | None, norad_id: int | None) -> tuple[ElementSet, ...]:
    """Return the sets of one object of a file, bad ones included; asking again costs nothing while the file stays."""
    status = path.stat()
    return _object(path, status.st_mtime_ns, status.st_size, where, name, norad_id)


@functools.lru_cache(maxsize=64)
def _object(
    path: Path, _modified_ns: int, _size: int, where: str, name: str | None, norad_id: int | None
) -> tuple[ElementSet, ...]:
    return tuple(of_one(_contents(path)[0], where, name, norad_id))


def _contents(path: Path) -> tuple[tuple[ElementSet, ...], tuple[str, ...]]:
    try:
        status = path.stat()
        if path.is_dir():
            raise CatalogError(f"{path}: is a folder: name a file of element sets")
        return _read(path, status.st_mtime_ns, status.st_size)
    except FileNotFoundError:
        raise CatalogError(f"{path}: no such file: check the path") from None
    except (OSError, ValueError) as error:
        if isinstance(error, CatalogError):
            raise
        raise CatalogError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}: check it") from None


@functools.lru_cache(maxsize=16)
def _read(path: Path, _modified_ns: int, _size: int) -> tuple[tuple[ElementSet, ...], tuple[str, ...]]:
    text = decoded(read_bytes(path, MOST_BYTES, CatalogError, "catalogue"))
    if text is None:
        raise CatalogError(f"{path}: is not UTF-8 text: name a file of two-line element sets")
    sets, junk = _parsed(text, str(path))
    return tuple(sets), tuple(junk)


def _parsed(text: str, where: str) -> Found:
    """Return the element sets of a text, bad ones included, and a line for each thing that is no record."""
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")
    start = text.lstrip()
    if not start:
        raise CatalogError(f"{where}: is empty: name a file of two-line element sets")
    first = next((line for line in start.split("\n") if line.strip() and not line.startswith("#")), "")
    if re.match(r"[\[{]\s*[{}\]\"]", start):
        found = read_json(text, where)
    elif start.startswith("<") and re.search(r"<(\w+:)?(omm|ndm)\b", start, re.IGNORECASE):
        found = read_xml(text, where)
    elif is_csv(first):
        found = read_csv(text, where)
    else:
        found = read_lines(text.split("\n"), where)
        if not found[0]:  # its beginning is spoilt
            found = _found_within(text, where) or found
    if not found[0]:
        raise CatalogError(
            f"{where}: holds no two-line element set and no OMM: element lines begin with '1 ' and '2 ', an OMM has the "
            "keys of CCSDS 502.0"
        )
    return found


def _found_within(text: str, where: str) -> Found | None:
    """Return what a text holds whose first line tells no format."""
    if re.search(r"<(\w+:)?omm\b", text, re.IGNORECASE):
        return read_xml(text, where)
    if any(is_csv(line) for line in text.split("\n")):
        return read_csv(text, where)
    return read_json(text, where) if re.search(r'\{\s*"', text) else None


def parse_lines(lines: Iterable[str], where: str) -> list[ElementSet]:
    """Return the element sets found in lines of text; `where` names their source in errors.

    A set is a line "1 ...", a line "2 ..." and, before them, maybe a name (a leading "0 " is dropped). Messages of lines
    KEY = value may stand between sets. Empty lines and lines that begin with # are skipped.
    """
    sets, _ = read_lines(lines, where)
    if not sets:
        raise CatalogError(f"{where}: holds no two-line element set: its lines should begin with '1 ' and '2 '")
    return sets


def read_lines(lines: Iterable[str], where: str) -> Found:
    """Return the element sets found in lines of text, and a line for each thing that is no record."""
    numbered = [(k, line.rstrip()) for k, line in enumerate(lines, start=1)]
    numbered = [(k, line) for k, line in numbered if line and not line.startswith("#")]
    sets: list[ElementSet] = []
    junk: list[str] = []
    message = Kvn(where)
    name: tuple[int, str] | None = None

    def no_name() -> None:
        if name is not None:
            junk.append(
                f"{where}: line {name[0]}: '{printable(name[1][:40])}' is no element line, and none follows that it "
                "could name: remove it"
            )

    at = 0
    while at < len(numbered):
        number, line = numbered[at]
        if element_line(line):
            sets += message.end()
            found, at = read_set(name[1].removeprefix("0 ").strip() if name else "", at, numbered, where)
            sets.append(found)
            name = None
            continue
        at += 1
        ended = message.take(number, line)
        if ended is None:
            sets += message.end()
            no_name()
            name = (number, line.strip())
            if re.fullmatch(r"\s*<[^>]*>\s*", line):  # of a web page, and no name
                no_name()
                name = None
        else:
            sets += ended
            no_name()
            name = None
    sets += message.end()
    no_name()
    return sets, junk


def of_one(
    sets: Sequence[ElementSet], where: str, name: str | None = None, norad_id: int | None = None
) -> list[ElementSet]:
    """Return the sets of the one object that is meant, by name (without regard to case) or catalogue number."""
    meant = list(sets)
    if not meant:
        raise CatalogError(f"{where}: holds no good element set: see its problems")
    if norad_id is not None:
        meant = [entry for entry in meant if entry.norad_id == norad_id]
        if not meant:
            raise CatalogError(f"{where}: no object with norad_id {norad_id}: it holds {_listed(sets)}")
    if name is not None:
        found = [entry for entry in meant if entry.name.casefold() == name.strip().casefold()]
        if not found:
            names = {entry.name.casefold(): entry.name for entry in meant if entry.name}
            guess = did_you_mean(name.casefold(), names)
            for folded, written_so in names.items():
                guess = guess.replace(f"'{folded}'", f"'{written_so}'")
            raise CatalogError(f"{where}: no object named '{name}'{guess or ': it holds ' + _listed(meant)}")
        meant = found
    if any(entry.norad_id for entry in meant):  # lines too broken to tell whose they are stop nobody
        meant = [entry for entry in meant if entry.norad_id]
    if len({entry.norad_id for entry in meant}) > 1:
        key = "norad_id" if name is not None else "name or norad_id"
        raise CatalogError(f"{where}: holds several objects, {_listed(meant)}: choose one with {key}")
    return meant


def choose(
    sets: Sequence[ElementSet],
    where: str,
    name: str | None = None,
    norad_id: int | None = None,
    near_utc: datetime.datetime | None = None,
) -> ElementSet:
    """Return the one element set that is meant, checked: by name or catalogue number, and nearest to `near_utc`.

    Without `near_utc` the newest set of the object is taken.
    """

    def rank(entry: ElementSet) -> tuple[bool, float]:
        epoch = entry.epoch_utc
        if epoch == NO_EPOCH:
            return (True, 0.0)
        return (False, abs((epoch - near_utc).total_seconds()) if near_utc else -epoch.timestamp())

    chosen = min(of_one(sets, where, name, norad_id), key=rank)
    if chosen.problem is not None:
        raise CatalogError(chosen.problem)
    return chosen


def _listed(sets: Sequence[ElementSet], most: int = 6) -> str:
    labels = list(dict.fromkeys(entry.label for entry in sets))
    more = f" and {len(labels) - most} more" if len(labels) > most else ""
    return ", ".join(labels[:most]) + more
