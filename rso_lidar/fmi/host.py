"""A process that runs one FMU: a script that reads requests from its standard input and writes answers to its output.

The native code of an FMU may crash, hang or print; none of that reaches the process that asks. Only this module imports
fmpy, and it imports nothing of the package, so that it starts fast. A request and an answer are pickles: ``(name, *given)``,
and ``("ok", result)`` or ``("error", text)``.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import queue
import sys
import threading
import time
import zipfile
from collections.abc import Sequence
from typing import Any

import numpy as np

MOST_UNPACKED_BYTES = 2**30  # of all files of an FMU; large ones have some 200 MiB
MOST_FILES = 20_000
_MOST_EVENTS = 1000  # iterations of one event
_BISECTIONS = 40  # of a step that holds an event: 1e-12 of it


class FmuError(Exception):
    """A failure of an FMU, in one line."""


class Host:
    """One FMU, unpacked into a folder: its description, and one instance of it."""

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self.messages: list[str] = []
        self.instance: Any = None
        self._row: tuple[float, ...] = ()  # inputs of a model for model exchange

    def describe(self, path: str) -> dict[str, Any]:
        """Unpack an FMU within bounds, and return its description in plain types."""
        from fmpy import extract, platform, platform_tuple, read_model_description

        try:
            with zipfile.ZipFile(path) as archive:
                entries = archive.infolist()
                names = {entry.filename for entry in entries}
                if "modelDescription.xml" not in names:
                    raise FmuError("has no modelDescription.xml; it is not an FMU")
                total = sum(entry.file_size for entry in entries)
                if total > MOST_UNPACKED_BYTES or len(entries) > MOST_FILES:
                    raise FmuError(f"unpacks to {total / 2**20:,.0f} MiB in {len(entries):,} files; it is too large")
            extract(path, self.folder, lambda name: not name.startswith(("sources/", "documentation/")))
        except OSError as error:
            raise FmuError(f"cannot be read ({error.strerror or error})") from None
        except (zipfile.BadZipFile, EOFError, RuntimeError) as error:
            raise FmuError(f"is not a ZIP archive that can be read ({error}); it is not an FMU") from None
        try:
            description = read_model_description(self.folder, validate=False)
        except Exception as error:
            raise FmuError(f"its modelDescription.xml cannot be read ({error})") from None
        if description.fmiVersion is None or description.fmiVersion[0] not in "23":
            raise FmuError(f"is of FMI {description.fmiVersion}; export it for FMI 2 or 3")
        self.description, self.version = description, int(description.fmiVersion[0])
        here = platform if self.version == 2 else platform_tuple
        platforms = sorted(
            {name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1}
        )
        if here not in platforms:
            raise FmuError(
                f"has no binary for {here} (it has {', '.join(platforms) or 'none'}); export it for this machine"
            )
        kinds = {"co_simulation": description.coSimulation, "model_exchange": description.modelExchange}
        return {
            "checksums": tuple(sorted((entry.filename, entry.file_size, entry.CRC) for entry in entries)),
            "version": self.version,
            "interfaces": [name for name, kind in kinds.items() if kind is not None],
            "can_restore": {name: bool(kind.canGetAndSetFMUstate) for name, kind in kinds.items() if kind is not None},
            "variables": {variable.name: _describe_variable(variable) for variable in description.modelVariables},
            "units": {
                unit.name: None if unit.baseUnit is None else _describe_unit(unit.baseUnit)
                for unit in description.unitDefinitions
            },
        }

    def begin(
        self,
        interface: str,
        step_s: float,
        tolerance: float,
        start: Sequence[tuple[str, float]],
        inputs: Sequence[str],
        first: np.ndarray,
        outputs: Sequence[str],
    ) -> np.ndarray:
        """Make a new instance, initialise it at t = 0 and return its outputs (output).

        Parameters
        ----------
        interface : "co_simulation" or "model_exchange"
        step_s : grid of the run [s]
        tolerance : relative, for the FMU's own integration
        first : inputs (input,) at t = 0
        """
        from fmpy.fmi2 import FMU2Model, FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
        from fmpy.fmi3 import FMU3Model, FMU3Slave

        self.close()
        is_model = self.is_model = interface == "model_exchange"
        kind = self.description.modelExchange if is_model else self.description.coSimulation
        variables = {variable.name: variable for variable in self.description.modelVariables}
        self.inputs, self.outputs = [variables[name] for name in inputs], [variables[name] for name in outputs]
        self.step_s, self.tick, self.kind = step_s, 0, kind
        classes = (FMU2Model if is_model else FMU2Slave, FMU3Model if is_model else FMU3Slave)
        given = {"guid": self.description.instantiationToken, "modelIdentifier": kind.modelIdentifier}
        try:
            fmu = classes[self.version - 2](unzipDirectory=self.folder, instanceName="rso_lidar", **given)
        except Exception as error:
            raise FmuError(f"its binary cannot be loaded ({error})") from None
        self.instance = fmu
        if self.version == 2:
            calls = fmi2CallbackFunctions()
            calls.allocateMemory, calls.freeMemory = defaultCallbacks.allocateMemory, defaultCallbacks.freeMemory
            calls.logger = fmi2CallbackLoggerTYPE(lambda env, name, status, category, text: self._log(status, text))
            fmu.instantiate(callbacks=calls)
            fmu.setupExperiment(tolerance=tolerance, startTime=0.0)
        else:
            fmu.instantiate(logMessage=lambda env, status, category, text: self._log(status, text))
        for name, value in start:
            self._set(variables[name], [value])
        if self.version == 2:
            fmu.enterInitializationMode()
        else:
            fmu.enterInitializationMode(tolerance=tolerance, startTime=0.0)
        self._write_inputs(first)
        fmu.exitInitializationMode()
        if is_model:
            self._begin_model()
        return self._read_outputs()

    def advance(self, held: np.ndarray) -> np.ndarray:
        """Go on by a step for each row of inputs (step, input), and return the outputs (step, output) at its end."""
        rows = []
        for row in held:
            time_s = self.tick * self.step_s
            if self.is_model:
                self._integrate(time_s, (self.tick + 1) * self.step_s, row)
            else:
                self._write_inputs(row)
                ended = self.instance.doStep(time_s, self.step_s)
                if self.version == 3 and ended[1]:
                    raise FmuError(f"ended its simulation at t = {ended[3]:g} s")
                if self.version == 3 and ended[2]:
                    raise FmuError(f"returned early from its step, at t = {ended[3]:g} s, which was not allowed")
            self.tick += 1
            rows.append(self._read_outputs())
        return np.array(rows).reshape(len(rows), -1)

    def save(self) -> bytes | None:
        """Return the state as bytes; None if the FMU cannot give it."""
        if not (self.kind.canGetAndSetFMUstate and self.kind.canSerializeFMUstate):
            return None
        fmu = self.instance
        if self.version == 2:
            state = fmu.getFMUstate()
            data = fmu.serializeFMUstate(state)
            fmu.freeFMUstate(state)
        else:
            state = fmu.getFMUState()
            data = fmu.serializeFMUState(state)
            fmu.freeFMUState(state)
        model = (list(self._states), self._row, self._next_s) if self.is_model else None
        return pickle.dumps((self.tick, bytes(data), model))

    def restore(self, saved: bytes) -> None:
        """Go back, or on, to a saved state."""
        tick, data, model = pickle.loads(saved)
        fmu = self.instance
        if self.version == 2:
            state = fmu.deSerializeFMUstate(data)
            fmu.setFMUstate(state)
            fmu.freeFMUstate(state)
        else:
            state = fmu.deserializeFMUState(data)
            fmu.setFMUState(state)
            fmu.freeFMUState(state)
        self.tick = tick
        if self.is_model:
            self._states[:], self._row, self._next_s = model

    def close(self) -> None:
        """Free the instance."""
        if self.instance is not None and self.instance.component:
            self.instance.freeInstance()
        self.instance = None

    def _log(self, status: int, text: bytes | None) -> None:
        if status not in (0, 5) and text:
            self.messages.append(" ".join(text.decode(errors="replace").split()))

    # ------------------------------------------------------------------------------------------------- values

    def _set(self, variable: Any, values: Sequence[float]) -> None:
        kind = variable.type if self.version == 3 or variable.type != "Enumeration" else "Integer"
        given: list[Any] = list(values)
        if kind == "Boolean":
            given = [bool(value) for value in values]
        elif kind not in ("Real", "Float64", "Float32"):
            given = [round(value) for value in values]
        getattr(self.instance, f"set{kind}")([variable.valueReference], given)

    def _get(self, variable: Any) -> list[float]:
        kind = variable.type if self.version == 3 or variable.type != "Enumeration" else "Integer"
        read = getattr(self.instance, f"get{kind}")
        if self.version == 3 and variable.dimensions:
            return [float(value) for value in read([variable.valueReference], nValues=_count_elements(variable))]
        return [float(value) for value in read([variable.valueReference])]

    def _write_inputs(self, row: Sequence[float] | np.ndarray) -> None:
        first = 0
        for variable in self.inputs:
            n = _count_elements(variable)
            self._set(variable, [float(value) for value in row[first : first + n]])
            first += n

    def _read_outputs(self) -> np.ndarray:
        return np.array([value for variable in self.outputs for value in self._get(variable)])

    # ----------------------------------------------------------------------------------------- model exchange

    def _begin_model(self) -> None:
        fmu = self.instance
        if self.version == 2:
            self._n = len(self.description.derivatives)
            self._n_events = self.description.numberOfEventIndicators
        else:
            self._n, self._n_events = fmu.getNumberOfContinuousStates(), fmu.getNumberOfEventIndicators()
        self._states, self._slopes = (ctypes.c_double * self._n)(), (ctypes.c_double * self._n)()
        self._indicators = (ctypes.c_double * self._n_events)()
        self._row = ()
        self._next_s = np.inf
        self._update_discrete()

    def _update_discrete(self) -> None:
        """Iterate an event, in event mode, and go back to continuous time."""
        fmu = self.instance
        for _ in range(_MOST_EVENTS):
            again, ended, _, _, is_timed, next_s = (
                fmu.newDiscreteStates() if self.version == 2 else fmu.updateDiscreteStates()
            )
            if ended:
                raise FmuError(f"ended its simulation at t = {self.tick * self.step_s:g} s")
            if not again:
                break
        else:
            raise FmuError(f"an event does not settle in {_MOST_EVENTS} iterations")
        self._next_s = next_s if is_timed else np.inf
        fmu.enterContinuousTimeMode()
        if self._n:
            fmu.getContinuousStates(self._states, self._n)

    def _integrate(self, begin_s: float, end_s: float, row: np.ndarray) -> None:
        """Integrate from tick to tick by classical Runge-Kutta steps; events are found by bisection.

        Parameters
        ----------
        begin_s, end_s : the ticks [s]
        row : inputs (input,), held
        """
        fmu = self.instance
        if tuple(row) != self._row:
            fmu.enterEventMode()
            self._write_inputs(row)
            self._row = tuple(row)
            self._update_discrete()
        now_s = begin_s
        for _ in range(_MOST_EVENTS):
            if now_s >= end_s:
                return
            until_s = min(end_s, max(self._next_s, now_s))
            before, signs = np.array(self._states), self._signs()
            crossed = until_s > now_s and self._step(before, now_s, until_s, signs)
            if crossed:
                low_s, high_s = now_s, until_s
                for _ in range(_BISECTIONS):
                    middle_s = 0.5 * (low_s + high_s)
                    if self._step(before, now_s, middle_s, signs):
                        high_s = middle_s
                    else:
                        low_s = middle_s
                self._step(before, now_s, high_s, signs)
                until_s = high_s
            asked, ended = fmu.completedIntegratorStep()
            if ended:
                raise FmuError(f"ended its simulation at t = {until_s:g} s")
            now_s = until_s
            if crossed or asked or now_s >= self._next_s:
                fmu.enterEventMode()
                self._update_discrete()
        raise FmuError(f"has more than {_MOST_EVENTS} events between t = {begin_s:g} and {end_s:g} s")

    def _step(self, states: np.ndarray, begin_s: float, end_s: float, signs: np.ndarray) -> bool:
        """Make one Runge-Kutta step, and return whether an event indicator has changed its sign.

        Parameters
        ----------
        states : continuous states (state,) at the beginning
        begin_s, end_s : ends of the step [s]
        signs : whether the indicators (indicator,) were positive at the beginning
        """
        h = end_s - begin_s
        if self._n:
            k1 = self._rates(begin_s, states)
            k2 = self._rates(begin_s + 0.5 * h, states + 0.5 * h * k1)
            k3 = self._rates(begin_s + 0.5 * h, states + 0.5 * h * k2)
            k4 = self._rates(end_s, states + h * k3)
            self._states[:] = (states + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)).tolist()
        self.instance.setTime(end_s)
        if self._n:
            self.instance.setContinuousStates(self._states, self._n)
        return bool((self._signs() != signs).any())

    def _rates(self, time_s: float, states: np.ndarray) -> np.ndarray:
        fmu = self.instance
        fmu.setTime(time_s)
        self._states[:] = states.tolist()
        fmu.setContinuousStates(self._states, self._n)
        (fmu.getDerivatives if self.version == 2 else fmu.getContinuousStateDerivatives)(self._slopes, self._n)
        return np.array(self._slopes)

    def _signs(self) -> np.ndarray:
        if self._n_events:
            self.instance.getEventIndicators(self._indicators, self._n_events)
        return np.array(self._indicators) > 0.0


def _count_elements(variable: Any) -> int:
    """Return the number of elements of a variable; arrays of FMI 3 have several."""
    return int(np.prod([int(dimension.start) for dimension in variable.dimensions or () if dimension.start]))


def _describe_variable(variable: Any) -> dict[str, Any]:
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType is not None else None)
    return {
        "causality": variable.causality,
        "variability": variable.variability,
        "type": variable.type,
        "unit": unit,
        "elements": _count_elements(variable),
    }


def _describe_unit(base: Any) -> tuple[tuple[int, ...], float, float]:
    exponents = tuple(int(getattr(base, name)) for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad"))
    return exponents, float(base.factor), float(base.offset)


def _read_requests(requests: queue.SimpleQueue[tuple[Any, ...]]) -> None:
    """Read requests until the input ends, then end the process, even while the FMU hangs in an earlier request."""
    try:
        while True:
            requests.put(pickle.load(sys.stdin.buffer))
    except Exception:  # the process that asks has ended, in a request or between two
        os._exit(0)


def _end_with(parent: int) -> None:
    """End the process soon after its parent. A fork of the parent may keep the input open."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(0)


def main() -> None:
    """Answer requests until the input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what an FMU prints would be taken for an answer
    sys.stdout = open(os.devnull, "w")  # noqa: SIM115, PTH123  until the process ends
    requests: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
    threading.Thread(target=_read_requests, args=(requests,), daemon=True).start()
    if os.name == "posix":
        threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    host = Host(sys.argv[1])
    while True:
        name, *given = requests.get()
        try:
            answer: tuple[str, Any] = ("ok", getattr(host, name)(*given))
        except Exception as error:
            said = [*host.messages[-1:], str(error) or type(error).__name__]
            answer = ("error", ": ".join(" ".join(text.split()) for text in said))
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
