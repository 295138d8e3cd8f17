"""Chunks of an HDF5 recording, encoded as HDF5's filters would, and appended to its datasets frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.export.layout.checksum import CHECKSUM_BYTES, append_fletcher32
from rso_lidar.export.layout.datasets import Variable
from rso_lidar.export.writer.deflate import deflate_planes, largest_stream
from rso_lidar.kernels import kernel, packed


class ChunkWriter:
    """The datasets of an open HDF5 file that grow by one chunk a frame.

    Chunks are encoded here and written as they are. HDF5's own filters would make the same bytes, at several times the cost.

    Parameters
    ----------
    file : open h5py file with a dataset for each variable.
    variables : by path.
    """

    def __init__(self, file: Any, variables: Mapping[str, Variable]) -> None:
        self._variables = variables
        # Low-level calls take a fifth of the time of dataset[k] = entry.
        self._datasets = {path: (file[path].id, one.shape, (0,) * len(one.shape)) for path, one in variables.items()}
        sizes = [variable.frame_bytes for variable in variables.values() if variable.is_image]
        largest = max(sizes, default=0)
        self._changes, self._tokens = np.empty(largest, np.int64), np.empty(largest, np.uint16)
        self._out = np.empty(largest_stream(largest) + CHECKSUM_BYTES, np.uint8)

    def append(self, entries: Mapping[str, np.ndarray], place: int) -> None:
        """Write the entries of one frame, each contiguous and in the dtype of its dataset, at a place of the first axis."""
        small = {path: entry for path, entry in entries.items() if not self._variables[path].is_image}
        chunks = dict(zip(small, _encode_small(list(small.values())), strict=True))
        for path, entry in entries.items():
            dataset, shape, corner = self._datasets[path]
            dataset.set_extent((place + 1, *shape))
            dataset.write_direct_chunk((place, *corner), chunks[path] if path in chunks else self._encode_image(entry))

    def flush(self, path: str) -> None:
        """Write what HDF5 still holds of one dataset."""
        self._datasets[path][0].flush()

    def _encode_image(self, entry: np.ndarray) -> np.ndarray:
        """Encode an image behind the filters shuffle, gzip and fletcher32; the chunk holds until the next call."""
        data = packed(entry.reshape(-1).view(np.uint8))
        words = data[: len(data) // 8 * 8].view(np.uint64)
        length = deflate_planes(data, words, entry.itemsize, self._changes, self._tokens, self._out)
        return self._out[: append_fletcher32(self._out, 0, length)]


def _encode_small(entries: list[np.ndarray]) -> list[memoryview]:
    """Encode entries behind the filter fletcher32 alone."""
    data = b"".join([entry.tobytes() for entry in entries])
    ends = np.cumsum([entry.nbytes for entry in entries])
    out = np.empty(len(data) + CHECKSUM_BYTES * len(entries), np.uint8)
    _copy_with_checksums(packed(np.frombuffer(data, np.uint8)), packed(ends, np.int64), out)
    stops = (ends + CHECKSUM_BYTES * np.arange(1, len(entries) + 1)).tolist()
    chunks = memoryview(out.data)
    return [chunks[start:stop] for start, stop in zip([0, *stops], stops, strict=False)]


@kernel
def _copy_with_checksums(data: np.ndarray, ends: np.ndarray, out: np.ndarray) -> None:
    """Copy entries that end at `ends`, each with its checksum behind it."""
    place, start = 0, 0
    for end in ends:
        length = end - start
        for k in range(length):
            out[place + k] = data[start + k]
        place = append_fletcher32(out, place, place + length)
        start = end
