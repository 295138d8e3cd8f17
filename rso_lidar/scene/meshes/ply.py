"""PLY files, ASCII and binary."""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.polygons import MeshPiece, cut_polygons
from rso_lidar.scene.meshes.text_lines import number_lines

_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 100_000  # bytes
_RGB = ("red", "green", "blue")
# Values of each property; of a list, those of all rows, with their counts under name + "#".
_Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class _Element:
    """An element of the header: name, number of rows, and by property its type and the type of a list's count."""

    name: str
    rows: int
    properties: dict[str, tuple[str, str]]

    @property
    def lists(self) -> list[str]:
        """Properties that are lists."""
        return [name for name, (_, count) in self.properties.items() if count]


def read_ply(path: Path, blob: bytes) -> list[MeshPiece]:
    """Read a PLY file, with the colours of its faces, or the mean of those of their vertices.

    Raises
    ------
    MeshError
        If the file is damaged, shorter than its header states, or has its triangles in strips.
    """
    broken = MeshError(f"{path.name}: cannot be read as PLY: it is cut short or damaged; export it again")
    try:
        order, elements, body = _read_header(path, blob)
        names = {element.name for element in elements}
        if "tristrips" in names:
            raise MeshError(f"{path.name}: has its triangles in 'tristrips', which are not read; export it as faces")
        if order is None or "vertex" not in names:
            raise broken
        columns = _read_ascii(path, body, elements) if order == "" else _read_binary(path, body, elements, order)
        vertex = columns["vertex"]
        points = np.stack([vertex[axis].astype(float) for axis in "xyz"], axis=1)
        if "face" not in names:
            return []
        face = columns["face"]
        key = next(key for key in ("vertex_indices", "vertex_index") if f"{key}#" in face)
        corners, sizes = face[key].astype(np.int64), face[f"{key}#"].astype(np.int64)
        if (corners != face[key]).any():
            raise broken
    except MeshError:
        raise
    except (ValueError, KeyError, IndexError, StopIteration, OverflowError, struct.error):
        raise broken from None
    facets = cut_polygons(path.name, points, corners, sizes)
    types = {element.name: element.properties for element in elements}
    colours = None
    if set(_RGB) <= set(face):
        colours = np.repeat(_read_colours(face, types["face"]), np.maximum(sizes - 2, 0), axis=0)
    elif set(_RGB) <= set(vertex):
        colours = _read_colours(vertex, types["vertex"])[facets].mean(axis=1)
    return [MeshPiece("body", points, facets, None if colours is None else colours.astype(np.uint8))]


def _read_header(path: Path, blob: bytes) -> tuple[str | None, list[_Element], bytes]:
    """Return the byte order ("" for ASCII, None where none is stated), the elements, and what follows the header."""
    match = re.search(rb"^[ \t]*end_header[ \t]*(\r\n|\n|\r)", blob[:_LONGEST_HEADER], re.MULTILINE)
    if match is None:
        match = re.search(rb"\r[ \t]*end_header[ \t]*\r", blob[:_LONGEST_HEADER])
    lines = number_lines(path, blob[: match.start() if match else _LONGEST_HEADER])
    if next(lines, (0, ""))[1].strip() != "ply" or match is None:
        raise ValueError
    order, elements = None, []
    for _, line in lines:
        match line.split():
            case ["format", name, _]:
                order = _ORDERS[name]
            case ["element", name, rows]:
                elements.append(_Element(name, int(rows), {}))
                if int(rows) < 0:
                    raise ValueError
            case ["property", *_, name] if name in elements[-1].properties:
                raise MeshError(f"{path.name}: its header states '{name}' twice; export it again")
            case ["property", "list", count, kind, name]:
                elements[-1].properties[name] = _TYPES[kind], _TYPES[count]
            case ["property", kind, name]:
                elements[-1].properties[name] = _TYPES[kind], ""
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise ValueError
    return order, elements, blob[match.end() :]


def _check_rows(path: Path, element: _Element, held: int) -> None:
    """Check that no more rows are stated than fit into the rest of the file.

    Parameters
    ----------
    held : what is left [bytes], each row being one at least
    """
    if element.properties and element.rows > held:
        raise MeshError(
            f"{path.name}: its header states {element.rows:,} of '{element.name}', more than the file holds; "
            "export it again"
        )


def _read_ascii(path: Path, body: bytes, elements: list[_Element]) -> dict[str, _Columns]:
    """Read the elements of an ASCII file, a line for each row.

    Parameters
    ----------
    body : what follows the header [bytes]
    """
    lines = (words for _, line in number_lines(path, body) if (words := line.split()))
    columns: dict[str, _Columns] = {}
    for element in elements:
        if {"vertex", "face"} <= columns.keys():
            break  # what follows does not bear on the triangles
        _check_rows(path, element, len(body))

        def start_row(width: int = len(element.properties)) -> Callable[[str, int], list[float]]:
            words = next(lines)
            if len(words) < width:
                raise ValueError
            values = map(float, words)
            return lambda _, count: [next(values) for _ in range(count)]

        columns[element.name] = _read_rows(element, start_row, len(body))
    return columns


def _read_binary(path: Path, body: bytes, elements: list[_Element], order: str) -> dict[str, _Columns]:
    """Read the elements of a binary file: at once where the lists of all rows are as long, else row by row.

    Parameters
    ----------
    body : what follows the header [bytes]
    order : of bytes, `<` or `>`
    """
    columns: dict[str, _Columns] = {}
    at = 0
    for element in elements:
        if {"vertex", "face"} <= columns.keys():
            break  # what follows does not bear on the triangles
        _check_rows(path, element, len(body) - at)
        if not element.properties:
            columns[element.name] = {}
            continue
        lengths = {}
        start = at
        if element.rows:
            for name, (kind, count) in element.properties.items():  # the first row gives the lengths of its lists
                if count:
                    lengths[name] = int(struct.unpack_from(order + count, body, start)[0])
                    start += struct.calcsize(order + count) + lengths[name] * struct.calcsize(order + kind)
                else:
                    start += struct.calcsize(order + kind)
                if start > len(body):
                    raise ValueError
        fields: list[Any] = []
        for name, (kind, count) in element.properties.items():
            if count:
                fields.append((f"{name}#", order + count))
            fields.append((name, order + kind, (lengths.get(name, 0),)) if count else (name, order + kind))
        row = np.dtype(fields)
        held = (len(body) - at) // row.itemsize
        if element.rows <= held:
            rows = np.frombuffer(body, dtype=row, count=element.rows, offset=at)
            if all((rows[f"{name}#"] == lengths.get(name, 0)).all() for name in element.lists):
                columns[element.name] = {name: rows[name].reshape(-1) for name in row.fields or ()}
                at += element.rows * row.itemsize
                continue
        if not element.lists:
            raise ValueError

        def start_row() -> Callable[[str, int], tuple[float, ...]]:
            def take(code: str, length: int) -> tuple[float, ...]:
                nonlocal at
                taken = struct.unpack_from(f"{order}{length}{code}", body, at)
                at += struct.calcsize(f"{order}{length}{code}")
                return taken

            return take

        columns[element.name] = _read_rows(element, start_row, len(body))
    return columns


def _read_rows(
    element: _Element, start_row: Callable[[], Callable[[str, int], list[float] | tuple[float, ...]]], held: int
) -> _Columns:
    """Read an element row by row.

    Parameters
    ----------
    start_row : goes on to the next row, and returns what takes so many numbers of a type from it
    held : the greatest length that a list can have, 0 or more
    """
    values = {name: array("d") for name in element.properties}
    counts = {name: array("q") for name in element.lists}
    if not element.properties:
        return {}
    for _ in range(element.rows):
        take = start_row()
        for name, (kind, count) in element.properties.items():
            length = int(take(count, 1)[0]) if count else 1
            if not 0 <= length <= held:
                raise ValueError
            if count:
                counts[name].append(length)
            taken = take(kind, length)
            if len(taken) != length:
                raise ValueError
            values[name].extend(taken)
    columns = {name: np.array(column, dtype=float) for name, column in values.items()}
    return columns | {f"{name}#": np.array(column, dtype=np.int64) for name, column in counts.items()}


def _read_colours(columns: _Columns, types: dict[str, tuple[str, str]]) -> np.ndarray:
    """Return colours (row, rgb) from 0 to 255. Those of floating-point type are from 0 to 1, others from 0 to 255."""
    rgb = np.stack([columns[name].astype(float) for name in _RGB], axis=1)
    if types["red"][0] in "fd":
        rgb = np.round(255.0 * np.nan_to_num(rgb))
    clipped: np.ndarray = np.clip(rgb, 0.0, 255.0)
    return clipped
