"""A user's own x' = f(t, x, u) (seed eq. 6): where f is found, and how it is called, checked and integrated."""

from __future__ import annotations

import functools
import importlib
import importlib.machinery
import importlib.util
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from rso_lidar.errors import PropagationError, RsoLidarError, ScenarioError, did_you_mean
from rso_lidar.orbit.propagation.integrator import Solution
from rso_lidar.part import Number, Part, Positive
from rso_lidar.shipped import find

Function = Callable[[float, np.ndarray, np.ndarray], Any]

_PANEL_S = 60.0
_COMMANDED_PANEL_S = 1.0  # under commands little is asked beyond the next one
_KEPT = 1000  # pieces between two inputs that are remembered


def _named_or_callable(value: Any) -> Any:
    if isinstance(value, str):
        place, colon, name = value.rpartition(":")
        if not (colon and place and name.isidentifier()):
            raise ValueError(f"'{value}' names no function: write 'file.py:name' or 'package.module:name'")
    elif not callable(value):
        raise ValueError(f"needs 'file.py:name', 'package.module:name' or a function f(t, x, u), not {value!r:.60}")
    elif not isinstance(value, Hashable):
        raise ValueError(f"{value!r:.60} cannot be hashed: give it a __hash__, as @dataclass(frozen=True) does")
    return value


def in_words(value: Any) -> str:
    """Return where a function can be found again."""
    if isinstance(value, str):
        return value
    return f"{getattr(value, '__module__', '?')}:{getattr(value, '__qualname__', type(value).__qualname__)}"


def file_of(dynamics: Any) -> str | None:
    """Return the Python file that a function is named by; None where it is not."""
    place = dynamics.rpartition(":")[0] if isinstance(dynamics, str) else ""
    return place if place.endswith(".py") else None


Dynamics = Annotated[
    Any,
    BeforeValidator(_named_or_callable),
    PlainSerializer(in_words, return_type=str),
    WithJsonSchema({"type": "string", "description": "file.py:name or package.module:name"}),
]


class StateSpaceModel(Part):
    """The base of what moves by a user's own x' = f(t, x, u) (seed eq. 6).

    `dynamics` is ``file.py:name``, ``package.module:name`` or, in Python, the function or object itself, called with
    seconds since `start_utc`, the state (n,) and the inputs (m,), and giving (n,). `inputs` hold until a controller's
    `Command.inputs` gives others. DOP853 to these tolerances for each step.
    """

    dynamics: Dynamics = Field(
        description=(
            "Function x' = f(t, x, u): `file.py:name`, `package.module:name`, or a function in Python. It returns the "
            "derivatives of all entries of x."
        )
    )
    initial_state: tuple[Number, ...] = Field(description="State x at `start_utc`.")
    inputs: tuple[Number, ...] = Field(
        default=(), description="Inputs u, constant until a controller's `Command.inputs` replaces them."
    )
    relative_tolerance: Positive = Field(
        default=1e-10, description="Relative tolerance of an integration step, at least 1e-12."
    )
    absolute_tolerance: Positive = Field(
        default=1e-9, description="Absolute tolerance of an integration step, in the units of x."
    )

    @property
    def label(self) -> str:
        """Return what to call the dynamics in errors."""
        return in_words(self.dynamics)

    def function(self) -> Function:
        """Return the function of the dynamics, wrapped so that what goes wrong in it is one line."""
        return checked(found(self.dynamics), self.label, len(self.initial_state))

    def solution(
        self, state: np.ndarray, inputs: np.ndarray, start_s: float = 0.0, panel_s: float = _PANEL_S
    ) -> Solution:
        """Return x(t - start_s) from `state` at `start_s` [s] on, under constant inputs, in panels of `panel_s` [s]."""
        function = self.function()

        def derivative(t: float, x: np.ndarray) -> np.ndarray:
            return np.asarray(function(t + start_s, x, inputs))

        return Solution(
            derivative,
            state,
            panel_s=panel_s,
            rtol=self.relative_tolerance,
            atol=self.absolute_tolerance,
            name=self.label,
        )


class Flight:
    """x(t) of one model, under inputs that are held from one instant to the next."""

    def __init__(self, model: StateSpaceModel) -> None:
        self.model = model
        self._inputs = np.array(model.inputs, dtype=float)
        self._pieces = [(0.0, self._inputs, model.solution(np.array(model.initial_state, dtype=float), self._inputs))]
        self._lost_s = (np.inf, -np.inf)

    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Hold other inputs from `time_s` [s] on, which is not before the instant of the last ones."""
        inputs = np.array(inputs, dtype=float, ndmin=1)
        if inputs.shape != self._inputs.shape or not np.all(np.isfinite(inputs)):
            raise ScenarioError(
                f"command: inputs of {self.model.label} are {inputs.tolist()!s:.60}: it takes {len(self._inputs)} finite "
                "numbers, as many as its `inputs`"
            )
        if np.array_equal(inputs, self._inputs):
            return
        state = self(np.array([time_s]))[0]
        if self._pieces[-1][0] == time_s:
            del self._pieces[-1]
        self._inputs = inputs
        self._pieces.append((time_s, inputs, self.model.solution(state, inputs, time_s, _COMMANDED_PANEL_S)))
        if len(self._pieces) > _KEPT + 1:
            self._lost_s = (min(self._lost_s[0], self._pieces[1][0]), self._pieces[2][0])
            del self._pieces[1]

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return x (time, n) at `time_s` (time,) [s]."""
        times = np.asarray(time_s, dtype=float)
        piece = self._piece(times)
        lost = (times > self._lost_s[0]) & (times < self._lost_s[1])
        if lost.any():
            raise PropagationError(
                f"{self.model.label}: what was flown from {self._lost_s[0]:g} to {self._lost_s[1]:g} s is forgotten, more "
                f"than {_KEPT} commands ago: ask for later instants",
                lost,
            )
        states = np.empty((len(times), len(self.model.initial_state)))
        for number in np.unique(piece):
            begin, _, solution = self._pieces[number]
            rows = piece == number
            states[rows] = solution(times[rows] - begin)
        return states

    def rates(self, time_s: np.ndarray) -> np.ndarray:
        """Return x' (time, n) at `time_s` (time,) [s]: f of the state there, under the inputs that are held from there."""
        times = np.asarray(time_s, dtype=float)
        function = self.model.function()
        inputs = [self._pieces[number][1] for number in self._piece(times)]
        rows = [function(t, x, u) for t, x, u in zip(times.tolist(), self(times), inputs, strict=True)]
        return np.array(rows, dtype=float).reshape(len(times), len(self.model.initial_state))

    @property
    def begins_s(self) -> np.ndarray:
        """Return the instants [s] from which other inputs are held."""
        return np.array([begin for begin, _, _ in self._pieces])

    def _piece(self, times: np.ndarray) -> np.ndarray:
        """Return the number (time) of the piece that holds each instant."""
        piece: np.ndarray = np.maximum(np.searchsorted(self.begins_s, times, side="right") - 1, 0)
        return piece


def open_loop(model: StateSpaceModel) -> Flight:
    """Return the flight of a model that nobody commands, worked out once for its dynamics as they are now."""
    return _flown(model, stamp(model.dynamics))


@functools.lru_cache(maxsize=64)
def _flown(model: StateSpaceModel, _stamp: tuple[int, int]) -> Flight:
    return Flight(model)


def stamp(dynamics: Any) -> tuple[int, int]:
    """Return what changes where the file of dynamics does."""
    place = file_of(dynamics)
    path = find(place) if place is not None else None
    if path is None:
        return (0, 0)
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def checked(function: Function, label: str, n: int) -> Function:
    """Return a function of dynamics whose errors, and answers that are no (n,) finite numbers, are one line."""

    def asked(t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        x, u = np.array(x), np.array(u)
        x.flags.writeable = u.flags.writeable = False  # what f writes into them would change the flight
        try:
            rates = np.asarray(function(t, x, u), dtype=float)
        except RsoLidarError:
            raise
        except (Exception, SystemExit, GeneratorExit) as error:
            raise ScenarioError(
                f"{label}: failed at t = {t:g} s with {type(error).__name__}{_said(error)}; mend the dynamics"
            ) from error
        if rates.shape != (n,):
            raise ScenarioError(f"{label}: gave a shape of {rates.shape} at t = {t:g} s; the state has {n} entries")
        if not np.all(np.isfinite(rates)):
            raise ScenarioError(f"{label}: gave {rates.tolist()!s:.60} at t = {t:g} s; the state has left what f knows")
        return rates

    return asked


def _said(error: BaseException) -> str:
    """Return what an error says, after a colon, if it says anything."""
    text = " ".join(str(error).split())
    return f": {text}" if text else ""


def found(dynamics: Any) -> Function:
    """Return the function that a part names, or the one that it is."""
    if not isinstance(dynamics, str):
        function: Function = dynamics
        return function
    place, _, name = dynamics.rpartition(":")
    module = _module(place)
    here: Any = getattr(module, name, None)
    if not callable(here):
        known = [word for word in vars(module) if not word.startswith("_") and callable(vars(module)[word])]
        guess = did_you_mean(name, known)
        what = "nothing" if here is None else "no function"
        raise ScenarioError(f"{place}: {what} is named '{name}' there{guess or '; correct the name'}")
    named: Function = here
    return named


def _module(place: str) -> Any:
    if not place.endswith(".py"):
        try:
            return importlib.import_module(place)
        except (Exception, SystemExit) as error:
            raise ScenarioError(
                f"{place}: cannot be imported ({type(error).__name__}{_said(error)}); check it"
            ) from None
    path = find(place)
    if path is None:
        raise ScenarioError(f"{place}: no such file; check the path of the dynamics")
    return _file_module(path.resolve(), *stamp(f"{place}:"))


class _SourceLoader(importlib.machinery.SourceFileLoader):
    """A loader that writes no compiled file beside a user's file or an installed example."""

    def path_stats(self, path: Any) -> Any:
        """Refuse to look for a compiled file: its time stamp has whole seconds, too coarse while a user edits the source."""
        raise OSError

    def set_data(self, path: Any, data: Any, *, _mode: int = 0o666) -> None:
        """Write nothing."""


@functools.lru_cache(maxsize=32)
def _file_module(path: Path, _modified_ns: int, _size: int) -> Any:
    name = f"rso_lidar_dynamics_{path.stem}"
    loader = _SourceLoader(name, str(path))
    spec = importlib.util.spec_from_loader(name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as error:
        line = getattr(error, "lineno", None)
        where = f"line {line}: " if line else ""
        raise ScenarioError(
            f"{path.name}: {where}cannot be imported ({type(error).__name__}{_said(error)}); mend it"
        ) from None
    return module
