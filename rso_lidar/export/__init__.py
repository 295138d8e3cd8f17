"""Frames to files, files to frames: `save`, `open`, and a `Recorder` for those who write frame by frame."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.export.layout.intermediates import PhotonImage, check_kept
    from rso_lidar.export.reader.recording import Frames, Recording
    from rso_lidar.export.reader.stored_array import StoredArray
    from rso_lidar.export.registry import format_for, open, save, writer_for
    from rso_lidar.export.writer.recorder import Recorder, check_output, run_id

__all__ = [
    "Frames",
    "PhotonImage",
    "Recorder",
    "Recording",
    "StoredArray",
    "check_kept",
    "check_output",
    "format_for",
    "open",
    "run_id",
    "save",
    "writer_for",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
