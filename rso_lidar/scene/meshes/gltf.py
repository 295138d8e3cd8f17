"""glTF 2.0 and GLB: triangles of the nodes of a scene."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.scene.meshes.accessors import COMPRESSIONS, GltfFile
from rso_lidar.scene.meshes.node_tree import check_tree, count_instances, find_users, place_instances, place_nodes
from rso_lidar.scene.meshes.polygons import MeshPiece, check_facet_count

_MOST_PRIMITIVES = 50_000
_TRIANGLES, _STRIP, _MODES = 4, 5, 7  # modes; those below are points and lines, and the last one is a fan
_APPLIED = ("KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_node_visibility", "AGI_articulations")
# Extensions that leave every vertex where it is: materials, textures, light, sound, physics, metadata, and lines.
_HARMLESS = re.compile(
    r"(KHR|EXT|ADOBE|NV|MSFT|FB)_(materials|texture|lights|xmp|audio)_?\w*|KHR_techniques_webgl|KHR_animation_pointer|"
    r"KHR_node_(hover|select)ability|KHR_interactivity|KHR_physics_rigid_bodies|KHR_(implicit|collision)_shapes|"
    r"EXT_(mesh|instance)_features|EXT_(structural|feature)_metadata|EXT_mesh_manifold|MSFT_lod|MSFT_packing_\w+|"
    r"FB_geometry_metadata|AGI_stk_metadata|CESIUM_primitive_outline|GODOT_single_root|OMI_\w+|MOZ_\w+"
)
# Where an extension can move, add or hide vertices. Those of materials, textures and cameras cannot.
_GEOMETRY = ("scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "skins")
_GREY = (102, 102, 102)  # of a material without a colour of its own
_CURE = "export it without"


class _Primitive(NamedTuple):
    """A primitive of triangles: its table, and how many facets it has."""

    table: Mapping[str, Any]
    facets: int


def read_gltf(path: Path, blob: bytes) -> list[MeshPiece]:
    """Read the scene of a GLB or glTF file.

    The default scene is read; the first one where none is the default; all nodes in a file without scenes. A mesh is a part
    by its name. If several nodes use it, each of them is a part by its own name. Pictures are not opened.

    Returns
    -------
    the triangles of each primitive of a mesh at each node, ordered by mesh, primitive and node.

    Raises
    ------
    MeshError
        If the file is damaged, asks for more memory than it is worth, or has geometry that is not applied.
    """
    document = GltfFile(path, blob)
    _check_extensions(document)
    meshes = document.list_of(document.tree, "meshes")
    shapes = _list_shapes(document, meshes)
    nodes = document.list_of(document.tree, "nodes")
    children = check_tree(document, nodes)
    worlds = place_nodes(document, nodes, children)
    users = find_users(document, nodes, children, meshes)
    total = 0
    for own, of in zip(users, shapes, strict=True):
        facets = sum(shape.facets for shape in of)
        total += facets * sum(count_instances(document, nodes[node]) for node in own)
    check_facet_count(document.where, total)
    instances = {node: place_instances(document, nodes[node]) for own in users for node in own}
    if not total and any(shape.facets for own in shapes for shape in own):
        raise document.refuse("its scene shows none of its meshes; add their nodes to the scene, or make them visible")
    return list(_make_pieces(document, (meshes, shapes, users), nodes, worlds, instances))


def _check_extensions(document: GltfFile) -> None:
    """Raise `MeshError` for what changes geometry and is not applied here."""
    required = [str(name)[:60] for name in document.list_of(document.tree, "extensionsRequired", str)]
    used = set(document.table_of(document.tree, "extensions"))
    for key in _GEOMETRY:
        for entry in document.list_of(document.tree, key):
            used.update(document.table_of(entry, "extensions"))
            for primitive in document.list_of(entry, "primitives") if key == "meshes" else ():
                used.update(document.table_of(primitive, "extensions"))
    unknown = [
        name
        for name in sorted({*required, *used})
        if name not in _APPLIED and not _HARMLESS.fullmatch(name) and (name in required or name not in COMPRESSIONS)
    ]
    packed = [name for name in unknown if name in COMPRESSIONS]
    if packed:
        raise document.refuse(f"is compressed with {packed[0]}, which is not read; export it without compression")
    if unknown:
        names = ", ".join(name[:60] for name in unknown[:8]) + (" and others" if len(unknown) > 8 else "")
        raise document.refuse(f"uses {names}, which may change its geometry and is not read; {_CURE}")
    articulations = document.table_of(document.table_of(document.tree, "extensions"), "AGI_articulations")
    for articulation in document.list_of(articulations, "articulations"):
        for stage in document.list_of(articulation, "stages"):
            still = 1.0 if str(stage.get("type")).endswith("cale") else 0.0
            if stage.get("initialValue", still) != still:
                name = str(articulation.get("name"))[:60]
                raise document.refuse(
                    f"AGI_articulations turns or moves '{name}' at the start, which is not applied; {_CURE}"
                )


def _list_shapes(document: GltfFile, meshes: list[Any]) -> list[list[_Primitive]]:
    """Return the primitives of each mesh, after checking that their accessors are within their buffers."""
    primitives, shapes = 0, []
    for mesh in meshes:
        own = []
        tables = document.list_of(mesh, "primitives")
        primitives += len(tables)
        if primitives > _MOST_PRIMITIVES:
            raise document.refuse(f"has over {_MOST_PRIMITIVES:,} pieces; join some and export it again")
        for table in tables:
            mode = document.count_of(table, "mode", _TRIANGLES)
            if mode >= _MODES:
                raise document.refuse(f"has a piece of mode {mode}, which glTF does not have; export it again")
            corners = 0
            if mode >= _TRIANGLES:  # points and lines reflect nothing
                attributes = document.table_of(table, "attributes")
                if "POSITION" not in attributes:
                    raise document.refuse("a piece has no POSITION; export it again")
                corners = document.count_values(document.count_of(attributes, "POSITION"))
                if "indices" in table:
                    corners = document.count_values(document.count_of(table, "indices"))
            own.append(_Primitive(table, corners // 3 if mode == _TRIANGLES else max(corners - 2, 0)))
        shapes.append(own)
    return shapes


def _make_pieces(
    document: GltfFile,
    of_meshes: tuple[list[Any], list[list[_Primitive]], list[list[int]]],
    nodes: list[Any],
    worlds: list[np.ndarray],
    instances: dict[int, np.ndarray],
) -> Iterator[MeshPiece]:
    """Yield the triangles of each primitive of a mesh at each node that uses it.

    Parameters
    ----------
    of_meshes : tables of the meshes, `meshes` of the file, their primitives, and the nodes that use them
    nodes : tables of the nodes, `nodes` of the file
    worlds : matrix scene_from_node (4, 4) of each node
    instances : matrices node_from_instance (instance, 4, 4) of each node that is used
    """
    names = _name_parts(of_meshes, nodes)
    for number, (mesh, shapes, users) in enumerate(zip(*of_meshes, strict=True)):
        for k, shape in enumerate(shapes):
            if not shape.facets or not users:
                continue
            facets, used = _read_facets(document, shape.table)
            colours = _read_colours(document, shape.table, facets, used)
            material = _name_material(document, shape.table)
            for node in users:
                points = _read_points(document, shape.table, used, (nodes[node], mesh), worlds)
                pose = np.eye(4) if "skin" in nodes[node] else worlds[node]  # joints place a skin, not its own node
                matrices = pose @ instances[node]
                if len(matrices) != 1 or not np.array_equal(matrices[0], np.eye(4)):
                    turned = np.einsum("nij,pj->npi", matrices[:, :3, :3], points)
                    points = (turned + matrices[:, None, :3, 3]).reshape(-1, 3)
                first = len(used) * np.arange(len(matrices))[:, None, None]
                yield MeshPiece(
                    names[number, k, node],
                    points,
                    (facets[None] + first).reshape(-1, 3),
                    None if colours is None else np.tile(colours, (len(matrices), 1)),
                    np.zeros(len(facets) * len(matrices), dtype=np.int64),
                    (material,),
                )


def _name_parts(
    of_meshes: tuple[list[Any], list[list[_Primitive]], list[list[int]]], nodes: list[Any]
) -> dict[tuple[int, int, int], str]:
    """Return a name for each mesh, primitive and node: that of the mesh, or of the node where several use the mesh.

    A name that is taken gets a number, as in ``panel_1``.
    """
    names: dict[tuple[int, int, int], str] = {}
    taken: set[str] = set()
    free: dict[str, int] = {}

    def take(wish: str) -> str:
        stem, _, last = wish.rpartition("_")
        name, number = wish or "geometry_1", 1
        if stem and last.isdecimal() and len(last) < 10:
            number = int(last) + 1
        else:
            stem = wish or "geometry"
        number = max(number, free.get(stem, 0))
        while name in taken:
            name, number = f"{stem}_{number}", number + 1
            free[stem] = number
        taken.add(name)
        return name

    for shared in (False, True):
        for mesh, (table, shapes, users) in enumerate(zip(*of_meshes, strict=True)):
            if shared != (len(users) > 1):
                continue
            for k in range(len(shapes)):
                for node in users if shared else (users or [-1]):
                    own = nodes[node].get("name") if node >= 0 else None
                    wish = (own or table.get("name")) if shared else (table.get("name") or own)
                    names[mesh, k, node] = take(str(wish or "GLTF"))
    return names


def _read_facets(document: GltfFile, table: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets (facet, 3) of a primitive, and the vertices that they use, by which they are numbered."""
    count = document.count_values(document.count_of(table["attributes"], "POSITION"))
    corners = np.arange(count)
    if "indices" in table:
        read = document.read(document.count_of(table, "indices"), "SCALAR", "indices that are not single numbers")
        if read.dtype.kind != "u":
            raise document.refuse("has indices that are not whole numbers from 0 up; export it again")
        if read.max() >= count:
            raise document.refuse("a facet names a vertex that is not in the file; export the mesh again")
        corners = read.reshape(-1).astype(np.int64)
    mode = table.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise document.refuse(f"has triangles of {len(corners):,} corners, not a multiple of 3; export it again")
        facets = corners.reshape(-1, 3)
    elif mode == _STRIP:
        facets = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
        facets[1::2] = facets[1::2, [1, 0, 2]]  # every second triangle turns the other way
    else:
        facets = np.stack([np.broadcast_to(corners[0], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)
    used, numbered = np.unique(facets, return_inverse=True)
    return numbered.reshape(-1, 3), used


def _read_points(
    document: GltfFile,
    table: Mapping[str, Any],
    used: np.ndarray,
    holders: tuple[Mapping[str, Any], Mapping[str, Any]],
    worlds: list[np.ndarray],
) -> np.ndarray:
    """Return the vertices (vertex, xyz) of a primitive at a node, with morph targets and skin applied.

    Parameters
    ----------
    table : the primitive, with its `attributes`
    used : numbers of the vertices to read (vertex), from 0
    holders : the node, and its mesh; the `weights` of morph targets of the node replace those of the mesh
    worlds : matrix scene_from_node (4, 4) of each node, for the joints of a skin
    """
    wrong = "positions that are not three numbers each"
    attributes = table["attributes"]
    node, mesh = holders
    points = document.read(document.count_of(attributes, "POSITION"), "VEC3", wrong, used).astype(float)
    targets = document.list_of(table, "targets")
    weights = document.numbers_of(node if "weights" in node else mesh, "weights", None, [])
    for target, weight in zip(targets, weights.tolist(), strict=False):
        if weight and "POSITION" in target:
            points += weight * document.read(document.count_of(target, "POSITION"), "VEC3", wrong, used)
    if "skin" not in node:
        return points
    return _apply_skin(document, attributes, (used, points), document.count_of(node, "skin"), worlds)


def _apply_skin(
    document: GltfFile,
    attributes: Mapping[str, Any],
    bound: tuple[np.ndarray, np.ndarray],
    number: int,
    worlds: list[np.ndarray],
) -> np.ndarray:
    """Return vertices (vertex, xyz) in the scene's axes, moved by the joints of a skin (glTF 2.0, section 3.7.3.3).

    Parameters
    ----------
    attributes : of the primitive, with `JOINTS_0` and `WEIGHTS_0`
    bound : numbers of the vertices, and their places (vertex, xyz) where they are bound to the joints
    number : of the skin, from 0
    worlds : matrix scene_from_node (4, 4) of each node
    """
    used, points = bound
    skin = document.entry(document.list_of(document.tree, "skins"), number, "skin")
    joints = document.list_of(skin, "joints", int)
    matrices = np.stack(
        [document.entry(worlds, document.count_of({"joints": j}, "joints"), "node") for j in joints] or [np.eye(4)]
    )
    if "inverseBindMatrices" in skin:
        what = "matrices of a skin that are not 4 x 4"
        inverse = document.read(document.count_of(skin, "inverseBindMatrices"), "MAT4", what)
        if len(inverse) < len(joints):
            raise document.refuse("has fewer matrices of a skin than joints; export it again")
        matrices = matrices @ inverse[: len(matrices)].astype(float).reshape(-1, 4, 4).transpose(0, 2, 1)
    moved, sums = np.zeros_like(points), np.zeros(len(points))
    for k in range(len(attributes)):
        if f"JOINTS_{k}" not in attributes or f"WEIGHTS_{k}" not in attributes:
            break
        joint = document.read(
            document.count_of(attributes, f"JOINTS_{k}"), "VEC4", "joints that are not four numbers each", used
        )
        weight = document.read(
            document.count_of(attributes, f"WEIGHTS_{k}"), "VEC4", "weights that are not four numbers each", used
        )
        if joint.dtype.kind != "u" or joint.max(initial=0) >= len(joints):
            raise document.refuse("has joints of a skin that do not fit its vertices; export it again")
        for slot in range(4):
            pose = matrices[joint[:, slot]]
            share = weight[:, slot].astype(float)
            moved += share[:, None] * (np.einsum("pij,pj->pi", pose[:, :3, :3], points) + pose[:, :3, 3])
            sums += share
    if not (sums > 0.0).all():
        raise document.refuse("has vertices of a skin without joints; apply the skin and export it again")
    return moved / sums[:, None]


def _name_material(document: GltfFile, table: Mapping[str, Any]) -> str:
    """Return the name of the material of a primitive with its words joined, or as ``material_2``; empty without one."""
    if "material" not in table:
        return ""
    number = document.count_of(table, "material")
    material = document.entry(document.list_of(document.tree, "materials"), number, "material")
    return "_".join(str(material.get("name") or "").split()) or f"material_{number}"


def _read_colours(
    document: GltfFile, table: Mapping[str, Any], facets: np.ndarray, used: np.ndarray
) -> np.ndarray | None:
    """Return the colours (facet, rgb) of a primitive: of its material without textures, else the mean of its vertices'.

    Parameters
    ----------
    table : the primitive, with its `attributes`
    facets, used : (facet, 3), its triangles, and the numbers of the vertices that they are numbered by
    """
    if "material" in table:
        materials = document.list_of(document.tree, "materials")
        material = document.entry(materials, document.count_of(table, "material"), "material")
        rough = document.table_of(material, "pbrMetallicRoughness")
        shiny = document.table_of(document.table_of(material, "extensions"), "KHR_materials_pbrSpecularGlossiness")
        if "baseColorFactor" in rough:
            factor = document.numbers_of(rough, "baseColorFactor", 4, [])
        elif "diffuseFactor" in shiny:
            factor = document.numbers_of(shiny, "diffuseFactor", 4, [])
        else:
            return np.broadcast_to(np.array(_GREY, dtype=np.uint8), (len(facets), 3))
        colour = np.round(255.0 * np.clip(factor[:3], 0.0, 1.0)).astype(np.uint8)
        return np.broadcast_to(colour, (len(facets), 3))
    attributes = table["attributes"]
    if "COLOR_0" not in attributes:
        return None
    what = "colours that are not three numbers or four"
    rgb = document.read(document.count_of(attributes, "COLOR_0"), "VEC3|VEC4", what, used)[:, :3].astype(float)
    of_vertices = np.round(255.0 * np.clip(np.nan_to_num(rgb), 0.0, 1.0))
    mean: np.ndarray = of_vertices[facets].mean(axis=1).astype(np.uint8)
    return mean
