"""Element sets as lines of text: TLE and 3LE, each line checked before it is used.

The sgp4 library accepts a wrong checksum in silence. Here a bad set states what is wrong with it, with file and line.
Format: Hoots & Roehrich, Spacetrack Report 3; CelesTrak's FAQ on the checksum; Space-Track's Alpha-5 catalogue numbers.
"""

from __future__ import annotations

import calendar
import datetime
import math
import re
from collections.abc import Sequence
from typing import Any

from rso_lidar.errors import CatalogError, warn
from rso_lidar.orbit.sets.element_set import NO_EPOCH, SGP4_XP, ElementSet, explain_impossible

LINE_LENGTH = 69
_ALPHA5 = "ABCDEFGHJKLMNPQRSTUVWXYZ"  # without I and O; A means 10
_HIGHEST_ALPHA5 = 339_999
_FIRST_YEAR, _LAST_YEAR = 1957, 2056  # years that the two digits of an epoch can express
_ELEMENT_LINE = re.compile(r"\s*([12]) [ 0-9A-Za-z][ 0-9]{4}")
# Vallado's verification set continues after column 69 with start, stop and step in minutes.
_SPAN = re.compile(r"(?:\s+-?\d+\.\d*){3}\s*")

# Columns (from 0) that must hold numbers, by line; those of `_PACKED` have an implied point and exponent.
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
_BLANK = {1: (1, 8, 17, 32, 43, 52, 61, 63), 2: (1, 7, 16, 25, 33, 42, 51)}
_NUMBER = re.compile(r" *[-+]?[0-9]*\.?[0-9]+ *")
_PACKED_NUMBER = re.compile(r"[-+ ][0-9 ]{5}[-+ ][0-9]")
_CHECKSUM_VALUE = bytes(int(chr(c)) if chr(c).isdigit() else int(chr(c) == "-") for c in range(128)) + bytes(128)


def decode_text(content: bytes) -> str | None:
    """Decode the bytes of a file: UTF-8, or UTF-16 with its mark; lines that are neither are read as Latin-1.

    Single NUL characters spoil only the record that contains them. Where one character in twenty is NUL, the file is no
    text, and the result is None.
    """
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):  # some shells write redirected output in UTF-16
        text = content.decode("utf-16", "replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = "\n".join(map(_decode_line, content.removeprefix(b"\xef\xbb\xbf").split(b"\n")))
    return None if 20 * text.count("\0") > len(text) else text


def _decode_line(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def identify_element_line(line: str) -> str | None:
    """Return "1" or "2" where a line is that line of an element set, good or bad; else None."""
    kind = _ELEMENT_LINE.match(line)
    return kind[1] if kind else None


def read_set(name: str, at: int, lines: list[tuple[int, str]], where: str) -> tuple[ElementSet, int]:
    """Read the element set that begins with an element line, and return it with the index after it."""
    number, line = lines[at][0], lines[at][1].strip()
    after = (lines[at + 1][0], lines[at + 1][1].strip()) if at + 1 < len(lines) else None
    place = f"{where}: line {number}"
    line1, line2, at = line, "", at + 1
    if line[0] == "2":
        line1, line2, problem = "", line, f"{place}: a line 2 without its line 1 before it; restore the missing line"
    elif after is None:
        problem = f"{place}: the file ends before line 2 of this element set; restore the missing line"
    elif not after[1].startswith("2 "):
        at += (
            identify_element_line(after[1]) is None and len(lines[at][1]) == LINE_LENGTH
        )  # a damaged line 2 is not the name of the next set
        problem = f"{where}: line {after[0]}: line 2 of an element set must begin with '2 ', not '{after[1][:12]}'"
    else:
        line2, at = after[1], at + 1
        if len(line2) > LINE_LENGTH and _SPAN.fullmatch(line2[LINE_LENGTH:]):
            line2 = line2[:LINE_LENGTH]
        problem = _find_problem(line1, number, line2, after[0], where) or ""
    identity = parse_norad_id((line1 or line2)[2:7]) or 0
    try:
        fields = _parse_fields(line1, line2)
    except (ValueError, OverflowError, IndexError) as error:
        fields = {}
        problem = problem or f"{place}: a number cannot be read ({error}); fetch the set again"
    if not problem:
        element_set = ElementSet(name, identity, line1, line2, place, None, **fields)
        out = explain_impossible(element_set)
        if out is None:
            return element_set, at
        cure = "fetch elements of SGP4" if element_set.ephemeris_type == SGP4_XP else "fetch the set again"
        problem = f"{place}: {out}; {cure}"
    return ElementSet(name, identity, line1, line2, place, problem, **fields), at


def _parse_fields(line1: str, line2: str) -> dict[str, Any]:
    ddot, bstar = line1[44:52], line1[53:61]
    return {
        "object_id": parse_object_id(line1[9:17]),
        "epoch_utc": _parse_epoch(line1),
        "mean_motion_rev_day": float(line2[52:63]),
        "eccentricity": float("0." + line2[26:33].replace(" ", "0")),
        "inclination_deg": float(line2[8:16]),
        "raan_deg": float(line2[17:25]),
        "argument_of_perigee_deg": float(line2[34:42]),
        "mean_anomaly_deg": float(line2[43:51]),
        "bstar_per_earth_radius": _unpack_number(bstar),
        "mean_motion_dot_rev_day2": float(line1[33:43]),
        "mean_motion_ddot_rev_day3": _unpack_number(ddot),
        "ephemeris_type": int(line1[62]) if line1[62:63].isdigit() else 0,
        "classification": line1[7].strip() or "U",
        "element_set_no": _parse_whole(line1[64:68]),
        "rev_at_epoch": _parse_whole(line2[63:68]),
    }


def _parse_epoch(line1: str) -> datetime.datetime:
    """Parse the epoch of a line 1. Two-digit years below 57 belong to this century; 1e-8 day are 864 us, exactly."""
    year, (day, _, decimals) = _parse_year(line1), line1[20:32].strip().partition(".")
    if not 1 <= int(day) <= _count_days(year):
        return NO_EPOCH
    first = datetime.datetime(year, 1, 1, tzinfo=datetime.UTC)
    microseconds = int(decimals or 0) * 86_400_000_000 // 10 ** len(decimals)
    return first + datetime.timedelta(days=int(day) - 1, microseconds=microseconds)


def _parse_year(line1: str) -> int:
    """Parse the year of the epoch of a line 1."""
    year = int(line1[18:20])
    return year + (1900 if year >= _FIRST_YEAR % 100 else 2000)


def _count_days(year: int) -> int:
    """Count the days of a year."""
    return 366 if calendar.isleap(year) else 365


def _unpack_number(field: str) -> float:
    """Parse eight columns with an implied point and exponent, such as ' 55648-4'."""
    digits = field[1:6].replace(" ", "0")
    exponent = f"{field[6]}{field[7]}".replace(" ", "")
    return float(f"{field[0].strip()}.{digits}e{exponent}")


def _parse_whole(field: str) -> int:
    return int(field) if field.strip().isdigit() else 0


def parse_object_id(field: str) -> str:
    """Convert the international designator of a TLE to the form of an OMM.

    >>> parse_object_id("58002B  ")
    '1958-002B'
    """
    text = field.strip()
    if not re.fullmatch(r"\d{5}[A-Z]{1,3}", text):
        return text
    return f"{'20' if int(text[:2]) < 57 else '19'}{text[:2]}-{text[2:]}"


def _find_problem(line1: str, number1: int, line2: str, number2: int, where: str) -> str | None:
    """Find what is wrong with an element set: the problem with file and line, or None."""
    for which, line, number in ((1, line1, number1), (2, line2, number2)):
        wrong = _find_line_problem(which, line)
        if wrong:
            return f"{where}: line {number}: {wrong}"
    if parse_norad_id(line1[2:7]) != parse_norad_id(line2[2:7]):
        return (
            f"{where}: line {number2}: is of object '{line2[2:7].strip()}', the line before it of "
            f"'{line1[2:7].strip()}'; restore the missing line"
        )
    return None


def _find_line_problem(which: int, line: str) -> str | None:
    """Find what is wrong with line 1 or 2 of an element set; None if it is good."""
    if not line.startswith(f"{which} "):
        return f"should begin with '{which} ', not '{line[:2]}'"
    if len(line) != LINE_LENGTH:
        what = "is truncated" if len(line) < LINE_LENGTH else "is too long"
        return f"{what}: {len(line)} characters, an element line has {LINE_LENGTH}; fetch the set again"
    if not (line.isascii() and line.isprintable()):
        return "contains a character that an element set cannot contain; fetch the set again"
    expected = str(compute_checksum(line))
    if line[68] != expected:
        return f"wrong checksum: its digits add up to {expected}, its last is '{line[68]}'; fetch the set again"
    if parse_norad_id(line[2:7]) is None:
        return f"'{line[2:7]}' is not a catalogue number; fetch the set again"
    for column in _BLANK[which]:
        if line[column] != " ":
            return f"column {column + 1} is '{line[column]}' and should be blank (shifted columns); fetch the set again"
    for what, (first, end) in _NUMBERS[which].items():
        field = line[first:end]
        if what == "eccentricity":
            if not re.fullmatch(r"[ 0-9]{7}", field):
                return f"eccentricity '{field}' is not a number of seven digits, its point implied; fetch the set again"
        elif not _NUMBER.fullmatch(field):
            return f"{what} '{field}' is not a number; fetch the set again"
    if which == 1:
        day = line[20:32].strip()
        if not (line[18:20].isdigit() and re.fullmatch(r"\d+\.?\d*", day)):
            return f"epoch '{line[18:32]}' is not a year and day; fetch the set again"
        year = _parse_year(line)
        if not 1.0 <= float(day) < _count_days(year) + 1.0:
            return f"epoch '{line[18:32]}' is not a year and day ({year} has {_count_days(year)} days); fetch the set again"
        for what, (first, end) in _PACKED.items():
            if not _PACKED_NUMBER.fullmatch(line[first:end]):
                return f"{what} '{line[first:end]}' is not a number; fetch the set again"
    return None


def compute_checksum(line: str) -> int:
    """Compute the checksum of an element line: the sum of its digits, and 1 for each minus, over 68 columns, modulo 10."""
    return sum(line[:68].encode("ascii", "replace").translate(_CHECKSUM_VALUE)) % 10


def parse_norad_id(field: str) -> int | None:
    """Parse a catalogue number of five columns, Alpha-5 included; None if it is none."""
    text = field.strip()
    if text.isascii() and text.isdigit():
        return int(text)
    if len(text) == 5 and text[0] in _ALPHA5 and text[1:].isascii() and text[1:].isdigit():
        return (10 + _ALPHA5.index(text[0])) * 10_000 + int(text[1:])
    return None


def format_tle(elements: ElementSet) -> tuple[str, str]:
    """Format lines 1 and 2 of an element set: its own lines, or new ones, rounded to the digits that a TLE has.

    Raises
    ------
    CatalogError
        if a TLE cannot hold the set: a number above 339999, a year that two digits cannot express, or any number that would
        not be read as an orbit again
    """
    if elements.line1:
        return elements.line1, elements.line2
    number, code = elements.norad_id, f"{elements.norad_id:05d}"
    if number > _HIGHEST_ALPHA5:
        raise CatalogError(
            f"{elements.label}: its number is above {_HIGHEST_ALPHA5}, the largest of a TLE; write .json"
        )
    if number > 99_999:
        code = f"{_ALPHA5[number // 10_000 - 10]}{number % 10_000:04d}"
    epoch, e = elements.epoch_utc, round(elements.eccentricity * 1e7)
    designator = re.sub(r"^(?:19|20)(\d\d)-", r"\1", elements.object_id)[:8]
    rate = f"{elements.mean_motion_dot_rev_day2:+.8f}".replace("+0.", " .").replace("-0.", "-.")
    out = CatalogError(f"{elements.label}: its numbers do not fit the columns of a TLE; write .json")
    if len(rate) != 10 or e > 9_999_999 or not _FIRST_YEAR <= epoch.year <= _LAST_YEAR or explain_impossible(elements):
        raise out
    line1 = (
        f"1 {code}{elements.classification[:1]} {designator:8s} {_format_epoch(elements)} {rate} "
        f"{_pack_number(elements.mean_motion_ddot_rev_day3, out)} {_pack_number(elements.bstar_per_earth_radius, out)} "
        f"{elements.ephemeris_type % 10:d} {elements.element_set_no % 10_000:4d}"
    )
    angles = (elements.raan_deg % 360.0, elements.argument_of_perigee_deg % 360.0, elements.mean_anomaly_deg % 360.0)
    line2 = (
        f"2 {code} {elements.inclination_deg:8.4f} {angles[0]:8.4f} {e:07d} {angles[1]:8.4f} {angles[2]:8.4f} "
        f"{elements.mean_motion_rev_day:11.8f}{elements.rev_at_epoch % 100_000:5d}"
    )
    line1, line2 = f"{line1}{compute_checksum(line1)}", f"{line2}{compute_checksum(line2)}"
    if _find_problem(line1, 1, line2, 2, ""):
        raise out
    return line1, line2


def format_tles(sets: Sequence[ElementSet], where: str) -> str:
    """Format element sets as lines, each below its name; a warning counts those that no TLE can hold.

    Raises
    ------
    CatalogError
        if a TLE can hold none of them: what is wrong with the first
    """
    lines: list[str] = []
    left_out: list[CatalogError] = []
    for entry in sets:
        try:
            pair = format_tle(entry)
        except CatalogError as error:
            left_out.append(error)
            continue
        lines += [f"0 {entry.name}"] if entry.name else []
        lines += pair
    if left_out and not lines:
        raise left_out[0]
    if left_out:
        warn(f"{where}: {len(left_out)} of {len(sets):,} element sets are left out, the first is {left_out[0]}")
    return "".join(f"{line}\n" for line in lines)


def _format_epoch(elements: ElementSet) -> str:
    """Format the epoch as line 1 has it: the nearest multiple of 1e-8 day (864 us).

    The last half step of a year becomes day 1 of the next year, except in 2056, because 57 means 1957.
    """
    epoch = elements.epoch_utc
    midnight = epoch.replace(hour=0, minute=0, second=0, microsecond=0)
    in_day_us = (epoch - midnight) / datetime.timedelta(microseconds=1) + 1e-3 * elements.epoch_rest_ns
    steps = round(in_day_us / 864.0)
    if steps == 10**8:
        after = midnight + datetime.timedelta(days=1)
        midnight, steps = (after, 0) if after.year <= _LAST_YEAR else (midnight, steps - 1)
    return f"{midnight.year % 100:02d}{midnight.timetuple().tm_yday:03d}.{steps:08d}"


def _pack_number(value: float, out: CatalogError) -> str:
    """Format a number in eight columns with an implied point and exponent; raise `out` if it does not fit."""
    if abs(value) < 1e-14:
        return " 00000+0" if value == 0.0 else " 00000-9"
    exponent = max(math.floor(math.log10(abs(value))) + 1, -9)
    digits = round(abs(value) / 10.0**exponent * 1e5)
    if digits == 100_000:
        digits, exponent = 10_000, exponent + 1
    if exponent > 9:
        raise out
    return f"{'-' if value < 0 else ' '}{digits:05d}{'-' if exponent < 0 else '+'}{abs(exponent)}"
