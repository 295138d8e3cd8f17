"""The default format: a complete recording as one HDF5 file, which `open` reads back as frames."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from rso_lidar.errors import RecordingError
from rso_lidar.export.writer.recorder import Recorder, check_output, run_id
from rso_lidar.records import Frame


def write_hdf5(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames to an HDF5 recording, one at a time, and return its path.

    Everything that the frames hold is recorded: all returns, kept records, and a lens that changes. An interrupted run
    leaves a temporary file with all its complete frames.

    Parameters
    ----------
    path : of the recording.
    frames : written as they come.
    overwrite : whether an older recording may be replaced.
    """
    output = check_output(path, overwrite=overwrite)
    coming = iter(frames)
    first = next(coming, None)
    if first is None:
        raise RecordingError(f"{output}: there are no frames to record; check the choice of frames")
    source = first.source
    named = run_id(source, "", source.versions.get("rso_lidar", ""))
    with Recorder(output, source, run_id=named, overwrite=overwrite, changing_lens=None) as recorder:
        recorder.write(first)
        del first
        for frame in coming:
            recorder.write(frame)
    return output
