"""Outputs of an FMU at the points of its grid: computed once, and read at any instant."""

from __future__ import annotations

import functools
from abc import abstractmethod
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import FmuModel, FmuPoint
from rso_lidar.motion.dynamics.commands import CommandedFlight, CommandedModel, check_inputs
from rso_lidar.motion.dynamics.row_history import RowHistory
from rso_lidar.part import Number, Positive

_MOST_STEPS = 10_000_000  # whose outputs are kept: 80 MB for each
_BLOCK = 256  # fewest steps that are computed at once; assumed
_EXCHANGE = "its model exchange"
_NAMES = {"co_simulation": "co-simulation", "model_exchange": "model exchange"}
_MOST_COMPARED = 20_000  # steps of an estimate of the error: about a second for an FMU in C; assumed
ON_GRID = 1e-6  # of a step: rounding of instants that are on the grid

# Unit and number of elements of the inputs; 0 is as many as are mapped.
FORCES = {"force_n": ("N", 0), "acceleration_m_s2": ("m/s2", 0)}
TORQUES = {"torque_n_m": ("N.m", 0)}
THROTTLES = {"throttle_fraction": ("1", 0)}


class StepComparison(NamedTuple):
    """Outputs (time, output) of an FMU at instants (time,) [s], as it is flown and by a reference integration."""

    interface: str
    reference: str
    time_s: np.ndarray
    flown: np.ndarray
    compared: np.ndarray


class FmuDynamics(FmuModel, CommandedModel):
    """Base of motions and attitudes that an FMU computes, as functions of time or under commands.

    With `inputs` the FMU takes commands. `Command.inputs` of a controller is a row of numbers: the elements of the mapped
    quantities, in the order force_n, acceleration_m_s2, torque_n_m, throttle_fraction. A quantity has as many elements as
    variables are mapped. Their axes are those that the FMU gives them. A command is held from the first point of the grid
    on that is not before it.
    """

    input_units: ClassVar[dict[str, tuple[str, int]]] = {}
    preferred_interface: ClassVar[str] = "model_exchange"  # the package then controls the error of the integration
    unnoticed_error: ClassVar[tuple[float, str]]  # greatest error without a warning, and its unit

    step_s: Positive = Field(
        description="Grid of the FMU from `start_utc` on [s]; between its points values are interpolated."
    )
    start_inputs: dict[str, Number | tuple[Number, ...]] = Field(
        default={},
        description="Values of `inputs` by quantity, held until a command replaces them. Zeros if omitted.",
    )

    @property
    def label(self) -> str:
        """Name of the FMU in error messages."""
        return Path(self.file).name

    @property
    def is_commanded(self) -> bool:
        """Whether the FMU takes commands."""
        return bool(self.inputs)

    @property
    def first_inputs(self) -> tuple[float, ...]:
        """Inputs at `start_utc`, in the order of a command."""
        row: list[float] = []
        if unknown := set(self.start_inputs) - set(self.inputs):
            raise ScenarioError(f"start_inputs: no quantity '{min(unknown)}' among `inputs`; name one that is mapped")
        for quantity in (name for name in self.input_units if name in self.inputs):
            names = self.inputs[quantity]
            count = 1 if isinstance(names, str) else len(names)
            given = self.start_inputs.get(quantity, (0.0,) * count)
            row += given if isinstance(given, tuple) else (given,)
        return tuple(row)

    def begin_flight(self) -> FmuFlight:
        """Begin a flight under commands."""
        return FmuFlight(self)

    def fly_open_loop(self) -> FmuHistory:
        """Return the outputs of the FMU over time, which all that ask for the same FMU share."""
        status = Path(self.file).stat()
        return _find_history(self.model_dump_json(), type(self), (status.st_mtime_ns, status.st_size))

    def advise(self, end_s: float) -> list[str]:
        """List a line if the integration of the FMU is probably wrong by more than is noticed, or cannot be judged.

        Parameters
        ----------
        end_s : end of the run [s]

        Returns
        -------
        one line, or none
        """
        flown = self.fly_open_loop()
        try:
            steps = self.compare_steps(end_s)
        except ScenarioError as error:
            return [f"the error of the {_NAMES[flown.interface]} of the FMU cannot be estimated ({error})"]
        errors = self._measure_errors(steps.flown, steps.compared)
        most, unit = self.unnoticed_error
        at = int(np.argmax(errors))
        if not errors[at] > most:
            return []
        return [
            f"the {_NAMES[steps.interface]} of the FMU and {steps.reference} differ by {errors[at]:.2g} {unit} at "
            f"{steps.time_s[at]:g} s, which estimates its error; "
            + ("leave out interface" if steps.reference == _EXCHANGE else "lower step_s")
        ]

    @abstractmethod
    def _measure_errors(self, flown: np.ndarray, compared: np.ndarray) -> np.ndarray:
        """Return the differences (time,) between outputs (time, output), in the unit of `unnoticed_error`."""

    def compare_steps(self, end_s: float) -> StepComparison:
        """Compute the outputs with another integration, whose difference is an estimate of the error of this one.

        The other integration of an FMU that is co-simulated is its model exchange, where it has both interfaces, and
        otherwise the same interface with steps of half the length. The inputs are those at the start.

        Parameters
        ----------
        end_s : end of the run [s]; the comparison ends earlier where it would need too many steps

        Returns
        -------
        StepComparison

        Raises
        ------
        ScenarioError
            If the FMU fails
        """
        time_s = self.step_s * np.arange(min(int(end_s / self.step_s), _MOST_COMPARED) + 1)
        flown = self.fly_open_loop()
        if flown.interface == "co_simulation" and "model_exchange" in flown.interfaces:
            other, reference = self.replace(interface="model_exchange"), _EXCHANGE
        else:
            other, reference = self.replace(step_s=0.5 * self.step_s), f"steps of {0.5 * self.step_s:g} s"
        return StepComparison(flown.interface, reference, time_s, flown(time_s), FmuHistory(other)(time_s))


class FmuHistory(CommandedFlight):
    """Outputs of an FMU on its grid without commands, extended as later instants are asked for.

    Parameters
    ----------
    model : the FMU
    """

    def __init__(self, model: FmuDynamics) -> None:
        self._step_s, self._run = model.step_s, model.make_run(model.step_s)
        self._inputs = np.array(model.first_inputs)
        elements = sum(signal.elements for signal in self._run.settings.inputs)
        if len(self._inputs) != elements:
            raise ScenarioError(
                f"start_inputs: has {len(self._inputs)} numbers for the {elements} elements of `inputs`; correct them"
            )
        self.interfaces: list[str] = self._run.description["interfaces"]
        self.interface = self._run.settings.interface
        self._point, first = self._run.begin(self._inputs)
        self._rows = RowHistory.begin(np.concatenate([first, self._inputs]))
        self._outputs = slice(0, len(first))

    def around(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the outputs at the points of the grid before and after instants.

        Parameters
        ----------
        time_s : instants (time,) from 0 [s]

        Returns
        -------
        outputs before and after (time, output), and the share of the step that has passed (time,). An instant on the
        grid is before itself and after itself

        Raises
        ------
        ScenarioError
            If the FMU fails, or an instant is before 0, no longer kept or too many steps away
        """
        low, high, share = self._locate(time_s)
        self._extend(int(high.max()) if high.size else 0)
        before, after = (self._read(ticks)[:, self._outputs] for ticks in (low, high))
        return before, after, share

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Interpolate the outputs (time, output) linearly to instants (time,) [s]."""
        before, after, share = self.around(time_s)
        values: np.ndarray = before + share[:, None] * (after - before)
        return values

    def inputs_at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the inputs (time, input) that are held from instants (time,) [s] on: those at the start."""
        return np.tile(self._inputs, (len(time_s), 1))

    def check_inputs(self, inputs: np.ndarray) -> np.ndarray:
        """Refuse a command, because others share this history."""
        raise ScenarioError(f"{self._run.name}: flies without commands; begin a flight")

    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Refuse a command."""
        self.check_inputs(inputs)

    def save(self) -> Any:
        """Return None, because no command changes a history."""

    def restore(self, state: Any) -> None:
        """Do nothing, because no command changes a history."""

    def _locate(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the ticks before and after instants [s], and the share of the step between (time,)."""
        place = np.asarray(time_s, dtype=float) / self._step_s
        if place.size and place.min() < -ON_GRID:
            raise ScenarioError(
                f"{self._run.name}: an FMU begins at t = 0, and {place.min() * self._step_s:g} s was asked for"
            )
        place = np.maximum(place, 0.0)
        if place.size and place.max() > _MOST_STEPS:
            raise ScenarioError(
                f"{self._run.name}: {place.max():,.0f} steps of {self._step_s:g} s are too many; raise step_s"
            )
        nearest = np.rint(place)
        place = np.where(np.abs(place - nearest) < ON_GRID, nearest, place)
        low = np.floor(place).astype(int)
        return low, np.ceil(place).astype(int), place - low

    def _read(self, ticks: np.ndarray) -> np.ndarray:
        """Read outputs and inputs (time, output and input) at ticks (time,)."""
        if ticks.size and ticks.min() < self._rows.first:
            raise ScenarioError(
                f"{self._run.name}: its outputs at {ticks.min() * self._step_s:g} s are no longer kept, because "
                f"{self._rows.end - ticks.min():,} steps followed; raise step_s, or make the steps between flashes shorter"
            )
        return self._rows.read(ticks)

    def _extend(self, tick: int) -> None:
        """Compute the outputs up to a tick, and some more, because nothing can change them."""
        missing = tick + 1 - self._rows.end
        if missing > 0:
            self._compute(max(missing, min(_BLOCK, self._rows.end)), keep_state=False, keep_all=True)

    def _compute(self, count: int, *, keep_state: bool, keep_all: bool) -> None:
        """Make steps under the present inputs.

        Parameters
        ----------
        keep_state : whether the flight may go back to the end of them
        keep_all : whether all outputs since t = 0 are kept
        """
        held = np.broadcast_to(self._inputs, (count, len(self._inputs)))
        self._point, outputs = self._point.run.advance(self._point, held, keep_state=keep_state)
        self._rows = self._rows.append(np.concatenate([outputs, held], axis=1), keep_all=keep_all)


class FmuFlight(FmuHistory):
    """Flight of an FMU under inputs that are held from command to command.

    Its state is the outputs so far, the point of the run and the inputs; a flight goes on from any of its states if the
    FMU can give its own (`canGetAndSetFMUstate`).
    """

    def check_inputs(self, inputs: np.ndarray) -> np.ndarray:
        """Return inputs as an array (input,), or raise `ScenarioError`."""
        return check_inputs(inputs, self._inputs, self._run.name)

    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Hold new, checked inputs from the first point of the grid on that is not before `time_s` [s]."""
        if (inputs == self._inputs).all():
            return
        _, tick, _ = self._locate(np.array([time_s]))
        self._extend(int(tick[0]))
        if tick[0] < self._rows.end - 1:
            raise ScenarioError(
                f"{self._run.name}: its outputs at {(self._rows.end - 1) * self._step_s:g} s were asked for before the "
                f"command at {time_s:g} s; ask for them after it"
            )
        self._inputs = inputs

    def inputs_at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the inputs (time, input) that are held from instants (time,) [s] on."""
        ticks = self._locate(time_s)[0] + 1  # the end of the step over which they are held
        rows = self._read(np.minimum(ticks, self._rows.end - 1))[:, self._outputs.stop :]
        return np.where((ticks < self._rows.end)[:, None], rows, self._inputs)

    def save(self) -> tuple[RowHistory, FmuPoint, np.ndarray]:
        """Return the present state: outputs and inputs so far, the point of the run, and the inputs in force."""
        return self._rows, self._point, self._inputs

    def restore(self, state: tuple[RowHistory, FmuPoint, np.ndarray]) -> None:
        """Go on from a state that a flight of the same model saved."""
        self._rows, self._point, self._inputs = state

    def _extend(self, tick: int) -> None:
        """Compute the outputs up to a tick."""
        missing = tick + 1 - self._rows.end
        if missing > 0:
            self._compute(missing, keep_state=True, keep_all=False)


@functools.lru_cache(maxsize=16)
def _find_history(dump: str, kind: type[FmuDynamics], _stamp: tuple[int, int]) -> FmuHistory:
    """Return the history of an FMU, cached until its file changes."""
    return FmuHistory(kind.model_validate_json(dump))


def interpolate_cubic(
    before: np.ndarray, after: np.ndarray, rates: tuple[np.ndarray, np.ndarray], share: np.ndarray, step_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Interpolate values and their rates by cubic Hermite polynomials.

    Parameters
    ----------
    before, after : values (time, n) at the ends of a step
    share : of the step that has passed (time,)
    step_s : length of the step [s]

    Returns
    -------
    values, rates and their rates (time, n)
    """
    s = share[:, None]
    first, last = rates[0] * step_s, rates[1] * step_s
    change = after - before
    values = before + s * (first + s * (3.0 * change - 2.0 * first - last + s * (first + last - 2.0 * change)))
    slopes = first + s * (2.0 * (3.0 * change - 2.0 * first - last) + 3.0 * s * (first + last - 2.0 * change))
    bends = 2.0 * (3.0 * change - 2.0 * first - last) + 6.0 * s * (first + last - 2.0 * change)
    return values, slopes / step_s, bends / step_s**2
