"""Groups of facets of a mesh, by a table of facets or by the materials of the mesh's file, and parts made of them."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.files import MOST_BYTES, format_csv, read_array, read_text
from rso_lidar.scene.meshes.mesh import Mesh, check_part_count, read_facet_materials

_DIGITS = 12  # of a facet's number at most, far more than any mesh needs


def read_facet_words(path: Path, facets: int, what: str) -> np.ndarray:
    """Read the word that a table gives to each facet of a mesh.

    A .csv has lines of a facet, or a span such as 10-19, and a word. A .npy holds an integer for each facet, -1 for none.

    Parameters
    ----------
    path : path of the table
    facets : number of facets in the mesh's file
    what : meaning of the words, such as "material", for messages

    Returns
    -------
    ndarray
        (facet in the file) texts, empty where the table gives none.

    Raises
    ------
    MeshError
        If the table cannot be read, or names a facet that the mesh does not have.
    """
    if path.suffix.lower() == ".npy":
        return _read_array(path, facets)
    if path.suffix.lower() == ".csv":
        return _read_table(path, facets, what)
    raise MeshError(f"{path.name}: '{path.suffix}' is not read; give a .csv (facet, {what}) or a .npy")


def group_facets(mesh: Mesh, table: Path | None = None) -> Mesh:
    """Make parts of the groups that a table, or the mesh's own file, gives to facets.

    Parameters
    ----------
    mesh : as it was read, with all its facets
    table : a .csv (facet, part) or .npy as in `read_facet_words`; facets that it does not list keep their parts. None makes
        a part of each material of the file

    Returns
    -------
    Mesh
        The same facets in other parts, which are in the order of their first facets.

    Raises
    ------
    MeshError
        If the table cannot be read, or the file names no materials.
    """
    words = read_facet_materials(mesh) if table is None else read_facet_words(table, mesh.source_facets, "part")
    words = words[mesh.source_facet]
    before = np.array(mesh.part_names, dtype=object)[mesh.part]
    names = np.where(words == "", before, words)
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names.tolist()))}
    check_part_count(mesh.path.name, len(numbers))
    part = np.array([numbers[name] for name in names.tolist()], dtype=np.int16)
    return replace(mesh, part=part, part_names=tuple(numbers))


def format_facet_words(mesh: Mesh) -> str:
    """Write the parts of a mesh as a table (facet, part) that `read_facet_words` reads, with a line for each span."""
    place, part = mesh.source_facet.astype(np.int64), mesh.part
    first = np.flatnonzero((np.diff(place, prepend=-9) != 1) | (np.diff(part, prepend=-1) != 0))
    last = np.append(first[1:], len(place)) - 1
    rows = [
        (format_span(int(place[start]), int(place[end])), mesh.part_names[part[start]])
        for start, end in zip(first.tolist(), last.tolist(), strict=True)
    ]
    return format_csv([("facet", "part"), *rows])


def format_span(first: int, last: int) -> str:
    """Write a span of facets as tables have it.

    Parameters
    ----------
    first, last : numbers of the first and the last facet

    Returns
    -------
    str

    Examples
    --------
    >>> format_span(10, 19), format_span(3, 3)
    ('10-19', '3')
    """
    return f"{first}" if first == last else f"{first}-{last}"


def _read_array(path: Path, facets: int) -> np.ndarray:
    numbers = read_array(path, MeshError)
    if numbers.dtype.kind not in "iu" or numbers.shape != (facets,):
        got = f"{numbers.dtype} {numbers.shape}"
        raise MeshError(f"{path.name}: holds {got}; give one integer for each of the {facets:,} facets of the mesh")
    return np.where(numbers < 0, "", numbers.astype(str)).astype(object)


def _read_table(path: Path, facets: int, what: str) -> np.ndarray:
    words = np.full(facets, "", dtype=object)
    try:
        rows = list(csv.reader(read_text(path, MOST_BYTES, MeshError, "table (.csv)").splitlines()))
    except csv.Error:
        raise MeshError(f"{path.name}: cannot be read; give a text with the columns facet, {what}") from None
    for line, row in enumerate(rows, start=1):
        if not row or (line == 1 and row[0].strip().lower() == "facet"):
            continue
        first, dash, last = row[0].strip().partition("-")
        if len(row) != 2 or not _is_whole_number(first) or (dash and not _is_whole_number(last)) or not row[1].strip():
            raise MeshError(f"{path.name}: line {line}: needs a facet, or a span such as 10-19, and a {what}")
        start, end = int(first), int(last) if dash else int(first)
        if start > end or end >= facets:
            raise MeshError(
                f"{path.name}: line {line}: no facets {row[0].strip()} in a mesh of {facets:,}; number them from 0"
            )
        words[start : end + 1] = row[1].strip()
    return words


def _is_whole_number(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= _DIGITS
