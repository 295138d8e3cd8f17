"""PNG images of 16 bits: those of the cameras beside the lidar, in a folder for each camera.

Counts stand in the file as the sensor reported them, not shifted to the highest bits, so that they equal the recording's.
An image viewer therefore shows 12 bits nearly black.
"""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.formats.companion_camera import check_images, compute_camera_poses, read_cameras
from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_files import get_file_stem, write_new_file, write_source
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.records import Frame


def write_png(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write the images of the cameras beside the lidar, and return the path of the folder.

    A camera has a folder of its name, with 000012.png and so on by the number of the frame. Three bands are one RGB image in
    the order of the bands; other numbers are grey images, one for each band (000012_nir.png). camera.json states intrinsics,
    bands, gain and black level. frames.jsonl has a line for each frame: its files, time, exposure and poses.
    """
    place = check_export_folder(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    if not first.camera:
        raise RecordingError(
            f"{place}: the frames have no images of a camera; add [[camera]] to the scenario and run it again, or use .bop "
            "for images of the lidar"
        )
    cameras = read_cameras(place, first)
    with draft_export_folder(place, overwrite=overwrite) as draft, ExitStack() as stack:
        write_source(draft, first.source, "png")
        lines = {}
        for name, camera in cameras.items():
            (draft / name).mkdir()
            text = json.dumps(camera.describe(), indent=1, ensure_ascii=False)
            (draft / name / "camera.json").write_text(text + "\n", encoding="utf-8", newline="\n")
            lines[name] = stack.enter_context((draft / name / "frames.jsonl").open("w", encoding="utf-8", newline="\n"))
        for frame in coming:
            check_images(place, frame, cameras)
            for name, camera in cameras.items():
                files = []
                bands = [band["name"] for band in camera.bands]
                for suffix, image in split_bands(bands, frame.camera[name].intensity_counts):
                    files.append(f"{get_file_stem(place, frame)}{suffix}.png")
                    write_new_file(place, draft / name / files[-1], encode_png(image))
                lines[name].write(json.dumps({"files": files, **_describe_image(frame, name)}) + "\n")
    return place


def encode_png(image: np.ndarray) -> bytes:
    """Encode an image as a PNG.

    Parameters
    ----------
    image : (row, col) uint8 or uint16, grey; or (row, col, 3) uint16, RGB

    Returns
    -------
    bytes
        The content of the file.
    """
    if image.ndim == 3:  # Pillow writes no RGB of 16 bits
        return _encode_rgb(image)
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(stream, format="PNG")
    return stream.getvalue()


def _encode_rgb(image: np.ndarray) -> bytes:
    """Encode an image (row, col, 3) with 16 bits a sample (Portable Network Graphics, ISO/IEC 15948, secs. 5, 9 and 11)."""
    rows, cols, _ = image.shape
    lines = np.zeros((rows, 1 + 6 * cols), np.uint8)  # before each row its filter: 0, none
    lines[:, 1:] = image.astype(">u2").reshape(rows, -1).view(np.uint8)
    header = struct.pack(">IIBBBBB", cols, rows, 16, 2, 0, 0, 0)  # 16 bits, truecolour, not interlaced
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes())), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def split_bands(bands: Sequence[str], counts: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Split an image of a camera into those of PNG files: grey for one band, RGB for three, else grey for each band.

    Parameters
    ----------
    bands : names of the bands
    counts : (row, col, band)

    Yields
    ------
    tuple
        What follows the number of the frame in the name of a file, such as ``_nir``, and its image (row, col) or
        (row, col, 3).
    """
    match len(bands):
        case 1:
            yield "", counts[..., 0]
        case 3:
            yield "", counts
        case _:
            for k, band in enumerate(bands):
                yield f"_{band}", counts[..., k]


def _describe_image(frame: Frame, camera: str) -> dict[str, Any]:
    """Return index, times [s] and true poses of an image: camera_from of all axes, as position [m] and x, y, z, w."""
    from scipy.spatial.transform import Rotation

    poses = compute_camera_poses(frame, camera)
    quaternions = Rotation.from_matrix(np.array([m[:3, :3] for m in poses.values()])).as_quat(canonical=True)
    return {
        "index": frame.index,
        "time_s": frame.time_s,
        "exposure_s": float(frame.camera[camera].exposure_s),
        "camera_from": {
            name: {"position_m": matrix[:3, 3].tolist(), "quaternion_xyzw": quaternion.tolist()}
            for (name, matrix), quaternion in zip(poses.items(), quaternions, strict=True)
        },
    }
