"""Frames as TFRecord files, written without TensorFlow: one example per frame, with images as bytes.

A file is a sequence of records: the length of the data (8 bytes), its masked CRC-32C (4 bytes), the data, and the masked
CRC-32C of the data (4 bytes), all little-endian (TensorFlow, `tf_record.proto` and `lib/io/record_writer.h`). The data of
a record are a message `tf.train.Example` in the encoding of Protocol Buffers (`core/example/example.proto`,
`feature.proto`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.conversion.frame_batches import ExportedFrame, divide, read_frames
from rso_lidar.kernels import kernel, packed

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

_CASTAGNOLI = 0x82F63B78  # polynomial of CRC-32C (RFC 3720, B.4), bits reversed
_ALL_ONES = 0xFFFFFFFF
_MASK_DELTA = 0xA282EAD8  # added to a rotated checksum, so that data may contain checksums (record_writer.h)
_BYTES, _FLOATS, _INTEGERS = 1, 2, 3  # numbers of the lists in the message `Feature`


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


def _make_table() -> np.ndarray:
    """Return the checksums (256) of single bytes."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> np.uint32(1)) ^ np.uint32(_CASTAGNOLI), table >> np.uint32(1))
    return table.astype(np.uint32)


_TABLE = _make_table()


@kernel
def compute_crc32c(content: np.ndarray) -> Any:
    """Compute the CRC-32C of bytes.

    Parameters
    ----------
    content : (byte) uint8
    """
    crc = np.uint32(_ALL_ONES)
    for byte in content:
        crc = _TABLE[(crc ^ byte) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
    return np.uint32(crc ^ np.uint32(_ALL_ONES))


def frame_record(content: bytes) -> bytes:
    """Put the length and the checksums around the data of one record."""
    length = struct.pack("<Q", len(content))
    return length + _mask_checksum(length) + content + _mask_checksum(content)


def encode_example(features: Mapping[str, Any]) -> bytes:
    """Encode a message `tf.train.Example`.

    Parameters
    ----------
    features : by name: a text, bytes, or an array of numbers. Integers become 64 bits, and all other numbers 32

    Returns
    -------
    bytes
        The message. Features are sorted by name, so that equal frames give equal bytes.
    """
    entries = b"".join(
        _encode_field(1, _encode_field(1, name.encode()) + _encode_field(2, _encode_feature(features[name])))
        for name in sorted(features)
    )
    return _encode_field(1, entries)


def _encode_feature(value: Any) -> bytes:
    """Encode a message `Feature`, which holds one of three lists."""
    if isinstance(value, str | bytes):
        content = value.encode() if isinstance(value, str) else value
        return _encode_field(_BYTES, _encode_field(1, content))
    numbers = np.atleast_1d(value)
    if numbers.dtype.kind in "iub":
        packed_numbers = b"".join(_encode_varint(int(number) & (2**64 - 1)) for number in numbers.ravel())
        return _encode_field(_INTEGERS, _encode_field(1, packed_numbers))
    return _encode_field(_FLOATS, _encode_field(1, numbers.astype("<f4").tobytes()))


def _encode_field(number: int, content: bytes) -> bytes:
    """Encode a field of a message that is a text, bytes, a message or a packed list."""
    return _encode_varint(number << 3 | 2) + _encode_varint(len(content)) + content


def _encode_varint(number: int) -> bytes:
    """Encode a non-negative integer with seven bits in each byte, the lowest bits first."""
    return bytes(_split_varint(number))


def _split_varint(number: int) -> Iterator[int]:
    """Yield the bytes of a number; the highest bit of a byte is set if another byte follows."""
    while number > 0x7F:
        yield number & 0x7F | 0x80
        number >>= 7
    yield number


def _mask_checksum(content: bytes) -> bytes:
    """Return the masked CRC-32C of bytes, as four bytes."""
    crc = int(compute_crc32c(packed(np.frombuffer(content, np.uint8))))
    return struct.pack("<I", ((crc >> 15 | crc << 17) + _MASK_DELTA) & _ALL_ONES)
