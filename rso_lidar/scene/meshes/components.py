"""Connected components of a mesh: facets that share edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.scene.meshes.mesh import Mesh


@dataclass(frozen=True)
class Component:
    """A component: its number of facets, the first of them in the file, its centre (xyz) and its longest side [m]."""

    facets: int
    first_facet: int
    center_m: tuple[float, float, float]
    size_m: float


def find_helper_cube(mesh: Mesh) -> Component | None:
    """Find a component of twelve facets that is a cube along the axes about the origin; None where there is none."""
    facets = merge_vertices(mesh)
    _, number = np.unique(np.sort(directed_edges(facets), axis=1), axis=0, return_inverse=True)
    component = number_components(number.reshape(-1), len(facets))
    for of in split_components(component, np.flatnonzero(np.bincount(component) == 12)):
        points = mesh.vertices[np.unique(mesh.facets[of])]
        low, high = points.min(axis=0), points.max(axis=0)
        side = float((high - low).max())
        at_corners = np.minimum(np.abs(points - low), np.abs(points - high)).max()
        uneven = (high - low).max() - (high - low).min()
        if max(uneven, at_corners, np.abs(low + high).max()) < 1e-3 * side:
            return describe_component(mesh, of)
    return None


def merge_vertices(mesh: Mesh) -> np.ndarray:
    """Return the facets (facet, 3) with one number for vertices in the same place."""
    _, place = np.unique(mesh.vertices.astype(np.float32), axis=0, return_inverse=True)
    merged: np.ndarray = place.reshape(-1)[mesh.facets]
    return merged


def directed_edges(facets: np.ndarray) -> np.ndarray:
    """Return the directed edges (3 * facet, 2), three for each facet."""
    return np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)


def number_components(edge: np.ndarray, facets: int) -> np.ndarray:
    """Number the components: return that of each facet (facet), from the numbers of its three edges."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(np.diff(edge[order]) == 0)
    facet, neighbour = order[same] // 3, order[same + 1] // 3
    graph = coo_array((np.ones(len(facet), dtype=np.int8), (facet, neighbour)), shape=(facets, facets))
    component: np.ndarray = connected_components(graph, directed=False)[1]
    return component


def split_components(component: np.ndarray, selected: np.ndarray) -> list[np.ndarray]:
    """Return the facets of each selected component."""
    of = np.flatnonzero(np.isin(component, selected))
    of = of[np.argsort(component[of], kind="stable")]
    return np.split(of, np.flatnonzero(np.diff(component[of])) + 1) if len(of) else []


def describe_component(mesh: Mesh, of: np.ndarray) -> Component:
    """Describe the component that some facets make."""
    points = mesh.vertices[mesh.facets[of]].reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, z = (float(value) for value in 0.5 * (low + high))
    numbers = mesh.source_facet[of]
    return Component(len(numbers), int(numbers.min()), (x, y, z), float((high - low).max()))
