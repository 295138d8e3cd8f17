"""Readers of element sets that recognise the format from the content: TLE, 3LE, or OMM in JSON, CSV, XML or KVN."""

from __future__ import annotations

import functools
import html
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rso_lidar.errors import CatalogError, make_printable, quote_value
from rso_lidar.files import MOST_BYTES, explain_unreadable, read_bytes
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.omm_text import Found, KvnCollector, is_csv, read_csv, read_json, read_xml
from rso_lidar.orbit.sets.selection import select_object
from rso_lidar.orbit.sets.tle_text import decode_text, identify_element_line, read_set

_QUOTED_FROM, _MOST_QUOTED = 20_000, 120  # characters of a text without element sets: searched for words, and quoted


def check_path(path: Any) -> str:
    """Check that a value is a path, and return it as text."""
    if not isinstance(path, str | os.PathLike) or not isinstance(os.fspath(path), str):
        raise CatalogError(f"catalogue: {quote_value(path)} is not a path; give the path of a file of element sets")
    return os.fspath(path)


def read_element_sets(path: str | Path) -> list[ElementSet]:
    """Read every element set of a file, bad ones included.

    Parameters
    ----------
    path : path of the file, in any of the formats of `Catalog.from_file`

    Returns
    -------
    list of ElementSet
        sets in the order of the file, bad ones with their `problem`

    Raises
    ------
    CatalogError
        if the file cannot be read, or holds no record
    """
    return list(read_file(Path(check_path(path)))[0])


def read_object(path: Path, where: str, name: str | None, norad_id: int | None) -> tuple[ElementSet, ...]:
    """Read the sets of one object of a file, bad ones included. The result is cached while the file does not change.

    Parameters
    ----------
    name : name of the object, in any case; None for any
    norad_id : catalogue number of the object; None for any

    Raises
    ------
    CatalogError
        if the file is invalid, or does not hold exactly one such object
    """
    status = path.stat()
    return _object(path, status.st_mtime_ns, status.st_size, where, name, norad_id)


@functools.lru_cache(maxsize=64)
def _object(
    path: Path, _modified_ns: int, _size: int, where: str, name: str | None, norad_id: int | None
) -> tuple[ElementSet, ...]:
    """Read the sets of one object, cached until the file changes."""
    return tuple(select_object(read_file(path)[0], where, name, norad_id))


def read_file(path: Path) -> tuple[tuple[ElementSet, ...], tuple[str, ...]]:
    """Read the element sets of a file, bad ones included, and a line for each part of it that is not a record.

    The result is cached while the file does not change.
    """
    try:
        status = path.stat()
        if path.is_dir():
            raise CatalogError(f"{path}: is a folder; give the path of a file of element sets")
        return _read(path, status.st_mtime_ns, status.st_size)
    except (OSError, ValueError) as error:
        if isinstance(error, CatalogError):
            raise
        raise CatalogError(explain_unreadable(path, error)) from None


@functools.lru_cache(maxsize=16)
def _read(path: Path, _modified_ns: int, _size: int) -> tuple[tuple[ElementSet, ...], tuple[str, ...]]:
    """Read the sets of a file, and a line for each part of it that is not a record; cached until the file changes.

    Raises
    ------
    CatalogError
        if the file is not UTF-8 text
    """
    content = read_bytes(path, MOST_BYTES, CatalogError, "catalogue")
    if content.startswith((b"\x1f\x8b", b"PK\x03\x04")):
        raise CatalogError(f"{path}: is compressed ({'zip' if content[:1] == b'P' else 'gzip'}); decompress it")
    text = decode_text(content)
    if text is None:
        raise CatalogError(f"{path}: is not UTF-8 text; give a file of two-line element sets")
    sets, junk = parse_element_sets(text, str(path))
    return tuple(sets), tuple(junk)


def parse_element_sets(text: str, where: str) -> Found:
    """Parse the element sets of a text, bad ones included.

    Parameters
    ----------
    text : element sets as TLE, 3LE, or OMM in JSON, CSV, XML or KVN
    where : name of the text, for messages

    Returns
    -------
    sets, junk : the element sets, bad ones with their `problem`, and a line for each part of the text that is no record

    Raises
    ------
    CatalogError
        if the text is empty or holds no record
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")
    start = text.lstrip()
    if not start:
        raise CatalogError(f"{where}: is empty; give a file of two-line element sets")
    first = next((line for line in start.split("\n") if line.strip() and not line.startswith("#")), "")
    if re.match(r"[\[{]\s*[{}\]\"]", start):
        parsed = read_json(text, where)
    elif start.startswith("<") and re.search(r"<(\w+:)?(omm|ndm)\b", start, re.IGNORECASE):
        parsed = read_xml(text, where)
    elif is_csv(first):
        parsed = read_csv(text, where)
    else:
        parsed = read_lines(text.split("\n"), where)
        if not parsed[0]:  # its beginning may be damaged
            parsed = _parse_from_middle(text, where) or parsed
    if not parsed[0]:
        raise _make_refusal(where, start)
    return parsed


def _make_refusal(where: str, text: str) -> CatalogError:
    """Make the error for a text without element sets. It quotes the text, which is often the answer of a server.

    Of a page or message with markup, the words are quoted.
    """
    begin = text[:_QUOTED_FROM]
    if begin.lstrip().startswith("<"):
        words = re.sub(
            r"<!--.*?(?:-->|\Z)|<(script|style)\b.*?(?:</\1\s*>|\Z)", " ", begin, flags=re.DOTALL | re.IGNORECASE
        )
        begin = html.unescape(re.sub(r"<[^>]*(?:>|\Z)", " ", words)).strip() or begin
    quoted = " ".join(make_printable(begin).split())
    if len(quoted) > _MOST_QUOTED:
        quoted = f"{quoted[: _MOST_QUOTED - 3]}..."
    what = f", but '{quoted}'" if quoted else ""
    return CatalogError(
        f"{where}: does not contain a two-line element set or an OMM{what}; fetch it again, or give another file"
    )


def _parse_from_middle(text: str, where: str) -> Found | None:
    """Parse a text whose first line is of no known format."""
    if re.search(r"<(\w+:)?omm\b", text, re.IGNORECASE):
        return read_xml(text, where)
    if any(is_csv(line) for line in text.split("\n")):
        return read_csv(text, where)
    return read_json(text, where) if re.search(r'\{\s*"', text) else None


def parse_lines(lines: Iterable[str], where: str) -> list[ElementSet]:
    """Parse the element sets in lines of text.

    A set is a line "1 ...", a line "2 ..." and an optional name before them (a leading "0 " is dropped). Messages of lines
    KEY = value may occur between sets. Empty lines and lines that begin with # are skipped.

    Raises
    ------
    CatalogError
        if the text contains no element set
    """
    lines = tuple(lines)
    sets, _ = read_lines(lines, where)
    if not sets:
        raise _make_refusal(where, "\n".join(lines))
    return sets


def read_lines(lines: Iterable[str], where: str) -> Found:
    """Parse the element sets in lines of text, with a line for each part of it that is not a record."""
    numbered = [(k, line.rstrip()) for k, line in enumerate(lines, start=1)]
    numbered = [(k, line) for k, line in numbered if line and not line.startswith("#")]
    sets: list[ElementSet] = []
    junk: list[str] = []
    message = KvnCollector(where)
    name: tuple[int, str] | None = None

    def no_name() -> None:
        if name is not None:
            junk.append(
                f"{where}: line {name[0]}: '{make_printable(name[1][:40])}' is not an element line, and no "
                "element line follows it; remove it"
            )

    at = 0
    while at < len(numbered):
        number, line = numbered[at]
        if identify_element_line(line):
            sets += message.end()
            element_set, at = read_set(name[1].removeprefix("0 ").strip() if name else "", at, numbered, where)
            sets.append(element_set)
            name = None
            continue
        at += 1
        ended = message.take(number, line)
        if ended is None:
            sets += message.end()
            no_name()
            name = (number, line.strip())
            if re.fullmatch(r"\s*<[^>]*>\s*", line):  # markup of a web page, not a name
                no_name()
                name = None
        else:
            sets += ended
            no_name()
            name = None
    sets += message.end()
    no_name()
    return sets, junk
