"""Lines of mesh files that are text."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path

from rso_lidar.errors import MeshError

_LONGEST = 1_000_000  # characters of a line: a polygon of 100,000 corners
_LOOKED_AT = 4096  # bytes at the start in which text has no zero byte


def number_lines(path: Path, blob: bytes, *, joined: tuple[bytes, ...] = ()) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text file with their numbers, without its byte order mark.

    Parameters
    ----------
    joined : first words of the lines that go on in the next one where they end in a backslash. A path at the end of a
        comment may end in one, too

    Raises
    ------
    MeshError
        If the file is not UTF-8 or ASCII text, or a line is too long.
    """
    if blob.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in blob[:_LOOKED_AT]:
        raise MeshError(f"{path.name}: is UTF-16 text or no text; save it as UTF-8 or plain ASCII text")
    start, number, held = 3 * blob.startswith(codecs.BOM_UTF8), 0, b""
    blob = blob.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in blob else blob
    while start < len(blob):
        end = blob.find(b"\n", start)
        end = len(blob) if end < 0 else end
        number += 1
        if end - start + len(held) > _LONGEST:
            raise MeshError(f"{path.name}: line {number}: is over {_LONGEST:,} characters long; export it again")
        line = held + blob[start:end]
        start, held = end + 1, b""
        if joined and line.rstrip().endswith(b"\\") and start < len(blob) and line.split(None, 1)[0] in joined:
            held = line.rstrip()[:-1] + b" "
            continue
        yield number, line.decode("utf-8", errors="replace")


def refuse_line(path: Path, number: int, line: str, kind: str) -> MeshError:
    """Return the error for a line that cannot be read."""
    text = line.strip()[:40]
    return MeshError(
        f"{path.name}: line {number} ({text}): cannot be read as {kind}: it is cut short or damaged; export it again"
    )
