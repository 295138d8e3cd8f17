"""Element sets read from text files of two or three lines each (TLE, 3LE), each checked before it is believed.

The sgp4 library accepts a wrong checksum in silence; here the chosen set must be whole, or the error names file and line.
A bad record of another object does not stop a good one from being chosen. Format: Hoots & Roehrich, Spacetrack Report 3;
CelesTrak's FAQ on the checksum; Space-Track's Alpha-5 catalogue numbers.
"""

from __future__ import annotations

import datetime
import functools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rso_lidar.errors import CatalogError, did_you_mean

LINE_LENGTH = 69
_ALPHA5 = "ABCDEFGHJKLMNPQRSTUVWXYZ"  # no I, no O; A stands for 10
_ELEMENT_LINE = re.compile(r"^([12]) [ 0-9A-Z][ 0-9]{4}")

# Columns (from 0) that must be numbers, by line; those of `_PACKED` have an implied point and exponent.
_NUMBERS = {
    1: {"epoch year": (18, 20), "epoch day": (20, 32), "mean motion rate": (33, 43)},
    2: {
        "inclination": (8, 16),
        "right ascension": (17, 25),
        "eccentricity": (26, 33),
        "argument of perigee": (34, 42),
        "mean anomaly": (43, 51),
        "mean motion": (52, 63),
    },
}
_PACKED = {"mean motion acceleration": (44, 52), "drag term": (53, 61)}


@dataclass(frozen=True)
class ElementSet:
    """One element set as it was written. `problem` says what is wrong with it; `where` is its file and first line."""

    name: str
    norad_id: int
    line1: str
    line2: str
    where: str = ""
    problem: str | None = None

    @property
    def epoch_utc(self) -> datetime.datetime:
        """Return the epoch of the elements; two-digit years below 57 are of this century."""
        year = int(self.line1[18:20])
        first = datetime.datetime(year + (2000 if year < 57 else 1900), 1, 1, tzinfo=datetime.UTC)
        return first + datetime.timedelta(days=float(self.line1[20:32]) - 1.0)

    @property
    def label(self) -> str:
        """Return what to call the object: its name if it has one, and its catalogue number."""
        return f"{self.name} (NORAD {self.norad_id})" if self.name else f"NORAD {self.norad_id}"


def read_element_sets(path: str | Path) -> list[ElementSet]:
    """Return every element set of a TLE or 3LE file, bad ones with their `problem`; a file without any is an error."""
    path = Path(path)
    try:
        status = path.stat()
        if path.is_dir():
            raise CatalogError(f"{path}: is a folder: name a file of element sets")
        return list(_read(path, status.st_mtime_ns, status.st_size))
    except FileNotFoundError:
        raise CatalogError(f"{path}: no such file: check the path") from None
    except OSError as error:
        raise CatalogError(f"{path}: cannot be read: {error.strerror}") from None


@functools.lru_cache(maxsize=16)
def _read(path: Path, _modified_ns: int, _size: int) -> tuple[ElementSet, ...]:
    content = path.read_bytes()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise CatalogError(f"{path}: is not UTF-8 text: name a file of two-line element sets")
    if not text.strip():
        raise CatalogError(f"{path}: is empty: name a file of two-line element sets")
    return tuple(parse_lines(text.split("\n"), str(path)))


def parse_lines(lines: Iterable[str], where: str) -> list[ElementSet]:
    """Return the element sets found in lines of text; `where` names their source in errors.

    A set is a line "1 ...", a line "2 ..." and, before them, maybe a name (a leading "0 " is dropped). Empty lines and
    lines that begin with # are skipped.
    """
    numbered = [(k, line.rstrip()) for k, line in enumerate(lines, start=1)]
    numbered = [(k, line) for k, line in numbered if line and not line.startswith("#")]
    sets: list[ElementSet] = []
    name, at = "", 0
    while at < len(numbered):
        number, line = numbered[at]
        after = numbered[at + 1] if at + 1 < len(numbered) else None
        kind = _ELEMENT_LINE.match(line)
        at += 1
        if kind is None:
            name = line.removeprefix("0 ").strip()
            continue
        place = f"{where}: line {number}"
        line1, line2, problem = line, "", None
        if kind[1] == "2":
            line1, line2, problem = (
                "",
                line,
                f"{place}: a line 2 without its line 1 before it: restore the missing line",
            )
        elif after is None:
            problem = f"{place}: the file ends before line 2 of this element set: restore the missing line"
        elif not after[1].startswith("2"):
            problem = f"{where}: line {after[0]}: line 2 of an element set must begin with '2 ', not '{after[1][:12]}'"
        else:
            line2, at = after[1], at + 1
            problem = _problem(line1, number, line2, after[0], where)
        identity = _norad_id((line1 or line2)[2:7])
        sets.append(ElementSet(name, identity or 0, line1, line2, place, problem))
        name = ""
    if not sets:
        raise CatalogError(f"{where}: holds no two-line element set: its lines should begin with '1 ' and '2 '")
    return sets


def choose(
    sets: Sequence[ElementSet],
    where: str,
    name: str | None = None,
    norad_id: int | None = None,
    near_utc: datetime.datetime | None = None,
) -> ElementSet:
    """Return the one element set that is meant, checked: by name or catalogue number, and nearest to `near_utc`.

    Names are compared without regard to case. Without `near_utc` the newest set of the object is taken.
    """
    meant = list(sets)
    if norad_id is not None:
        meant = [entry for entry in meant if entry.norad_id == norad_id]
        if not meant:
            raise CatalogError(f"{where}: no object with norad_id {norad_id}: it holds {_listed(sets)}")
    if name is not None:
        found = [entry for entry in meant if entry.name.casefold() == name.strip().casefold()]
        if not found:
            names = {entry.name.casefold(): entry.name for entry in meant if entry.name}
            guess = did_you_mean(name.casefold(), names)
            for folded, written in names.items():
                guess = guess.replace(f"'{folded}'", f"'{written}'")
            raise CatalogError(f"{where}: no object named '{name}'{guess or ': it holds ' + _listed(meant)}")
        meant = found
    if any(entry.norad_id for entry in meant):  # lines too broken to tell whose they are stop nobody
        meant = [entry for entry in meant if entry.norad_id]
    if len({entry.norad_id for entry in meant}) > 1:
        key = "norad_id" if name is not None else "name or norad_id"
        raise CatalogError(f"{where}: holds several objects, {_listed(meant)}: choose one with {key}")

    def rank(entry: ElementSet) -> tuple[bool, float]:
        try:
            epoch = entry.epoch_utc
        except (ValueError, OverflowError):
            return (True, 0.0)
        return (False, abs((epoch - near_utc).total_seconds()) if near_utc else -epoch.timestamp())

    chosen = min(meant, key=rank)
    if chosen.problem is not None:
        raise CatalogError(chosen.problem)
    return chosen


def _listed(sets: Sequence[ElementSet], most: int = 6) -> str:
    labels = list(dict.fromkeys(entry.label for entry in sets))
    more = f" and {len(labels) - most} more" if len(labels) > most else ""
    return ", ".join(labels[:most]) + more


def _problem(line1: str, number1: int, line2: str, number2: int, where: str) -> str | None:
    """Return what is wrong with an element set, naming file and line, or None."""
    for which, line, number in ((1, line1, number1), (2, line2, number2)):
        wrong = _line_problem(which, line)
        if wrong:
            return f"{where}: line {number}: {wrong}"
    if _norad_id(line1[2:7]) != _norad_id(line2[2:7]):
        return (
            f"{where}: line {number2}: is of object '{line2[2:7].strip()}', the line before it of "
            f"'{line1[2:7].strip()}': restore the missing line"
        )
    return None


def _line_problem(which: int, line: str) -> str | None:
    """Return what is wrong with line 1 or 2 of an element set, or None."""
    if not line.startswith(f"{which} "):
        return f"should begin with '{which} ', not '{line[:2]}'"
    if len(line) != LINE_LENGTH:
        what = "is truncated" if len(line) < LINE_LENGTH else "is too long"
        return f"{what}: {len(line)} characters, an element line has {LINE_LENGTH}: fetch the set again"
    if not line.isascii():
        return "holds a character that no element set has: fetch the set again"
    expected = str(checksum(line))
    if line[68] != expected:
        return f"wrong checksum: its digits add up to {expected}, its last is '{line[68]}': fetch the set again"
    if _norad_id(line[2:7]) is None:
        return f"'{line[2:7]}' is not a catalogue number: fetch the set again"
    for what, (first, end) in _NUMBERS[which].items():
        if not re.fullmatch(r" *[-+]?[0-9 ]*\.?[0-9]+ *", line[first:end]):
            return f"{what} '{line[first:end]}' is not a number: fetch the set again"
    if which == 1:
        day = line[20:32].strip()
        if not (line[18:20].isdigit() and re.fullmatch(r"\d+\.?\d*", day) and 1.0 <= float(day) < 367.0):
            return f"epoch '{line[18:32]}' is no year and day: fetch the set again"
        for what, (first, end) in _PACKED.items():
            if not re.fullmatch(r"[-+ ][0-9 ]{5}[-+ ][0-9]", line[first:end]):
                return f"{what} '{line[first:end]}' is not a number: fetch the set again"
    return None


def checksum(line: str) -> int:
    """Return the checksum of an element line: its digits, and 1 for each minus, over 68 columns, modulo 10."""
    return sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10


def _norad_id(field: str) -> int | None:
    """Return a catalogue number from its five columns, Alpha-5 included, or None."""
    text = field.strip()
    if text.isascii() and text.isdigit():
        return int(text)
    if len(text) == 5 and text[0] in _ALPHA5 and text[1:].isascii() and text[1:].isdigit():
        return (10 + _ALPHA5.index(text[0])) * 10_000 + int(text[1:])
    return None
