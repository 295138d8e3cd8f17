"""The text of an iCalendar file (RFC 5545)."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

_LINE_BYTES = 75  # of a content line without its end (RFC 5545, sec. 3.1)


@dataclass(frozen=True)
class CalendarEntry:
    """One entry of a calendar, from `begin_utc` to `end_utc`, with a title and a description."""

    begin_utc: datetime.datetime
    end_utc: datetime.datetime
    title: str
    description: str


def write_calendar(entries: Sequence[CalendarEntry], stamp: datetime.datetime) -> str:
    """Write a calendar.

    Times are whole seconds in such files, so that entries are widened to them.

    Parameters
    ----------
    entries : in any order
    stamp : instant of the calendar itself; the same one gives the same bytes
    """
    lines = ["BEGIN:VCALENDAR", "VERSION:2.0", "PRODID:-//rso_lidar//events//EN", "CALSCALE:GREGORIAN"]
    for number, entry in enumerate(entries):
        begin = entry.begin_utc.replace(microsecond=0)
        end = (entry.end_utc + datetime.timedelta(seconds=1) - datetime.timedelta(microseconds=1)).replace(
            microsecond=0
        )
        words = f"{number} {entry.begin_utc.isoformat()} {entry.end_utc.isoformat()} {entry.title}"
        lines += [
            "BEGIN:VEVENT",
            f"UID:{hashlib.sha256(words.encode()).hexdigest()[:32]}@rso_lidar",
            f"DTSTAMP:{_format_time(stamp)}",
            f"DTSTART:{_format_time(begin)}",
            f"DTEND:{_format_time(max(end, begin + datetime.timedelta(seconds=1)))}",
            f"SUMMARY:{_escape(entry.title)}",
            f"DESCRIPTION:{_escape(entry.description)}",
            "TRANSP:TRANSPARENT",
            "END:VEVENT",
        ]
    lines.append("END:VCALENDAR")
    return "".join(f"{folded}\r\n" for line in lines for folded in _fold(line))


def _format_time(at: datetime.datetime) -> str:
    return f"{at.astimezone(datetime.UTC):%Y%m%dT%H%M%SZ}"


def _escape(text: str) -> str:
    r"""Escape a text (RFC 5545, sec. 3.3.11).

    >>> _escape("a,b;c")
    'a\\,b\\;c'
    """
    for sign in ("\\", ",", ";"):
        text = text.replace(sign, "\\" + sign)
    return text.replace("\r", "").replace("\n", "\\n")


def _fold(line: str) -> list[str]:
    """Fold a content line into lines of at most 75 bytes of UTF-8; all but the first begin with a space."""
    folded, held, size = [], "", 0
    for letter in line:
        wide = len(letter.encode())
        if size + wide > _LINE_BYTES:
            folded.append(held)
            held, size = " ", 1
        held, size = held + letter, size + wide
    return [*folded, held]
