"""Times that HDF5 writes into a file whatever it is told, set to zero: the bytes of a recording depend on its run alone."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.export.reader.hdf5_file import SUPERBLOCK_BYTES

_EXTENSION = slice(20, 28)  # of a superblock (version 2 or 3): the address of its extension
_STORES_TIMES, _STORES_PHASES, _WIDTH = 0x20, 0x10, 0x03  # flags of an object header (version 2)
_TIMES = slice(6, 22)  # of such a header: access, modification, change and birth [s]
_MOST_BYTES, _MASK = 4096, 0xFFFFFFFF


def clear_header_times(path: Path) -> None:
    """Set the times in the extension of the superblock of a closed HDF5 file to zero, and seal it again.

    HDF5 keeps times there, although no object of a recording has any. A file without an extension stays as it is.
    """
    with path.open("r+b") as file:
        place = int.from_bytes(file.read(SUPERBLOCK_BYTES)[_EXTENSION], "little")
        file.seek(min(place, path.stat().st_size))
        header = bytearray(file.read(_MOST_BYTES))
        if header[:5] != b"OHDR\x02" or not header[5] & _STORES_TIMES:
            return
        width = 1 << (header[5] & _WIDTH)
        begin = _TIMES.stop + 4 * bool(header[5] & _STORES_PHASES)
        end = begin + width + int.from_bytes(header[begin : begin + width], "little")
        if compute_lookup3(header[:end]) != int.from_bytes(header[end : end + 4], "little"):
            return  # not as it is described; it is left alone
        header[_TIMES] = bytes(16)
        header[end : end + 4] = compute_lookup3(header[:end]).to_bytes(4, "little")
        file.seek(place)
        file.write(header[: end + 4])


def compute_lookup3(data: bytes | bytearray) -> int:
    """Compute the checksum of HDF5's metadata: lookup3 of Bob Jenkins (2006), `hashlittle`, from 0."""
    a = b = c = (0xDEADBEEF + len(data)) & _MASK
    whole = max((len(data) - 1) // 12, 0) * 12
    for at in range(0, whole, 12):
        a, b, c = ((one + word) & _MASK for one, word in zip((a, b, c), _read_words(data[at : at + 12]), strict=True))
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
    a, b, c = ((one + word) & _MASK for one, word in zip((a, b, c), _read_words(rest), strict=True))
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
