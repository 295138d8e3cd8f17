"""Folders of exports with many files: checked before the work, and written completely or not at all."""

from __future__ import annotations

import itertools
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from rso_lidar.errors import RecordingError
from rso_lidar.files import check_draft, is_same, make_write_error
from rso_lidar.interruption import defer_signals, remove_on_signal

MARKS = ("source.json", "zarr.json", "metadata.yaml", "dataset_export.json")  # a folder that we wrote has one of these,
MARK = "rso_lidar_version"  # with this in it
_OURS = re.compile(
    r"source\.json|frames\.jsonl|camera\.json|zarr\.json|metadata\.yaml|.+_0\.mcap|000000|\d{6,}\.(pcd|ply)"
    r"|dataset_export\.json|images|annotations|(train|val|test)-\d{6}\.(tar|tfrecord)"
    r"|README\.md|labels\.sha256|test_frames\.csv|(dataset|scenario)\.toml|manifest\.jsonl|sensor\.h5(\.sha256)?|train|val|test"
)


@contextmanager
def _reporting_access(place: Path) -> Iterator[None]:
    """Turn an error of access to a path into a one-line `RecordingError`."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{place}: cannot be written here ({error.strerror}); choose another place") from None


def check_export_folder(path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Check that a folder of many files may be written at a path, before the work begins.

    Parameters
    ----------
    path : of the folder, which does not exist, is empty, or is an older export of rso_lidar
    overwrite : whether an older export may be replaced

    Returns
    -------
    Path

    Raises
    ------
    RecordingError
        If the path is a file, has no parent, or is a folder that holds anything else.
    """
    place = Path(path)
    if not place.name or place.name == "..":
        raise RecordingError(f"{place}: cannot be replaced; name a folder in it")
    with _reporting_access(place):
        with suppress(FileNotFoundError, NotADirectoryError):
            place.lstat()  # from Python 3.14 on, `exists` hides why a name cannot be looked up
        if place.exists() and not place.is_dir():
            raise RecordingError(f"{place}: is a file, and this format needs a folder; give another name")
        if not place.parent.is_dir():
            raise RecordingError(f"{place}: there is no folder {place.parent}; create it first")
        if place.is_dir() and any(place.iterdir()):
            if not overwrite:
                raise RecordingError(f"{place}: exists already; give --overwrite (overwrite=True) or another name")
            strange = _find_foreign(place)
            if strange:
                raise RecordingError(
                    f"{place}: holds {strange}, which is not an export of rso_lidar; name another folder"
                )
    return place


@contextmanager
def draft_export_folder(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[Path]:
    """Provide a new folder to write into, which takes the final name when the context ends without an error.

    An older export that is overwritten stays untouched until the new one is complete. Signals that end the process remove
    the draft.

    Parameters
    ----------
    path : of the folder, as for `check_export_folder`
    overwrite : whether an older export may be replaced

    Yields
    ------
    Path
        Of the draft, beside the final place.

    Raises
    ------
    RecordingError
        As `check_export_folder`, and if the disk is full or may not be written.
    """
    place = Path(path)
    held = ExitStack()
    ours: list[tuple[Path, os.stat_result]] = []  # folders to remove in the end, as they were made

    def remove() -> None:
        for folder, status in ours:
            if is_same(folder, status):
                shutil.rmtree(folder, ignore_errors=True)

    try:
        with remove_on_signal(remove):
            check_export_folder(place, overwrite=overwrite)
            with defer_signals():
                draft = _make_folder(place, "part")
                ours.append((draft, status := draft.lstat()))
                if os.name == "posix":  # while it is open, no other folder can get its inode
                    held.callback(os.close, os.open(draft, os.O_RDONLY))
            yield draft
            check_draft(draft, status, place)
            check_export_folder(place, overwrite=overwrite)  # a folder that appeared since belongs to someone else
            with defer_signals():
                if place.is_dir():
                    old = _make_folder(place, "old")
                    place.replace(old)
                    ours.append((old, old.lstat()))
                draft.replace(place)
    except PermissionError as error:
        raise RecordingError(f"{place}: may not be written ({error.strerror}); choose another folder") from None
    except OSError as error:
        raise make_write_error(place, error) from None
    finally:
        remove()
        held.close()


def _make_folder(place: Path, what: str) -> Path:
    """Make an empty folder with a new name beside `place`."""
    for number in itertools.count():
        draft = place.with_name(f"{place.name}.{what}{number or ''}")
        try:
            draft.mkdir()
        except FileExistsError:
            continue
        return draft
    raise AssertionError("counting has no end")


def _find_foreign(place: Path) -> str:
    """Return the name of an entry that no export wrote, or an empty text where all entries belong to one."""
    if not any((place / name).is_file() and MARK in (place / name).read_text(errors="replace") for name in MARKS):
        return next(entry.name for entry in sorted(place.iterdir()))
    others = (entry for entry in sorted(place.iterdir()) if not _OURS.fullmatch(entry.name))
    groups = ("zarr.json", "camera.json")  # in each folder of a Zarr store, and of a camera's images
    return next((entry.name for entry in others if not any((entry / name).is_file() for name in groups)), "")
