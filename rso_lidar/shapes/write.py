"""Models to files: one binary glTF per craft, and the two tables that describe them.

`python -m rso_lidar.shapes.write [folder]` writes them, by default to where the package looks for them.
"""

from __future__ import annotations

import hashlib
import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.shapes.build import builders
from rso_lidar.shapes.materials import MATERIALS
from rso_lidar.shapes.model import CraftModel
from rso_lidar.shipped import shipped

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125  # glTF 2.0, table of accessor component types
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_GENERATED = (
    "# Written by `python -m rso_lidar.shapes.write` from the builders in rso_lidar/shapes; edit those, not this.\n\n"
)


def write(folder: Path) -> list[Path]:
    """Write every model as GLB, `index.toml` and `materials.toml` into a folder, and return the paths of the files."""
    import tomli_w

    folder.mkdir(parents=True, exist_ok=True)
    written, entries = [], []
    for builder in builders().values():
        model = builder()
        content = glb(model)
        path = folder / f"{model.name}.glb"
        path.write_bytes(content)
        written.append(path)
        entries.append(statement(model, content))
    for name, table in (("index.toml", {"model": entries}), ("materials.toml", MATERIALS)):
        path = folder / name
        path.write_text(_GENERATED + tomli_w.dumps(table), encoding="utf-8")
        written.append(path)
    return written


def statement(model: CraftModel, content: bytes) -> dict[str, Any]:
    """Describe a model for the index; `content` is the content of its file."""
    symmetry = {} if model.symmetry is None else {"symmetry": model.symmetry.model_dump(exclude_defaults=True)}
    return {
        "name": model.name,
        "file": f"{model.name}.glb",
        "what": model.what,
        "source": model.source,
        "licence": "MIT",
        "size_m": _rounded(model.size_m, 4),
        "facets": model.facet_count,
        "size_bytes": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
        "axes": model.axes,
        "center_of_mass_m": _rounded(model.center_of_mass_m, 5),
        "mass_kg": round(model.mass_kg, 3),
        "inertia_kg_m2": [_rounded(row, 5) for row in model.inertia_kg_m2],
        "confidence": model.confidence,
        "parts": model.materials,
        "part_classes": model.part_classes,
        "taxonomy": model.taxonomy.model_dump(),
        "hinge": [hinge.model_dump(exclude_none=True) for hinge in model.hinges],
    } | symmetry


def _rounded(values: np.ndarray, digits: int) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]  # + 0.0 turns -0.0 into 0.0


def glb(model: CraftModel) -> bytes:
    """Encode a model as binary glTF 2.0: one mesh and node per part, float32 coordinates [m] in the model's axes (z up)."""
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
        "materials": [_appearance(name) for name in names],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _appearance(name: str) -> dict[str, Any]:
    """Return the glTF material that a viewer shows; the lidar uses materials.toml instead."""
    colour = [*MATERIALS[name]["display_rgb"], 1.0]
    look = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}


if __name__ == "__main__":
    for place in write(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped("models")):
        sys.stdout.write(f"{place}\n")
