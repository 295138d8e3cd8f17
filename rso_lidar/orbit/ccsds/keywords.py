"""Messages of keywords without rows (CCSDS 508.0-B CDM, 502.0-B OPM): keyword = value text or XML, each with its line."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.message import Entry, parse_number
from rso_lidar.orbit.ccsds.xml import walk_message

KEYWORD = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*?)\s*(?:\[([^\]]*)\])?", re.ASCII)
_RADIUS = re.compile(r"COMMENT\s+HBR\s*=\s*(\S+)\s*(?:\[([^\]]*)\])?", re.ASCII)
_NOT_GIVEN = ("nan", "n/a", "na", "none", "unknown", "null")  # values of optional numbers that producers do not know
RADIUS_COMMENT = "COMMENT HBR"  # stands for the keyword HBR
GREATEST_TERM = 1e24  # of a covariance; an unknown component is written as one of thousands of kilometres


@dataclass(frozen=True)
class StatedValue(Entry):
    """An entry with the unit that the file states for it; empty where it states none."""

    unit: str = ""


def read_keywords(text: str, kind: str, where: str) -> tuple[str, list[tuple[str, StatedValue]]]:
    """Read the version of the format, and the keywords in the order of the file, of a message in either notation."""
    if text.lstrip().startswith("<"):
        leaves = _Leaves()
        version = walk_message(text, kind, where, leaves)
        return version, leaves.entries
    return _read_text(text, kind, where)


def _read_text(text: str, kind: str, where: str) -> tuple[str, list[tuple[str, StatedValue]]]:
    """Read keyword = value notation."""
    version = ""
    entries: list[tuple[str, StatedValue]] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        radius = _RADIUS.fullmatch(line)
        if radius is not None and version:  # CARA's way to state the hard-body radius
            entries.append((RADIUS_COMMENT, StatedValue(radius[1], number, (radius[2] or "").strip())))
        if not line or line.split()[0] == "COMMENT":
            continue
        match = KEYWORD.fullmatch(line)
        if match is None:
            raise ScenarioError(f"{where}: line {number}: '{line:.40}' is not KEYWORD = value; correct the line")
        if not version:
            if match[1] != f"CCSDS_{kind}_VERS":
                article = "a" if kind == "CDM" else "an"
                raise ScenarioError(
                    f"{where}: line {number}: begins with '{line:.40}'; {article} {kind} begins with "
                    f"CCSDS_{kind}_VERS = ..."
                )
            version = match[2] or "(none)"
        elif match[2]:
            entries.append((match[1], StatedValue(match[2], number, (match[3] or "").strip())))
    if not version:
        raise ScenarioError(f"{where}: is empty; give a message, which begins with CCSDS_{kind}_VERS = ...")
    return version, entries


class _Leaves:
    """Receiver of elements that keeps those named in capitals."""

    def __init__(self) -> None:
        self.entries: list[tuple[str, StatedValue]] = []

    def begin(self, tag: str, line: int) -> None:
        """Take the begin of an element, which has no value yet."""

    def end(self, tag: str, value: str, unit: str, line: int) -> None:
        if value and tag == tag.upper() and tag != "COMMENT":
            self.entries.append((tag, StatedValue(value, line, unit)))


class KeywordBlock:
    """Keywords of one part of a message.

    Parameters
    ----------
    where : name of the file, for messages
    part : name of the part, for messages
    """

    def __init__(self, where: str, part: str) -> None:
        self.where, self.part = where, part
        self.entries: dict[str, list[StatedValue]] = {}

    def add(self, key: str, entry: StatedValue) -> None:
        """Add a keyword; one that is given twice is refused only where it is used."""
        self.entries.setdefault(key, []).append(entry)

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def find(self, key: str) -> StatedValue | None:
        """Return an optional entry, or None; raise `ScenarioError` if it is given twice."""
        several = self.entries.get(key, [])
        if len(several) > 1:
            raise ScenarioError(f"{self.where}: line {several[1].line}: {key} is given twice; remove one")
        return several[0] if several else None

    def require(self, key: str) -> StatedValue:
        """Return a mandatory entry; raise `ScenarioError` if the part lacks it."""
        entry = self.find(key)
        if entry is None:
            raise ScenarioError(f"{self.where}: {self.part} lacks {key}, which the standard requires; add it")
        return entry

    def text(self, key: str) -> str:
        """Return an optional text, which no calculation uses: the first one, or empty."""
        return self.entries[key][0].value if key in self.entries else ""

    def number(self, key: str, unit: str, low: float = -math.inf, high: float = math.inf) -> float | None:
        """Return an optional number in the standard's unit; None where the part lacks it or states that it is unknown."""
        entry = self.find(key)
        if entry is None or entry.value.lower() in _NOT_GIVEN:
            return None
        value = self._parse(key, entry, unit)
        if not low <= value <= high:
            raise ScenarioError(f"{self.where}: line {entry.line}: {key} is {value:g}; give {low:g} to {high:g}")
        return value

    def require_number(self, key: str, unit: str, most: float | None = None) -> float:
        """Return a mandatory number in a unit.

        Parameters
        ----------
        key, unit : keyword, and the unit that the standard sets for it
        most : greatest magnitude; by default that of any number
        """
        return self._parse(key, self.require(key), unit, most)

    def _parse(self, key: str, entry: StatedValue, unit: str, most: float | None = None) -> float:
        """Parse a number in a unit."""
        at = f"{self.where}: line {entry.line}"
        if entry.unit.lower() not in ("", unit.lower()):
            raise ScenarioError(f"{at}: {key} in {entry.unit}; write it in {unit or 'no unit'}, as the standard does")
        return parse_number(at, key, entry.value) if most is None else parse_number(at, key, entry.value, most)


def check_version(version: str, kind: str, where: str, known: Sequence[str]) -> None:
    """Raise `ScenarioError` unless the main number of a format's version is known."""
    if not re.fullmatch(rf"[{''.join(known)}]\.[0-9]+", version):
        written = " or ".join(f"{number}.0" for number in known)
        raise ScenarioError(f"{where}: CCSDS_{kind}_VERS {version} is not supported; write {written}")
