"""Keywords of a conjunction data message (CCSDS 508.0-B), read from keyword = value text or XML, each with its line.

The text has no blocks: the keyword OBJECT begins the part of each of the two objects.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.message import Entry

_KEYWORD = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*?)\s*(?:\[([^\]]*)\])?", re.ASCII)
_RADIUS = re.compile(r"COMMENT\s+HBR\s*=\s*(\S+)\s*(?:\[([^\]]*)\])?", re.ASCII)


@dataclass(frozen=True)
class StatedValue(Entry):
    """An entry with the unit that the file states for it; empty where it states none."""

    unit: str = ""


@dataclass
class ConjunctionKeywords:
    """Keywords of a message: those of the conjunction, and those of each object; `where` names the source."""

    where: str
    version: str = ""
    common: dict[str, StatedValue] = field(default_factory=dict)
    objects: list[dict[str, StatedValue]] = field(default_factory=list)

    def add(self, key: str, entry: StatedValue) -> None:
        """Add a keyword to the open part.

        Raises
        ------
        ScenarioError
            if it is there already, or begins a third object
        """
        if key == "OBJECT":
            if entry.value.upper() != f"OBJECT{len(self.objects) + 1}":
                raise ScenarioError(
                    f"{self.where}: line {entry.line}: OBJECT {entry.value:.20}: a message has OBJECT1 and then OBJECT2"
                )
            if len(self.objects) == 2:
                raise ScenarioError(f"{self.where}: line {entry.line}: a third object: a message has two")
            self.objects.append({})
        into = self.objects[-1] if self.objects else self.common
        if key in into:
            raise ScenarioError(f"{self.where}: line {entry.line}: {key} is given twice: remove one")
        into[key] = entry


def read_conjunction_keywords(text: str, where: str) -> ConjunctionKeywords:
    """Read the keywords of a conjunction data message in either notation.

    Parameters
    ----------
    text : content of the file
    where : name of the file, for messages

    Returns
    -------
    ConjunctionKeywords

    Raises
    ------
    ScenarioError
        if the text does not follow the format, or does not hold two objects
    """
    known = _read_xml(text, where) if text.lstrip().startswith("<") else _read_text(text, where)
    if not re.fullmatch(r"[12]\.[0-9]+", known.version):
        raise ScenarioError(f"{where}: CCSDS_CDM_VERS {known.version} is not supported: write 1.0 or 2.0")
    if len(known.objects) != 2:
        raise ScenarioError(f"{where}: holds {len(known.objects)} of the two objects: give OBJECT1 and OBJECT2")
    return known


def _read_text(text: str, where: str) -> ConjunctionKeywords:
    known = ConjunctionKeywords(where)
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        radius = _RADIUS.fullmatch(line)
        if radius is not None and known.version:  # CARA's way to state the hard-body radius
            known.common.setdefault("HBR", StatedValue(radius[1], number, (radius[2] or "").strip()))
        if not line or line.split()[0] == "COMMENT":
            continue
        match = _KEYWORD.fullmatch(line)
        if match is None:
            raise ScenarioError(f"{where}: line {number}: '{line:.40}' is not KEYWORD = value: correct the line")
        if not known.version:
            if match[1] != "CCSDS_CDM_VERS":
                raise ScenarioError(
                    f"{where}: line {number}: begins with '{line:.40}': a CDM begins with CCSDS_CDM_VERS = ..."
                )
            known.version = match[2] or "(none)"
        elif match[2]:
            known.add(match[1], StatedValue(match[2], number, (match[3] or "").strip()))
    if not known.version:
        raise ScenarioError(f"{where}: is empty: give a CDM, which begins with CCSDS_CDM_VERS = ...")
    return known


def _read_xml(text: str, where: str) -> ConjunctionKeywords:
    reader = _XmlReader(where)
    parser = expat.ParserCreate()
    reader.parser = parser
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.doctype
    try:
        parser.Parse(text.strip().encode(), True)
    except expat.ExpatError as error:
        what = expat.ErrorString(error.code)
        raise ScenarioError(f"{where}: line {error.lineno}: is not well-formed XML ({what}): correct it") from None
    if not reader.known.version:
        raise ScenarioError(f"{where}: does not contain <cdm>: give a file with a CDM")
    return reader.known


class _XmlReader:
    """Callbacks of expat, which keep the words of the open leaf."""

    def __init__(self, where: str) -> None:
        self.known = ConjunctionKeywords(where)
        self.parser: Any = None
        self.inside = False
        self.words: list[str] = []
        self.unit = ""

    def doctype(self, *_: Any) -> None:
        raise ScenarioError(f"{self.known.where}: has a DOCTYPE, which these messages must not have: remove it")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "cdm":
            if self.known.version:
                raise ScenarioError(f"{self.known.where}: holds several <cdm>: split it into files of one each")
            self.inside, self.known.version = True, attributes.get("version", "(none)")
        self.words, self.unit = [], attributes.get("units", "").strip()

    def text(self, data: str) -> None:
        self.words.append(data)

    def end(self, tag: str) -> None:
        value = " ".join("".join(self.words).split())
        self.words = []
        if tag == "cdm":
            self.inside = False
        elif self.inside and value and tag == tag.upper() and tag != "COMMENT":
            self.known.add(tag, StatedValue(value, self.parser.CurrentLineNumber, self.unit))
