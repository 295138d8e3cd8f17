"""Chunks of an HDF5 recording: encoded like HDF5's filters do, and appended frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rso_lidar.export.layout.checksum import CHECKSUM_BYTES, append_fletcher32
from rso_lidar.export.layout.datasets import Variable
from rso_lidar.export.writer.deflate import bound_stream, deflate_planes
from rso_lidar.kernels import kernel, packed

_HEAD, _TAIL = 7, 4 + CHECKSUM_BYTES  # bytes before and after a small entry
_FRAMING = _HEAD + _TAIL


class ImageEncoder:
    """Encoder of images as HDF5's filters shuffle, gzip and fletcher32 store them, at a fraction of their cost.

    Parameters
    ----------
    largest : bytes of the largest image
    """

    def __init__(self, largest: int) -> None:
        self._changes, self._tokens = np.empty(largest, np.int64), np.empty(largest, np.uint16)
        self._out = np.empty(bound_stream(largest) + CHECKSUM_BYTES, np.uint8)

    def encode(self, entry: np.ndarray) -> np.ndarray:
        """Encode an image as a chunk.

        Parameters
        ----------
        entry : (row, col), contiguous, of at most `largest` bytes

        Returns
        -------
        ndarray
            (byte) uint8, to be written with the filter mask 0; a view that is valid until the next call.
        """
        data = packed(entry.reshape(-1).view(np.uint8))
        words = data[: len(data) // 8 * 8].view(np.uint64)
        length = deflate_planes(data, words, entry.itemsize, self._changes, self._tokens, self._out)
        return self._out[: append_fletcher32(self._out, 0, length)]


class ChunkWriter:
    """The datasets of an open HDF5 file that grow by one chunk per frame.

    Chunks are encoded here and written directly. HDF5's own filters would store the same data at several times the
    cost.

    Parameters
    ----------
    file : open h5py file with a dataset for each variable
    """

    def __init__(self, file: Any, variables: Mapping[str, Variable]) -> None:
        self._file = file
        # Low-level calls take a fifth of the time of dataset[k] = entry.
        self._datasets = {
            path: (file[path].id, variable.shape, (0,) * len(variable.shape)) for path, variable in variables.items()
        }
        self._images = [path for path, variable in variables.items() if variable.is_compressed]
        self._small = [path for path, variable in variables.items() if not variable.is_compressed]
        self._small_ends = np.cumsum([variables[path].frame_bytes + _FRAMING for path in self._small])
        self._encoder = ImageEncoder(max((variables[path].frame_bytes for path in self._images), default=0))

    def append(self, entries: Mapping[str, np.ndarray], place: int) -> None:
        """Write one frame and flush it, /time last: a frame is complete once its time is in the file.

        Parameters
        ----------
        entries : by path, each contiguous and in the dtype of its dataset
        place : index of the frame on the first axis
        """
        for path in self._images:
            self._append(path, self._encoder.encode(entries[path]), place)
        chunks = self._encode_small(entries)
        last = chunks.pop("time")
        for path, chunk in chunks.items():
            self._append(path, chunk, place)
        self._file.flush()
        self._append("time", last, place)
        self._datasets["time"][0].flush()

    def _append(self, path: str, chunk: Any, place: int) -> None:
        """Append an encoded chunk to a dataset."""
        dataset, shape, corner = self._datasets[path]
        dataset.set_extent((place + 1, *shape))
        dataset.write_direct_chunk((place, *corner), chunk)

    def _encode_small(self, entries: Mapping[str, np.ndarray]) -> dict[str, memoryview]:
        """Encode all entries that are not images, as the filters gzip and fletcher32 store them without compression."""
        room = bytes(_FRAMING)
        data = bytearray(bytes(_HEAD) + room.join(entries[path].tobytes() for path in self._small) + bytes(_TAIL))
        frame_streams(np.frombuffer(data, np.uint8), self._small_ends)
        ends, chunks = self._small_ends.tolist(), memoryview(data)
        return {path: chunks[start:end] for path, start, end in zip(self._small, [0, *ends], ends, strict=False)}


@kernel
def frame_streams(data: np.ndarray, ends: np.ndarray) -> None:
    """Write the head and the checksums of each chunk; the chunks are adjacent and end at `ends` [bytes].

    A chunk is a zlib stream (RFC 1950) of one stored block (RFC 1951, sec. 3.2.4) and the checksum of fletcher32.
    """
    start = 0
    for end in ends:
        size = end - start - _FRAMING
        # The header of zlib (deflate in a window of 32 kB, fastest), and that of the last block, which is stored.
        data[start], data[start + 1], data[start + 2] = 0x78, 0x01, 1
        data[start + 3], data[start + 4] = size & 0xFF, size >> 8
        data[start + 5], data[start + 6] = ~size & 0xFF, (~size >> 8) & 0xFF
        low, high = 1, 0  # Adler-32 (RFC 1950, sec. 8.2); below 2**63 for all sizes of a stored block
        tail = start + _HEAD + size
        for k in range(start + _HEAD, tail):
            low += int(data[k])
            high += low
        low, high = low % 65521, high % 65521
        data[tail], data[tail + 1] = high >> 8, high & 0xFF
        data[tail + 2], data[tail + 3] = low >> 8, low & 0xFF
        append_fletcher32(data, start, tail + 4)
        start = end
