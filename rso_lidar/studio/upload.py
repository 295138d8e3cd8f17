"""Files that a user uploads into the folder: bounded, checked by their reader, and never over another file."""

from __future__ import annotations

import tempfile
from pathlib import Path

from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.studio.model.file_summary import KINDS, summarize_file
from rso_lidar.studio.model.root_folder import Folder

MOST_BYTES = 64 * 2**20


def keep_upload(folder: Folder, name: str, content: bytes) -> str:
    """Write an uploaded file into the folder after its reader has read it, and return a line about it.

    Raises
    ------
    RsoLidarError
        If the name is not allowed or taken, the file is too large, or its reader refuses it.
    """
    place = folder.resolve(name, KINDS)
    if len(content) > MOST_BYTES:
        raise ScenarioError(f"{name}: has over {MOST_BYTES >> 20} MB; copy it into the folder yourself")
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
