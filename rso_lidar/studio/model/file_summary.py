"""What a file holds, in a few words, after the reader of its kind has read it; and files that a user uploads."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.files import MOST_BYTES, check_writable, read_bytes, write_atomically
from rso_lidar.orbit import OrbitParameterMessage, list_ephemeris_objects, read_element_sets
from rso_lidar.scene import load_mesh
from rso_lidar.studio.model.mesh_sizes import summarize_mesh
from rso_lidar.studio.model.root_folder import Folder

MESHES = (".stl", ".obj", ".ply", ".glb", ".off")
_ELEMENT_SETS = (".tle", ".3le", ".omm")
KINDS = (
    *MESHES,
    *_ELEMENT_SETS,
    ".toml",
    ".csv",
    ".json",
    ".oem",
    ".opm",
    ".aem",
    ".txt",
)  # suffixes of files that are read
MOST_UPLOAD_BYTES = 64 * 2**20


def summarize_file(path: Path) -> str:
    """Read a file with the reader that its suffix asks for, and return what it holds in a few words.

    Of tables, whose columns depend on what reads them, and of attitude messages only the encoding is checked.

    Parameters
    ----------
    path : of a file with one of the suffixes `KINDS`

    Raises
    ------
    RsoLidarError
        If its reader refuses it. The message begins with the file's name, without folders.
    """
    try:
        return _read(path)
    except RsoLidarError as error:
        raise ScenarioError(str(error).replace(str(path), path.name)) from None


def _read(path: Path) -> str:
    if path.suffix in MESHES:
        return summarize_mesh(load_mesh(path))
    if path.suffix in _ELEMENT_SETS:
        return f"{len(read_element_sets(path)):,} element sets"
    if path.suffix == ".oem":
        return f"ephemeris of {', '.join(list_ephemeris_objects(str(path)))}"
    if path.suffix == ".opm":
        return f"state of {OrbitParameterMessage.from_file(path).object_name or path.stem}"
    content = read_bytes(path, MOST_BYTES, ScenarioError)
    try:
        text = content.decode("utf-8-sig")
        if path.suffix == ".json":
            json.loads(text)
    except UnicodeDecodeError:
        raise ScenarioError(f"{path.name}: is not UTF-8 text; save it as UTF-8") from None
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{path.name}: is not JSON ({error}); export it again") from None
    return f"{len(content):,} bytes"


def keep_upload(folder: Folder, name: str, content: bytes) -> str:
    """Write an uploaded file into the folder after its reader has read it, and return a line about it.

    Raises
    ------
    RsoLidarError
        If the name is not allowed or taken, the file is too large, or its reader refuses it.
    """
    place = folder.resolve(name, KINDS)
    if len(content) > MOST_UPLOAD_BYTES:
        raise ScenarioError(f"{name}: has over {MOST_UPLOAD_BYTES >> 20} MB; copy it into the folder yourself")
    if place.exists():
        raise ScenarioError(f"{name}: is in the folder already; rename yours, or remove that one first")
    with tempfile.TemporaryDirectory() as aside:  # where no other file lies that a mesh could name
        tried = Path(aside) / place.name
        tried.write_bytes(content)
        said = summarize_file(tried)
    check_writable(place)
    with write_atomically(place) as draft:
        draft.write_bytes(content)
    return f"{name}: {said}"
