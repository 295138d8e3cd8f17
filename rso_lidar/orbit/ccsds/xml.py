"""CCSDS navigation messages in XML (505.0-B), read to the same `CcsdsMessage` as their keyword = value notation."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol
from xml.parsers import expat

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.message import CcsdsMessage, CcsdsSegment, Entry, parse_sigma

# Leaves of a data row that are read, in the order of the cells in keyword = value notation, and units they may state.
_ROWS = {
    "stateVector": ("EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"),
    "attitudeState": ("EPOCH", "Q1", "Q2", "Q3", "QC"),
    "observation": ("EPOCH",),  # and one leaf of any name
}
_UNITS = {
    "stateVector": dict.fromkeys(("X", "Y", "Z"), "km") | dict.fromkeys(("X_DOT", "Y_DOT", "Z_DOT"), "km/s"),
    "attitudeState": dict.fromkeys(("Q1", "Q2", "Q3", "QC"), ""),
    "observation": {},
}
_COVARIANCE = "covarianceMatrix"
_SKIPPED = ("COMMENT", "USER_DEFINED")


class Elements(Protocol):
    """Receiver of the elements within one message, each by its local name."""

    def begin(self, tag: str, line: int) -> None:
        """Take the begin of an element."""
        ...

    def end(self, tag: str, value: str, unit: str, line: int) -> None:
        """Take the end of an element.

        Parameters
        ----------
        tag, value : its name, and its text since the last begin or end
        unit : attribute units; empty without one
        line : its line in the file
        """
        ...


def walk_message(text: str, kind: str, where: str, elements: Elements) -> str:
    """Walk through the elements of the one message of a kind, and return the version of its format.

    Prefixes of namespaces are dropped, and other messages in a combined `ndm` are skipped. A document type declaration,
    which could define entities, is refused.

    Raises
    ------
    ScenarioError
        if the text is not well-formed, or does not hold exactly one such message
    """
    walker = _Walker(kind, where, elements)
    parser = expat.ParserCreate("UTF-8")  # the text has been decoded, whatever its declaration states
    walker.parser = parser
    parser.StartElementHandler = walker.start
    parser.EndElementHandler = walker.end
    parser.CharacterDataHandler = walker.text
    parser.StartDoctypeDeclHandler = walker.doctype
    try:
        parser.Parse(text.strip().encode(), True)
    except expat.ExpatError as error:
        what = expat.ErrorString(error.code)
        raise ScenarioError(f"{where}: line {error.lineno}: is not well-formed XML ({what}); correct it") from None
    if not walker.version:
        raise ScenarioError(f"{where}: does not contain <{kind.lower()}>; give a file with one {kind}")
    return walker.version


class _Walker:
    """Callbacks of expat. They keep the depth inside the message, and the words and unit of the open leaf."""

    def __init__(self, kind: str, where: str, elements: Elements) -> None:
        """Begin outside the message."""
        self.kind, self.tag, self.where, self.elements = kind, kind.lower(), where, elements
        self.parser: Any = None
        self.version = ""
        self.depth = 0  # of open elements from that of the message on; 0 outside
        self.words: list[str] = []
        self.unit = ""

    def doctype(self, root: str, *_: Any) -> None:
        if root.lower() == "html":
            raise ScenarioError(f"{self.where}: is a web page (HTML) and no {self.kind}; fetch the file again")
        raise ScenarioError(f"{self.where}: has a DOCTYPE, which these messages must not have; remove it")

    def start(self, name: str, attributes: dict[str, str]) -> None:
        tag = name.rpartition(":")[2]
        self.words, self.unit = [], attributes.get("units", "").strip()
        if self.depth:
            self.depth += 1
            self.elements.begin(tag, self.parser.CurrentLineNumber)
        elif tag == self.tag:
            if self.version:
                raise ScenarioError(f"{self.where}: holds several <{tag}>; split it into files of one each")
            self.depth, self.version = 1, attributes.get("version", "(none)")

    def text(self, data: str) -> None:
        self.words.append(data)

    def end(self, name: str) -> None:
        value, self.words = " ".join("".join(self.words).split()), []
        if self.depth > 1:
            self.elements.end(name.rpartition(":")[2], value, self.unit, self.parser.CurrentLineNumber)
        self.depth = max(self.depth - 1, 0)


def read_xml(text: str, kind: str, where: str) -> CcsdsMessage:
    """Read a message of rows in XML; a `ScenarioError` names the line that does not follow the format."""
    rows = _RowReceiver(where)
    rows.message.version = walk_message(text, kind, where, rows)
    return rows.message


class _RowReceiver:
    """Receiver that keeps metadata and rows, and the path of open elements."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.message = CcsdsMessage(where, "", {}, [])
        self.path: list[str] = []
        self.row: dict[str, str] | None = None
        self.row_line = 0
        self.row_tag = ""

    def begin(self, tag: str, line: int) -> None:
        self.path.append(tag)
        if tag == "segment":
            self.message.segments.append(CcsdsSegment(line))
        elif tag in _ROWS and self.message.segments:
            self.row, self.row_line, self.row_tag = {}, line, tag

    def end(self, tag: str, value: str, unit: str, line: int) -> None:
        self.path.pop()
        note = parse_sigma(value) if tag == "COMMENT" and self.message.segments else None
        if note is not None:
            self.message.segments[-1].meta.setdefault(note[0], Entry(note[1], line))
        if tag in _SKIPPED or any(open_tag in _SKIPPED for open_tag in self.path):
            return
        if self.row is not None and tag == self.row_tag:
            self.message.segments[-1].rows.append((self.row_line, self.cells(self.row)))
            if "QC" in self.row:
                self.message.segments[-1].meta["QUATERNION_TYPE"] = Entry("LAST", self.row_line)
            self.row = None
        elif _COVARIANCE in self.path:
            if value and self.message.segments:
                stated = f" [{unit}]" if unit else ""
                self.message.segments[-1].covariances.append((line, f"{tag} = {value}{stated}"))
        elif self.row is not None and value:
            if tag in _ROWS[self.row_tag] or self.row_tag == "observation":
                self.check_unique(tag, self.row, line)
                expected = _UNITS[self.row_tag].get(tag, unit)
                if unit.lower() not in ("", expected):
                    cure = f"write {expected}" if expected else "leave the unit out"
                    raise ScenarioError(f"{self.where}: line {line}: {tag} in {unit}; {cure}")
                self.row[tag] = value
        elif "metadata" in self.path and value and self.message.segments:
            self.check_unique(tag, self.message.segments[-1].meta, line)
            self.message.segments[-1].meta[tag] = Entry(value, line)
        elif "header" in self.path and value:
            self.message.header.setdefault(tag, Entry(value, line))

    def check_unique(self, tag: str, known: Collection[str], line: int) -> None:
        """Raise `ScenarioError` if a leaf is among the names that have occurred."""
        if tag in known:
            raise ScenarioError(f"{self.where}: line {line}: {tag} is given twice; remove one")

    def cells(self, row: dict[str, str]) -> list[str]:
        """Return the cells of a row.

        A state vector that lacks a component is refused, because the next component would take its place.
        """
        names = _ROWS[self.row_tag]
        if self.row_tag == "observation":
            return [*(word for key in row if key != "EPOCH" for word in (key, row.get("EPOCH", ""), row[key]))]
        lacking = [name for name in names if name not in row]
        if self.row_tag == "stateVector" and lacking:
            raise ScenarioError(
                f"{self.where}: line {self.row_line}: the {self.row_tag} lacks {', '.join(lacking)}; "
                f"give all of {', '.join(names)}"
            )
        return [row[name] for name in names if name in row]
