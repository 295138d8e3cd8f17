"""Times that HDF5 writes into a file whatever it is told, set to zero: the bytes of a recording depend on its run alone."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.export.layout.checksum import compute_lookup3
from rso_lidar.export.reader.hdf5_checks import SUPERBLOCK_BYTES

_EXTENSION = slice(20, 28)  # of a superblock (version 2 or 3): the address of its extension
_STORES_TIMES, _STORES_PHASES, _WIDTH = 0x20, 0x10, 0x03  # flags of an object header (version 2)
_TIMES = slice(6, 22)  # of such a header: access, modification, change and birth [s]
_MOST_BYTES = 4096


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
