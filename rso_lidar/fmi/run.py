"""Runs of an FMU on a fixed grid from t = 0, and points of a run from which it can go on again."""

from __future__ import annotations

import importlib.util
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_regular
from rso_lidar.fmi import host
from rso_lidar.fmi.unit_table import Conversion

Checksums = tuple[tuple[str, int, int], ...]
_ANSWER_S = 120.0  # longest time of a request; a step of an FMU takes microseconds to milliseconds


class Signal(NamedTuple):
    """Elements of a quantity, and the variable of the FMU that holds them; None for a constant."""

    quantity: str
    variable: str | None
    elements: int
    conversion: Conversion


class FmuSettings(NamedTuple):
    """What a run needs beside the file: interface, grid [s], tolerance, start values by name, and signals."""

    interface: str
    step_s: float
    tolerance: float
    start: tuple[tuple[str, float], ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]


class FmuPoint:
    """A point of a run: the number of steps since t = 0, and the state of the FMU there where it can give it.

    Parameters
    ----------
    run : of which it is a point
    tick : number of steps since t = 0
    state : of the FMU; None if it cannot give it
    begin : start values and inputs with which the run began
    """

    def __init__(self, run: FmuRun, tick: int, state: bytes | None, begin: Any) -> None:
        self.run, self.tick, self.state, self.begin = run, tick, state, begin

    def __reduce__(self) -> Any:
        if self.tick and self.state is None:
            raise ScenarioError(
                f"{self.run.name}: the FMU cannot give its state (canGetAndSetFMUstate, canSerializeFMUstate), so a "
                "simulation with it cannot be pickled"
            )
        return _rebuild, (str(self.run.path), self.run.checksums, self.run.settings, self.tick, self.state, self.begin)


def _rebuild(
    path: str, checksums: Checksums, settings: FmuSettings, tick: int, state: bytes | None, begin: Any
) -> FmuPoint:
    """Return a point of a new run of the same FMU.

    Raises
    ------
    ScenarioError
        If the file cannot be run, or is another FMU by now. The bytes of a state mean nothing to another binary.
    """
    run = FmuRun(Path(path))
    if run.checksums != checksums:
        raise ScenarioError(
            f"{run.name}: the FMU has changed since the state was saved; restore with the former one, or begin again"
        )
    run.settings = settings
    return FmuPoint(run, tick, state, begin)


class FmuRun:
    """A run of one FMU. Values are in the units of the package.

    Parameters
    ----------
    path : of the FMU

    Raises
    ------
    ScenarioError
        If it is not an FMU that runs on this machine
    """

    settings: FmuSettings

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, path.name
        check_regular(path, sys.maxsize, ScenarioError, "file (.fmu)")
        self._process = HostProcess(path)
        self._tick = 0
        self._here: FmuPoint | None = None  # None before the beginning

    @property
    def description(self) -> dict[str, Any]:
        """Version, interfaces, variables and units of the FMU."""
        return self._process.description

    @property
    def checksums(self) -> Checksums:
        """Names, sizes and CRC-32 of the files in the FMU, by which another FMU of the same name is noticed."""
        checksums: Checksums = self.description["checksums"]
        return checksums

    def begin(self, first: np.ndarray, start: tuple[tuple[str, float], ...] = ()) -> tuple[FmuPoint, np.ndarray]:
        """Initialise the FMU at t = 0.

        Parameters
        ----------
        first : inputs (input,) at t = 0
        start : further start values of variables, in the units of the FMU

        Returns
        -------
        the point at t = 0, and the outputs (output,) there

        Raises
        ------
        ScenarioError
            If the FMU fails
        """
        settings = self.settings
        given = (
            settings.interface,
            settings.step_s,
            settings.tolerance,
            [*settings.start, *start],
            [signal.variable for signal in settings.inputs],
            self._to_fmu(np.reshape(first, (1, -1)))[0],
            [signal.variable for signal in settings.outputs if signal.variable is not None],
        )
        rows = self._process.ask("begin", *given)
        self._tick = 0
        self._here = FmuPoint(self, 0, None, (np.array(first, dtype=float), start))
        return self._here, self._from_fmu(rows[None])[0]

    def advance(self, point: FmuPoint, held: np.ndarray, *, keep_state: bool = True) -> tuple[FmuPoint, np.ndarray]:
        """Go on from a point by a step for each row of inputs.

        Parameters
        ----------
        point : of this run
        held : inputs (step, input), each held over a step
        keep_state : whether a later run may go on from the point again

        Returns
        -------
        the point after the last step, and the outputs (step, output) after each

        Raises
        ------
        ScenarioError
            If the FMU fails, or cannot go back to the point
        """
        self._go_to(point)
        rows = self._process.ask("advance", self._to_fmu(np.asarray(held, dtype=float)))
        self._tick += len(held)
        outputs = self._from_fmu(rows)
        state = self._process.ask("save") if keep_state else None
        self._here = FmuPoint(self, self._tick, state, point.begin)
        return self._here, outputs

    def keep(self, point: FmuPoint) -> FmuPoint:
        """Return a point to which the run can go back.

        Parameters
        ----------
        point : the present one, or one that has its state

        Raises
        ------
        ScenarioError
            If the FMU cannot give its state
        """
        if point.tick == 0 or point.state is not None:
            return point
        state = self._process.ask("save") if point is self._here else None
        if state is None:
            raise ScenarioError(
                f"{self.name}: the FMU cannot give its state (canGetAndSetFMUstate, canSerializeFMUstate), so it cannot be "
                "saved; begin again with a new one"
            )
        self._here = FmuPoint(self, point.tick, state, point.begin)
        return self._here

    def _go_to(self, point: FmuPoint) -> None:
        """Bring the FMU to a point of this run."""
        if point is self._here:
            return
        if point.tick and point.state is None:
            raise ScenarioError(
                f"{self.name}: the FMU cannot go back from {self._tick * self.settings.step_s:g} s to "
                f"{point.tick * self.settings.step_s:g} s, because it cannot give its state (canGetAndSetFMUstate, "
                "canSerializeFMUstate); begin again with reset()"
            )
        if point.tick == 0 or self._here is None:
            self.begin(*point.begin)
        if point.tick:
            self._process.ask("restore", point.state)
        self._tick, self._here = point.tick, point

    def _to_fmu(self, rows: np.ndarray) -> np.ndarray:
        """Convert inputs (step, input) to the units of the FMU."""
        factors = [signal.conversion.factor for signal in self.settings.inputs for _ in range(signal.elements)]
        offsets = [signal.conversion.offset for signal in self.settings.inputs for _ in range(signal.elements)]
        with np.errstate(over="ignore"):
            converted: np.ndarray = (rows - np.array(offsets)) / np.array(factors)
        if not np.isfinite(converted).all():
            names = [signal.variable for signal in self.settings.inputs for _ in range(signal.elements)]
            column = int(np.flatnonzero(~np.isfinite(converted).all(axis=0))[0])
            raise ScenarioError(
                f"{self.name}: the input '{names[column]}' is too large in the unit of the FMU; give a smaller number"
            )
        return converted

    def _from_fmu(self, rows: np.ndarray) -> np.ndarray:
        """Convert outputs (step, read) from the units of the FMU, and put constants among them."""
        columns, read = [], 0
        for signal in self.settings.outputs:
            factor, offset = signal.conversion
            if signal.variable is None:
                columns.append(np.full((len(rows), 1), offset))
                continue
            values = rows[:, read : read + signal.elements] * factor + offset
            read += signal.elements
            if not np.isfinite(values).all():
                first = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
                time_s = (self._tick - len(rows) + 1 + first) * self.settings.step_s
                raise ScenarioError(
                    f"{self.name}: the output '{signal.variable}' is not a finite number at t = {max(time_s, 0.0):g} s; "
                    "correct the FMU or its settings"
                )
            columns.append(values)
        return np.concatenate(columns, axis=1) if columns else np.empty((len(rows), 0))


class HostProcess:
    """A process that runs one FMU, from its first request until nobody holds this object.

    Raises
    ------
    ScenarioError
        If fmpy is not installed, the process cannot be started, or the file is not an FMU for this machine
    """

    def __init__(self, path: Path) -> None:
        if importlib.util.find_spec("fmpy") is None:
            raise ScenarioError(f"{path.name}: an FMU needs fmpy; install it with: pip install rso-lidar[fmi]")
        self.name = path.name
        folder = tempfile.mkdtemp(prefix="rso_lidar_fmu_")
        command = [sys.executable, str(Path(host.__file__)), folder]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        weakref.finalize(self, _end, self._process, folder)
        self._answers: queue.Queue[tuple[str, Any] | None] = queue.Queue()
        threading.Thread(target=_read_answers, args=(self._process.stdout, self._answers), daemon=True).start()
        self.description: dict[str, Any] = self.ask("describe", str(path.resolve()))

    def ask(self, name: str, *given: Any) -> Any:
        """Make a request and wait for its answer.

        Parameters
        ----------
        name : of a method of `host.Host`

        Raises
        ------
        ScenarioError
            If the FMU fails, ends its process, or does not answer in time. The process has then ended.
        """
        assert self._process.stdin is not None
        try:
            pickle.dump((name, *given), self._process.stdin)
            self._process.stdin.flush()
            answer = self._answers.get(timeout=_ANSWER_S)
        except queue.Empty:
            self._process.kill()
            raise ScenarioError(
                f"{self.name}: the FMU has not answered for {_ANSWER_S:g} s and was ended; check it in another tool"
            ) from None
        except OSError:
            answer = None
        if answer is None:
            status = self._process.wait()
            raise ScenarioError(
                f"{self.name}: the FMU has ended its process with status {status}, as after a crash; check it in another "
                "tool"
            )
        kind, result = answer
        if kind == "error":
            raise ScenarioError(f"{self.name}: {result}; correct the FMU or its settings")
        return result


def _read_answers(stream: Any, answers: queue.Queue[tuple[str, Any] | None]) -> None:
    """Read answers until the stream ends, which is the last answer: None."""
    with stream:
        try:
            while True:
                answers.put(pickle.load(stream))
        except Exception:  # the process has ended, in an answer or between two
            answers.put(None)


def _end(process: subprocess.Popen[bytes], folder: str) -> None:
    """End a process that runs an FMU, and remove the folder of its files."""
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()
    try:
        process.wait(timeout=2.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)
