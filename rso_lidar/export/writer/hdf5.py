"""The default format: a complete recording as one HDF5 file, which `open` reads back as frames."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from rso_lidar.errors import RunError
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.export.writer.recorder import Recorder, check_output, run_id
from rso_lidar.records import Frame


def write_hdf5(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames to an HDF5 recording, one at a time, and return its path.

    Everything that the frames hold is recorded: all returns, kept records, and a lens that changes. An interrupted run
    leaves a temporary file with all its complete frames, and its exception a note that names the file.
    """
    output = check_output(path, overwrite=overwrite)
    first, coming = take_first(output, frames)
    source = first.source
    del first
    named = run_id(source, "", source.versions.get("rso_lidar", ""))
    with Recorder(output, source, run_id=named, overwrite=overwrite, changing_lens=None) as recorder:
        try:
            for frame in coming:
                recorder.write(frame)
        except Exception as error:
            if recorder.written and not isinstance(error, RunError):  # which names the file itself
                error.add_note(
                    f"{recorder.temporary}: holds the {recorder.written} frames before; open() reads it, and "
                    "overwrite=True replaces it"
                )
            raise
    return output
