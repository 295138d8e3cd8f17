"""CCSDS navigation messages in XML (505.0-B), read to the same `Message` as their keyword = value notation."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any
from xml.parsers import expat

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.message import Entry, Message, Segment

# Leaves of a data row, in the order of the cells in keyword = value notation.
_ROWS = {
    "stateVector": ("EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"),
    "attitudeState": ("EPOCH", "Q1", "Q2", "Q3", "QC"),
}
_ACCELERATION = ("X_DDOT", "Y_DDOT", "Z_DDOT")
_SKIPPED = ("COMMENT", "covarianceMatrix", "USER_DEFINED")
_LENGTHS = {"km", "km/s", "km/s**2", ""}  # of an OEM; quaternions have none


def read_xml(text: str, kind: str, where: str) -> Message:
    """Read a message in XML. A document type declaration, which could define entities, is refused.

    Parameters
    ----------
    text : content of the file
    kind : "OEM" or "AEM"
    where : name of the file, for messages

    Returns
    -------
    the message

    Raises
    ------
    ScenarioError
        if the text does not follow the format; the message names the line
    """
    reader = _Reader(kind, where)
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
    if not reader.message.version:
        raise ScenarioError(f"{where}: does not contain <{kind.lower()}>: give a file with an {kind}")
    return reader.message


class _Reader:
    """Callbacks of expat. They keep the path of open elements and the words of the open leaf."""

    def __init__(self, kind: str, where: str) -> None:
        self.kind, self.where = kind, where
        self.message = Message(where, "", {}, [])
        self.parser: Any = None
        self.path: list[str] = []
        self.words: list[str] = []
        self.row: dict[str, str] | None = None
        self.row_line = 0

    def doctype(self, *_: Any) -> None:
        raise ScenarioError(f"{self.where}: has a DOCTYPE, which these messages must not have: remove it")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.path.append(tag)
        self.words = []
        if tag == self.kind.lower():
            if self.message.version:
                raise ScenarioError(f"{self.where}: holds several <{tag}>: split it into files of one each")
            self.message.version = attributes.get("version", "(none)")
        elif self.kind.lower() not in self.path:
            return
        elif tag == "segment":
            self.message.segments.append(Segment(self.parser.CurrentLineNumber))
        elif tag in _ROWS and self.message.segments:
            self.row, self.row_line = {}, self.parser.CurrentLineNumber
        elif self.row is not None and attributes.get("units", "") not in _LENGTHS:
            raise ScenarioError(
                f"{self.where}: line {self.parser.CurrentLineNumber}: {tag} in {attributes['units']}: write km and km/s"
            )

    def text(self, data: str) -> None:
        self.words.append(data)

    def end(self, tag: str) -> None:
        self.path.pop()
        value, line = " ".join("".join(self.words).split()), self.parser.CurrentLineNumber
        self.words = []
        if tag in _SKIPPED or any(tag in _SKIPPED for tag in self.path):
            return
        if tag in _ROWS and self.row is not None:
            self.message.segments[-1].rows.append((self.row_line, self.cells(tag, self.row)))
            if "QC" in self.row:
                self.message.segments[-1].meta["QUATERNION_TYPE"] = Entry("LAST", self.row_line)
            self.row = None
        elif self.row is not None and value:
            self.check_unique(tag, self.row, line)
            self.row[tag] = value
        elif "metadata" in self.path and value and self.message.segments:
            self.check_unique(tag, self.message.segments[-1].meta, line)
            self.message.segments[-1].meta[tag] = Entry(value, line)
        elif "header" in self.path and value:
            self.check_unique(tag, self.message.header, line)
            self.message.header[tag] = Entry(value, line)

    def check_unique(self, tag: str, known: Collection[str], line: int) -> None:
        """Check that a leaf occurs once.

        Parameters
        ----------
        tag : name of the leaf
        known : names that have occurred
        line : its line in the file

        Raises
        ------
        ScenarioError
            if it has occurred before
        """
        if tag in known:
            raise ScenarioError(f"{self.where}: line {line}: {tag} is given twice: remove one")

    def cells(self, tag: str, row: dict[str, str]) -> list[str]:
        """Return the cells of a row.

        A state vector that lacks a component is refused, because the next component would take its place.
        """
        names = _ROWS[tag]
        if tag == "stateVector":
            names += _ACCELERATION if any(name in row for name in _ACCELERATION) else ()
            lacking = [name for name in names if name not in row]
            if lacking:
                raise ScenarioError(
                    f"{self.where}: line {self.row_line}: the {tag} lacks {', '.join(lacking)}: "
                    f"give all of {', '.join(names)}"
                )
        return [row[name] for name in names if name in row]
