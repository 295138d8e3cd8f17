"""HDF5 files opened with care: heaps of texts are walked here before libhdf5 walks them, and declared sizes are bounded.

The global heap holds texts and references of variable length. It is the only metadata of HDF5 without a checksum, and
libhdf5 never returns from a heap in which an object has no size. It then holds the interpreter's lock, so that no
signal ends the process. A file is therefore opened first through a stream that walks every heap that libhdf5 reads.
"""

from __future__ import annotations

import io
import math
import os
import struct
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.export.layout.checksum import compute_lookup3

SUPERBLOCK_BYTES = 48
CACHE_BYTES = 2**20  # of chunks that libhdf5 keeps for each dataset
_VERSION, _MARKS, _SUM = 8, 11, 44  # places in a superblock: its version, the marks of a writer, and its checksum
_HEAP = b"GCOL"
_HAS_PREADV = hasattr(os, "preadv")  # not on Windows
_HEADER = struct.Struct("<4sB3xQ")  # of a heap: signature, version, size with this header
_OBJECT = struct.Struct("<HH4xQ")  # of an object: index, references, size; index 0 is free space, with this header
_SMALL_BYTES, _MOST_RATIO = 2**24, 1100  # deflate makes data at most 1032 times smaller (zlib, Technical Details)
_ATTEMPTS, _PAUSE_S = 7, 0.002  # pauses double: a busy machine replaces metadata in up to 0.1 s


class CheckedStream(io.RawIOBase):
    """A file for reading that raises `OSError` where libhdf5 reads a damaged heap."""

    def __init__(self, path: Path, *, as_closed: bool = False) -> None:
        self._file = path.open("rb", buffering=0)
        self._descriptor = self._file.fileno()
        self._path, self._as_closed, self._place = path, as_closed, 0

    def __repr__(self) -> str:  # which h5py takes for the name of the file
        return str(self._path)

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the place of the next reading [bytes]."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._measure()}[whence]
        self._place = start + offset
        return self._place

    def tell(self) -> int:
        """Return the place of the next reading [bytes]."""
        return self._place

    def readinto(self, buffer: Any, /) -> int:
        """Read bytes into a buffer, and return their number."""
        place, view = self._place, memoryview(buffer).cast("B")  # h5py gives a type of its own, unequal to all bytes
        count = self._read_at(place, view)
        if view[:4] == _HEAP:
            self._check_heap(place)
        if self._as_closed and place == 0 and count >= SUPERBLOCK_BYTES and view[_VERSION] >= 2:
            view[_MARKS] = 0
            view[_SUM:SUPERBLOCK_BYTES] = compute_lookup3(bytes(view[:_SUM])).to_bytes(4, "little")
        self._place = place + count
        return count

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._file.close()
        super().close()

    def _measure(self) -> int:
        return os.fstat(self._descriptor).st_size

    def _read_at(self, place: int, view: memoryview) -> int:
        """Read bytes of a place into a view; forked processes share the place of the system's file."""
        if _HAS_PREADV:
            return os.preadv(self._descriptor, (view,), place)
        self._file.seek(place)
        return self._file.readinto(view) or 0

    def _check_heap(self, place: int) -> None:
        """Walk the objects of the heap at a place; raise an `OSError` where they do not fill it."""
        header = bytearray(_HEADER.size)
        self._read_at(place, memoryview(header))
        _, version, size = _HEADER.unpack(header)
        if version != 1 or not _HEADER.size <= size <= self._measure() - place:
            return  # no heap, but data that begin like one; libhdf5 refuses it as a heap
        heap = bytearray(size)
        self._read_at(place, memoryview(heap))
        at = _HEADER.size
        while at + _OBJECT.size <= size:
            number, _, length = _OBJECT.unpack_from(heap, at)
            step = _OBJECT.size + (length + 7) // 8 * 8 if number else length
            if not 0 < step <= size - at:
                raise OSError(f"the heap of texts at byte {place} has an object of {length} bytes at byte {place + at}")
            at += step


def open_checked(path: Path, *, cache_bytes: int = CACHE_BYTES) -> Any:
    """Open an HDF5 file for reading, after its heaps were checked.

    Parameters
    ----------
    path : of the file
    cache_bytes : of chunks that libhdf5 keeps for each dataset [bytes], at most 1 MiB

    Returns
    -------
    h5py.File
        The open file. Its errors are those of h5py: OSError, RuntimeError, KeyError, ValueError and TypeError.
    """
    import h5py

    check_heaps(path)
    return h5py.File(path, "r", locking="best-effort", rdcc_nbytes=min(cache_bytes, CACHE_BYTES))


def check_heaps(path: Path, *, is_growing: bool = False) -> None:
    """Check all heaps that attributes and datasets refer to; raise an error of h5py where one is damaged.

    A file is checked again only after it has changed.

    Parameters
    ----------
    is_growing : whether a writer may be extending it. Metadata that it is replacing are read again
    """
    status = path.stat()
    stamp = status.st_mtime_ns, status.st_size, status.st_ino
    for left in reversed(range(_ATTEMPTS if is_growing else 1)):
        try:
            _walk_heaps(path.absolute(), stamp, is_growing)
            break
        except (OSError, RuntimeError, KeyError, ValueError, TypeError):
            if not left:
                raise
            time.sleep(_PAUSE_S * 2 ** (_ATTEMPTS - 1 - left))


@lru_cache(maxsize=4096)
def _walk_heaps(path: Path, _stamp: tuple[int, int, int], as_closed: bool) -> None:
    """Let libhdf5 read all data of variable length in a file through a stream that checks heaps.

    Parameters
    ----------
    _stamp : (time of its last change [ns], size [bytes], inode), the key of the cache
    """
    import h5py

    # This file is closed again here: at the end of the interpreter, h5py crashes where such a stream is still open.
    with CheckedStream(path, as_closed=as_closed) as stream, h5py.File(stream, "r") as file:
        _read_texts(file.id)
        h5py.h5o.visit(file.id, lambda name: _read_texts(h5py.h5o.open(file.id, name)))


def _read_texts(place: Any) -> None:
    """Read the attributes of variable length of an object, and the object if it is a dataset of that kind.

    Parameters
    ----------
    place : identifier of the object, of h5py
    """
    import h5py

    for number in range(h5py.h5a.get_num_attrs(place)):
        attribute = h5py.h5a.open(place, index=number)
        if _is_variable(attribute.get_type()):
            attribute.read(np.empty(attribute.shape, attribute.dtype))
    if isinstance(place, h5py.h5d.DatasetID) and _is_variable(place.get_type()):
        check_declared_size(h5py.Dataset(place))
        h5py.Dataset(place)[()]


def _is_variable(kind: Any) -> bool:
    """Return whether data of an HDF5 type may lie in a heap; numbers and texts of fixed length do not."""
    import h5py

    return not (
        isinstance(kind, h5py.h5t.TypeIntegerID | h5py.h5t.TypeFloatID | h5py.h5t.TypeEnumID)
        or (isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str())
    )


def check_declared_size(dataset: Any) -> None:
    """Check that a dataset is not much larger than its file, before memory is taken for it.

    A dataset without stored data is read as fill values: a file of 1 kB can declare terabytes of them.

    Parameters
    ----------
    dataset : of h5py

    Raises
    ------
    OSError
        If it is larger than 16 MiB and than what fits into the file with the strongest compression.
    """
    size = dataset.dtype.itemsize * math.prod(dataset.shape)
    stored = dataset.file.id.get_filesize()
    if size > _SMALL_BYTES + _MOST_RATIO * stored:
        raise OSError(f"{dataset.name} declares {size:,} bytes, in a file of {stored:,}")
