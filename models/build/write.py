"""Models to files: one binary glTF per craft, and the two tables that describe them.

`python -m models.build.write [folder]` writes them, by default to where the package looks for them.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import Any

import numpy as np

from models.build.build import builders
from models.build.keypoints import find_keypoints
from models.build.materials import MATERIALS
from rso_lidar.shapes import CraftModel, glb
from rso_lidar.shipped import shipped

_GENERATED = "# Written by `python -m models.build.write` from the builders in models/build; edit those, not this.\n\n"


def write(folder: Path) -> list[Path]:
    """Write every model as GLB, `index.toml` and `materials.toml` into a folder, and return the paths of the files."""
    import tomli_w

    folder.mkdir(parents=True, exist_ok=True)
    display_rgb = {name: table["display_rgb"] for name, table in MATERIALS.items()}
    written, entries = [], []
    for builder in builders().values():
        model = builder()
        content = glb(model, display_rgb)
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
        "keypoint": [point.model_dump(exclude_none=True) for point in find_keypoints(model.parts, model.part_classes)],
        "hinge": [hinge.model_dump(exclude_none=True) for hinge in model.hinges],
    } | symmetry


def _rounded(values: np.ndarray, digits: int) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]  # + 0.0 turns -0.0 into 0.0


if __name__ == "__main__":
    for place in write(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped("models")):
        sys.stdout.write(f"{place}\n")
