"""glTF: checks of a file before it is read, so that no small file can ask for boundless memory."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from rso_lidar.errors import MeshError

MOST_FACETS = 20_000_000  # of one target, all instances counted: some 2 GB of acceleration structure
_MOST_PRIMITIVES, _MOST_NODES, _DEEPEST = 50_000, 50_000, 1_000
_MOST_COMMAS = 5_000_000  # a list of empty lists takes twenty times its size in memory
_MAGIC, _JSON = b"glTF", 0x4E4F534A  # glTF 2.0, section 4.4
_TRIANGLES = (4, 5, 6)  # modes: triangles, strip, fan
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_SIZE = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}  # bytes of a component
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")


def check_gltf(path: Path, blob: bytes) -> None:
    """Check the counts, node tree and external files of a GLB or glTF; raise `MeshError` where they are unsafe to read."""
    where = path.name
    tree = _tree(where, blob)
    packed = sorted(set(_PACKED) & set(map(str, _list(where, tree, "extensionsRequired", str))))
    if packed:
        raise MeshError(f"{where}: is compressed with {packed[0]}, which is not read; export it without compression")
    for buffer in _list(where, tree, "buffers"):
        _check_outside(path, buffer.get("uri"))
    _check_tree(where, tree, _facets(where, tree))


def _tree(where: str, blob: bytes) -> Mapping[str, Any]:
    """Read the JSON of a file."""
    text = blob
    if blob[:4] == _MAGIC:
        if len(blob) < 20:
            raise MeshError(f"{where}: is cut short in its header; export it again")
        _, version, _, length, kind = struct.unpack_from("<4sIIII", blob)
        if version != 2 or kind != _JSON or length > len(blob) - 20:
            raise MeshError(f"{where}: is not a whole GLB of version 2; export it again as glTF 2.0")
        text = blob[20 : 20 + length]
    if text.count(b",") > _MOST_COMMAS:
        raise MeshError(
            f"{where}: its description has over {_MOST_COMMAS:,} entries; join its pieces and export it again"
        )
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError):
        raise MeshError(f"{where}: its description is not readable as JSON; export it again") from None
    if not isinstance(tree, dict):
        raise MeshError(f"{where}: its description is not glTF; export it again")
    return tree


def _list(where: str, table: Mapping[str, Any], key: str, of: type = dict) -> list[Any]:
    """Return a list of a glTF table, empty if it is absent.

    Parameters
    ----------
    where : name of the file, for messages.
    table : the table.
    key : key of the list.
    of : type that each entry must have.

    Raises
    ------
    MeshError
        If the value is not such a list.
    """
    found = table.get(key, [])
    if not isinstance(found, list) or not all(isinstance(entry, of) for entry in found):
        raise MeshError(f"{where}: '{key}' is not a list as glTF defines it; export it again")
    return found


def _whole(where: str, table: Mapping[str, Any], key: str, default: int | None = None) -> int:
    """Return a count or an index of a glTF table.

    Parameters
    ----------
    where : name of the file, for messages.
    table : the table.
    key : key of the number.
    default : value if the key is absent; None for an error.

    Raises
    ------
    MeshError
        If the value is not an integer from 0 up.
    """
    found = table.get(key, default)
    if type(found) is not int or found < 0:
        raise MeshError(f"{where}: '{key}' is {str(found)[:20]} and not a count; export it again")
    return found


def _entry(where: str, entries: list[Any], number: int, what: str) -> Any:
    """Return the entry of a list that another part of the file refers to.

    Parameters
    ----------
    where : name of the file, for messages.
    entries : the list.
    number : index of the entry.
    what : name of the list, for messages.

    Raises
    ------
    MeshError
        If the list is too short.
    """
    if number >= len(entries):
        raise MeshError(f"{where}: names {what} {number} of {len(entries)}; export it again")
    return entries[number]


def _check_outside(path: Path, uri: Any) -> None:
    """Raise `MeshError` for external data that are not a plain file in the same folder."""
    if uri is None or (isinstance(uri, str) and uri.startswith("data:")):
        return
    cure = "export it as one .glb"
    try:
        folder = path.resolve().parent
        places = [(folder / name).resolve() for name in (str(uri), unquote(str(uri)))]
        inside = isinstance(uri, str) and ":" not in uri and all(folder in place.parents for place in places)
        plain = inside and any(place.is_file() for place in places)
    except (OSError, ValueError):
        inside, plain = False, False
    if not inside:
        raise MeshError(f"{path.name}: names data outside its folder ({str(uri)[:60]}), which is not fetched; {cure}")
    if not plain:
        raise MeshError(f"{path.name}: its data file {str(uri)[:60]} is not there; put it beside, or {cure}")


def _facets(where: str, tree: Mapping[str, Any]) -> list[int]:
    """Return the number of triangles of each mesh, after checking that its accessors are within their buffers."""
    accessors, views = _list(where, tree, "accessors"), _list(where, tree, "bufferViews")
    buffers = _list(where, tree, "buffers")
    primitives, counts = 0, []
    for mesh in _list(where, tree, "meshes"):
        count = 0
        shapes = _list(where, mesh, "primitives")
        primitives += len(shapes)
        if primitives > _MOST_PRIMITIVES:
            raise MeshError(f"{where}: has over {_MOST_PRIMITIVES:,} pieces; join some and export it again")
        for shape in shapes:
            mode = shape.get("mode", 4)
            if mode not in _TRIANGLES:
                continue
            attributes = shape.get("attributes")
            if not isinstance(attributes, dict) or "POSITION" not in attributes:
                raise MeshError(f"{where}: a piece has no POSITION; export it again")
            places = [_whole(where, attributes, "POSITION")]
            places += [_whole(where, shape, "indices")] if "indices" in shape else []
            corners = [_corners(where, _entry(where, accessors, n, "accessor"), views, buffers) for n in places][-1]
            count += corners // 3 if mode == 4 else max(corners - 2, 0)
        counts.append(count)
    return counts


def _corners(where: str, accessor: Mapping[str, Any], views: list[Any], buffers: list[Any]) -> int:
    """Check that the data of an accessor are complete, and return its count.

    Parameters
    ----------
    where : name of the file, for messages.
    accessor : the accessor.
    views : all buffer views.
    buffers : all buffers.

    Returns
    -------
    number of values.

    Raises
    ------
    MeshError
        If they are not complete.
    """
    count = _whole(where, accessor, "count")
    if "sparse" in accessor or "bufferView" not in accessor:
        raise MeshError(f"{where}: has geometry that is sparse or without data, which is not read; export it again")
    width, size = _WIDTH.get(str(accessor.get("type"))), _SIZE.get(_whole(where, accessor, "componentType"))
    if width is None or size is None:
        raise MeshError(f"{where}: has geometry of a type that glTF does not have; export it again")
    view = _entry(where, views, _whole(where, accessor, "bufferView"), "bufferView")
    buffer = _entry(where, buffers, _whole(where, view, "buffer"), "buffer")
    start, length = _whole(where, view, "byteOffset", 0), _whole(where, view, "byteLength")
    step = _whole(where, view, "byteStride", width * size) or width * size
    needed = _whole(where, accessor, "byteOffset", 0) + max(count - 1, 0) * step + min(count, 1) * width * size
    if step < width * size or needed > length or start + length > _whole(where, buffer, "byteLength"):
        raise MeshError(f"{where}: states {count:,} values, more than its data hold; export it again")
    return count


def _check_tree(where: str, tree: Mapping[str, Any], facets: list[int]) -> None:
    """Check that the nodes form a tree, and that they do not repeat a mesh too often.

    Parameters
    ----------
    where : name of the file, for messages.
    tree : the whole file.
    facets : number of facets of each mesh.

    Raises
    ------
    MeshError
        If the nodes form a cycle, are too many or too deep, or hold too many facets.
    """
    nodes = _list(where, tree, "nodes")
    if len(nodes) > _MOST_NODES:
        raise MeshError(f"{where}: has over {_MOST_NODES:,} nodes; join some and export it again")
    children = [_list(where, node, "children", int) for node in nodes]
    parents = [0] * len(nodes)
    for number in (child for own in children for child in own):
        _entry(where, nodes, number, "node") if number >= 0 else _whole(where, {"children": number}, "children")
        parents[number] += 1
    level, seen, depth = [n for n, count in enumerate(parents) if not count], 0, 0
    while level:
        seen, depth = seen + len(level), depth + 1
        if depth > _DEEPEST:
            raise MeshError(f"{where}: its nodes are over {_DEEPEST:,} deep; flatten them and export it again")
        level = [child for n in level for child in children[n]]
        if seen + len(level) > len(nodes):
            break
    if max(parents, default=0) > 1 or seen != len(nodes):
        raise MeshError(f"{where}: its nodes are not a tree (a cycle, or two parents); export it again")
    total = 0
    for node in nodes:
        if "mesh" in node:
            number = _whole(where, node, "mesh")
            _entry(where, facets, number, "mesh")
            total += facets[number]
    if total > MOST_FACETS:
        raise MeshError(f"{where}: holds {total:,} facets, over {MOST_FACETS:,}; decimate it and export it again")
