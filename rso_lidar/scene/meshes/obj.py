"""OBJ files: triangles in the order of the file, by group."""

from array import array
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError

_LONGEST = 1_000_000  # characters of a line: a polygon of 100,000 corners


def read_obj(path: Path, blob: bytes, most_parts: int) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Read the groups of an OBJ file.

    A polygon becomes a fan of triangles, numbered one by one. Textures, normals, smoothing groups and materials do not
    bear on range and intensity, and are ignored.

    Parameters
    ----------
    path : name of the file, for messages.
    blob : its contents.
    most_parts : the greatest number of groups.

    Returns
    -------
    Name, vertices (vertex, xyz) and facets (facet, 3) of each run of facets under one group or object.

    Raises
    ------
    MeshError
        If a line cannot be read, or there are too many groups.
    """
    vertices = array("d")
    runs: list[tuple[str, array]] = []
    names: set[str] = set()
    name = "body"
    for number, line in _lines(path, blob):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                x, y, z = (float(word) for word in words[1:4])
                vertices.extend((x, y, z))
            elif words[0] in ("g", "o"):
                name = "_".join(words[1:]) or "body"
            elif words[0] == "f":
                corners = [_index(word, len(vertices) // 3) for word in words[1:]]
                if len(corners) < 3:
                    raise ValueError
                if not runs or runs[-1][0] != name:
                    runs.append((name, array("q")))
                    names.add(name)
                    if len(names) > most_parts:
                        raise MeshError(f"{path.name}: has over {most_parts:,} parts; join some and export it again")
                for b, c in pairwise(corners[1:]):
                    runs[-1][1].extend((corners[0], b, c))
        except MeshError:
            raise
        except ValueError:
            raise MeshError(
                f"{path.name}: line {number}: cannot be read as OBJ ({line.strip()[:40]}); correct it"
            ) from None
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    return [(name, *_drop_unused(points, np.array(facets, dtype=np.int64).reshape(-1, 3))) for name, facets in runs]


def _lines(path: Path, blob: bytes) -> Iterator[tuple[int, str]]:
    """Yield the numbered lines of a file. A line that ends in a backslash is joined to the next."""
    start, number, held = 0, 0, b""
    blob = blob.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in blob else blob
    while start < len(blob):
        end = blob.find(b"\n", start)
        end = len(blob) if end < 0 else end
        number += 1
        if end - start + len(held) > _LONGEST:
            raise MeshError(f"{path.name}: line {number}: is over {_LONGEST:,} characters long; export it again")
        line = held + blob[start:end]
        start, held = end + 1, b""
        if line.endswith(b"\\") and start < len(blob):
            held = line[:-1] + b" "
            continue
        yield number, line.decode("utf-8", errors="replace")


def _index(word: str, count: int) -> int:
    """Return the vertex that a corner refers to: from 1 up, or negative from the last, before the first slash."""
    number = int(word.partition("/")[0])
    index = number - 1 if number > 0 else count + number
    if not 0 <= index < count:
        raise ValueError
    return index


def _drop_unused(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop unused vertices; return the others and the facets renumbered."""
    used, inverse = np.unique(facets, return_inverse=True)
    return points[used], inverse.reshape(facets.shape)
