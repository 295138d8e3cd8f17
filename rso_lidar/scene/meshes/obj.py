"""OBJ files: triangles in the order of the file, by group."""

import itertools
from array import array
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.polygons import MeshPiece, cut_polygons
from rso_lidar.scene.meshes.text_lines import number_lines, refuse_line

_CONTINUED = (b"v", b"f", b"fo", b"l", b"p", b"g", b"o")  # lines that a backslash may continue; paths are in others
_CURVED = ("surf", "curv", "cdc", "cdp", "bzp", "bsp")  # surfaces and curves without triangles, and patches


def read_obj(path: Path, blob: bytes, most_parts: int) -> list[MeshPiece]:
    """Read the groups of an OBJ file; return the triangles of each run of polygons under one group or object.

    A polygon becomes triangles, numbered one by one. The name of its material is kept. Textures, normals and smoothing
    groups do not bear on range and intensity, and are ignored.

    Raises
    ------
    MeshError
        If a line cannot be read, there are too many groups, or the file has curved surfaces or commands for other files.
    """
    vertices = array("d")
    runs: list[tuple[str, array, array, array]] = []
    names: set[str] = set()
    name, material = "body", 0
    materials = {"": 0}
    for number, line in number_lines(path, blob, joined=_CONTINUED):
        words = line.split()
        if words and words[0] not in ("g", "o"):  # a name may have a number sign inside, as in panel#2
            words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                x, y, z = (float(word) for word in words[1:4])
                vertices.extend((x, y, z))
            elif words[0] in ("g", "o"):
                name = "_".join(itertools.takewhile(lambda word: word[0] != "#", words[1:])) or "body"
            elif words[0] == "usemtl":
                material = materials.setdefault("_".join(words[1:]), len(materials))
            elif words[0] in ("f", "fo"):
                corners = [_index(word, len(vertices) // 3) for word in words[1:]]
                if len(corners) < 3:
                    raise ValueError
                if not runs or runs[-1][0] != name:
                    runs.append((name, array("q"), array("q"), array("q")))
                    names.add(name)
                    if len(names) > most_parts:
                        raise MeshError(f"{path.name}: has over {most_parts:,} parts; join some and export it again")
                runs[-1][1].extend(corners)
                runs[-1][2].append(len(corners))
                runs[-1][3].append(material)
            elif words[0] in _CURVED:
                raise MeshError(
                    f"{path.name}: line {number}: has a curved surface ('{words[0]}'), which is not read; export "
                    "it as polygons"
                )
            elif words[0] in ("call", "csh"):
                raise MeshError(f"{path.name}: line {number}: calls another file, which is not read; export it as one")
        except MeshError:
            raise
        except ValueError:
            raise refuse_line(path, number, line, "OBJ") from None
    if not vertices and not runs:
        raise MeshError(f"{path.name}: contains no triangles and no vertices, so it is no OBJ file; export it again")
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    pieces = []
    for name, run_corners, run_sizes, of_polygon in runs:
        sizes = np.array(run_sizes, dtype=np.int64)
        facets = cut_polygons(path.name, points, np.array(run_corners, dtype=np.int64), sizes)
        of_facet = np.repeat(np.array(of_polygon, dtype=np.int64), sizes - 2)
        named = (of_facet, tuple(materials)) if len(materials) > 1 else (None, ())
        pieces.append(MeshPiece(name, *_drop_unused(points, facets), None, *named))
    return pieces


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
