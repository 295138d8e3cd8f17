"""Frames to files, files to frames: `save`, `open`, and a `Recorder` for those who write frame by frame."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.export.formats.bop import choose_depth_scale, quantize_depth
    from rso_lidar.export.formats.camera import fit_camera
    from rso_lidar.export.formats.parquet import check_parquet, write_parquet
    from rso_lidar.export.formats.png import encode_png, split_bands
    from rso_lidar.export.formats.raster import write_raster
    from rso_lidar.export.formats.trajectory import to_stamp_ns
    from rso_lidar.export.formats.truth_batches import peek_source, read_truth
    from rso_lidar.export.layout.datasets import collect_truth
    from rso_lidar.export.layout.intermediates import PhotonImage, check_kept
    from rso_lidar.export.reader.hdf5_checks import check_declared_size, open_checked
    from rso_lidar.export.reader.hdf5_file import check_self_contained
    from rso_lidar.export.reader.recording import Frames, Recording
    from rso_lidar.export.reader.status import RecordingStatus, read_status
    from rso_lidar.export.reader.stored_array import StoredArray
    from rso_lidar.export.registry import FORMATS, Format, format_for, open, save, writer_for
    from rso_lidar.export.writer.chunks import ImageEncoder
    from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
    from rso_lidar.export.writer.recorder import Recorder, check_output, run_id
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "FORMATS",
    "Format",
    "Frames",
    "ImageEncoder",
    "PhotonImage",
    "Recorder",
    "Recording",
    "RecordingStatus",
    "StoredArray",
    "check_declared_size",
    "check_export_folder",
    "check_kept",
    "check_output",
    "check_parquet",
    "check_self_contained",
    "choose_depth_scale",
    "collect_truth",
    "draft_export_folder",
    "encode_png",
    "fit_camera",
    "format_for",
    "open",
    "open_checked",
    "peek_source",
    "quantize_depth",
    "read_status",
    "read_truth",
    "run_id",
    "save",
    "split_bands",
    "to_stamp_ns",
    "write_parquet",
    "write_raster",
    "writer_for",
]

__dir__ = limit_dir(__name__)
