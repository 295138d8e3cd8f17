"""Orbit mean-elements messages (CCSDS 502.0-B-3) as text: JSON, CSV, XML and KVN, read record by record.

Each reader returns the element sets, bad ones with their `problem`, and one line for each part of the text that is not a
record.
"""

from __future__ import annotations

import csv
import datetime
import io
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any
from xml.sax.saxutils import escape

from rso_lidar.errors import CatalogError, make_printable
from rso_lidar.orbit.sets.element_set import KEYS, KNOWN, REQUIRED, ElementSet, element_set_from_omm

Found = tuple[list[ElementSet], list[str]]

_OBJECT = re.compile(r"\{[^{}]*(\})?")
_KVN_LINE = re.compile(r"\s*([A-Za-z][A-Za-z0-9_]*)\s*=\s*(.*?)\s*")
_UNIT = re.compile(r"(.*?)\s*\[(.*)\]")
_TEXTS = ("OBJECT_NAME", "OBJECT_ID")  # texts, which may end in brackets
# Units of the standard (tables 4-3 and 7.7), the only ones that a number may have, in any case.
_UNITS = {
    "MEAN_MOTION": ("rev/day",),
    "INCLINATION": ("deg",),
    "RA_OF_ASC_NODE": ("deg",),
    "ARG_OF_PERICENTER": ("deg",),
    "MEAN_ANOMALY": ("deg",),
    "BSTAR": ("1/ER", "1/[Earth radii]"),
    "BTERM": ("m**2/kg",),
    "MEAN_MOTION_DOT": ("rev/day**2",),
    "MEAN_MOTION_DDOT": ("rev/day**3",),
}
_FIRST_KEY = "CCSDS_OMM_VERS"
_VERSION = "3.0"  # of CCSDS 502.0-B-3
# Keys of the metadata, and of the two blocks of data (CCSDS 502.0-B-3, tables 4-2 and 4-3).
_METADATA = ("OBJECT_NAME", "OBJECT_ID")
_MEAN_ELEMENTS = KEYS[KEYS.index("EPOCH") : KEYS.index("MEAN_ANOMALY") + 1]
_TLE_PARAMETERS = KEYS[KEYS.index("EPHEMERIS_TYPE") :]
_FIXED = {"CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC", "MEAN_ELEMENT_THEORY": "SGP4"}
_TWICE = "' is given twice"


def read_json(text: str, where: str) -> Found:
    """Read JSON: one object or a list of objects, or the intact objects of a damaged file."""
    try:
        tree = json.loads(text, object_pairs_hook=_mark_duplicate_keys)
    except (ValueError, RecursionError):
        return _salvage_json(text, where)
    if isinstance(tree, dict) and "EPOCH" not in tree and len(tree) <= 2:
        tree = next((value for value in tree.values() if isinstance(value, list)), tree)  # {"data": [...]}
    records = tree if isinstance(tree, list) else [tree]
    sets, junk = [], []
    for k, record in enumerate(records, start=1):
        place = f"{where}: record {k}"
        if isinstance(record, dict) and KNOWN.intersection(record):
            sets.append(_set_from_json(record, place))
        else:
            junk.append(f"{place}: is not an object with the keys of an OMM; remove it")
    return sets, junk


def _mark_duplicate_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object with its keys in capitals; a key that occurs twice is named under '!'."""
    record = {key.upper(): value for key, value in pairs}
    if len(record) < len(pairs):
        keys = [key.upper() for key, _ in pairs]
        seen: set[str] = set()
        record["!"] = next(key for key in keys if key in seen or seen.add(key))  # type: ignore[func-returns-value]
    return record


def _set_from_json(record: dict[str, Any], place: str) -> ElementSet:
    twice = record.get("!")
    return element_set_from_omm(record, place, f"key '{twice}{_TWICE}" if twice else None)


def _salvage_json(text: str, where: str) -> Found:
    """Read the intact flat objects of damaged JSON, with a line for each part that is none."""
    sets: list[ElementSet] = []
    junk: list[str] = []
    end, line, counted = 0, 1, 0
    for match in _OBJECT.finditer(text):
        between = text[end : match.start()].strip(" \t\r\n,[]")
        line += text.count("\n", counted, match.start())
        counted, end = match.start(), match.end()
        place = f"{where}: line {line}"
        if between:
            junk.append(f"{place}: '{_shorten(between)}' before it is not JSON; remove it")
        if not any(f'"{key}"' in match[0].upper() for key in KNOWN):
            junk.append(f"{place}: '{_shorten(match[0])}' has no key of an OMM; remove it")
            continue
        try:
            if not match[1]:
                raise ValueError("no end")
            record = json.loads(match[0], object_pairs_hook=_mark_duplicate_keys)
        except ValueError as error:
            what = "is cut off" if not match[1] else f"is not JSON ({_shorten(getattr(error, 'msg', str(error)))})"
            name = re.search(r'"OBJECT_NAME"\s*:\s*"([^"]*)"', match[0], re.IGNORECASE)
            number = re.search(r'"NORAD_CAT_ID"\s*:\s*"?(\d{1,9})\b', match[0], re.IGNORECASE)
            problem = f"{place}: this record {what}; fetch it again"
            sets.append(
                ElementSet(name[1] if name else "", int(number[1]) if number else 0, where=place, problem=problem)
            )
            continue
        sets.append(_set_from_json(record, place))
    after = text[end:].strip(" \t\r\n,[]}")
    if after:
        junk.append(f"{where}: line {text.count(chr(10), 0, end) + 1}: '{_shorten(after)}' is not JSON; remove it")
    return sets, junk


def is_csv(line: str) -> bool:
    """Determine whether a line is the header of a table of OMM."""
    return len(KNOWN.intersection(cell.strip(' "').upper() for cell in line.split(","))) >= 3


def read_csv(text: str, where: str) -> Found:
    """Read a table: a header line with the keys of an OMM, and a line for each record."""
    sets: list[ElementSet] = []
    junk: list[str] = []
    header: list[str] = []
    for number, line in enumerate(text.split("\n"), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        place = f"{where}: line {number}"
        # Line by line, so that an unclosed quote spoils only its own record.
        try:
            cells = next(csv.reader([line]))
        except csv.Error as error:
            sets.append(_make_broken(place, f"cannot be read as CSV ({error})"))
            continue
        if is_csv(line):  # header of this table, or of another one appended to it
            header = [cell.strip().upper() for cell in cells]
            _check_header(place, header)
        elif len(cells) != len(header):
            sets.append(
                _make_broken(
                    place, f"has {len(cells)} cells, the header {len(header)}", dict(zip(header, cells, strict=False))
                )
            )
        else:
            sets.append(element_set_from_omm(dict(zip(header, cells, strict=True)), place))
    return sets, junk


def _check_header(place: str, header: list[str]) -> None:
    twice = next((name for name in header if name in KNOWN and header.count(name) > 1), None)
    if twice:
        raise CatalogError(f"{place}: column '{twice}{_TWICE}; remove one")
    missing = [name for name in REQUIRED if name not in header and not (name == "BSTAR" and "BTERM" in header)]
    if missing:
        raise CatalogError(f"{place}: column {', '.join(missing)} is missing; an OMM needs {', '.join(REQUIRED)}")


def _make_broken(place: str, what: str, fields: dict[str, str] | None = None) -> ElementSet:
    """Make a bad element set that states its problem, and the fields that could be read."""
    fields = fields or {}
    number = fields.get("NORAD_CAT_ID", "").strip()
    identity = int(number) if number.isascii() and number.isdigit() and len(number) < 10 else 0
    name = fields.get("OBJECT_NAME", "").strip()
    return ElementSet(name, identity, where=place, problem=f"{place}: {what}; correct the record, or fetch it again")


def read_xml(text: str, where: str) -> Found:
    """Read XML: one `omm`, or several in an `ndm`."""
    import xml.etree.ElementTree as ET

    if re.search(r"<!\s*(?:DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise CatalogError(f"{where}: declares a DOCTYPE or entities, which an OMM does not need; remove them")
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError, RecursionError) as error:
        return _salvage_xml(text, where, str(error))
    return [_set_from_xml(leaves, f"{where}: record {k}") for k, leaves in enumerate(_find_messages(root), start=1)], []


def _find_messages(root: Any) -> list[list[Any]]:
    """Return the nodes within each `omm`, without those of an `omm` nested in it."""
    messages: list[list[Any]] = []
    ahead: list[tuple[Any, list[Any]]] = [(root, [])]
    while ahead:
        node, within = ahead.pop()
        if _local_name(node.tag) == "OMM":
            within = []
            messages.append(within)
        within.append(node)
        ahead += [(child, within) for child in reversed(node)]
    return messages


def _salvage_xml(text: str, where: str, error: str) -> Found:
    """Read the intact messages of damaged XML, and a line for each damaged part."""
    import xml.etree.ElementTree as ET

    sets: list[ElementSet] = []
    starts = [match.start() for match in re.finditer(r"<(?:\w+:)?omm\b", text, re.IGNORECASE)]
    line, counted = 1, 0
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        line, counted = line + text.count("\n", counted, start), start
        place = f"{where}: line {line}"
        piece = re.match(r"<(\w+:)?omm\b.*?</(?:\w+:)?omm\s*>", text[start:end], re.IGNORECASE | re.DOTALL)
        if piece is None:
            sets.append(_make_broken(place, "this message is cut off", _find_identity(text[start:end])))
            continue
        try:
            node = ET.fromstring(re.sub(r"(</?)\w+:", r"\1", piece[0]))
        except ET.ParseError as wrong:
            sets.append(_make_broken(place, f"this message is not XML ({wrong})", _find_identity(piece[0])))
            continue
        sets.append(_set_from_xml(next(iter(_find_messages(node)), []), place))
    junk = [] if any(entry.problem for entry in sets) else [f"{where}: is not complete XML ({error}); fetch it again"]
    return sets, junk


def _find_identity(text: str) -> dict[str, str]:
    return dict(re.findall(r"<(OBJECT_NAME|NORAD_CAT_ID)[^>]*>([^<]*)<", text))


def _set_from_xml(nodes: list[Any], place: str) -> ElementSet:
    fields: dict[str, str] = {}
    wrong: str | None = None
    for leaf in nodes:
        key = _local_name(leaf.tag)
        if key in KNOWN:
            wrong = wrong or (f"key '{key}{_TWICE}" if key in fields else _check_unit(key, leaf.get("units")))
            fields.setdefault(key, (leaf.text or "").strip())
    return element_set_from_omm(fields, place, wrong)


def _check_unit(key: str, unit: str | None) -> str | None:
    """Describe a unit that is not the standard's; None if it is."""
    allowed = _UNITS.get(key, ())
    if unit is None or "".join(unit.split()).casefold() in {"".join(known.split()).casefold() for known in allowed}:
        return None
    return f"{key} is in [{_shorten(unit)}], which must be {f'[{allowed[0]}]' if allowed else 'without a unit'}"


def _local_name(tag: Any) -> str:
    return str(tag).rpartition("}")[2].upper()


class KvnCollector:
    """Collects messages of lines `KEY = value` from a file that may hold other content between them."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._fields: dict[str, str] = {}
        self._place, self._wrong = "", ""

    def take(self, number: int, line: str) -> Iterator[ElementSet] | None:
        """Take a line, and return the messages that end with it; None if the line belongs to no message."""
        match = _KVN_LINE.fullmatch(line)
        key = match[1].upper() if match else ""
        if self._fields and (not line.strip() or line.lstrip().upper().startswith("COMMENT")):
            return iter(())
        if not match or not (self._fields or key in KNOWN or key == _FIRST_KEY):
            return None
        # A message begins with its version or, without one, with the key that began the message before.
        ended = list(self.end()) if key == _FIRST_KEY or key == next(iter(self._fields), None) else []
        if not self._fields:
            self._place, self._wrong = f"{self._where}: line {number}", ""
        elif key in self._fields and key in KNOWN:
            self._wrong = self._wrong or f"key '{key}{_TWICE}, again in line {number}"
        value, unit = match[2], None if key in _TEXTS else _UNIT.fullmatch(match[2])
        if unit and key in KNOWN:
            value, self._wrong = unit[1], self._wrong or _check_unit(key, unit[2]) or ""
        self._fields.setdefault(key, value)
        return iter(ended)

    def end(self) -> Iterator[ElementSet]:
        """Return the message that is open, if any."""
        if self._fields:
            yield element_set_from_omm(self._fields, self._place, self._wrong or None)
        self._fields = {}


def format_json(sets: Iterable[ElementSet]) -> str:
    """Format element sets as a list of OMM in JSON."""
    return "[" + ",\n".join(json.dumps(entry.omm()) for entry in sets) + "]\n"


def format_csv(sets: Sequence[ElementSet]) -> str:
    """Format element sets as a table of OMM. Texts are quoted if a name begins with #, which would read as a comment."""
    table = io.StringIO()
    remark = any(entry.name.startswith("#") for entry in sets)
    quoting = csv.QUOTE_NONNUMERIC if remark else csv.QUOTE_MINIMAL
    rows = csv.writer(table, lineterminator="\n", quoting=quoting)  # type: ignore[arg-type]
    rows.writerow(KEYS)
    rows.writerows(entry.omm().values() for entry in sets)
    return table.getvalue()


def format_kvn(sets: Iterable[ElementSet]) -> str:
    """Format element sets as messages of lines KEY = value, one after the other."""
    return "\n".join(
        "\n".join(
            f"{key} = {value}"
            for block in _format_blocks(entry.omm())
            for pairs in block
            for key, value in pairs.items()
        )
        + "\n"
        for entry in sets
    )


def format_xml(sets: Iterable[ElementSet]) -> str:
    """Format element sets as one `ndm` of several `omm` (CCSDS 505.0-B)."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<ndm>"]
    for entry in sets:
        (_, header), (metadata,), (elements, parameters) = _format_blocks(entry.omm())
        lines += [
            f'<omm id="{_FIRST_KEY}" version="{_VERSION}">',
            f"<header>{_format_leaves(header)}</header>",
            f"<body><segment><metadata>{_format_leaves(metadata)}</metadata>",
            f"<data><meanElements>{_format_leaves(elements)}</meanElements>",
            f"<tleParameters>{_format_leaves(parameters)}</tleParameters></data></segment></body>",
            "</omm>",
        ]
    return "\n".join([*lines, "</ndm>"]) + "\n"


def _format_leaves(pairs: dict[str, Any]) -> str:
    return "".join(f"<{key}>{escape(str(value))}</{key}>" for key, value in pairs.items())


def _format_blocks(fields: dict[str, str | int | float]) -> tuple[tuple[dict[str, Any], ...], ...]:
    """Return version and header, metadata, and the two blocks of data of a message."""
    created = f"{datetime.datetime.now(datetime.UTC):%Y-%m-%dT%H:%M:%S}"
    header = {"CREATION_DATE": created, "ORIGINATOR": "RSO_LIDAR"}
    elements = {key: fields[key] for key in _MEAN_ELEMENTS}
    parameters = {key: fields[key] for key in _TLE_PARAMETERS}
    metadata = {key: fields[key] for key in _METADATA} | _FIXED
    return ({_FIRST_KEY: _VERSION}, header), (metadata,), (elements, parameters)


def _shorten(text: str) -> str:
    text = make_printable(" ".join(text.split()))
    return text if len(text) <= 40 else f"{text[:37]}..."
