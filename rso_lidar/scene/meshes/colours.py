"""Colours of facets in a mesh's file, which tell materials apart where parts have no names."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import MeshError
from rso_lidar.scene.meshes.gltf import check_gltf
from rso_lidar.scene.meshes.mesh import Mesh, silence_trimesh

SUFFIXES = (".glb", ".ply")


def read_facet_colours(mesh: Mesh) -> np.ndarray:
    """Read the colours (facet in the file, rgb) of facets as bytes, numbered like `Mesh.source_facet`.

    GLB gives a base colour to each group; textures are ignored. PLY gives colours to facets, or to vertices, of which a
    facet gets the mean.
    """
    import trimesh

    path = mesh.path
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise MeshError(
            f"{path.name}: colours are read from {' and '.join(SUFFIXES)} only; give parts or facets instead"
        )
    try:
        if suffix == ".glb":
            check_gltf(path, path.read_bytes())
        with silence_trimesh(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(path, process=False)
            order = {name: number for number, name in enumerate(scene.geometry)}
            nodes = sorted(scene.graph.nodes_geometry, key=lambda node: order[scene.graph[node][1]])
            pieces = [scene.geometry[scene.graph[node][1]] for node in nodes]
            colours = [_of(piece, path) for piece in pieces if len(getattr(piece, "faces", ()))]
    except (MeshError, MemoryError):
        raise
    except Exception:
        raise MeshError(f"{path.name}: its colours cannot be read; give parts or facets instead") from None
    found = np.concatenate(colours)
    if len(found) != mesh.source_facets:
        raise MeshError(
            f"{path.name}: has colours for {len(found)} of {mesh.source_facets} facets; give parts or facets"
        )
    return found


def _of(piece: Any, path: Path) -> np.ndarray:
    """Return the colours (facet, rgb) of one geometry."""
    material = getattr(piece.visual, "material", None)
    if material is not None:
        return np.broadcast_to(np.asarray(material.main_color, dtype=np.uint8)[:3], (len(piece.faces), 3))
    if piece.visual.kind is None:
        raise MeshError(f"{path.name}: contains no colours; give parts or facets instead")
    colours: np.ndarray = np.asarray(piece.visual.face_colors, dtype=np.uint8)[:, :3]
    return colours


def format_colours(colours: np.ndarray) -> np.ndarray:
    """Format colours (…, rgb) as texts such as ``#a29225``."""
    numbers = (colours.astype(np.int64) * np.array([65536, 256, 1])).sum(axis=-1)
    distinct, place = np.unique(numbers, return_inverse=True)
    texts: np.ndarray = np.array([f"#{number:06x}" for number in distinct.tolist()], dtype=object)[place]
    return texts.reshape(colours.shape[:-1])
