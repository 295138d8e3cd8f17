"""Meshes: triangles in named parts, read from a file and repaired."""

import hashlib
import logging
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import MeshError, RsoLidarWarning, ScenarioError, did_you_mean, has_warnings_enabled, warn
from rso_lidar.files import check_regular, read_bytes
from rso_lidar.scene.meshes.gltf import MOST_FACETS, check_gltf
from rso_lidar.scene.meshes.obj import read_obj

SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf", ".off")
CAD_SUFFIXES = (".step", ".stp", ".iges", ".igs")

# The ISS is 109 m across, and no spacecraft is as small as a marble: beyond these sizes the unit is doubtful.
_LARGEST_M, _SMALLEST_M = 250.0, 0.02
_MOST_PARTS = 32_767  # labels number them in 16 bits
_MOST_BYTES = 2**29  # ten million facets as STL; a reader takes some eight times as much memory
FARTHEST_M = 1e7  # float32 still resolves a metre there
_OTHER_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254, "feet": 0.3048, "kilometres": 1e3}
_reported: set[tuple[Path, str]] = set()  # files, with their SHA-256, whose repairs have been reported


@dataclass(frozen=True, eq=False)
class Mesh:
    """The triangles of one file, in its own coordinates.

    Attributes
    ----------
    path, sha256 : the file, and its hash.
    vertices : (vertex, xyz) f8.
    facets : (facet, 3), indices of vertices.
    part, part_names : index of each facet's part (facet), and the names of the parts.
    source_facet : (facet), number of the facet in the file, counted over its parts in order.
    source_facets : number of facets in the file.
    degenerate : number of facets that have no area and were dropped.
    left_out : number of facets that do not belong to the craft and were dropped.
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
        place : where the parts are named, for the message.
        named : names of parts.

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
    return _read(path)


def load_mesh(path: Path) -> Mesh:
    """Load the mesh of an STL, OBJ, PLY, GLB, glTF or OFF file. Each named geometry in it is a part.

    Facets without area are dropped and counted.

    Parameters
    ----------
    path : path of the file.

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
        return _read_cached(path.resolve(), (status.st_mtime_ns, status.st_size))
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror or error}); check its permissions") from None
    except MemoryError:
        raise MeshError(f"{path}: needs more memory than is available; decimate it and export it again") from None


def checked_file(path: Path, suffixes: tuple[str, ...]) -> Path:
    """Check that a path is a plain file of one of some suffixes, of a size that can be read, and return it."""
    if path.suffix.lower() not in suffixes:
        known = ", ".join(suffixes)
        cad = " (STEP and IGES come in through `rso-lidar models add`)" if path.suffix.lower() in CAD_SUFFIXES else ""
        raise MeshError(f"{path}: a mesh of type '{path.suffix}' is not read; convert it to one of {known}{cad}")
    check_regular(path, _MOST_BYTES, MeshError, "mesh file")
    return path


def _read(path: Path) -> Mesh:
    blob = read_bytes(path, _MOST_BYTES, MeshError, "mesh file")
    if not blob:
        raise MeshError(f"{path.name}: the file is empty; export the mesh again")
    pieces = _pieces(path, blob)
    total = sum(len(facets) for _, _, facets in pieces)
    if total > MOST_FACETS:
        raise MeshError(f"{path.name}: holds {total:,} facets, over {MOST_FACETS:,}; decimate it and export it again")
    if not total:
        raise MeshError(f"{path.name}: contains no triangles; export the mesh again as a triangulated surface")
    numbers: dict[str, int] = {}
    vertices, facets, part = [], [], []
    base = 0
    for name, piece_vertices, piece_facets in pieces:
        number = numbers.setdefault(name, len(numbers))
        if number >= _MOST_PARTS:
            raise MeshError(f"{path.name}: has over {_MOST_PARTS:,} parts; join some and export it again")
        vertices.append(piece_vertices)
        facets.append(piece_facets + base)
        part.append(np.full(len(piece_facets), number, dtype=np.int16))
        base += len(piece_vertices)
    all_vertices, all_facets = np.concatenate(vertices), np.concatenate(facets)
    if all_facets.size and (all_facets.min() < 0 or all_facets.max() >= len(all_vertices)):
        raise MeshError(f"{path.name}: a facet names a vertex that is not in the file; export the mesh again")
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


def _pieces(path: Path, blob: bytes) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Read name, vertices (f8) and facets of each named geometry of a file, in the file's order."""
    suffix = path.suffix.lower()
    if suffix == ".obj":
        return read_obj(path, blob, _MOST_PARTS)  # trimesh loses the order of facets, by which labels number them
    if suffix in (".glb", ".gltf"):
        check_gltf(path, blob)
    if suffix == ".stl":
        _check_stl(path, blob)
    import trimesh

    broken = f"{path.name}: cannot be read as {suffix[1:].upper()}: it is cut short or damaged; export it again"
    try:
        with silence_trimesh() as problems, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a broken file is reported below in one line
            # NumPy may stop at text that is not a number, and keep what it has read so far.
            warnings.filterwarnings("error", message="string or file could not be read")
            scene = trimesh.load_scene(path, process=False, skip_materials=True)  # without opening textures
            _check_count(path, blob, scene)
            pieces = _place_geometries(scene, single=suffix in (".stl", ".off", ".ply"))
    except (MeshError, MemoryError):
        raise
    except Exception:  # trimesh raises any Python exception, with a message that does not name the file
        raise MeshError(broken) from None
    if problems:  # trimesh skipped lines that it could not read
        raise MeshError(broken)
    if any(vertices.shape[1:] != (3,) or facets.shape[1:] != (3,) for _, vertices, facets in pieces):
        raise MeshError(f"{path.name}: has positions that are not three numbers each; export it again")
    return pieces


@contextmanager
def silence_trimesh() -> Iterator[list[str]]:
    """Collect the warnings and errors that trimesh logs inside the context, instead of printing them."""
    problems: list[str] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            problems.append(record.getMessage())

    log, kept = logging.getLogger("trimesh"), Kept(logging.WARNING)
    propagates, log.propagate = log.propagate, False
    log.addHandler(kept)
    try:
        yield problems
    finally:
        log.removeHandler(kept)
        log.propagate = propagates


def _check_stl(path: Path, blob: bytes) -> None:
    """Raise `MeshError` for a truncated ASCII STL, of which trimesh reads the facets that are there."""
    is_binary = len(blob) >= 84 and 84 + 50 * int.from_bytes(blob[80:84], "little") <= len(blob)
    if not is_binary and blob.lstrip()[:5].lower() == b"solid" and b"endsolid" not in blob[-1000:].lower():
        raise MeshError(f"{path.name}: has no 'endsolid' at its end, so it is cut short; export it again")


def _place_geometries(scene: Any, *, single: bool) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return the named geometries of trimesh's scene, placed by its nodes. A `single` one is named ``body``."""
    pieces = []
    order = {name: number for number, name in enumerate(scene.geometry)}
    for node in sorted(scene.graph.nodes_geometry, key=lambda node: order[scene.graph[node][1]]):
        parent_from_node, geometry_name = scene.graph[node]
        geometry = scene.geometry[geometry_name]
        facets = getattr(geometry, "faces", None)
        if facets is None or not len(facets):
            continue  # points and lines reflect nothing
        vertices = np.asarray(geometry.vertices, dtype=float)
        if not np.array_equal(parent_from_node, np.eye(4)):
            vertices = vertices @ parent_from_node[:3, :3].T + parent_from_node[:3, 3]
        pieces.append(("body" if single else str(geometry_name), vertices, np.asarray(facets, dtype=np.int64)))
    return pieces


def _check_count(path: Path, blob: bytes, scene: Any) -> None:
    """Check that a PLY or OFF has as many facets as its header states, because trimesh reads a shorter one in silence.

    Parameters
    ----------
    path : path of the file; its suffix decides the format.
    blob : contents of the file.
    scene : what trimesh read.

    Raises
    ------
    MeshError
        If it has fewer.
    """
    if path.suffix.lower() == ".ply":
        head, _, _ = blob.partition(b"end_header")
        stated = re.search(rb"element\s+face\s+(\d{1,18})", head)
    elif path.suffix.lower() == ".off":
        stated = re.match(rb"\s*\w*OFF\s+\d+\s+(\d{1,18})", re.sub(rb"#[^\n]*", b"", blob))
    else:
        return
    found = sum(len(getattr(geometry, "faces", ())) for geometry in scene.geometry.values())
    if stated and found < int(stated[1]):
        raise MeshError(
            f"{path.name}: has {found} of the {int(stated[1])} facets that its header states; export it again"
        )


def normalize_mesh(
    mesh: Mesh, scale: float, mesh_axes: str = "z_up", left_out: tuple[tuple[int, int], ...] = ()
) -> Mesh:
    """Scale a mesh to metres, turn it to z up, and drop runs of facets.

    Parameters
    ----------
    mesh : the mesh as it was read.
    scale : metres in one unit of the file.
    mesh_axes : "z_up" or "y_up".
    left_out : first and last facet of each run to drop, by number in the file.

    Returns
    -------
    the mesh in metres and body axes.

    Raises
    ------
    MeshError
        If all facets are dropped.
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
    """Convert vectors (…, xyz) from a mesh's axes to body axes: "z_up" unchanged, "y_up" with the file's y up."""
    if mesh_axes == "y_up":
        return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)
    return vectors


def guess_units(largest_m: float) -> dict[str, float]:
    """Return the units, with their metres, in which a mesh of this size is a spacecraft; none where metres fit."""
    if is_plausible_size(largest_m):
        return {}
    return {unit: metres for unit, metres in _OTHER_UNITS.items() if 0.3 <= largest_m * metres <= 120.0}


def is_plausible_size(largest_m: float) -> bool:
    """Return whether a spacecraft may be of this size [m]."""
    return _SMALLEST_M <= largest_m <= _LARGEST_M


def warn_of_repairs(mesh: Mesh, name: str) -> None:
    """Warn, once a process for each file, of facets that were dropped when the mesh was loaded.

    Parameters
    ----------
    mesh : the mesh as it was read.
    name : name of the target, for the message.
    """
    if not mesh.degenerate or not has_warnings_enabled() or (mesh.path, mesh.sha256) in _reported:
        return
    _reported.add((mesh.path, mesh.sha256))
    warn(
        f"target {name}: {mesh.path.name}: {mesh.degenerate:,} of {mesh.source_facets:,} facets have no area and were "
        f"dropped; `rso-lidar models check {mesh.path.name}` reports them"
    )


def warn_of_size(mesh: Mesh, scale: float, name: str) -> None:
    """Warn if the size of a scaled mesh shows that its unit is not the metre, and name the likely unit.

    Parameters
    ----------
    mesh : the mesh as it was read.
    scale : metres in one unit of the file.
    name : name of the target, for the message.
    """
    largest = float(mesh.size_m.max()) * scale
    if is_plausible_size(largest):
        return
    fits = list(guess_units(largest))
    guess = f"; it may be in {' or '.join(fits)} (scale = {_OTHER_UNITS[fits[0]] * scale:g})" if fits else ""
    warnings.warn(
        f"target {name}: {mesh.path.name} is {largest:.4g} m across{guess}; give scale or size_m",
        RsoLidarWarning,
        stacklevel=2,
    )
