"""The structure of CCSDS navigation messages (OEM 502.0-B, AEM 504.0-B): header, metadata blocks and data rows."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.orbit.epochs import PS_PER_S, TIME_SYSTEMS, parse_epoch_ps
from rso_lidar.part import GREATEST

# Comments in which this package states the noise of measurements of a TDM.
_SIGMA = re.compile(
    r"\s*(SIGMA_ANGLE(?=[^\[]*\[deg)|SIGMA_(?:RANGE|OFFSET_ALONG|OFFSET_ACROSS)(?=[^\[]*\[m))\s*=\s*(\S+)\s*"
    r"\[(?:m|deg)\]\s*",
    re.ASCII,
)


@dataclass(frozen=True)
class Entry:
    """The value of a keyword, and its line in the file."""

    value: str
    line: int


@dataclass
class CcsdsSegment:
    """One metadata block and the data rows under it: (line, cells).

    The lines of its covariances are kept as keyword = value notation has them, and read only where they are used.
    """

    line: int
    meta: dict[str, Entry] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)
    covariances: list[tuple[int, str]] = field(default_factory=list)


@dataclass
class CcsdsMessage:
    """A message as read: its source, the version of its format, its header and its segments."""

    where: str
    version: str
    header: dict[str, Entry]
    segments: list[CcsdsSegment]

    def require(self, segment: CcsdsSegment, key: str) -> Entry:
        """Return a mandatory entry of a segment's metadata; raise `ScenarioError` if it is missing."""
        if key not in segment.meta:
            raise ScenarioError(
                f"{self.where}: line {segment.line}: the metadata lack {key}, which the standard requires; add it"
            )
        return segment.meta[key]

    def stamp(self, entry: Entry, system: str) -> int:
        """Parse the instant of an entry [ps of TAI since the start of 2000]."""
        return parse_epoch_ps(entry.value, system, f"{self.where}: line {entry.line}")

    def time_system(self, segment: CcsdsSegment) -> str:
        """Return the time system of a segment; `ScenarioError` if it is not one of `TIME_SYSTEMS`."""
        return read_time_system(self.require(segment, "TIME_SYSTEM"), self.where)


def parse_sigma(comment: str) -> tuple[str, str] | None:
    """Parse a comment that states the noise of measurements of a TDM, as its key and its number."""
    match = _SIGMA.fullmatch(comment)
    return None if match is None else (f"COMMENT {match[1]}", match[2])


def read_time_system(entry: Entry, where: str) -> str:
    """Return the time system that an entry states; `ScenarioError` if it is not one of `TIME_SYSTEMS`."""
    system = entry.value.upper()
    if system not in TIME_SYSTEMS:
        raise ScenarioError(
            f"{where}: line {entry.line}: TIME_SYSTEM {entry.value} is not supported; write the epochs in "
            f"{', '.join(TIME_SYSTEMS)}"
        )
    return system


def check_center(key: str, entry: Entry, where: str) -> None:
    """Raise `ScenarioError` if an entry states another centre of an orbit than the Earth."""
    if entry.value.upper() not in ("EARTH", "EARTH CENTER"):
        raise ScenarioError(f"{where}: line {entry.line}: {key} {entry.value}; only EARTH is supported")


def list_objects(message: CcsdsMessage) -> list[str]:
    """List the names of the objects of a message, in its order."""
    return list(dict.fromkeys(message.require(segment, "OBJECT_NAME").value for segment in message.segments))


def select_segments(message: CcsdsMessage, wanted: str | None) -> list[CcsdsSegment]:
    """Select the segments of an object by name or id in any case (None: the only one), or raise `ScenarioError`."""
    chosen, known = [], {}
    for segment in message.segments:
        name, identity = message.require(segment, "OBJECT_NAME").value, message.require(segment, "OBJECT_ID").value
        known[f"{name} ({identity})"] = (name, identity)
        if wanted is None or wanted.upper() in (name.upper(), identity.upper()):
            chosen.append(segment)
    if not chosen:
        guess = did_you_mean(str(wanted), [word for words in known.values() for word in words])
        raise ScenarioError(f"{message.where}: unknown object '{wanted}'{guess} (objects: {', '.join(known)})")
    if wanted is None and len(known) > 1:
        raise ScenarioError(f"{message.where}: has several objects ({', '.join(known)}); set `object` to one of them")
    return chosen


def parse_number(where: str, name: str, cell: str, most: float = GREATEST) -> float:
    """Parse a cell as a finite number, or raise `ScenarioError`."""
    try:
        value = float(cell if cell.isascii() and "_" not in cell else "no number")
    except ValueError:
        raise ScenarioError(f"{where}: {name} '{cell.strip():.40}' is not a number; correct it") from None
    if not abs(value) <= most:
        raise ScenarioError(f"{where}: {name} is {cell.strip():.40}; give a finite number within {most:g}")
    return value


def check_increasing(where: str, stamps: Sequence[int], lines: Sequence[int]) -> None:
    """Check that the instants of rows increase by 1 ns or more, and tell rows of one epoch from rows in disorder.

    Parameters
    ----------
    stamps : (row,) instants [ps]
    lines : (row,) their lines in the file
    """
    for (before, after), line in zip(itertools.pairwise(stamps), lines[1:], strict=True):
        if abs(after - before) < 1000:  # 1 ns
            raise ScenarioError(
                f"{where}: line {line}: its epoch occurs twice, in the row before, too; remove one of the rows, or begin "
                "a new segment there if the state jumps, as at a burn"
            )
        if after < before:
            raise ScenarioError(f"{where}: line {line}: its epoch is before that of the row before; sort the rows")


def usable_span_s(
    message: CcsdsMessage, segment: CcsdsSegment, system: str, first_ps: int, time_s: np.ndarray
) -> tuple[float, float]:
    """Return the usable span of a segment, within its rows.

    Parameters
    ----------
    first_ps : instant of the first row [ps]
    time_s : (row,) instants of the rows [s]

    Returns
    -------
    begin, end : [s], counted as `time_s`
    """
    span = []
    for key, edge_s in (("START_TIME", float(time_s[0])), ("STOP_TIME", float(time_s[-1]))):
        entry = segment.meta.get(f"USEABLE_{key}") or segment.meta.get(key)
        since_s = edge_s
        if entry is not None:
            since_s = float(time_s[0]) + (message.stamp(entry, system) - first_ps) / PS_PER_S
        span.append(min(max(since_s, float(time_s[0])), float(time_s[-1])))
    if not span[0] < span[1]:
        raise ScenarioError(
            f"{message.where}: line {segment.line}: no useable time is left between the segment's START and STOP times "
            "and its rows; correct them"
        )
    return span[0], span[1]
