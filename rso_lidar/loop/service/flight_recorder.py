"""Recordings of a served simulation: a file of frames and a log of commands for each flight from t = 0."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.files import check_writable
from rso_lidar.loop.service.command_log import SUFFIX, CommandLog, FlownStep
from rso_lidar.records import Frame
from rso_lidar.simulation import Simulation


def _make_run_id() -> str:
    """Return an identity for the temporary files of a flight: no two servers share one, nor a killed one and the next."""
    return uuid.uuid4().hex[:8]


class FlightRecorder:
    """Writes the frames of each flight to a recording of its own: ``a.h5``, then ``a.2.h5`` after a reset, and so on.

    Every frame is on disk when `write` returns. A killed server leaves the frames so far in ``a.h5.tmp-…``, which
    `rl.open` reads. The steps and their commands are in ``a.commands.jsonl``, from which `repeat_flight` flies again; a
    killed server leaves them under the same ending, ``a.commands.jsonl.tmp-…``.

    Parameters
    ----------
    path : of the first recording
    overwrite : whether recordings that exist are replaced
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self._first = export.check_output(path, overwrite=overwrite)
        check_writable(self._first.with_suffix(SUFFIX), overwrite=overwrite)
        self._overwrite = overwrite
        self._flight, self._run_id = 1, _make_run_id()
        self._open = ExitStack()
        self._recorder: export.Recorder | None = None
        self._log: CommandLog | None = None
        self.completed: list[tuple[Path, int]] = []  # recordings, with their numbers of frames

    @property
    def path(self) -> Path:
        """Path of the recording of the present flight."""
        return self._first if self._flight == 1 else self._first.with_suffix(f".{self._flight}{self._first.suffix}")

    @property
    def unfinished(self) -> tuple[Path, int]:
        """Path of the temporary file of the present flight and the number of frames in it."""
        return (self.path, 0) if self._recorder is None else (self._recorder.temporary, self._recorder.written)

    def write(self, frame: Frame | None, steps: Sequence[FlownStep], simulation: Simulation) -> None:
        """Write a step of the present flight, in a new recording if it has the first frame.

        Parameters
        ----------
        frame : that was made; None for none
        steps : for the log
        simulation : that made them

        Raises
        ------
        RunError
            If it cannot be written.
        """
        try:
            self._log = self._log or CommandLog(self.path.with_suffix(SUFFIX), self._run_id, simulation)
            self._log.write(steps)
            if frame is not None:
                self._write(frame)
        except (RecordingError, RunError) as error:
            self._recorder = None
            self._open.__exit__(type(error), error, error.__traceback__)
            raise RunError(str(error)) from error

    def _write(self, frame: Frame) -> None:
        if self._recorder is None:
            recorder = export.Recorder(
                self.path,
                frame.source,
                run_id=self._run_id,
                overwrite=self._overwrite,
                changing_lens=None,  # a command may zoom
            )
            self._recorder = self._open.enter_context(recorder)
        self._recorder.write(frame)

    def complete(self) -> None:
        """Complete the recording of the present flight, if it has frames; the next frame begins another."""
        self._run_id = _make_run_id()
        if self._log is not None:
            log, self._log = self._log, None
            log.complete(keep=self._recorder is not None)
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
            check_writable(after.with_suffix(SUFFIX), overwrite=self._overwrite)
