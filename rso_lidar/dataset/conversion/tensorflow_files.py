"""Frames as TFRecord files: one example per frame, with images as bytes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, divide, read_frames
from rso_lidar.dataset.conversion.tensorflow_records import encode_example, frame_record

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset


def write_tensorflow_files(folder: Path, data: Dataset, splits: Sequence[str], images: Sequence[str]) -> None:
    """Write ``<split>-<number>.tfrecord`` with a message `tf.train.Example` per frame.

    Images are raw little-endian bytes, beside ``<name>/shape`` and ``<name>/dtype``. Numbers are features of their own
    names. Texts are ``name``, ``split``, ``class``, ``model`` and ``sensor``, empty where there is none.
    """
    for split in splits:
        for number, group in enumerate(divide(read_frames(data, split, images))):
            with (folder / f"{split}-{number:06d}.tfrecord").open("wb") as stream:
                for frame in group:
                    stream.write(frame_record(encode_example(_list_features(frame))))


def _list_features(frame: ExportedFrame) -> dict[str, Any]:
    """Return the features of a frame by name."""
    features = dict(frame.numbers) | {word: text or "" for word, text in frame.words.items()} | {"name": frame.name}
    for name, values in frame.images.items():
        little = values.astype(values.dtype.newbyteorder("<"))
        shape = np.array(values.shape)
        features |= {name: little.tobytes(), f"{name}/shape": shape, f"{name}/dtype": values.dtype.name}
    return features
