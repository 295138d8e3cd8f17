"""Meshes: triangles in named parts, read from a file and repaired."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from rso_lidar.errors import MeshError, ScenarioError, did_you_mean, warn, warn_of_input
from rso_lidar.files import check_regular, explain_unreadable, read_bytes
from rso_lidar.scene.meshes.accessors import MOST_BYTES
from rso_lidar.scene.meshes.gltf import read_gltf
from rso_lidar.scene.meshes.obj import read_obj
from rso_lidar.scene.meshes.off import read_off
from rso_lidar.scene.meshes.ply import read_ply
from rso_lidar.scene.meshes.polygons import MeshPiece, check_facet_count
from rso_lidar.scene.meshes.stl import read_stl

SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off")
CAD_SUFFIXES = (".step", ".stp", ".iges", ".igs")

# The ISS is 109 m across, and no spacecraft is as small as a marble: beyond these sizes the unit is doubtful.
_LARGEST_M, _SMALLEST_M = 250.0, 0.02
_MOST_PARTS = 32_767  # labels number them in 16 bits
_COLOURED = (".glb", ".ply")  # formats of which colours are read
FARTHEST_M = 1e7  # float32 still resolves a metre there
UNITS_M = {"metres": 1.0, "millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254, "feet": 0.3048, "kilometres": 1e3}


@dataclass(frozen=True, eq=False)
class Mesh:
    """The triangles of one file, in its own coordinates.

    Attributes
    ----------
    path, sha256 : the file, and its hash
    vertices : (vertex, xyz) f8
    facets : (facet, 3), indices of vertices
    part, part_names : index of each facet's part (facet), and the names of the parts
    source_facet : (facet), number of the facet in the file, counted over its parts in order
    source_facets : number of facets in the file
    degenerate : number of facets that have no area and were dropped
    left_out : number of facets that do not belong to the craft and were dropped
    """

    path: Path
    sha256: str
    vertices: np.ndarray
    facets: np.ndarray
    part: np.ndarray
    part_names: tuple[str, ...]
    source_facet: np.ndarray
    source_facets: int
    degenerate: int
    left_out: int = 0

    @cached_property
    def size_m(self) -> np.ndarray:
        """Sides (xyz) of the box about the mesh, in its own unit."""
        used = self.vertices[np.unique(self.facets)]
        sides: np.ndarray = used.max(axis=0) - used.min(axis=0)
        return sides

    def check_parts(self, place: str, named: Iterable[str]) -> None:
        """Check that the mesh has some parts.

        Parameters
        ----------
        place : where the parts are named, for the message
        named : names of parts

        Raises
        ------
        ScenarioError : if the mesh lacks one.
        """
        for part in named:
            if part not in self.part_names:
                guess, known = did_you_mean(part, self.part_names), ", ".join(self.part_names)
                raise ScenarioError(f"{place}: no part '{part}' in {self.path.name}{guess} ({known})")


@lru_cache(maxsize=32)
def _read_cached(path: Path, _stamp: tuple[int, int]) -> Mesh:
    return parse_mesh(path, read_bytes(path, MOST_BYTES, MeshError, "mesh file"), path.suffix.lower())


def load_mesh(path: Path) -> Mesh:
    """Load the mesh of an STL, OBJ, PLY, GLB, glTF or OFF file. Each named geometry in it is a part.

    Facets without area are dropped and counted.

    Parameters
    ----------
    path : path of the file

    Returns
    -------
    the mesh, in the units and axes of the file.

    Raises
    ------
    MeshError : the file is missing, unreadable or empty, or holds vertices that are not finite.
    """
    path = Path(path)
    status = checked_file(path, SUFFIXES).stat()
    try:
        return _read_cached(path.absolute(), (status.st_mtime_ns, status.st_size))
    except OSError as error:
        raise MeshError(explain_unreadable(path, error)) from None
    except MemoryError:
        raise MeshError(f"{path}: needs more memory than is available; decimate it and export it again") from None


def checked_file(path: Path, suffixes: tuple[str, ...]) -> Path:
    """Check that a path is a plain file of one of some suffixes, of a size that can be read, and return it."""
    if path.suffix.lower() not in suffixes:
        known = ", ".join(suffixes)
        cad = " (STEP and IGES come in through `rso-lidar models add`)" if path.suffix.lower() in CAD_SUFFIXES else ""
        raise MeshError(f"{path}: a mesh of type '{path.suffix}' is not read; convert it to one of {known}{cad}")
    check_regular(path, MOST_BYTES, MeshError, "mesh file")
    return path


def parse_mesh(path: Path, blob: bytes, suffix: str) -> Mesh:
    """Parse the contents of a mesh file.

    Parameters
    ----------
    path : of the file, for messages, and for data that glTF keeps beside it
    suffix : names the format, in lower case; a solid from `tessellate` is of ".glb" whatever its file is

    Returns
    -------
    Mesh
        In the units and axes of the file.

    Raises
    ------
    MeshError
        As `load_mesh`.
    """
    if not blob:
        raise MeshError(f"{path.name}: the file is empty; export the mesh again")
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is reported below
        pieces = _read_pieces(path, blob, suffix)
    total = sum(len(piece.facets) for piece in pieces)
    check_facet_count(path.name, total)
    if not total:
        raise MeshError(f"{path.name}: contains no triangles; export the mesh again as a triangulated surface")
    numbers: dict[str, int] = {}
    vertices, facets, part = [], [], []
    base = 0
    for name, piece_vertices, piece_facets, *_ in pieces:
        number = numbers.setdefault(name, len(numbers))
        check_part_count(path.name, number + 1)
        vertices.append(piece_vertices)
        facets.append(piece_facets + base)
        part.append(np.full(len(piece_facets), number, dtype=np.int16))
        base += len(piece_vertices)
    all_vertices, all_facets = np.concatenate(vertices), np.concatenate(facets)
    bad = ~np.isfinite(all_vertices[all_facets]).all(axis=(1, 2))
    if bad.any():
        raise MeshError(
            f"{path.name}: {int(bad.sum())} of {len(bad)} facets have coordinates that are not finite, "
            f"the first is facet {int(np.argmax(bad))}; correct the mesh and export it again"
        )
    corners = all_vertices[all_facets]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that are finite and have no square
        twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        sound = np.flatnonzero(twice_area > 1e-12 * np.maximum(longest, 1e-300) ** 2)
    if not len(sound):
        raise MeshError(f"{path.name}: all {len(all_facets)} facets are without area; export the mesh again")
    return Mesh(
        path=path,
        sha256=hashlib.sha256(blob).hexdigest(),
        vertices=all_vertices,
        facets=all_facets[sound],
        part=np.concatenate(part)[sound],
        part_names=tuple(numbers),
        source_facet=sound.astype(np.int32),
        source_facets=len(all_facets),
        degenerate=len(all_facets) - len(sound),
    )


def check_part_count(where: str, count: int) -> None:
    """Raise `MeshError` if a mesh has more parts than labels can number."""
    if count > _MOST_PARTS:
        raise MeshError(f"{where}: has over {_MOST_PARTS:,} parts; join some and export it again")


def _read_pieces(path: Path, blob: bytes, suffix: str) -> list[MeshPiece]:
    """Read the triangles of each named geometry of a file, in the file's order.

    Parameters
    ----------
    blob : its contents [bytes]
    suffix : names the format, in lower case, such as `.stl`
    """
    match suffix:
        case ".obj":
            return read_obj(path, blob, _MOST_PARTS)
        case ".glb" | ".gltf":
            return read_gltf(path, blob)
        case ".stl":
            return read_stl(path, blob)
        case ".ply":
            return read_ply(path, blob)
        case _:
            return read_off(path, blob)


def read_facet_colours(mesh: Mesh) -> np.ndarray:
    """Read the colours of the facets of a mesh file.

    GLB gives a base colour to each group; textures are ignored. PLY gives colours to facets, or to vertices, of which a
    facet gets the mean.

    Parameters
    ----------
    mesh : as it was read

    Returns
    -------
    ndarray
        (facet in the file) texts such as ``#a29225``, numbered like `Mesh.source_facet`.

    Raises
    ------
    MeshError
        If the file holds no colours, or not for all facets.
    """
    path = mesh.path
    suffix = path.suffix.lower()
    if suffix not in _COLOURED:
        raise MeshError(
            f"{path.name}: colours are read from {' and '.join(_COLOURED)} only; give parts or facets instead"
        )
    pieces = _read_pieces(path, read_bytes(path, MOST_BYTES, MeshError, "mesh file"), suffix)
    colours = [piece.colours for piece in pieces if piece.colours is not None]
    if len(colours) != len(pieces) or sum(map(len, colours)) != mesh.source_facets:
        raise MeshError(f"{path.name}: contains no colours, or not for all facets; give parts or facets instead")
    numbers = (np.concatenate(colours).astype(np.int64) * np.array([65536, 256, 1])).sum(axis=-1)
    distinct, place = np.unique(numbers, return_inverse=True)
    texts: np.ndarray = np.array([f"#{number:06x}" for number in distinct.tolist()], dtype=object)[place]
    return texts


def read_facet_materials(mesh: Mesh) -> np.ndarray:
    """Read the names of the materials of the facets of a mesh file, OBJ (`usemtl`) or glTF.

    Parameters
    ----------
    mesh : as it was read

    Returns
    -------
    ndarray
        (facet in the file) texts, numbered like `Mesh.source_facet`; empty for facets without a material.

    Raises
    ------
    MeshError
        If the file names no materials.
    """
    path = mesh.path
    suffix = path.suffix.lower()
    words = []
    for piece in _read_pieces(path, read_bytes(path, MOST_BYTES, MeshError, "mesh file"), suffix):
        if piece.material is None:
            words.append(np.full(len(piece.facets), "", dtype=object))
        else:
            words.append(np.array(piece.material_names, dtype=object)[piece.material])
    names: np.ndarray = np.concatenate(words)
    if len(names) != mesh.source_facets or not names.any():
        raise MeshError(
            f"{path.name}: names no materials (OBJ and glTF files can); give a table of facets, a .csv (facet, part)"
        )
    return names


def normalize_mesh(
    mesh: Mesh, scale: float, mesh_axes: str = "z_up", left_out: tuple[tuple[int, int], ...] = ()
) -> Mesh:
    """Scale a mesh to metres, turn it to z up, and drop runs of facets; raise `MeshError` if all facets are dropped.

    Parameters
    ----------
    scale : metres in one unit of the file
    """
    if scale == 1.0 and mesh_axes == "z_up" and not left_out:
        return mesh
    kept = np.ones(len(mesh.facets), dtype=bool)
    for first, last in left_out:
        kept &= (mesh.source_facet < first) | (mesh.source_facet > last)
    if not kept.any():
        raise MeshError(f"{mesh.path.name}: all its facets are left out; give fewer in left_out")
    return replace(
        mesh,
        vertices=body_from_mesh(mesh.vertices * scale, mesh_axes),
        facets=mesh.facets[kept],
        part=mesh.part[kept],
        source_facet=mesh.source_facet[kept],
        left_out=int(np.count_nonzero(~kept)),
    )


def body_from_mesh(vectors: np.ndarray, mesh_axes: str) -> np.ndarray:
    """Convert vectors from a mesh's axes to body axes.

    Parameters
    ----------
    vectors : (…, xyz), in any unit
    mesh_axes : ``"z_up"`` leaves them unchanged; ``"y_up"`` turns the file's y to z

    Returns
    -------
    ndarray
        (…, xyz).
    """
    if mesh_axes == "y_up":
        return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)
    return vectors


def guess_units(largest_m: float) -> dict[str, float]:
    """Return the units, with their metres, in which a mesh of this size is a spacecraft; none where metres fit."""
    if is_plausible_size(largest_m):
        return {}
    return {unit: metres for unit, metres in UNITS_M.items() if 0.3 <= largest_m * metres <= 120.0}


def is_plausible_size(largest_m: float) -> bool:
    """Return whether a spacecraft may be of this size [m]."""
    return _SMALLEST_M <= largest_m <= _LARGEST_M


def warn_of_repairs(mesh: Mesh, name: str) -> None:
    """Warn, once a process for each file, of facets that were dropped when the mesh was loaded.

    Parameters
    ----------
    mesh : the mesh as it was read
    name : name of the target, for the message
    """
    if mesh.degenerate:
        warn(
            f"target {name}: {mesh.path.name}: {mesh.degenerate:,} of {mesh.source_facets:,} facets have no area and were "
            f"dropped; `rso-lidar models check {mesh.path.name}` reports them",
            about=(mesh.path, mesh.sha256),
        )


def warn_of_size(mesh: Mesh, scale: float, name: str) -> None:
    """Warn if the size of a scaled mesh shows that its unit is not the metre, and name the likely unit.

    Parameters
    ----------
    mesh : the mesh as it was read
    scale : metres in one unit of the file
    name : name of the target, for the message
    """
    largest = float(mesh.size_m.max()) * scale
    if is_plausible_size(largest):
        return
    fits = list(guess_units(largest))
    guess = f"; it may be in {' or '.join(fits)} (scale = {UNITS_M[fits[0]] * scale:g})" if fits else ""
    warn_of_input(f"target {name}: {mesh.path.name} is {largest:.4g} m across{guess}; give scale or size_m")
