"""Recordings from strangers: an HDF5 file may take its data from other files of the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError
from rso_lidar.export.reader.hdf5_file import TEMPORARY, open_hdf5

_MOST_OBJECTS = 10_000  # groups and datasets; a recording has some hundred


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
