"""Checksums of what a recording stores: of each chunk of a dataset, and of the texts in its attributes."""

from __future__ import annotations

import functools
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

_BYTES = 4  # of a checksum behind a chunk
TEXTS = ("title", "scenario", "start_utc", "seed", "versions", "targets")  # attributes of the root
TREE = ("tree", "states")  # attributes of /truth


def fletcher32(data: bytes) -> bytes:
    """Compute the checksum that HDF5's filter fletcher32 stores behind a chunk, low byte first.

    The data are 16-bit words w with the high byte first. The low half is the sum of w_i, the high half the sum of
    (n - i) w_i, both modulo 65535 with 65535 in place of 0, unless all words are 0 (J. G. Fletcher, "An arithmetic
    checksum for serial transmissions", IEEE Transactions on Communications 30, 1982). Each single wrong bit shows.
    """
    words = np.frombuffer(data + b"\0" * (len(data) % 2), ">u2").astype(np.uint64)
    count = len(words)
    low, high = map(_fold, (_weights(1 << count.bit_length())[:, -count:] @ words).tolist())
    return (high << 16 | low).to_bytes(_BYTES, "little")


def is_intact(chunk: bytes) -> bool:
    """Return whether a chunk, as it stands in the file, agrees with the fletcher32 checksum at its end."""
    return len(chunk) > _BYTES and fletcher32(chunk[:-_BYTES]) == chunk[-_BYTES:]


def texts_crc32(file: Any) -> int:
    """Compute the CRC-32 of the texts that a reader takes from the attributes of an h5py file.

    HDF5 has checksums for all its metadata but the heap in which texts of any length stand.
    """
    texts = [*_texts(file.attrs, TEXTS), *_texts(file["truth"].attrs, TREE)]
    return zlib.crc32("\0".join(texts).encode("utf-8", "surrogateescape"))


def _texts(attributes: Any, names: Iterable[str]) -> list[str]:
    return [f"{name}={attributes[name]}" for name in names]


@functools.lru_cache(maxsize=32)
def _weights(count: int) -> np.ndarray:
    """Return the weights (sum, word) of the words in both sums; those of fewer words are the last columns."""
    return np.stack([np.ones(count, dtype=np.uint64), np.arange(count, 0, -1, dtype=np.uint64)])


def _fold(total: int) -> int:
    return (total - 1) % 65535 + 1 if total else 0
