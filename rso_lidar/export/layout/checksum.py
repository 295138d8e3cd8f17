"""Checksums of a recording: Fletcher-32 of each chunk, CRC-32 of the texts in its attributes, lookup3 of metadata."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from rso_lidar.kernels import kernel

CHECKSUM_BYTES = 4  # of a checksum behind a chunk
_LARGE = 2**36  # as much as 2**21 words make; 2**63 / 2**36 words more would be needed for too large a sum
TEXTS = ("title", "scenario", "start_utc", "seed", "versions", "targets")  # attributes of the root
OPTIONAL_TEXTS = ("sensors",)
_MASK = 0xFFFFFFFF
TREE = ("tree", "states")  # attributes of /truth


@kernel
def append_fletcher32(data: np.ndarray, start: int, stop: int) -> int:
    """Write the checksum that HDF5's filter fletcher32 stores after a chunk, low byte first.

    The data are 16-bit words w, high byte first. The low half is the sum of w_i, the high half the sum of (n - i) w_i.
    Both are taken modulo 65535, with 65535 in place of 0 unless all words are 0. Source: J. G. Fletcher, "An arithmetic
    checksum for serial transmissions", IEEE Transactions on Communications 30, 1982. Any single wrong bit changes the
    checksum.

    Parameters
    ----------
    data : bytes (byte), with room for the checksum after the chunk

    Returns
    -------
    int
        Where the checksum ends.
    """
    low, high = 0, 0
    for k in range(start, stop, 2):
        low += int(data[k]) << 8
        if k + 1 < stop:
            low += int(data[k + 1])
        high += low
        if low >= _LARGE:  # so that the sum of it stays below 2**63
            low, high = (low - 1) % 65535 + 1, (high - 1) % 65535 + 1
    low = (low - 1) % 65535 + 1 if low else 0
    high = (high - 1) % 65535 + 1 if high else 0
    data[stop], data[stop + 1] = low & 0xFF, low >> 8
    data[stop + 2], data[stop + 3] = high & 0xFF, high >> 8
    return stop + CHECKSUM_BYTES


def compute_fletcher32(data: bytes) -> bytes:
    """Compute the checksum of a chunk, as `append_fletcher32` writes it."""
    chunk = np.frombuffer(data + bytes(CHECKSUM_BYTES), np.uint8).copy()
    append_fletcher32(chunk, 0, len(data))
    return chunk[len(data) :].tobytes()


def is_intact(chunk: bytes) -> bool:
    """Return whether a stored chunk agrees with the Fletcher-32 checksum at its end."""
    return len(chunk) > CHECKSUM_BYTES and compute_fletcher32(chunk[:-CHECKSUM_BYTES]) == chunk[-CHECKSUM_BYTES:]


def compute_texts_crc32(file: Any) -> int:
    """Compute the CRC-32 of the texts that a reader takes from the attributes of an h5py file.

    HDF5 protects all its metadata with checksums, except the heap that holds texts of variable length.
    """
    optional = [name for name in OPTIONAL_TEXTS if name in file.attrs]
    texts = [*_list_texts(file.attrs, (*TEXTS, *optional)), *_list_texts(file["truth"].attrs, TREE)]
    return zlib.crc32("\0".join(texts).encode("utf-8", "surrogateescape"))


def _list_texts(attributes: Any, names: Iterable[str]) -> list[str]:
    return [f"{name}={attributes[name]}" for name in names]


def compute_lookup3(data: bytes | bytearray) -> int:
    """Compute the checksum of HDF5's metadata: lookup3 of Bob Jenkins (2006), `hashlittle`, from 0."""
    a = b = c = (0xDEADBEEF + len(data)) & _MASK
    whole = max((len(data) - 1) // 12, 0) * 12
    for at in range(0, whole, 12):
        a, b, c = (
            (state + word) & _MASK for state, word in zip((a, b, c), _read_words(data[at : at + 12]), strict=True)
        )
        for turn_a, turn_b, turn_c in ((4, 6, 8), (16, 19, 4)):
            a = ((a - c) ^ _rotate(c, turn_a)) & _MASK
            c = (c + b) & _MASK
            b = ((b - a) ^ _rotate(a, turn_b)) & _MASK
            a = (a + c) & _MASK
            c = ((c - b) ^ _rotate(b, turn_c)) & _MASK
            b = (b + a) & _MASK
    if not data:
        return c
    rest = bytes(data[whole:]).ljust(12, b"\0")
    a, b, c = ((state + word) & _MASK for state, word in zip((a, b, c), _read_words(rest), strict=True))
    c = ((c ^ b) - _rotate(b, 14)) & _MASK
    a = ((a ^ c) - _rotate(c, 11)) & _MASK
    b = ((b ^ a) - _rotate(a, 25)) & _MASK
    c = ((c ^ b) - _rotate(b, 16)) & _MASK
    a = ((a ^ c) - _rotate(c, 4)) & _MASK
    b = ((b ^ a) - _rotate(a, 14)) & _MASK
    return ((c ^ b) - _rotate(b, 24)) & _MASK


def _read_words(twelve: bytes | bytearray) -> tuple[int, ...]:
    return tuple(int.from_bytes(twelve[at : at + 4], "little") for at in (0, 4, 8))


def _rotate(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _MASK
