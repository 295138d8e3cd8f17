"""Recordings of a served simulation: one file for each flight from t = 0."""

from __future__ import annotations

import uuid
from contextlib import ExitStack
from pathlib import Path

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.records import Frame


class FlightRecorder:
    """Writes the frames of each flight to a recording of its own: ``a.h5``, then ``a.2.h5`` after a reset, and so on.

    Every frame is on disk when `write` returns. A killed server leaves the frames so far in ``a.h5.tmp-…``, which
    `rl.open` reads.

    Parameters
    ----------
    path : of the first recording.
    overwrite : whether recordings that exist are replaced.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self._first = export.check_output(path, overwrite=overwrite)
        self._overwrite = overwrite
        self._flight = 1
        self._open = ExitStack()
        self._recorder: export.Recorder | None = None
        self.completed: list[tuple[Path, int]] = []  # recordings, with their numbers of frames

    @property
    def path(self) -> Path:
        """Path of the recording of the present flight."""
        return self._first if self._flight == 1 else self._first.with_suffix(f".{self._flight}{self._first.suffix}")

    @property
    def unfinished(self) -> tuple[Path, int]:
        """Path of the temporary file of the present flight and the number of frames in it."""
        return (self.path, 0) if self._recorder is None else (self._recorder.temporary, self._recorder.written)

    def write(self, frame: Frame) -> None:
        """Write one frame, in a new recording if it is the first of its flight.

        Parameters
        ----------
        frame : of the present flight.

        Raises
        ------
        RunError
            If it cannot be written.
        """
        try:
            self._write(frame)
        except (RecordingError, RunError) as error:
            self._recorder = None
            self._open.__exit__(type(error), error, error.__traceback__)
            raise RunError(str(error)) from error

    def _write(self, frame: Frame) -> None:
        if self._recorder is None:
            # Its own identity: two servers, or a killed one and the next, never share a temporary file.
            recorder = export.Recorder(
                self.path,
                frame.source,
                run_id=uuid.uuid4().hex[:8],
                overwrite=self._overwrite,
                changing_lens=None,  # a command may zoom
            )
            self._recorder = self._open.enter_context(recorder)
        self._recorder.write(frame)

    def complete(self) -> None:
        """Complete the recording of the present flight, if it has frames; the next frame begins another."""
        if self._recorder is None:
            return
        recorder, self._recorder = self._recorder, None
        self._open.close()
        self.completed.append((recorder.path, recorder.written))
        self._flight += 1

    def check_next(self) -> None:
        """Check that the next flight can be recorded, before the present one is completed.

        Raises
        ------
        RecordingError
            If the file of the next flight exists, or cannot be written.
        """
        if self._recorder is not None:
            after = self._first.with_suffix(f".{self._flight + 1}{self._first.suffix}")
            export.check_output(after, overwrite=self._overwrite)
