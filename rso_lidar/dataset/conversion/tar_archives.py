"""Frames as WebDataset: tar archives in which the files of a frame are consecutive and share a base name."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, divide, read_frames

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset


def write_tar_archives(folder: Path, data: Dataset, splits: Sequence[str], images: Sequence[str]) -> None:
    """Write ``<split>-<number>.tar`` with ``<frame>.<image>.npy``, ``<frame>.json`` and ``<frame>.cls`` of each frame.

    Archives hold no dates and no owners, so equal frames give equal bytes.
    """
    for split in splits:
        for number, group in enumerate(divide(read_frames(data, split, images))):
            with tarfile.open(folder / f"{split}-{number:06d}.tar", "w", format=tarfile.USTAR_FORMAT) as archive:
                for frame in group:
                    _add_frame(archive, frame)


def _add_frame(archive: tarfile.TarFile, frame: ExportedFrame) -> None:
    """Add the files of a frame to an archive."""
    files = {f"{name}.npy": _encode_array(values) for name, values in frame.images.items()}
    files |= {"json": json.dumps(frame.description).encode(), "cls": str(int(frame.numbers["class_id"])).encode()}
    for suffix, content in files.items():
        member = tarfile.TarInfo(f"{frame.name}.{suffix}")
        member.size = len(content)
        archive.addfile(member, io.BytesIO(content))


def _encode_array(values: np.ndarray) -> bytes:
    """Encode an array as a .npy file."""
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    return stream.getvalue()
