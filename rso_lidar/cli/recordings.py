"""Recordings as arguments of commands, and the selection of their frames."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export
from rso_lidar.errors import RecordingError, ScenarioError

RecordingFile = Annotated[Path, typer.Argument(metavar="REC", help="Recording (.h5, .nc, or .zarr).")]


def parse_frames(text: str | None) -> slice | None:
    """Parse ``A:B`` or ``A:B:C`` as a slice."""
    if text is None:
        return None
    try:
        ends = [int(word) if word else None for word in text.split(":")]
        if len(ends) == 1 and ends[0] is not None:
            return slice(ends[0], ends[0] + 1)
        if len(ends) in (2, 3) and (len(ends) == 2 or ends[2] is None or ends[2] > 0):
            return slice(*ends)
    except ValueError:
        pass
    raise ScenarioError(f"--frames {text}: is not A:B or A:B:STEP; write for example 0:100")


def select_frames(read: export.Recording, frames: str | None) -> list[int]:
    """Select frames of a recording by their numbers."""
    numbers = read.frame_index[:]
    if not numbers.size:
        raise RecordingError(f"{read.path}: holds no frames yet; run the scenario again")
    wanted = parse_frames(frames)
    if wanted is None:
        return list(range(numbers.size))
    places = np.flatnonzero(np.isin(numbers, np.arange(int(numbers.max()) + 1)[wanted])).tolist()
    if not places:
        held = f"{numbers.size} from {numbers.min()} to {numbers.max()}"
        raise RecordingError(f"--frames {frames}: {read.path.name} holds none of them, but {held}")
    return list(places)


def count_bytes(path: Path) -> int:
    """Return the size of a file, or of all files in a folder."""
    files_in = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files_in if file.is_file())
