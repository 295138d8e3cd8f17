"""Examination of a mesh: unit, components, holes, winding, hidden facets, and what was repaired on loading.

Nothing here changes a mesh. A mesh with holes and mixed winding is cast as it is, because facets are two-sided.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.library.mesh_units import known_meshes
from rso_lidar.scene.library.model_index import model
from rso_lidar.scene.meshes.cad import is_cad, tessellate
from rso_lidar.scene.meshes.components import (
    Component,
    describe_component,
    directed_edges,
    find_helper_cube,
    merge_vertices,
    number_components,
    split_components,
)
from rso_lidar.scene.meshes.mesh import Mesh, guess_units, is_plausible_size, load_mesh, normalize_mesh, parse_mesh
from rso_lidar.scene.surfaces.surface import Surface, build_surface
from rso_lidar.units import format_count

_DIRECTIONS = 60
_GRID = 96  # rays along each side of the square that they are cast from
_GRAZING = 0.05  # cosine below which a facet is not probed: float32 could start the ray behind it
_TIE = 1e-9  # of the weight: a sum this near to half of it counts as half
_STRAY = 2.0  # times as far from the middle as 95 % of the surface
_LISTED = 40  # strays that have a line each


@dataclass(frozen=True)
class Examination:
    """What the examination of a mesh found. Lengths are in metres where the mesh is.

    Attributes
    ----------
    size_m, area_m2 : sides of the box about the mesh, and its area
    facets, degenerate, left_out : facets of the file; those without area; those left out by the library
    duplicates : facets with the same corners as another
    parts, components : named parts; sets of facets connected by edges
    strays : components far from the rest
    boundary_edges, nonmanifold_edges : edges with one facet, and with over two
    turned_edges : edges across which the winding of two facets disagrees
    front_share : share of first hits, of rays from all around, on the side that the winding makes the front
    hidden, hidden_area_share : facets that no ray reaches, and their share of the area
    cube : a helper cube about the origin, the root of the rig in some models
    known : what is known about the file by its SHA-256, in words; empty for most
    """

    size_m: tuple[float, float, float]
    facets: int
    degenerate: int
    left_out: int
    duplicates: int
    parts: int
    components: int
    strays: tuple[Component, ...]
    boundary_edges: int
    nonmanifold_edges: int
    turned_edges: int
    front_share: float
    hidden: int
    hidden_area_share: float
    area_m2: float
    cube: Component | None
    known: str = ""

    @property
    def largest_m(self) -> float:
        """Longest side [m]."""
        return max(self.size_m)

    def lines(self) -> list[str]:
        """Return the findings as lines of text, each with a keyword."""
        x, y, z = self.size_m
        text = [f"known       {self.known}"] if self.known else []
        text += [
            f"size        {x:.4g} x {y:.4g} x {z:.4g} m, {self.area_m2:.4g} m2 of surface, hidden surface included"
        ]
        if not is_plausible_size(self.largest_m):
            fits = guess_units(self.largest_m)
            guess = ", ".join(f"{unit} (--scale {metres:g})" for unit, metres in fits.items()) or "no common unit fits"
            text.append(f"unit        doubtful: no spacecraft is {self.largest_m:.4g} m across; perhaps {guess}")
        repairs = ((self.degenerate, "without area dropped"), (self.left_out, "left out, not a part of the craft"))
        repaired = [f"{count:,} {what}" for count, what in repairs if count]
        text.append(
            f"facets      {self.facets:,} in {format_count(self.parts, 'part')}; {', '.join(repaired) or 'none dropped'}"
        )
        if self.duplicates:
            text.append(
                f"duplicates  {format_count(self.duplicates, 'facet')} on another with the same corners: harmless"
            )
        text.append(f"components  {self.components:,}, by shared edges")
        text += [
            f"stray       {_at(piece)}, far from the rest: not a part of the craft?" for piece in self.strays[:_LISTED]
        ]
        if len(self.strays) > _LISTED:
            text.append(
                f"stray       and {len(self.strays) - _LISTED:,} more, each a line in `examine_mesh(mesh).strays`"
            )
        if self.cube:
            text.append(
                f"cube        {_at(self.cube)}: a helper cube of the drawing, most likely; in NASA's models it is 1 m"
            )
        shell = f"{format_count(self.nonmanifold_edges, 'edge')} with over two"
        if not self.boundary_edges and not self.nonmanifold_edges:
            shell += "; watertight"
        text.append(f"holes       {format_count(self.boundary_edges, 'edge')} with one facet; {shell}")
        text.append(
            f"winding     {self.front_share:.2%} of first hits face the ray, "
            f"{format_count(self.turned_edges, 'edge')} turned: facets are two-sided here, so no light is lost"
        )
        text.append(
            f"hidden      {self.hidden:,} facets ({self.hidden_area_share:.1%} of the area) are never hit from outside"
        )
        return text


def examine_file(source: str | Path, scale: float | None = None) -> Examination:
    """Examine a mesh file, a CAD solid or a model of the catalogue, as `rso-lidar models check` does.

    Parameters
    ----------
    source : path of an STL, OBJ, PLY, GLB, glTF, OFF, STEP or IGES file, or name of a model
    scale : metres in one unit of the file (None: as the file states, or as it is known by its SHA-256, else metres)

    Returns
    -------
    Examination

    Raises
    ------
    MeshError
        If the file cannot be read, or the scale is not above 0.
    ScenarioError
        If no model has that name.
    """
    if scale is not None and not 0.0 < scale < math.inf:
        raise MeshError(f"--scale {scale:g}: is not a scale; give a number over 0")
    path = Path(source)
    if is_cad(path):
        blob, unit_m = tessellate(path)
        mesh = normalize_mesh(parse_mesh(path, blob, ".glb"), unit_m)
    elif path.suffix or path.exists() or len(path.parts) > 1:
        mesh = load_mesh(path)
    else:
        mesh = model(str(source)).mesh
    entry = known_meshes().get(mesh.sha256) if path.exists() else None
    metres = scale or (1.0 / entry["units_per_metre"] if entry else 1.0)
    examination = examine_mesh(normalize_mesh(mesh, metres))
    if entry is None:
        return examination
    known = f"{entry['file']} of NASA's printable models: one unit is {metres:.6g} m; `models add` corrects it"
    return replace(examination, known=known)


def examine_mesh(mesh: Mesh) -> Examination:
    """Examine a mesh: unit, components, holes, winding, hidden facets, and repairs made on loading.

    Parameters
    ----------
    mesh : in metres. It is not changed; a mesh with holes and mixed winding can be simulated

    Returns
    -------
    Examination
        The findings. Its method `lines` puts them into words.

    Raises
    ------
    MeshError
        If coordinates are too large for float32 to resolve a metre.
    """
    surface = build_surface("mesh", mesh)  # first, because it raises an error for coordinates that are too large
    facets = merge_vertices(mesh)
    edges, ends = np.sort(directed_edges(facets), axis=1), directed_edges(facets)
    _, number, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    number = number.reshape(-1)
    forward = np.bincount(number, weights=ends[:, 0] < ends[:, 1], minlength=len(count))
    component = number_components(number, len(facets))
    area = surface.areas_m2
    strays = _strays(surface.corners, component, area)
    front_share, hidden = _probe_visibility(surface)
    x, y, z = (float(side) for side in mesh.size_m)
    return Examination(
        size_m=(x, y, z),
        facets=mesh.source_facets,
        degenerate=mesh.degenerate,
        left_out=mesh.left_out,
        duplicates=len(facets) - len(np.unique(np.sort(facets, axis=1), axis=0)),
        parts=len(mesh.part_names),
        components=int(component.max()) + 1,
        strays=tuple(describe_component(mesh, of) for of in split_components(component, strays)),
        boundary_edges=int(np.count_nonzero(count == 1)),
        nonmanifold_edges=int(np.count_nonzero(count > 2)),
        turned_edges=int(np.count_nonzero((count == 2) & (forward != 1))),
        front_share=front_share,
        hidden=int(np.count_nonzero(hidden)),
        hidden_area_share=float(area[hidden].sum() / area.sum()),
        area_m2=float(area.sum()),
        cube=find_helper_cube(mesh),
    )


def _at(piece: Component) -> str:
    x, y, z = piece.center_m
    about = ", ".join(f"{value + 0.0:.2f}" for value in (round(x, 2), round(y, 2), round(z, 2)))
    facets = format_count(piece.facets, "facet")
    return f"{facets} from facet {piece.first_facet} on, {piece.size_m:.4g} m across, about ({about}) m"


def _strays(corners: np.ndarray, component: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Find components that are entirely beyond twice the radius that holds 95 % of the surface.

    Parameters
    ----------
    corners : (facet, corner, xyz) [m]
    component : (facet), number of the component
    area : (facet) [m²]
    """
    middle = corners.mean(axis=1)
    order = np.argsort(middle, axis=0)
    center = np.array([_median(middle[order[:, k], k], area[order[:, k]]) for k in range(3)])
    distance = np.linalg.norm(middle - center, axis=1)
    outward = np.argsort(distance)
    most = distance[outward[np.searchsorted(np.cumsum(area[outward]), 0.95 * area.sum())]]
    nearest = np.full(component.max() + 1, np.inf)
    np.minimum.at(nearest, component, np.linalg.norm(corners - center, axis=2).min(axis=1))
    return np.flatnonzero(nearest > _STRAY * most)


def _median(rising: np.ndarray, weight: np.ndarray) -> float:
    """Return the weighted median of ascending values; of two that are equal to rounding, the lower one."""
    below = np.cumsum(weight)
    return float(rising[np.searchsorted(below, 0.5 * below[-1] * (1.0 - _TIE))])


def _probe_visibility(surface: Surface) -> tuple[float, np.ndarray]:
    """Return the share of first hits on front faces, and which facets (facet) cannot be seen from outside."""
    center, radius = surface.sphere
    corners = surface.corners
    normal = surface.planes[:3].T
    step = (np.arange(_GRID) + 0.5) / _GRID * 2.0 - 1.0
    across = np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2)
    across = across[(across**2).sum(axis=1) <= 1.0] * radius
    facing = hits = 0
    seen = np.zeros(len(corners), dtype=bool)
    directions = _sphere_directions(_DIRECTIONS)
    for direction in directions:
        side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        side /= np.linalg.norm(side)
        up = np.cross(direction, side)
        origins = center - 1.01 * radius * direction + across[:, :1] * side + across[:, 1:] * up
        struck = _first(surface.embree, origins, np.broadcast_to(direction, origins.shape))
        struck = struck[struck >= 0]
        seen[struck] = True
        hits += len(struck)
        facing += int(np.count_nonzero(normal[struck] @ direction < 0.0))
    for weights in ((1 / 3, 1 / 3, 1 / 3), (0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)):
        points = np.einsum("c,fci->fi", np.array(weights), corners)
        for direction in directions:
            left = np.flatnonzero(~seen & (np.abs(normal @ direction) > _GRAZING))
            if len(left):
                origins = points[left] + 2e-5 * radius * direction
                free = _first(surface.embree, origins, np.broadcast_to(direction, origins.shape)) < 0
                seen[left[free]] = True
    return facing / max(hits, 1), ~seen


def _first(embree: Any, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the facet that each ray hits first, -1 where none.

    Parameters
    ----------
    origins : (ray, xyz) origins of the rays [m]
    directions : (ray, xyz) their directions
    """
    struck: np.ndarray = embree.run(origins.astype(np.float32), np.ascontiguousarray(directions, dtype=np.float32))
    return struck


def _sphere_directions(count: int) -> np.ndarray:
    """Return unit vectors (count, xyz) spread evenly over the sphere, on a golden-angle spiral."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
