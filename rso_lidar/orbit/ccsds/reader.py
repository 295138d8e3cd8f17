"""Readers that recognise the notation of a table from its content: CCSDS keyword = value, CCSDS XML, or CSV."""

from __future__ import annotations

import codecs
import re
import zlib
from pathlib import Path

from rso_lidar import files
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.kvn import read_kvn
from rso_lidar.orbit.ccsds.message import CcsdsMessage
from rso_lidar.orbit.ccsds.xml import read_xml
from rso_lidar.shipped import find


def find_table(file: str) -> tuple[Path, int, int]:
    """Find a file named by a part: in the working folder, then among the shipped data.

    Returns
    -------
    path, modification time [ns] and size [bytes]: the key of a cache of its content

    Raises
    ------
    ScenarioError
        if there is no such file, or it cannot be read
    """
    path = find(file) or files.expand_user(file)
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise ScenarioError(files.explain_unreadable(path, error)) from None
    return path, status.st_mtime_ns, status.st_size


def read_table_text(path: Path) -> str:
    """Read the text of a table: UTF-8, or UTF-16 with its byte-order mark, and either of them compressed by gzip.

    Parameters
    ----------
    path : path of the file

    Returns
    -------
    str
        its text, with line feeds only

    Raises
    ------
    ScenarioError
        if the file cannot be read, is empty, is not text, or is larger than `files.MOST_BYTES` after decompression
    """
    content = files.read_bytes(path, files.MOST_BYTES, ScenarioError, "table (OEM, AEM or CSV)")
    if content.startswith(b"\x1f\x8b"):
        content = _decompress(content, path)
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        text = content.decode("utf-16" if is_wide else "utf-8-sig")
    except UnicodeDecodeError:
        name = "UTF-16" if is_wide else "UTF-8"
        raise ScenarioError(f"{path}: is not {name} text; give the path of an OEM, OPM, AEM, TDM or CSV file") from None
    if "\0" in text:
        raise ScenarioError(
            f"{path}: is not UTF-8 text, it contains NUL characters; save it as UTF-8, or as UTF-16 with its byte-order mark"
        )
    if not text.strip():
        raise ScenarioError(f"{path}: is empty; give a file with at least two rows")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _decompress(content: bytes, path: Path) -> bytes:
    """Decompress gzip, of one or several members, to at most `files.MOST_BYTES`, or raise `ScenarioError`."""
    pieces: list[bytes] = []
    left = files.MOST_BYTES + 1
    while content and left > 0:
        member = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
        try:
            pieces.append(member.decompress(content, left))
        except zlib.error as error:
            raise ScenarioError(f"{path}: is damaged gzip ({error}); copy it again") from None
        left -= len(pieces[-1])
        if left > 0 and not member.eof:
            raise ScenarioError(f"{path}: is gzip that is cut short; copy it again")
        content = member.unused_data.lstrip(b"\0")  # padding of some archives
    if left <= 0:
        limit = files.describe_size(files.MOST_BYTES)
        raise ScenarioError(f"{path}: holds more than {limit} after decompression; give a smaller file")
    return b"".join(pieces)


def is_message(text: str) -> bool:
    """Determine whether a text is meant as a CCSDS message rather than CSV."""
    first = text.lstrip().splitlines()[0]
    return first.startswith(("<", "CCSDS_", "COMMENT")) or "," not in first


def is_message_of(kind: str, text: str) -> bool:
    """Return whether a text is a CCSDS message of a kind, in keyword = value notation or XML.

    Parameters
    ----------
    kind : such as "OEM", "OPM" or "TDM"
    text : the text, or its first lines

    Returns
    -------
    bool
    """
    return f"CCSDS_{kind}_VERS" in text.upper() or re.search(rf"<(\w+:)?{kind}\b", text, re.IGNORECASE) is not None


def read_message(text: str, kind: str, where: str) -> CcsdsMessage:
    """Read a message in keyword = value or XML notation; raise `ScenarioError` if it does not follow the format."""
    if text.lstrip().startswith("<"):
        return _check_message(read_xml(text, kind, where), kind)
    return _check_message(read_kvn(text, kind, where), kind)


def _check_message(message: CcsdsMessage, kind: str) -> CcsdsMessage:
    if not re.fullmatch(r"[123]\.[0-9]+", message.version):
        raise ScenarioError(
            f"{message.where}: CCSDS_{kind}_VERS {message.version} is not supported; write 1.0, 2.0 or 3.0"
        )
    if not message.segments:
        raise ScenarioError(f"{message.where}: has no segment; give META_START ... META_STOP and rows under it")
    return message
