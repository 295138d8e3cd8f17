"""State-space models, and their flights: integrated under inputs that are held from command to command."""

from __future__ import annotations

import functools

import numpy as np
from pydantic import Field

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion.dynamics.function import (
    Dynamics,
    Function,
    find_function,
    name_function,
    stamp_file,
    wrap_dynamics,
)
from rso_lidar.orbit.propagation.integrator import OdeSolution
from rso_lidar.part import Number, Part, Positive

_PANEL_S = 60.0
_COMMANDED_PANEL_S = 1.0  # short, because integration beyond the next command is wasted
_KEPT = 1000  # pieces between two commands that are remembered


class StateSpaceModel(Part):
    """Base of motions and attitudes by user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6).

    `dynamics` is ``file.py:name``, ``package.module:name`` or, in Python, the callable itself. It is called with
    seconds since `start_utc`, the state (n,) and the inputs (m,), and returns the derivatives (n,). `inputs` hold until
    `Command.inputs` of a controller replaces them. The integrator is DOP853 with these tolerances for each step.
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
        """Name of the dynamics in error messages."""
        return name_function(self.dynamics)

    def function(self) -> Function:
        """Find the function of the dynamics, and wrap it so that its failures become one-line errors."""
        return wrap_dynamics(find_function(self.dynamics), self.label, len(self.initial_state))

    def solution(
        self, state: np.ndarray, inputs: np.ndarray, start_s: float = 0.0, panel_s: float = _PANEL_S
    ) -> OdeSolution:
        """Start an integration under constant inputs.

        Parameters
        ----------
        state : (n,) at `start_s`.
        inputs : (m,), constant.
        start_s : start of the integration [s].
        panel_s : length of the panels in which it proceeds [s].

        Returns
        -------
        x as a function of t - start_s [s].
        """
        function = self.function()

        def derivative(t: float, x: np.ndarray) -> np.ndarray:
            return np.asarray(function(t + start_s, x, inputs))

        return OdeSolution(
            derivative,
            state,
            panel_s=panel_s,
            rtol=self.relative_tolerance,
            atol=self.absolute_tolerance,
            name=self.label,
        )


class Flight:
    """x(t) of one model, under inputs that are held from one command to the next."""

    def __init__(self, model: StateSpaceModel) -> None:
        self.model = model
        self._inputs = np.array(model.inputs, dtype=float)
        self._pieces = [(0.0, self._inputs, model.solution(np.array(model.initial_state, dtype=float), self._inputs))]
        self._lost_s = (np.inf, -np.inf)

    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Hold new inputs from `time_s` [s] on, which must not be earlier than the previous command."""
        inputs = np.array(inputs, dtype=float, ndmin=1)
        if inputs.shape != self._inputs.shape or not np.all(np.isfinite(inputs)):
            raise ScenarioError(
                f"command: inputs of {self.model.label} are {inputs.tolist()!s:.60}: give {len(self._inputs)} finite "
                "numbers, one for each of its `inputs`"
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
        """Integrate x (time, n) to `time_s` (time,) [s]."""
        times = np.asarray(time_s, dtype=float)
        piece = self._piece(times)
        lost = (times > self._lost_s[0]) & (times < self._lost_s[1])
        if lost.any():
            raise PropagationError(
                f"{self.model.label}: the states from {self._lost_s[0]:g} to {self._lost_s[1]:g} s are no longer kept, "
                f"because more than {_KEPT} commands followed: request later instants",
                lost,
            )
        states = np.empty((len(times), len(self.model.initial_state)))
        for number in np.unique(piece):
            begin, _, solution = self._pieces[number]
            rows = piece == number
            states[rows] = solution(times[rows] - begin)
        return states

    def rates(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluate x' (time, n) at `time_s` (time,) [s], under the inputs that are held from there on."""
        times = np.asarray(time_s, dtype=float)
        function = self.model.function()
        inputs = [self._pieces[number][1] for number in self._piece(times)]
        rows = [function(t, x, u) for t, x, u in zip(times.tolist(), self(times), inputs, strict=True)]
        return np.array(rows, dtype=float).reshape(len(times), len(self.model.initial_state))

    @property
    def begins_s(self) -> np.ndarray:
        """Instants from which new inputs are held [s]."""
        return np.array([begin for begin, _, _ in self._pieces])

    def _piece(self, times: np.ndarray) -> np.ndarray:
        """Find the number (time) of the piece that contains each instant."""
        piece: np.ndarray = np.maximum(np.searchsorted(self.begins_s, times, side="right") - 1, 0)
        return piece


def fly_open_loop(model: StateSpaceModel) -> Flight:
    """Return the flight of a model without commands, cached until the file of its dynamics changes."""
    return _cache_flight(model, stamp_file(model.dynamics))


@functools.lru_cache(maxsize=64)
def _cache_flight(model: StateSpaceModel, _stamp: tuple[int, int]) -> Flight:
    return Flight(model)
