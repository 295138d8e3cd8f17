"""OBJ files: triangles in the order of the file, by group."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError


def read_obj(path: Path) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return name, vertices (vertex, xyz) and facets (facet, 3) of each run of facets under one group or object.

    A polygon becomes a fan of triangles, counted one by one. Of the rest of the format nothing bears on range and
    intensity: textures, normals, smoothing and materials are passed over.
    """
    vertices: list[list[float]] = []
    runs: list[tuple[str, list[list[int]]]] = []
    name = "body"
    text = path.read_bytes().decode("utf-8", errors="replace").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                x, y, z = (float(word) for word in words[1:4])
                vertices.append([x, y, z])
            elif words[0] in ("g", "o"):
                name = "_".join(words[1:]) or "body"
            elif words[0] == "f":
                corners = [_index(word, len(vertices)) for word in words[1:]]
                if len(corners) < 3:
                    raise ValueError
                if not runs or runs[-1][0] != name:
                    runs.append((name, []))
                runs[-1][1].extend([corners[0], b, c] for b, c in pairwise(corners[1:]))
        except ValueError:
            raise MeshError(
                f"{path.name}: line {number}: cannot be read as OBJ ({line.strip()[:40]}); mend it"
            ) from None
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    return [(name, *_used(points, np.array(facets))) for name, facets in runs]


def _index(word: str, count: int) -> int:
    """Return the vertex that a corner names: from 1, or from the last backwards, before the first slash."""
    number = int(word.partition("/")[0])
    index = number - 1 if number > 0 else count + number
    if not 0 <= index < count:
        raise ValueError
    return index


def _used(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices that some facets use, and the facets in their numbers."""
    used, inverse = np.unique(facets, return_inverse=True)
    return points[used], inverse.reshape(facets.shape)
