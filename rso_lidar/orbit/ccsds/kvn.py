"""CCSDS navigation messages in keyword = value notation, read and written."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Sequence

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.orbit.ccsds.message import CcsdsMessage, CcsdsSegment, Entry, parse_sigma

_KEYWORD = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*)", re.ASCII)
Piece = tuple[dict[str, str], Iterable[str]]  # the metadata of a segment, and its lines


def read_kvn(text: str, kind: str, where: str) -> CcsdsMessage:
    """Read a message in keyword = value notation; a `ScenarioError` names the line that does not follow the format."""
    message = CcsdsMessage(where, "", {}, [])
    inside = ""  # the block that is open: META, COVARIANCE or DATA
    begun = 0
    number = 0
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line == "COMMENT" or line.startswith(("COMMENT ", "COMMENT\t")):
            note = parse_sigma(line.removeprefix("COMMENT"))
            if note is not None and message.segments:
                message.segments[-1].meta.setdefault(note[0], Entry(note[1], number))
            continue
        if not message.version:
            match = _KEYWORD.fullmatch(line)
            if match is None or match[1] != f"CCSDS_{kind}_VERS":
                article = "a" if kind == "TDM" else "an"
                other = "; read the state of an OPM with `rl.orbit.read_opm`" if line.startswith("CCSDS_OPM") else ""
                raise ScenarioError(
                    f"{where}: line {number}: begins with '{line:.40}'; {article} {kind} begins with "
                    f"CCSDS_{kind}_VERS = ...{other}"
                )
            message.version = match[2]
            continue
        block = re.fullmatch(r"(META|DATA|COVARIANCE)_(START|STOP)", line)
        if block is not None:
            name, edge = block[1], block[2]
            if (edge == "START") == bool(inside) or (edge == "STOP" and inside != name):
                open_one = f"{inside}_START of line {begun}" if inside else "no block"
                raise ScenarioError(f"{where}: line {number}: {line} while {open_one} is open; pair START and STOP")
            if name == "META" and edge == "START":
                message.segments.append(CcsdsSegment(number))
            elif not message.segments:
                raise ScenarioError(f"{where}: line {number}: {line} before any META_START; put metadata first")
            inside, begun = (name, number) if edge == "START" else ("", 0)
            continue
        if inside == "COVARIANCE":
            message.segments[-1].covariances.append((number, line))
            continue
        match = _KEYWORD.fullmatch(line)
        if match is not None and kind == "TDM" and inside == "DATA":
            message.segments[-1].rows.append((number, [match[1], *match[2].split()]))
        elif match is not None:
            if inside != "META" and message.segments:
                other = ", or measurements after DATA_START" if kind == "TDM" else ""
                raise ScenarioError(
                    f"{where}: line {number}: keyword {match[1]} among the rows; put it between META_START and "
                    f"META_STOP{other}"
                )
            into = message.segments[-1].meta if inside == "META" else message.header
            if match[1] in into:
                raise ScenarioError(f"{where}: line {number}: {match[1]} is given twice; remove one")
            if match[2].strip():  # a keyword without a value is not given
                into[match[1]] = Entry(match[2].strip(), number)
        elif inside == "META" or not message.segments:
            raise ScenarioError(f"{where}: line {number}: '{line:.40}' is not KEYWORD = value; correct the line")
        else:
            message.segments[-1].rows.append((number, line.split()))
    if inside:
        raise ScenarioError(f"{where}: line {begun}: {inside}_START is never closed; add {inside}_STOP")
    return message


def format_kvn(kind: str, version: str, header: dict[str, str], segments: Sequence[Piece]) -> str:
    """Format a message of one or more segments in keyword = value notation.

    Raises
    ------
    RecordingError
        if a value is not printable ASCII of at most 200 characters
    """
    before, after = (["DATA_START"], ["DATA_STOP"]) if kind in ("AEM", "TDM") else ([], [])
    lines = [f"CCSDS_{kind}_VERS = {version}", *_format_pairs(header), ""]
    for meta, rows in segments:
        lines += ["META_START", *_format_pairs(meta), "META_STOP", "", *before, *rows, *after, ""]
    return "\n".join(lines[:-1]) + "\n"


def format_keywords(kind: str, version: str, header: dict[str, str], blocks: Sequence[dict[str, str]]) -> str:
    """Format a message of keywords without rows, block by block.

    Raises
    ------
    RecordingError
        if a value is not printable ASCII of at most 200 characters
    """
    lines = [f"CCSDS_{kind}_VERS = {version}", *_format_pairs(header)]
    for block in blocks:
        lines += ["", *_format_pairs(block)]
    return "\n".join(lines) + "\n"


def _format_pairs(words: dict[str, str]) -> list[str]:
    for key, value in words.items():
        if not value.strip() or not value.isascii() or not value.isprintable() or len(value) > 200:
            raise RecordingError(
                f"{key} {value!r:.60}: the format allows up to 200 printable ASCII characters; change it"
            )
    return [f"{key} = {value}" for key, value in words.items()]


def make_header(originator: str, created_utc: datetime.datetime | None) -> dict[str, str]:
    """Make the header of a message; `created_utc` is now unless given."""
    created = (created_utc or datetime.datetime.now(datetime.UTC)).astimezone(datetime.UTC)
    return {"CREATION_DATE": f"{created:%Y-%m-%dT%H:%M:%S}", "ORIGINATOR": originator}
