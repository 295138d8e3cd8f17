"""State-space models, and their flights: integrated under inputs that are held from command to command."""

from __future__ import annotations

import bisect
import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from rso_lidar.errors import PropagationError
from rso_lidar.motion.dynamics.commands import CommandedFlight, CommandedModel, check_inputs
from rso_lidar.motion.dynamics.function import (
    Dynamics,
    Function,
    find_function,
    name_function,
    stamp_file,
    wrap_dynamics,
)
from rso_lidar.motion.dynamics.short_steps import ShortSolution
from rso_lidar.orbit import OdeSolution
from rso_lidar.part import Number, Part, Positive

_PANEL_S = 60.0
_COMMANDED_PANEL_S = 1.0  # short, because integration beyond the next command is wasted
_KEPT = 1000  # pieces between two commands that are remembered


class StateSpaceModel(Part, CommandedModel):
    """Base of motions and attitudes by user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6).

    `dynamics` is ``file.py:name``, ``package.module:name`` or, in Python, the callable itself. It is called with
    seconds since `start_utc`, the state (n,) and the inputs (m,), and returns the derivatives (n,). `inputs` hold until
    `Command.inputs` of a controller replaces them. The integrators keep these tolerances for each step: Runge-Kutta 5(4)
    just after a command, then DOP853. For a motion, an accelerometer measures f(t, x, u) - f(t, x, 0). Where f has
    drag or light pressure, or inputs that are not thrust, the function states what is felt as its attribute
    `specific_force`: a function of (t, x, u) that returns the acceleration without gravitation [m/s2] (3,), in the
    axes of the velocity in x.
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

    @functools.cached_property
    def label(self) -> str:
        """Name of the dynamics in error messages."""
        return name_function(self.dynamics)

    @property
    def is_commanded(self) -> bool:
        """Whether the model takes commands, which every state-space model does."""
        return True

    @property
    def first_inputs(self) -> tuple[float, ...]:
        """Inputs u at `start_utc`."""
        return self.inputs

    @property
    def body_rate_entries(self) -> slice | None:
        """Entries of the state that are the body's angular velocity; None if it has no attitude."""
        return None

    def begin_flight(self) -> Flight:
        """Begin a flight under commands."""
        return Flight(self)

    def fly_open_loop(self) -> Flight:
        """Return the flight without commands, cached until the file of its dynamics changes."""
        return _cache_flight(self, stamp_file(self.dynamics))

    def function(self) -> Function:
        """Find the function of the dynamics, and wrap it so that its failures become one-line errors."""
        return wrap_dynamics(find_function(self.dynamics), self.label, len(self.initial_state))

    def specific_force_function(self) -> Function | None:
        """Find the attribute `specific_force` of the function of the dynamics, and wrap it likewise; None without one."""
        felt = getattr(find_function(self.dynamics), "specific_force", None)
        if felt is None:
            return None
        return wrap_dynamics(felt, f"{self.label}.specific_force", 3, "return three accelerations")


class Piece(NamedTuple):
    """A stretch of a flight under constant inputs (m,), from the state (n,) at `begin_s`; None for a solution not begun."""

    begin_s: float
    inputs: np.ndarray
    state: np.ndarray
    solution: OdeSolution | ShortSolution | None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what the solution begins with, and not the solution."""
        return Piece, (self.begin_s, self.inputs, self.state, None)


@dataclass(frozen=True, eq=False)
class FlightState:
    """State of a flight: its pieces, and the span of time whose pieces are no longer kept [s]."""

    pieces: tuple[Piece, ...]
    lost_s: tuple[float, float]


class Flight(CommandedFlight):
    """x(t) of one model, under inputs that are held from one command to the next."""

    def __init__(self, model: StateSpaceModel) -> None:
        self.model = model
        self._function, self._felt = model.function(), model.specific_force_function()
        self._accuracy: dict[str, Any] = {
            "rtol": model.relative_tolerance,
            "atol": model.absolute_tolerance,
            "name": model.label,
        }
        state, inputs = np.array(model.initial_state, dtype=float), np.array(model.inputs, dtype=float)
        self._pieces = [self._begin_piece(0.0, inputs, state)]
        self._begins_s = [0.0]
        self._last: tuple[tuple[float, int, float] | None, np.ndarray] = (None, state)  # the instant evaluated last
        self._lost_s = (np.inf, -np.inf)

    def _begin_piece(self, begin_s: float, inputs: np.ndarray, state: np.ndarray) -> Piece:
        """Begin a piece of the flight; only the first begins without a command.

        Parameters
        ----------
        inputs : (m,), constant
        state : (n,) at `begin_s`
        """
        inputs.setflags(write=False)
        f = self._function
        solution: OdeSolution | ShortSolution
        if begin_s > 0.0:
            solution = ShortSolution(f, begin_s, state, inputs, panel_s=_COMMANDED_PANEL_S, **self._accuracy)
        else:
            solution = OdeSolution(lambda t, x: f(t, x, inputs), state, panel_s=_PANEL_S, **self._accuracy)
        return Piece(begin_s, inputs, state, solution)

    def save(self) -> FlightState:
        """Return the present state, from which `restore` goes on."""
        return FlightState(tuple(self._pieces), self._lost_s)

    def restore(self, state: FlightState) -> None:
        """Go on from a state that a flight of the same model saved."""
        self._pieces = [
            piece if piece.solution is not None else self._begin_piece(*piece[:3]) for piece in state.pieces
        ]
        self._begins_s = [piece.begin_s for piece in self._pieces]
        self._last = None, self._pieces[0].state
        self._lost_s = state.lost_s

    def check_inputs(self, inputs: np.ndarray) -> np.ndarray:
        """Return inputs as an array (m,), or raise `ScenarioError`."""
        return check_inputs(inputs, self._pieces[-1].inputs, self.model.label)

    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Hold new, checked inputs from `time_s` [s] on, which must not be earlier than the previous command."""
        last = self._pieces[-1]
        if (inputs == last.inputs).all():
            return
        state = self(np.array([time_s]))[0]
        if last.begin_s == time_s:
            del self._pieces[-1], self._begins_s[-1]
        self._pieces.append(self._begin_piece(time_s, inputs, state))
        self._begins_s.append(time_s)
        if len(self._pieces) > _KEPT + 1:
            self._lost_s = (min(self._lost_s[0], self._pieces[1].begin_s), self._pieces[2].begin_s)
            del self._pieces[1], self._begins_s[1]

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Integrate x (time, n) to `time_s` (time,) [s]."""
        times = np.asarray(time_s, dtype=float)
        if len(times) == 1 and self._last[0] == (key := (times.item(), len(self._begins_s), self._begins_s[-1])):
            return self._last[1]
        number = self._find_pieces(times)
        if 0 in number:
            self._check_kept(times)
        if len(times) == 1:
            states = self._evaluate_piece(number[0], times)
            states.setflags(write=False)
            self._last = key, states
            return states
        states = np.empty((len(times), len(self.model.initial_state)))
        for piece in set(number):
            rows = np.array(number) == piece
            states[rows] = self._evaluate_piece(piece, times[rows])
        return states

    def _check_kept(self, time_s: np.ndarray) -> None:
        """Refuse instants (time) [s] whose pieces are no longer kept; only the first piece reaches into their span."""
        lost = (time_s > self._lost_s[0]) & (time_s < self._lost_s[1])
        if lost.any():
            raise PropagationError(
                f"{self.model.label}: the states from {self._lost_s[0]:g} to {self._lost_s[1]:g} s are no longer kept, "
                f"because more than {_KEPT} commands followed; request later instants",
                lost,
            )

    def _evaluate_piece(self, number: int, time_s: np.ndarray) -> np.ndarray:
        """Integrate x (time, n) to instants (time) [s] of one piece."""
        piece = self._pieces[number]
        assert piece.solution is not None
        return piece.solution(time_s - piece.begin_s)

    def rates(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluate x' (time, n) at `time_s` (time,) [s], under the inputs that are held from there on."""
        rates: np.ndarray = np.array(self(time_s))
        for row, (t, inputs) in enumerate(self._list_inputs(time_s)):
            rates[row] = self._function(t, rates[row], inputs)
        return rates

    def specific_force(self, time_s: np.ndarray) -> np.ndarray:
        """Evaluate the acceleration without gravitation (time, 3) [m/s2], in the axes of the velocity in x.

        It is the `specific_force` of the function of the dynamics, for a function that has it. Otherwise it is the share of
        the acceleration that comes from the inputs: f(t, x, u) - f(t, x, 0).

        Parameters
        ----------
        time_s : (time) instants [s]
        """
        states = self(time_s)
        felt = np.empty((len(states), 3))
        f, none = self._function, np.zeros(len(self.model.inputs))
        for row, (t, inputs) in enumerate(self._list_inputs(time_s)):
            if self._felt is not None:
                felt[row] = self._felt(t, states[row], inputs)
            else:
                felt[row] = (f(t, states[row], inputs) - f(t, states[row], none))[3:6]
        return felt

    def inputs_at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the inputs (time, m) that are held from `time_s` (time,) [s] on."""
        held = [inputs for _, inputs in self._list_inputs(time_s)]
        inputs: np.ndarray = np.array(held).reshape(len(held), len(self.model.inputs))
        return inputs

    def _list_inputs(self, time_s: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """List instants (time,) [s] with the inputs that are held from each on."""
        numbers = self._find_pieces(time_s)
        return [(t, self._pieces[number].inputs) for t, number in zip(time_s.tolist(), numbers, strict=True)]

    def _find_pieces(self, time_s: np.ndarray) -> list[int]:
        """Find the number (time) of the piece that contains each instant [s]."""
        begins_s, last = self._begins_s, len(self._begins_s) - 1
        return [
            last if at_s >= begins_s[last] else max(bisect.bisect_right(begins_s, at_s) - 1, 0)
            for at_s in np.asarray(time_s).tolist()
        ]


@functools.lru_cache(maxsize=64)
def _cache_flight(model: StateSpaceModel, _stamp: tuple[int, int]) -> Flight:
    return Flight(model)
