"""The text of CCSDS navigation messages (OEM 502.0-B, AEM 504.0-B): keyword = value lines, metadata blocks, data rows.

An instant is kept as whole picoseconds of TAI since the start of 2000 (UTC), so that no date is rounded: in one float64
a date of 2026 is 0.1 us coarse, which is a millimetre along a low orbit.
"""

from __future__ import annotations

import datetime
import functools
import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rso_lidar import files
from rso_lidar.errors import RecordingError, ScenarioError, did_you_mean
from rso_lidar.orbit.epochs import TT_MINUS_TAI_S, Epochs
from rso_lidar.part import GREATEST
from rso_lidar.shipped import find

PS_PER_S = 10**12
TIME_SYSTEMS = ("UTC", "TAI", "TT", "GPS")
_LABELS = {"CALENDAR": r"(\d{4})-(\d{2})-(\d{2})", "DAY OF YEAR": r"(\d{4})-(\d{3})"}
_CLOCK = r"[T ](\d{2}):(\d{2}):(\d{2})(?:\.(\d*))?(Z?)"
_CALENDAR = re.compile(_LABELS["CALENDAR"] + _CLOCK, re.ASCII)
_DAY_OF_YEAR = re.compile(_LABELS["DAY OF YEAR"] + _CLOCK, re.ASCII)
_KEYWORD = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*)", re.ASCII)
_START = datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC)
_FIRST_YEAR, _LAST_YEAR = 1972, 2200  # before 1972 UTC had other seconds
_TAI_MINUS_GPS_S = 19  # fixed by GPS's start on 1980-01-06 (IS-GPS-200, 3.3.4)


@dataclass(frozen=True)
class Entry:
    """The value of a keyword, and the line it stands on."""

    value: str
    line: int


@dataclass
class Segment:
    """One metadata block and the data rows under it: (line, cells)."""

    line: int
    meta: dict[str, Entry] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)


@dataclass
class Message:
    """A message as read: where it is from, its format's version, its header and its segments."""

    where: str
    version: str
    header: dict[str, Entry]
    segments: list[Segment]

    def need(self, segment: Segment, key: str) -> Entry:
        """Return an obligatory entry of a segment's metadata."""
        if key not in segment.meta:
            raise ScenarioError(
                f"{self.where}: line {segment.line}: the metadata lack {key}: add it, for the standard asks for it"
            )
        return segment.meta[key]

    def stamp(self, entry: Entry, system: str) -> int:
        """Return an entry's instant [ps of TAI since the start of 2000]."""
        return stamp_ps(entry.value, system, f"{self.where}: line {entry.line}")

    def time_system(self, segment: Segment) -> str:
        """Return the time system of a segment, one of those known here."""
        entry = self.need(segment, "TIME_SYSTEM")
        system = entry.value.upper()
        if system not in TIME_SYSTEMS:
            raise ScenarioError(
                f"{self.where}: line {entry.line}: TIME_SYSTEM {entry.value} is not known here: write the epochs in "
                f"{', '.join(TIME_SYSTEMS)}"
            )
        return system


# --------------------------------------------------------------------------------------------------------- reading


def found(file: str) -> Path:
    """Return the path of a file that a part names, looked up beside the working folder and among the shipped data."""
    path = find(file)
    if path is None:
        raise ScenarioError(f"{file}: no such file: check the path")
    return path


def read_text(path: Path) -> str:
    """Return the text of a file; what cannot be read is a `ScenarioError` that names it."""
    text = files.read_text(path, files.MOST_BYTES, ScenarioError, "table (OEM, AEM or CSV)")
    if "\0" in text:
        raise ScenarioError(f"{path}: is not UTF-8 text: name an OEM, AEM or CSV file")
    if not text.strip():
        raise ScenarioError(f"{path}: is empty: name a file with at least two rows")
    return text


def is_message(text: str) -> bool:
    """Return whether a text is meant as a CCSDS message, and not as CSV."""
    first = text.lstrip().splitlines()[0]
    return first.startswith(("<", "CCSDS_", "COMMENT")) or "," not in first


def read_message(text: str, kind: str, where: str) -> Message:
    """Return the message of a KVN or XML text; `kind` is "OEM" or "AEM"."""
    if text.lstrip().startswith("<"):
        from rso_lidar.orbit.ccsds_xml import read_xml

        return _checked(read_xml(text, kind, where), kind)
    return _checked(_read_kvn(text, kind, where), kind)


def _checked(message: Message, kind: str) -> Message:
    if not re.fullmatch(r"[123]\.[0-9]+", message.version):
        raise ScenarioError(f"{message.where}: CCSDS_{kind}_VERS {message.version} is not known: write 1.0, 2.0 or 3.0")
    if not message.segments:
        raise ScenarioError(f"{message.where}: has no segment: give META_START ... META_STOP and rows under it")
    return message


def _read_kvn(text: str, kind: str, where: str) -> Message:
    message = Message(where, "", {}, [])
    inside = ""  # the block that is open: META, COVARIANCE or DATA
    begun = 0
    number = 0
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line == "COMMENT" or line.startswith(("COMMENT ", "COMMENT\t")):
            continue
        if not message.version:
            match = _KEYWORD.fullmatch(line)
            if match is None or match[1] != f"CCSDS_{kind}_VERS":
                raise ScenarioError(
                    f"{where}: line {number}: begins with '{line:.40}': an {kind} begins with CCSDS_{kind}_VERS = ..."
                )
            message.version = match[2]
            continue
        block = re.fullmatch(r"(META|DATA|COVARIANCE)_(START|STOP)", line)
        if block is not None:
            name, edge = block[1], block[2]
            if (edge == "START") == bool(inside) or (edge == "STOP" and inside != name):
                open_one = f"{inside}_START of line {begun}" if inside else "no block"
                raise ScenarioError(f"{where}: line {number}: {line} while {open_one} is open: pair START and STOP")
            if name == "META" and edge == "START":
                message.segments.append(Segment(number))
            elif not message.segments:
                raise ScenarioError(f"{where}: line {number}: {line} before any META_START: put metadata first")
            inside, begun = (name, number) if edge == "START" else ("", 0)
            continue
        if inside == "COVARIANCE":
            continue
        match = _KEYWORD.fullmatch(line)
        if match is not None:
            if inside != "META" and message.segments:
                raise ScenarioError(
                    f"{where}: line {number}: keyword {match[1]} among the rows: put it between META_START and META_STOP"
                )
            into = message.segments[-1].meta if inside == "META" else message.header
            if match[1] in into:
                raise ScenarioError(f"{where}: line {number}: {match[1]} stands there twice: remove one")
            into[match[1]] = Entry(match[2].strip(), number)
        elif inside == "META" or not message.segments:
            raise ScenarioError(f"{where}: line {number}: '{line:.40}' is no KEYWORD = value: correct the line")
        else:
            message.segments[-1].rows.append((number, line.split()))
    if inside:
        raise ScenarioError(f"{where}: line {begun}: {inside}_START is never closed: add {inside}_STOP")
    return message


def choose(message: Message, wanted: str | None) -> list[Segment]:
    """Return the segments of the object of that name or id, or of the only one."""
    chosen, known = [], {}
    for segment in message.segments:
        name, identity = message.need(segment, "OBJECT_NAME").value, message.need(segment, "OBJECT_ID").value
        known[f"{name} ({identity})"] = (name, identity)
        if wanted is None or wanted.upper() in (name.upper(), identity.upper()):
            chosen.append(segment)
    if not chosen:
        guess = did_you_mean(str(wanted), [word for words in known.values() for word in words])
        raise ScenarioError(f"{message.where}: has no object '{wanted}'{guess} (objects: {', '.join(known)})")
    if wanted is None and len(known) > 1:
        raise ScenarioError(f"{message.where}: has several objects ({', '.join(known)}): set `object` to one of them")
    return chosen


def number(where: str, name: str, cell: str) -> float:
    """Return a cell as a finite number."""
    try:
        value = float(cell if cell.isascii() and "_" not in cell else "no number")
    except ValueError:
        raise ScenarioError(f"{where}: {name} '{cell.strip():.40}' is not a number: correct it") from None
    if not abs(value) <= GREATEST:
        raise ScenarioError(f"{where}: {name} is {cell.strip():.40}: give a finite number within {GREATEST:g}")
    return value


def growing(where: str, stamps: Sequence[int], lines: Sequence[int]) -> None:
    """Refuse rows whose instants [ps] do not grow by 1 ns or more."""
    for (before, after), line in zip(itertools.pairwise(stamps), lines[1:], strict=True):
        if after - before < 1000:
            raise ScenarioError(
                f"{where}: line {line}: its epoch is not 1 ns or more after the row before: sort the rows"
            )


def useable_s(
    message: Message, segment: Segment, system: str, first_ps: int, time_s: np.ndarray
) -> tuple[float, float]:
    """Return the useable span of a segment, counted as its rows' `time_s` are, and within them."""
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
            "and its rows: correct them"
        )
    return span[0], span[1]


# ---------------------------------------------------------------------------------------------------------- epochs


def stamp_ps(text: str, system: str, where: str) -> int:
    """Return the instant of an epoch [ps of TAI since the start of 2000 UTC]: calendar or day of year, UTC, TAI, TT or GPS.

    >>> stamp_ps("2017-01-01T00:00:00", "UTC", "-") - stamp_ps("2016-12-31T23:59:60", "UTC", "-")
    1000000000000
    """
    match = _CALENDAR.fullmatch(text) or _DAY_OF_YEAR.fullmatch(text)
    if match is None:
        raise ScenarioError(f"{where}: epoch '{text:.40}': write 2024-09-17T12:00:00.000 or 2024-261T12:00:00.000")
    *date, hour, minute, second, fraction, _zulu = match.groups()
    year = int(date[0])
    if not _FIRST_YEAR <= year <= _LAST_YEAR:
        raise ScenarioError(f"{where}: epoch '{text}' is not between {_FIRST_YEAR} and {_LAST_YEAR}: correct the year")
    try:
        if len(date) == 3:
            day = datetime.date(year, int(date[1]), int(date[2]))
        else:
            day = datetime.date(year, 1, 1) + datetime.timedelta(days=int(date[1]) - 1)
            if day.year != year:
                raise ValueError
    except ValueError:
        raise ScenarioError(f"{where}: epoch '{text}': there is no such day: correct the date") from None
    in_day = int(hour) * 3600 + int(minute) * 60 + int(second)
    leap = int(second) == 60 and system == "UTC" and in_day == 86_400 and _day_length_s(day) == 86_401
    if int(hour) > 23 or int(minute) > 59 or (int(second) > 59 and not leap):
        raise ScenarioError(f"{where}: epoch '{text}': there is no such time of day: correct it")
    ps = int(f"{fraction or '':0<12.12}")
    if system == "UTC":
        return (_midnight_s(day) + in_day) * PS_PER_S + ps
    return ((day - _START.date()).days * 86_400 + in_day) * PS_PER_S + ps - _lead_ps(system)


@functools.lru_cache(maxsize=4096)
def _midnight_s(day: datetime.date) -> int:
    """Return the TAI seconds from the start of 2000 (UTC) to the start of a UTC day."""
    midnight = datetime.datetime(day.year, day.month, day.day, tzinfo=datetime.UTC)
    return round(float(Epochs(midnight, np.zeros(1)).since(_START)[0]))


def _day_length_s(day: datetime.date) -> int:
    return _midnight_s(day + datetime.timedelta(days=1)) - _midnight_s(day)


@functools.cache
def _lead_ps(system: str) -> int:
    """Return by how much a clock of TAI, TT or GPS is ahead of UTC at the start of 2000 [ps]."""
    whole, fraction = Epochs(_START, np.zeros(1)).tt_julian()
    tt_ps = round(((float(whole[0]) - 2_451_544.0) + (float(fraction[0]) - 0.5)) * 86_400_000) * 10**9
    tai_ps = tt_ps - round(TT_MINUS_TAI_S * 1000) * 10**9
    return {"TT": tt_ps, "TAI": tai_ps, "GPS": tai_ps - _TAI_MINUS_GPS_S * PS_PER_S}[system]


def start_near(ps: int) -> tuple[datetime.datetime, int]:
    """Return a UTC instant within a second at or before one [ps], to count epochs from, and its own [ps]."""
    day = _START.date() + datetime.timedelta(days=ps // (86_400 * PS_PER_S))
    while _midnight_s(day) * PS_PER_S > ps:
        day -= datetime.timedelta(days=1)
    in_day = min(ps // PS_PER_S - _midnight_s(day), 86_399)
    start = datetime.datetime(day.year, day.month, day.day, tzinfo=datetime.UTC) + datetime.timedelta(seconds=in_day)
    return start, (_midnight_s(day) + in_day) * PS_PER_S


def instant_ps(instant: datetime.datetime) -> int:
    """Return an aware datetime as picoseconds of TAI since the start of 2000 (UTC)."""
    utc = instant.astimezone(datetime.UTC)
    in_day = utc.hour * 3600 + utc.minute * 60 + utc.second
    return (_midnight_s(utc.date()) + in_day) * PS_PER_S + utc.microsecond * 1_000_000


def epoch_texts(epochs: Epochs) -> list[str]:
    """Return the instants as ISO calendar text in UTC, leap seconds as 23:59:60, to the picosecond, at least to the ms."""
    start_ps = instant_ps(epochs.start_utc)
    texts = []
    for time_s in epochs.time_s.tolist():
        whole = int(time_s // 1.0)
        texts.append(stamp_text(start_ps + whole * PS_PER_S + round((time_s - whole) * PS_PER_S)))
    return texts


def stamp_text(ps: int) -> str:
    """Return an instant [ps of TAI since the start of 2000 UTC] as ISO calendar text in UTC, without a Z."""
    start, start_ps = start_near(ps)
    seconds, rest = divmod(ps - start_ps, PS_PER_S)
    digits = f"{rest:012d}".rstrip("0")
    return f"{start:%Y-%m-%dT%H:%M}:{start.second + seconds:02d}.{digits:0<3}"


# --------------------------------------------------------------------------------------------------------- writing


Piece = tuple[dict[str, str], Iterable[str]]  # the metadata of a segment, and its lines


def kvn_text(kind: str, version: str, header: dict[str, str], segments: Sequence[Piece]) -> str:
    """Return a message of one or more segments in keyword = value notation."""
    before, after = (["DATA_START"], ["DATA_STOP"]) if kind == "AEM" else ([], [])
    lines = [f"CCSDS_{kind}_VERS = {version}", *_pairs(header), ""]
    for meta, rows in segments:
        lines += ["META_START", *_pairs(meta), "META_STOP", "", *before, *rows, *after, ""]
    return "\n".join(lines[:-1]) + "\n"


def _pairs(words: dict[str, str]) -> list[str]:
    for key, value in words.items():
        if not value.strip() or not value.isascii() or not value.isprintable() or len(value) > 200:
            raise RecordingError(
                f"{key} {value!r:.60}: the format wants up to 200 printable ASCII characters: change it"
            )
    return [f"{key} = {value}" for key, value in words.items()]


def header(originator: str, created_utc: datetime.datetime | None) -> dict[str, str]:
    """Return the header of a message; it is created now, unless `created_utc` says otherwise."""
    created = (created_utc or datetime.datetime.now(datetime.UTC)).astimezone(datetime.UTC)
    return {"CREATION_DATE": f"{created:%Y-%m-%dT%H:%M:%S}", "ORIGINATOR": originator}
