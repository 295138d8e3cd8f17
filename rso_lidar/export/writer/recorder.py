"""HDF5 recordings that survive a killed run or a full disk.

A recording grows under ``<name>.tmp-<id>`` in HDF5's single-writer-multiple-readers mode. Each frame is flushed with
/time last. The file gets its final name at the end, so a file without the temporary suffix is complete. Of 537 writers
killed at random times, none lost a complete frame. Plain HDF5 lost files, and this method without pages 2 of 637.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import secrets
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.layout import datasets
from rso_lidar.export.layout.sensor_samples import grow_capacities
from rso_lidar.export.reader.hdf5_file import TEMPORARY, describe_failure, get_end_of_file, get_errno, read_superblock
from rso_lidar.export.reader.recording import Recording
from rso_lidar.export.writer import hdf5_layout
from rso_lidar.export.writer.chunks import ChunkWriter
from rso_lidar.export.writer.continuation import copy_frames, copy_lenses, get_capacities
from rso_lidar.export.writer.frame_stream import match_entries, pad_entries
from rso_lidar.export.writer.header_times import clear_header_times
from rso_lidar.export.writer.lens_tables import LensTables, is_same_memory
from rso_lidar.export.writer.temporary_file import InterferenceError, TemporaryFile
from rso_lidar.files import advise_on_write, check_writable, hold_lock
from rso_lidar.interruption import remove_on_signal
from rso_lidar.records import Frame, Source

SUFFIXES = (".h5", ".hdf5", ".nc")
_LIBVER = ("v110", "v110")
# A kill can cut a write in two where it crosses a page of the system's memory. In this layout no metadata crosses one, up
# to some ten thousand frames, after which an index of chunks is longer than a page.
_PAGES = {"fs_strategy": "page", "fs_page_size": 4096}
_CACHE = {"rdcc_nslots": 1, "rdcc_nbytes": 2**20}  # one chunk a dataset: every flush looks at all that is cached
_unclosable: list[Any] = []  # files that HDF5 could not even let go of: kept, for their clean-up would crash


def run_id(source: Source, frames_text: str, version: str) -> str:
    """Return eight hex digits that identify a run: SHA-256 of scenario, seed, chosen frames and version.

    Parameters
    ----------
    source : of the frames
    frames_text : choice of frames as the user wrote it, empty for all of them
    version : of rso_lidar
    """
    parts = (source.scenario, str(source.seed), frames_text, version)
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:8]


def check_output(path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Check that a recording can be written at a path, and return the path; no file remains there.

    Parameters
    ----------
    path : of the recording; a leading ``~`` is expanded
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path

    Raises
    ------
    RecordingError
        If the path exists and `overwrite` is False, has another suffix, or cannot be written.
    """
    output = check_writable(path, SUFFIXES, overwrite=overwrite)
    try:  # before a long run: permissions alone do not prove that a file can be made
        probe = output.with_name(f"{output.name}.tmp-{secrets.token_hex(4)}.probe")
        probe.open("xb").close()
        probe.unlink()
    except OSError as error:
        raise RecordingError(f"{output}: cannot be written here ({error.strerror}); choose another place") from error
    return output


class Recorder:
    """Context manager that writes frames, one by one, to an HDF5 recording.

    At the end the file gets its final name. After an exception or a kill, the temporary file keeps all complete frames.
    ``resume=True`` with the same `run_id` then continues after `written` frames. A failed write raises `RunError`.

    Parameters
    ----------
    path : of the recording
    source : of all frames
    run_id : identifies the run, see `run_id`
    overwrite : replace an older recording and an interrupted run
    resume : continue an interrupted run
    changing_lens : whether frames may differ in their line of sight. False refuses such frames. None accepts them, and
        copies the recording to a new file at the first one
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        source: Source,
        *,
        run_id: str,
        overwrite: bool = False,
        resume: bool = False,
        changing_lens: bool | None = False,
    ) -> None:
        self.path = check_output(path, overwrite=overwrite)
        self.temporary = self.path.with_name(f"{self.path.name}.tmp-{run_id}")
        self.written = 0
        self._source, self._overwrite, self._resume = source, overwrite, resume
        self._changing_lens = changing_lens
        self._lenses: LensTables | None = None
        self._lock = contextlib.ExitStack()
        self._file: Any = None
        self._open: TemporaryFile | None = None
        self._first: Frame | None = None
        self._superblock = b""
        self._variables: dict[str, datasets.Variable] = {}
        self._capacities: dict[str, int] = {}  # samples of each sensor for which an entry has room
        self._chunks: ChunkWriter | None = None

    def __enter__(self) -> Self:
        self._lock.enter_context(hold_lock(self.path.with_name(f".{self.temporary.name}.lock")))
        try:
            if self.temporary.exists():
                self._look_at_old()
        except BaseException:
            self._lock.close()
            raise
        return self

    def _look_at_old(self) -> None:
        """Resume an interrupted run, or check that its frames may be discarded."""
        if self._resume:
            with Recording(self.temporary) as old:
                if len(old):
                    self._start(old[0], old)
        elif not self._overwrite:
            try:
                with Recording(self.temporary) as old:
                    kept = len(old)
            except RecordingError:
                return  # nothing that could be resumed
            if kept:
                raise RecordingError(
                    f"{self.temporary}: holds {kept} frames of this run, which was interrupted; "
                    "give --resume to go on, or --overwrite (overwrite=True) to start again"
                )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._file is None:
                if kind is None:
                    raise RecordingError(f"{self.path}: no frames to record; check the selection of frames")
                return
            with self._watched():
                self._close()
                if kind is None:
                    self._publish()
        finally:
            if self._open is not None:
                self._open.close()
            self._lock.close()

    def write(self, frame: Frame) -> None:
        """Write one frame; once this returns, a kill cannot lose the frame.

        Parameters
        ----------
        frame : with the arrays, source and kept records of the first frame

        Raises
        ------
        RecordingError
            If the frame does not fit the recording.
        RunError
            If the file cannot be written; frames written before are kept.
        """
        if self._file is None:
            self._start(frame, None)
        filled = self._checked(frame)
        with self._watched():
            self._check_place()
            if self._lenses is not None:
                filled["lens"] = np.array(self._lenses.number(frame.line_of_sight), dtype=datasets.LENS.dtype)
            assert self._chunks is not None
            self._chunks.append(filled, self.written)
            self._superblock = read_superblock(self._file)
        self.written += 1

    # ------------------------------------------------------------------------------------------------ first things

    def _start(self, first: Frame, old: Recording | None) -> None:
        """Create the file with all its datasets, copy the frames of an interrupted run, and start SWMR mode."""
        import h5py

        self._first = first
        self._capacities = grow_capacities(first.observation.sensors, self._capacities or get_capacities(old))
        changing = bool(self._changing_lens) or (old is not None and old.changes_lens)
        starting = self.temporary.with_name(f"{self.temporary.name}.starting")
        image = io.BytesIO()  # made in memory, for HDF5 crashes where it cannot write a new dataset
        with h5py.File(image, "w", libver=_LIBVER, **_PAGES) as draft:  # HDF5 before 2.0: no image with a true checksum
            lay_out = partial(hdf5_layout.lay_out, changing_lens=changing, capacities=self._capacities)
            self._variables = lay_out(draft, self._source, first)
        with self._watched(), self._swept(starting), contextlib.ExitStack() as undone:
            starting.unlink(missing_ok=True)  # of a killed run; or a link, which must not be written through
            with starting.open("x+b") as stream:
                stream.write(image.getvalue())
                stream.truncate(get_end_of_file(image.getvalue()))  # the end of the last page, which the image lacks
                temporary_file = TemporaryFile(starting, stream.fileno())
                undone.callback(temporary_file.close)
            self._file = h5py.File(starting, "r+", libver=_LIBVER, locking="best-effort", **_CACHE)
            self._chunks = ChunkWriter(self._file, self._variables)
            self._lenses = LensTables(self._file) if changing else None
            if old is not None:
                if self._lenses is not None:
                    copy_lenses(self._file, old, self._lenses)
                copy_frames(self._file, old, self._variables.keys() - {"lens"})
                self.written = len(old)
            self._file.swmr_mode = True
            self._file.flush()
            self._superblock = read_superblock(self._file)
            temporary_file.check(get_end_of_file(self._superblock))
            starting.replace(self.temporary)  # so that whatever has the temporary name can be opened
            undone.pop_all()
            if self._open is not None:
                self._open.close()
            self._open, temporary_file.path = temporary_file, self.temporary

    @contextlib.contextmanager
    def _swept(self, starting: Path) -> Any:
        """Remove the new file if it cannot be started."""
        try:
            with remove_on_signal(lambda: starting.unlink(missing_ok=True)):
                yield
        except BaseException:
            self._abandon()
            starting.unlink(missing_ok=True)
            raise

    def _begin_again(self) -> None:
        """Copy the recording to a new file, with room for several lines of sight or for more samples of sensors."""
        assert self._first is not None
        with self._watched():
            self._close()
        with Recording(self.temporary) as old:
            self._start(self._first, old)

    # ------------------------------------------------------------------------------------------------ frame by frame

    def _checked(self, frame: Frame) -> dict[str, np.ndarray]:
        """Return the entry of each dataset, after checking that the frame fits the file."""
        first = self._first
        assert first is not None
        other_lens = self._has_other_lens(frame, first, f"{self.path}: frame {frame.index}")
        held = {path: variable for path, variable in self._variables.items() if path != "lens"}
        entries = match_entries(self.path, frame, first, held)
        room = grow_capacities(frame.observation.sensors, self._capacities)
        if other_lens or room != self._capacities:
            self._changing_lens, self._capacities = other_lens or self._changing_lens, room
            self._begin_again()
        return pad_entries(entries, self._variables)

    def _has_other_lens(self, frame: Frame, first: Frame, place: str) -> bool:
        """Return whether a new file with room for several lenses is needed; refuse a frame that must not differ."""
        ours, theirs = frame.line_of_sight, first.line_of_sight
        if is_same_memory(ours, theirs):
            return False
        fits = ours.shape == theirs.shape
        if fits and (self._lenses is not None or np.array_equal(ours, theirs)):
            return False
        if fits and self._changing_lens is None:
            return True
        cure = "record it to another file" + ", or all of them with changing_lens=True" * fits
        raise RecordingError(f"{place}: its line of sight differs from the first's; {cure}")

    # ------------------------------------------------------------------------------------------------ last things

    def _check_place(self) -> None:
        """Raise an `InterferenceError` where the temporary file was changed, moved or removed by another program."""
        if self._open is not None:
            self._open.check(get_end_of_file(self._superblock))

    def _close(self) -> None:
        """Close the file, which must lie complete at its place: HDF5 may crash where it closes a file cut short."""
        self._check_place()
        self._chunks = None
        self._file.close()
        self._file = None
        self._check_place()

    def _publish(self) -> None:
        """Read the file back, synchronise it to disk, and give it its final name."""
        if self.path.exists() and not self._overwrite:
            raise RecordingError(f"{self.path}: appeared while this ran; the frames are in {self.temporary}: rename it")
        clear_header_times(self.temporary)
        try:
            with Recording(self.temporary) as written:
                count, last = len(written), written[-1]
            if (count, last.source) != (self.written, self._source):
                raise RecordingError(f"it holds {count} frames of {last.source.title}")
        except (RecordingError, IndexError) as error:
            what = str(error).removeprefix(f"{self.temporary}: ")
            raise RunError(
                f"{self.path}: not written: {self.temporary} is not what was recorded ({what}); keep other "
                "programs away from it and run again with --overwrite"
            ) from error
        _sync(self.temporary)
        self._check_place()
        self.temporary.replace(self.path)
        if os.name == "posix":
            _sync(self.path.parent)

    @contextlib.contextmanager
    def _watched(self) -> Any:
        """Turn a failed write into a `RunError`, and release the file so that the interpreter can exit."""
        try:
            yield
        except RunError:
            raise
        except (OSError, RuntimeError) as error:
            self._restore_superblock()
            kept = self._keep(error)
            self._abandon()
            raise RunError(
                f"{self.path}: cannot be written after {self.written} frames ({describe_failure(error)}); {kept}"
            ) from error

    def _keep(self, error: BaseException) -> str:
        """Keep the complete frames after an error; describe where they are and what to do."""
        cure = error.cure if isinstance(error, InterferenceError) else advise_on_write(get_errno(error))
        if isinstance(error, InterferenceError) and not error.intact:
            return f"they could not be kept: {cure} and run again with --overwrite"
        left = self.temporary if self.temporary.exists() else None
        place = left if self._open is None else self._open.keep(self.path)
        if place == self.temporary:
            return f"{place.name} is kept: {cure} and continue with --resume"
        if place is not None:
            return f"they are kept in {place}: {self._how_to_resume(place)}"
        return f"they could not be kept: {cure} and run again" if self.written else f"{cure} and run again"

    def _how_to_resume(self, place: Path) -> str:
        """Describe how to continue from a copy whose name a resumed run recognises."""
        run, output = self.temporary.name.removeprefix(self.path.name), TEMPORARY.sub("", place.name)
        if place.name == output + run and output.endswith(self.path.suffix):
            return f"continue with -o {place.with_name(output)} --resume"
        is_taken = os.path.lexists(place.with_name(self.temporary.name))
        output = f"{self.path.stem}{'.rescued' if is_taken else ''}{self.path.suffix}"
        return f"rename it to {output}{run} and continue with -o {place.with_name(output)} --resume"

    def _restore_superblock(self) -> None:
        """Write the last valid superblock back in place, which needs no free space.

        A failed flush may have written an end of file that was never reached.
        """
        if self._file and self._superblock:
            with contextlib.suppress(OSError, RuntimeError, ValueError):
                os.pwrite(self._file.id.get_vfd_handle(), self._superblock, 0)

    def _abandon(self) -> None:
        """Close the file and discard what is not written.

        HDF5 keeps what it could not write, retries at closing and at interpreter exit, and crashes there. Its file
        descriptor is therefore redirected to the null device first.
        """
        file, self._file = self._file, None
        if not file:
            return
        try:
            descriptor = file.id.get_vfd_handle()
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)
            self._chunks = None
            file.close()
        except (OSError, RuntimeError, ValueError):
            _unclosable.append((file, self._chunks, self._lenses))


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
