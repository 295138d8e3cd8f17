"""OFF files: polygons as text."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.polygons import MeshPiece, cut_polygons
from rso_lidar.scene.meshes.text_lines import number_lines, refuse_line

# With texture, colours or normals, which come after the position and are ignored.
_KEYWORD = re.compile(r"(ST)?(C)?(N)?OFF")


def read_off(path: Path, blob: bytes) -> list[MeshPiece]:
    """Read an OFF file.

    Raises
    ------
    MeshError
        If the file is binary, not in three dimensions, damaged, or shorter than its header states.
    """
    rows = _rows(path, blob)
    number, line, words = next(rows, (1, "", [""]))
    try:
        if not words[0].lstrip("+").isdigit():  # the keyword may be absent
            if not _KEYWORD.fullmatch(words[0]) or words[1:2] == ["BINARY"]:
                raise MeshError(
                    f"{path.name}: does not begin with OFF, or is binary or not in three dimensions, which is not read; "
                    "export it as OFF text"
                )
            words = words[1:]
            if not words:
                number, line, words = next(rows)
        vertices, faces = int(words[0]), int(words[1])
        if vertices < 0 or faces < 0:
            raise ValueError
        points, corners, sizes = array("d"), array("q"), array("q")
        for number, line, words in rows:  # noqa: B007, the error below names the line
            if len(points) < 3 * vertices:
                x, y, z = (float(word) for word in words[:3])
                points.extend((x, y, z))
                continue
            if len(sizes) == faces:
                break
            size = int(words[0])
            own = [int(word) for word in words[1 : 1 + size]]
            if len(own) != size or min(own, default=0) < 0:
                raise ValueError
            corners.extend(own)
            sizes.append(size)
    except MeshError:
        raise
    except StopIteration:
        raise MeshError(f"{path.name}: ends after its first line; export it again") from None
    except (ValueError, IndexError, OverflowError):
        raise refuse_line(path, number, line, "OFF") from None
    if len(points) < 3 * vertices or len(sizes) < faces:
        raise MeshError(
            f"{path.name}: has {len(sizes):,} of the {faces:,} facets that its header states; export it again"
        )
    whole = np.array(points, dtype=float).reshape(-1, 3)
    facets = cut_polygons(path.name, whole, np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64))
    return [MeshPiece("body", whole, facets)]


def _rows(path: Path, blob: bytes) -> Iterator[tuple[int, str, list[str]]]:
    """Yield number, text and words of each line that has words outside comments."""
    for number, line in number_lines(path, blob):
        words = line.partition("#")[0].split()
        if words:
            yield number, line, words
