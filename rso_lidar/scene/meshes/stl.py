"""STL files, binary and ASCII."""

from __future__ import annotations

import re
from array import array
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.polygons import MeshPiece, cut_polygons
from rso_lidar.scene.meshes.text_lines import number_lines, refuse_line

_HEAD, _RECORD = 84, 50  # bytes: 80 of header and a count, then normal, corners and two spare bytes for each facet
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
_ASCII = re.compile(rb"(\xef\xbb\xbf)?\s*solid.*?(facet\s+normal|endsolid)", re.DOTALL | re.IGNORECASE)


def read_stl(path: Path, blob: bytes) -> list[MeshPiece]:
    """Read an STL file. Solids of an ASCII file that holds several are parts by their names.

    Returns
    -------
    the triangles of the file, or of each of its solids.

    Raises
    ------
    MeshError
        If the file is cut short, or does not have as many facets as its header states.
    """
    stated = int.from_bytes(blob[80:_HEAD], "little")
    surplus = len(blob) - _HEAD - _RECORD * stated
    if len(blob) < _HEAD or (surplus and (b"\0" not in blob[:1000] or _ASCII.match(blob[:1000]))):
        return _read_ascii(path, blob)
    if blob.startswith((b"\xff\xfe", b"\xfe\xff")) and surplus:
        return _read_ascii(path, blob)  # refused as UTF-16 text
    held = (len(blob) - _HEAD) // _RECORD
    if stated > held:
        raise MeshError(
            f"{path.name}: is cut short: its header promises {stated:,} facets and {held:,} are there; export it again"
        )
    if held > stated:  # fewer bytes behind the last facet are padding or a comment, as other readers take them
        raise MeshError(
            f"{path.name}: its header promises {stated:,} facets, but there is room for {held:,}; export it again"
        )
    corners = np.frombuffer(blob, dtype=_FACET, count=stated, offset=_HEAD)["corners"]
    return [MeshPiece("body", corners.reshape(-1, 3).astype(float), np.arange(3 * stated).reshape(-1, 3))]


def _read_ascii(path: Path, blob: bytes) -> list[MeshPiece]:
    """Read an ASCII STL. A facet of more than three corners is a polygon."""
    points = array("d")
    solids: list[tuple[str, array]] = []
    is_open, corners = False, -1  # whether a solid is open; corners of the open loop, -1 where none is open
    for number, line in number_lines(path, blob):
        words = line.split()
        try:
            while words:
                match words[0].lower():
                    case "solid":
                        if is_open or corners >= 0:
                            raise ValueError
                        is_open = True
                        solids.append(("_".join(words[1:]) or "body", array("q")))
                        words = []
                    case "endsolid":
                        if not is_open or corners >= 0:
                            raise ValueError
                        is_open, words = False, []
                    case "facet":
                        if not is_open or corners >= 0 or words[1].lower() != "normal":
                            raise ValueError
                        if len(words) < 5:
                            raise ValueError
                        words = words[5:]  # the normal is not read: the corners state the plane
                    case "outer":
                        if not is_open or corners >= 0 or words[1].lower() != "loop":
                            raise ValueError
                        corners, words = 0, words[2:]
                    case "vertex":
                        if corners < 0:
                            raise ValueError
                        x, y, z = (float(word) for word in words[1:4])
                        points.extend((x, y, z))
                        corners, words = corners + 1, words[4:]
                    case "endloop":
                        if corners < 3:
                            raise ValueError
                        solids[-1][1].append(corners)
                        corners, words = -1, words[1:]
                    case "endfacet":
                        if corners >= 0:
                            raise ValueError
                        words = words[1:]
                    case _:
                        raise ValueError
        except (ValueError, IndexError):
            if not solids:
                raise MeshError(
                    f"{path.name}: is neither ASCII STL, which begins with 'solid', nor binary STL; export it again"
                ) from None
            raise refuse_line(path, number, line, "STL") from None
    if is_open or not solids:
        raise MeshError(f"{path.name}: has no 'endsolid' at its end, so it is cut short; export it again")
    is_one = len({name for name, _ in solids}) == 1
    vertices = np.array(points, dtype=float).reshape(-1, 3)
    pieces, first = [], 0
    for name, counts in solids:
        sizes = np.array(counts, dtype=np.int64)
        own = vertices[first : first + int(sizes.sum())]
        facets = cut_polygons(path.name, own, np.arange(len(own)), sizes)
        pieces.append(MeshPiece("body" if is_one else name, own, facets))
        first += len(own)
    return pieces
