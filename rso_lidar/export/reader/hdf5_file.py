"""HDF5 files opened for reading, with one-line errors, and the reasons of failed writes."""

from __future__ import annotations

import ctypes
import difflib
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError
from rso_lidar.export.reader.hdf5_checks import CACHE_BYTES, SUPERBLOCK_BYTES, check_heaps, open_checked
from rso_lidar.files import explain_unreadable

TEMPORARY = re.compile(r"\.tmp-[0-9a-zA-Z]+(\.starting)?$")

# HDF5 reads metadata again where its checksum is wrong, as it is while a writer replaces it. It waits 1 ns, then twice as
# long each time: 34 ms in all with 25 attempts. The default of 100 attempts would never end.
_READ_ATTEMPTS = 25
_MOST_OBJECTS = 10_000  # groups and datasets; a recording has some hundred


def open_hdf5(path: Path, *, swmr: bool) -> Any:
    """Open an HDF5 file for reading.

    Parameters
    ----------
    swmr : whether a writer may be extending it

    Raises
    ------
    RecordingError
        If the file is missing, is not HDF5, is cut short or damaged.
    """
    import h5py

    try:
        if path.is_dir():
            raise RecordingError(f"{path}: is a folder; name a recording in it")
        if not os.path.lexists(path):
            raise RecordingError(f"{path}: there is no such file{_suggest_name(path)}")
        path.stat()  # which raises the reason where a link leads nowhere
        if not path.is_file():
            raise RecordingError(f"{path}: is not a regular file; give a recording made by `run`")
        with path.open("rb") as stream:
            head = stream.read(SUPERBLOCK_BYTES)
        if not h5py.is_hdf5(path):
            raise RecordingError(f"{path}: is not an HDF5 file, or is cut short; give a recording made by `run`")
        # The superblock (version 2 and 3) says after every flush where the file ends. HDF5 does not look there while a
        # file is marked as being written, and then reads zeros behind its end, or tries for ever.
        size = path.stat().st_size
        if size < SUPERBLOCK_BYTES or (head[8] >= 2 and size < int.from_bytes(head[28:36], "little")):
            raise RecordingError(f"{path}: is cut short; copy or record it again")
    except OSError as error:
        raise RecordingError(explain_unreadable(path, error)) from error
    try:
        if swmr:
            check_heaps(path, is_growing=True)
            return _open_growing(path)
        file = open_checked(path)
        if not file.swmr_mode:
            return file
        # This process still has the file open from the time when it grew. HDF5 then shares what it knew, such as fewer
        # frames, among all who open it by one driver. Another driver reads the file anew.
        file.close()
        return h5py.File(path, "r", driver="stdio", locking="best-effort", rdcc_nbytes=CACHE_BYTES)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        if "h5clear" in str(error) or "already open" in str(error):
            raise RecordingError(f"{path}: is still being written, or its run was killed; wait or resume") from error
        what = " ".join(str(error).split())[:120]
        raise RecordingError(f"{path}: is damaged ({what}); copy or record it again") from error


def _open_growing(path: Path) -> Any:
    """Open a file that a writer may be extending, with a limit on the wait for complete metadata."""
    import h5py

    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_file_locking(True, True)  # as "best-effort" in h5py.File
    _limit_read_attempts(access)
    flags = h5py.h5f.ACC_RDONLY | h5py.h5f.ACC_SWMR_READ
    return h5py.File(h5py.h5f.open(os.fsencode(path), flags, fapl=access))


def _limit_read_attempts(access: Any) -> None:
    """Call H5Pset_metadata_read_attempts, which h5py does not offer, on a file access property list of h5py.

    Where the function is not found, HDF5's own limit remains.
    """
    import h5py

    # The loader finds the function through h5py's own module on POSIX systems, and in the loaded hdf5.dll on Windows.
    for library in (h5py.h5p.__file__, "hdf5"):
        with suppress(OSError, AttributeError):
            function = ctypes.CDLL(library).H5Pset_metadata_read_attempts
            function.argtypes, function.restype = (ctypes.c_int64, ctypes.c_uint), ctypes.c_int
            function(access.id, _READ_ATTEMPTS)
            return


def read_superblock(file: Any) -> bytes:
    """Read the first bytes of an open h5py file from the disk; return none where the system cannot (Windows)."""
    return os.pread(file.id.get_vfd_handle(), SUPERBLOCK_BYTES, 0) if hasattr(os, "pread") else b""


def get_end_of_file(superblock: bytes) -> int:
    """Return the end of the file [bytes] that a superblock (version 2 or 3) states; 0 without a superblock."""
    return int.from_bytes(superblock[28:36], "little")


def get_errno(error: BaseException) -> int | None:
    """Return the errno of an error, which HDF5 reports as text only; None where there is none."""
    number: int | None = getattr(error, "errno", None)
    if number is None and (match := re.search(r"errno = (\d+)", str(error))):
        number = int(match[1])
    return number


def describe_failure(error: BaseException) -> str:
    """Describe why a write failed, in the words of the operating system where it gave an errno."""
    number = get_errno(error)
    return os.strerror(number) if number else " ".join(str(error).split())[:200]


def _suggest_name(path: Path) -> str:
    """Suggest an unfinished recording of that name, or the closest name in the folder."""
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent} either"
    names = sorted(entry.name for entry in path.parent.iterdir())
    unfinished = [name for name in names if name.startswith(f"{path.name}.tmp-") and not name.endswith(".starting")]
    if unfinished:
        return f", only the unfinished {unfinished[0]}: open that, or continue with --resume"
    near = difflib.get_close_matches(path.name, names, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else "; record it first"


def check_self_contained(path: Path) -> None:
    """Check that a recording has all its data in its own file, before any of them are read.

    HDF5 follows external links to other files, and reads datasets from raw files or as mosaics of other files. A file
    from somebody else could show in this way what else is on the machine.

    Parameters
    ----------
    path : of the recording; it may still be written

    Raises
    ------
    RecordingError
        If the file cannot be read, names other files, or has more than 10,000 objects.
    """
    # HDF5 refuses this mode for a file that the process has open without it, such as a recording that is shown.
    with open_hdf5(path, swmr=TEMPORARY.search(path.name) is not None) as file:
        groups, seen = [file], 0
        while groups:
            group = groups.pop()
            for name in group:
                seen += 1
                if seen > _MOST_OBJECTS:
                    raise RecordingError(
                        f"{path}: has more than {_MOST_OBJECTS:,} objects; it is no recording of `run`"
                    )
                if named := _find_other_file(group, name):
                    raise RecordingError(
                        f"{path}: '{group.name.rstrip('/')}/{name:.80}' is in another file, {named[-80:]!r}; export it "
                        "again as one file"
                    )
                if group.get(name, getclass=True, getlink=True).__name__ == "HardLink" and _is_group(group, name):
                    groups.append(group[name])


def _is_group(group: Any, name: str) -> bool:
    kind: str = group.get(name, getclass=True).__name__
    return kind == "Group"


def _find_other_file(group: Any, name: str) -> str:
    """Return the file that holds an object, where it is not the file itself; else an empty text.

    Parameters
    ----------
    group : of h5py
    """
    link = group.get(name, getlink=True)
    if hasattr(link, "filename"):
        return str(link.filename)
    if type(link).__name__ != "HardLink" or _is_group(group, name):  # a soft link stays in the file
        return ""
    dataset = group[name]
    if not hasattr(dataset, "shape"):  # a named type
        return ""
    if dataset.external:
        return str(dataset.external[0][0])
    sources = dataset.virtual_sources() if dataset.is_virtual else []
    return next((str(source.file_name) for source in sources if source.file_name != "."), "")
