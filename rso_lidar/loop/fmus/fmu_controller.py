"""A controller that a Functional Mock-up Unit computes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.fmi import FmuModel, FmuPoint
from rso_lidar.loop.fmus.instrument import MEASURED, measure
from rso_lidar.records import Command, Observation, SensorSamples


class ControllerModel(FmuModel):
    """The mapping of a controller's FMU: quantities of `MEASURED` in, pan, tilt or an acceleration of the follower out."""

    input_units: ClassVar[dict[str, tuple[str, int]]] = {port.name: (port.unit, 1) for port in MEASURED}
    output_units: ClassVar[dict[str, tuple[str, int]]] = {
        "pan_rad": ("rad", 1),
        "tilt_rad": ("rad", 1),
        "acceleration_m_s2": ("m/s2", 3),
    }
    optional_names: ClassVar[frozenset[str]] = frozenset((*input_units, *output_units))


class ControllerState(NamedTuple):
    """State of an FMU's controller: steps since t = 0, the point of its run (None before the first), and the inputs held."""

    tick: int
    point: FmuPoint | None
    held: tuple[float, ...] = ()


class FmuController:
    """Controller by an FMU (FMI 2 or 3), for `simulate`; each run needs its own.

    At each flash the FMU receives its inputs, makes one step to the next command, and its outputs are the command. Under a
    `command_rate_hz` of `simulate` it makes further steps between the flashes, with the inputs of the last flash. The
    `acceleration_m_s2` becomes the inputs of the follower's state-space model. Quantities of `inputs`: hits, target_pixels,
    centroid_x_m, centroid_y_m, centroid_z_m (lidar axes), range_m, pan_rad, tilt_rad (measured) and time_s.

    Parameters
    ----------
    file : path of the FMU
    step_s : time between commands [s], the grid of the FMU: that between flashes, or 1 / command_rate_hz
    trust_fmu : whether its native code may run
    mapping : `inputs`, `outputs`, and further fields of an FMU: parameters, units, interface, relative_tolerance

    Raises
    ------
    ScenarioError
        If the FMU is not trusted or cannot be run, the mapping does not fit it, or `step_s` is no length of time.
    """

    def __init__(self, file: str, *, step_s: float, trust_fmu: bool = False, **mapping: Any) -> None:
        if not trust_fmu:
            raise ScenarioError(
                f"FmuController: the FMU '{file}' holds native code, which runs only where it is trusted; give "
                "trust_fmu=True"
            )
        if not isinstance(step_s, int | float) or isinstance(step_s, bool) or not 0.0 < step_s < np.inf:
            raise ScenarioError(
                f"FmuController: step_s: {step_s!r:.40} is no time between commands; give seconds above 0"
            )
        self._model = ControllerModel(file=str(file), **mapping)
        self._run = self._model.make_run(step_s)
        self._step_s, self._tick = step_s, 0
        self._point: FmuPoint | None = None
        self._held = np.empty(0)

    def save(self) -> ControllerState:
        """Return the present state, from which `restore` goes on, as `Simulation.save` does.

        Returns
        -------
        ControllerState

        Raises
        ------
        ScenarioError
            If the FMU cannot give its state.
        """
        if self._point is not None:
            self._point = self._point.run.keep(self._point)
        return ControllerState(self._tick, self._point, tuple(self._held.tolist()))

    def restore(self, state: ControllerState) -> None:
        """Go on from a state that a controller by the same FMU saved, in this process or another.

        Parameters
        ----------
        state : from `save`

        Raises
        ------
        ScenarioError
            If it is not a state of this FMU with this mapping.
        """
        if not isinstance(state, ControllerState):
            raise ScenarioError(f"FmuController: {state!r:.60} is not a state; give what save() returned")
        run = self._run if state.point is None else state.point.run
        mine = self._run
        if (run.path, run.checksums, run.settings) != (mine.path, mine.checksums, mine.settings):
            raise ScenarioError("FmuController: the state is one of another FMU or mapping; give a state of this one")
        self._run, self._tick, self._point, self._held = run, state.tick, state.point, np.array(state.held)

    def __call__(self, observation: Observation) -> Command:
        """Return the command that acts from a flash until the next command."""
        measured = measure(observation)
        given = [measured[name] for name in self._model.input_units if name in self._model.inputs]
        return self._advance(observation.time_s, np.array(given))

    def command_at(self, time_s: float, samples: Mapping[str, SensorSamples]) -> Command:
        """Return the command between flashes, as `FastController.command_at`.

        Parameters
        ----------
        time_s : present time [s], on the grid of the FMU
        samples : not used

        Returns
        -------
        Command

        Raises
        ------
        ScenarioError
            If the time is not on the grid, or there was no flash before
        """
        if self._point is None:
            raise ScenarioError("FmuController: command_at() before the first flash; call it with an observation first")
        return self._advance(time_s, self._held)

    def _advance(self, time_s: float, held: np.ndarray) -> Command:
        """Make a step under inputs (input,) from `time_s` [s] on, and return its outputs as a command."""
        if abs(time_s - self._tick * self._step_s) > 1e-6:
            raise ScenarioError(
                f"FmuController: {time_s:g} s is not the next instant on the grid of {self._step_s:g} s from t = 0; give "
                "the time between commands as step_s"
            )
        if self._point is None:
            self._point, _ = self._run.begin(held)
        self._held = held
        self._point, rows = self._run.advance(self._point, held[None], keep_state=False)
        self._tick += 1
        quantities: dict[str, list[float]] = {}
        signals = [signal.quantity for signal in self._run.settings.outputs for _ in range(signal.elements)]
        for name, value in zip(signals, rows[-1].tolist(), strict=True):
            quantities.setdefault(name, []).append(value)
        acceleration = quantities.get("acceleration_m_s2")
        return Command(
            pan_rad=quantities["pan_rad"][0] if "pan_rad" in quantities else None,
            tilt_rad=quantities["tilt_rad"][0] if "tilt_rad" in quantities else None,
            inputs=None if acceleration is None else {"follower": acceleration},
        )
