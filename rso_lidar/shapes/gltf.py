"""Models as binary glTF 2.0."""

from __future__ import annotations

import json
import struct
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rso_lidar.shapes.model import CraftModel
from rso_lidar.shipped import shipped

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125  # glTF 2.0, table of accessor component types
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963


def glb(model: CraftModel, display_rgb: Mapping[str, Sequence[float]] | None = None) -> bytes:
    """Encode a model as binary glTF 2.0: one mesh and node per part, in the model's axes (z up).

    Parameters
    ----------
    model : the model; coordinates are stored as float32 [m]
    display_rgb : colour on screen (red, green, blue), each 0 to 1, by name of material; by default those of the shipped
        materials

    Returns
    -------
    bytes
        The content of a ``.glb`` file.
    """
    if display_rgb is None:
        materials = tomllib.loads(shipped("models/materials.toml").read_text(encoding="utf-8"))
        display_rgb = {name: material["display_rgb"] for name, material in materials.items()}
    buffer = b""
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    names = sorted(set(model.materials.values()))

    def store(array: np.ndarray, target: int, **accessor: Any) -> int:
        nonlocal buffer
        content = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(content), "target": target})
        accessors.append({"bufferView": len(views) - 1, **accessor})
        buffer += content + b"\0" * (-len(content) % 4)
        return len(accessors) - 1

    meshes = []
    for name, piece in model.pieces.items():
        # Rounded to 1e-9 m, so that rounding errors of other processors change no byte; + 0.0 turns -0.0 into 0.0
        vertices = (np.round(piece.solid.vertices, 9) + 0.0).astype("<f4")
        wide = len(vertices) > 65535
        indices = piece.solid.facets.ravel().astype("<u4" if wide else "<u2")
        low, high = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
        position = store(
            vertices, _ARRAY_BUFFER, componentType=_FLOAT, count=len(vertices), type="VEC3", min=low, max=high
        )
        index_type = _UINT32 if wide else _UINT16
        index = store(indices, _ELEMENT_BUFFER, componentType=index_type, count=len(indices), type="SCALAR")
        shape = {
            "attributes": {"POSITION": position},
            "indices": index,
            "material": names.index(piece.material),
            "mode": 4,
        }
        meshes.append({"name": name, "primitives": [shape]})
    header = {
        "asset": {"version": "2.0", "generator": "rso_lidar.shapes", "extras": {"up": "z", "unit": "m"}},
        "scene": 0,
        "scenes": [{"name": model.name, "nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh["name"], "mesh": k} for k, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": [_appearance(name, display_rgb[name]) for name in names],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _appearance(name: str, rgb: Sequence[float]) -> dict[str, Any]:
    """Return the glTF material that a viewer shows; the lidar uses materials.toml instead."""
    look = {"baseColorFactor": [*rgb, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}
