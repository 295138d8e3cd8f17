"""glTF: the tree of nodes, their places in the scene, and which of them are shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.scene.meshes.accessors import GltfFile

_MOST_NODES, _DEEPEST = 50_000, 1_000
_INSTANCING = {
    "TRANSLATION": ("VEC3", [0.0, 0.0, 0.0]),
    "ROTATION": ("VEC4", [0.0, 0.0, 0.0, 1.0]),
    "SCALE": ("VEC3", [1.0] * 3),
}


def check_tree(document: GltfFile, nodes: list[Any]) -> list[list[int]]:
    """Return the children of each node, after checking that the nodes form trees, not too many and not too deep."""
    if len(nodes) > _MOST_NODES:
        raise document.refuse(f"has over {_MOST_NODES:,} nodes; join some and export it again")
    children = [document.list_of(node, "children", int) for node in nodes]
    parents = [0] * len(nodes)
    for number in (child for own in children for child in own):
        document.entry(nodes, document.count_of({"children": number}, "children"), "node")
        parents[number] += 1
    level, seen, depth = [n for n, count in enumerate(parents) if not count], 0, 0
    while level:
        seen, depth = seen + len(level), depth + 1
        if depth > _DEEPEST:
            raise document.refuse(f"its nodes are over {_DEEPEST:,} deep; flatten them and export it again")
        level = [child for n in level for child in children[n]]
        if seen + len(level) > len(nodes):
            break
    if max(parents, default=0) > 1 or seen != len(nodes):
        raise document.refuse("its nodes are not a tree (a cycle, or two parents); export it again")
    return children


def place_nodes(document: GltfFile, nodes: list[Any], children: list[list[int]]) -> list[np.ndarray]:
    """Return the matrix scene_from_node (4, 4) of each node."""
    worlds = [_place(document, node) for node in nodes]
    level = sorted(set(range(len(nodes))) - {child for own in children for child in own})
    while level:
        for n in level:
            for child in children[n]:
                worlds[child] = worlds[n] @ worlds[child]
        level = [child for n in level for child in children[n]]
    return worlds


def _place(document: GltfFile, node: Mapping[str, Any]) -> np.ndarray:
    """Return the matrix parent_from_node (4, 4) of a node."""
    if "matrix" in node:
        whole: np.ndarray = document.numbers_of(node, "matrix", 16, []).reshape(4, 4).T
        return whole
    if not node.keys() & {"translation", "rotation", "scale"}:
        return np.eye(4)
    turn = document.numbers_of(node, "rotation", 4, [0.0, 0.0, 0.0, 1.0])
    scale = document.numbers_of(node, "scale", 3, [1.0, 1.0, 1.0])
    step = document.numbers_of(node, "translation", 3, [0.0, 0.0, 0.0])
    placed: np.ndarray = _compose(document, step[None], turn[None], scale[None])[0]
    return placed


def _compose(document: GltfFile, step: np.ndarray, turn: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the matrices (n, 4, 4) of translations (n, xyz), rotations (n, xyzw) and scales (n, xyz).

    Parameters
    ----------
    step, scale : (n, xyz)
    turn : quaternions (n, xyzw), of any length but zero
    """
    length = np.linalg.norm(turn, axis=1)
    if not (length > 0.0).all():
        raise document.refuse("has a 'rotation' of four zeros; correct it and export it again")
    matrices = np.zeros((len(step), 4, 4))
    x, y, z, w = (turn / length[:, None]).T
    matrices[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    matrices[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    matrices[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    matrices[:, :3, :3] *= scale[:, None, :]
    matrices[:, :3, 3], matrices[:, 3, 3] = step, 1.0
    return matrices


def count_instances(document: GltfFile, node: Mapping[str, Any]) -> int:
    """Return how often a node shows its mesh: once, or as often as EXT_mesh_gpu_instancing places it."""
    attributes = _list_instancing(document, node)
    if attributes is None:
        return 1
    counts = {document.count_values(number) for number in attributes.values()}
    if len(counts) != 1:
        raise document.refuse("EXT_mesh_gpu_instancing has no places, or not one number of them; export it again")
    return counts.pop()


def place_instances(document: GltfFile, node: Mapping[str, Any]) -> np.ndarray:
    """Return the matrices node_from_instance (instance, 4, 4): the identity, or those of EXT_mesh_gpu_instancing."""
    attributes = _list_instancing(document, node)
    if attributes is None:
        return np.eye(4)[None]
    values = []
    for key, (kind, default) in _INSTANCING.items():
        if key in attributes:
            what = f"a {key} of instances that is no {kind}"
            values.append(document.read(attributes[key], kind, what).astype(float))
        else:
            values.append(np.tile(np.array(default), (count_instances(document, node), 1)))
    return _compose(document, *values)


def _list_instancing(document: GltfFile, node: Mapping[str, Any]) -> dict[str, int] | None:
    """Return the accessors of EXT_mesh_gpu_instancing by what they hold; None for a node without it."""
    extensions = document.table_of(node, "extensions")
    if "EXT_mesh_gpu_instancing" not in extensions:
        return None
    attributes = document.table_of(document.table_of(extensions, "EXT_mesh_gpu_instancing"), "attributes")
    return {key: document.count_of(attributes, key) for key in _INSTANCING if key in attributes}


def find_users(document: GltfFile, nodes: list[Any], children: list[list[int]], meshes: list[Any]) -> list[list[int]]:
    """Return the visible nodes of the scene that use each mesh, in the order of the file."""
    scenes = document.list_of(document.tree, "scenes")
    if scenes:
        number = document.count_of(document.tree, "scene", 0)
        level = document.list_of(document.entry(scenes, number, "scene"), "nodes", int)
        for root in level:
            document.entry(nodes, document.count_of({"nodes": root}, "nodes"), "node")
    else:
        level = sorted(set(range(len(nodes))) - {child for own in children for child in own})
    reached: set[int] = set()
    while level:
        visible = []
        for n in level:
            state = document.table_of(document.table_of(nodes[n], "extensions"), "KHR_node_visibility")
            if state.get("visible", True) is not False and n not in reached:
                visible.append(n)
        reached.update(visible)
        level = [child for n in visible for child in children[n]]
    users: list[list[int]] = [[] for _ in meshes]
    for n in sorted(reached):
        if "mesh" in nodes[n]:
            document.entry(users, document.count_of(nodes[n], "mesh"), "mesh").append(n)
    return users
