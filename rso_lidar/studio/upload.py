"""Files that a user uploads into the folder: bounded, checked by their reader, and never over another file."""

from __future__ import annotations

import tempfile
from pathlib import Path

from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.files.root_folder import Folder
from rso_lidar.orbit.sets.formats import read_element_sets
from rso_lidar.scene import load_mesh

MOST_BYTES = 64 * 2**20
_MESHES = (".stl", ".obj", ".ply", ".glb", ".off")
_ELEMENT_SETS = (".tle", ".3le", ".omm")
SUFFIXES = (*_MESHES, *_ELEMENT_SETS, ".toml", ".csv", ".json", ".oem", ".aem", ".txt")


def keep_upload(folder: Folder, name: str, content: bytes) -> str:
    """Write an uploaded file into the folder after its reader has read it, and return a line about it.

    Parameters
    ----------
    folder : of the studio.
    name : of the file.
    content : of the file.

    Raises
    ------
    RsoLidarError
        If the name is not allowed or taken, the file is too large, or its reader refuses it.
    """
    place = folder.resolve(name, SUFFIXES)
    if len(content) > MOST_BYTES:
        raise ScenarioError(f"{name}: has over {MOST_BYTES >> 20} MB; copy it into the folder yourself")
    if place.exists():
        raise ScenarioError(f"{name}: is in the folder already; rename yours, or remove that one first")
    with tempfile.TemporaryDirectory() as aside:  # where no other file lies that a mesh could name
        tried = Path(aside) / place.name
        tried.write_bytes(content)
        said = _check(tried)
    check_writable(place)
    with write_atomically(place) as draft:
        draft.write_bytes(content)
    return f"{name}: {said}"


def _check(path: Path) -> str:
    """Read a file, and return what it holds in a few words."""
    if path.suffix in _MESHES:
        mesh = load_mesh(path)
        return f"{len(mesh.facets):,} facets, {len(mesh.part_names)} parts"
    if path.suffix in _ELEMENT_SETS:
        return f"{len(read_element_sets(path)):,} element sets"
    if path.suffix == ".toml":
        try:
            path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            raise ScenarioError(f"{path.name}: is not UTF-8 text; save it as UTF-8") from None
    return f"{path.stat().st_size:,} bytes"
