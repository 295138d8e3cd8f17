"""The instrument as a block with inputs and outputs: what the FMUs that `rso-lidar fmu` writes compute."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rso_lidar.records import Command, Observation
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import Simulation, SimulationState
from rso_lidar.track import find_cluster

GATE_M, MIN_PIXELS = 20.0, 4  # of the cluster that is the target, as in track.Pointing
NO_TARGET, TARGET, OVER = 0, 1, 2
_ROUNDING_S = 1e-9


class Port(NamedTuple):
    """An input or output: name, unit, meaning, value at the start, and whether it is a whole number."""

    name: str
    unit: str
    meaning: str
    start: float = 0.0
    is_whole: bool = False


MEASURED = (
    Port("hits", "1", "pixels that reported a return at the last flash", is_whole=True),
    Port("target_pixels", "1", "pixels of the densest cluster of returns, taken for the target", is_whole=True),
    Port("centroid_x_m", "m", "centroid of these returns, lidar axes, x right; 0 without a target"),
    Port("centroid_y_m", "m", "y down"),
    Port("centroid_z_m", "m", "z ahead"),
    Port("range_m", "m", "median range of these returns; 0 without a target"),
    Port("pan_rad", "rad", "pan of the encoders at the last flash; 0 without a PTU"),
    Port("tilt_rad", "rad", "tilt of the encoders"),
    Port("time_s", "s", "time of the last flash"),
)


def measure(observation: Observation) -> dict[str, float]:
    """Compute the quantities of `MEASURED` from what the spacecraft could know of a flash; return values by name."""
    reading = observation.reading
    cluster = find_cluster(reading, GATE_M, MIN_PIXELS)
    has_cluster = bool(cluster.any())
    centroid = observation.points_m[cluster].mean(axis=0) if has_cluster else np.zeros(3)
    pan_tilt = np.zeros(2) if observation.pan_tilt_rad is None else observation.pan_tilt_rad
    values = (
        np.isfinite(reading.range_m).sum(),
        cluster.sum(),
        *centroid,
        np.median(reading.range_m[cluster]) if has_cluster else 0.0,
        *pan_tilt,
        observation.time_s,
    )
    return {port.name: float(value) for port, value in zip(MEASURED, values, strict=True)}


class InstrumentState(NamedTuple):
    """State of an instrument: that of its simulation, and the values of its ports. It pickles."""

    simulation: SimulationState
    inputs: dict[str, float]
    outputs: dict[str, float]


class Instrument:
    """A simulation with inputs that are held from step to step, and the quantities of its last flash as outputs."""

    def __init__(self, scenario: Scenario) -> None:
        self._simulation = Simulation(scenario, threads=1)
        self._models = {name: model for body in scenario.bodies for name, model in body.models.items()}
        self.inputs: dict[str, float] = {port.name: port.start for port in list_inputs(scenario)}
        self._has_ptu = scenario.ptu is not None
        self.outputs: dict[str, float] = {port.name: port.start for port in MEASURED} | {"status": float(NO_TARGET)}

    @classmethod
    def load(cls, folder: Path) -> Instrument:
        """Make the instrument of the scenario in the resources of an FMU."""
        text = (folder / "scenario.toml").read_text(encoding="utf-8")
        # Whoever runs the FMU runs its code: that of its scenario is part of it.
        return cls(Scenario.loads(text, folder=folder, where="scenario.toml", trust_code=True).with_trusted_fmus())

    def save(self) -> InstrumentState:
        """Return the present state, from which `restore` goes on."""
        return InstrumentState(self._simulation.save(), dict(self.inputs), dict(self.outputs))

    def restore(self, state: InstrumentState) -> None:
        """Go on from a state that an instrument of the same scenario saved."""
        self._simulation.restore(state.simulation)
        self.inputs, self.outputs = dict(state.inputs), dict(state.outputs)

    def advance(self, until_s: float) -> None:
        """Go on to an instant under the present inputs, with all flashes on the way.

        Parameters
        ----------
        until_s : the instant [s]
        """
        simulation, command = self._simulation, self._command()
        while not simulation.is_over:
            ahead_s = simulation.next_flash_s
            if ahead_s is None or ahead_s > until_s + _ROUNDING_S:
                break
            self._read(simulation.step(command).observation)
        if simulation.is_over:
            self.outputs["status"] = float(OVER)
        elif until_s - simulation.time_s > _ROUNDING_S:
            simulation.step(command, dt_s=until_s - simulation.time_s)

    def _read(self, observation: Observation) -> None:
        measured = measure(observation)
        self.outputs |= measured | {"status": float(TARGET if measured["target_pixels"] else NO_TARGET)}

    def _command(self) -> Command:
        given = self.inputs
        inputs = {
            name: [given[f"{name}.u[{k + 1}]"] for k in range(len(model.first_inputs))]
            for name, model in self._models.items()
            if model.first_inputs
        }
        points = self._has_ptu and given["point"] > 0.5
        return Command(
            pan_rad=given["pan_demand_rad"] if points else None,
            tilt_rad=given["tilt_demand_rad"] if points else None,
            inputs=inputs or None,
        )


def list_inputs(scenario: Scenario) -> tuple[Port, ...]:
    """List the inputs of the instrument of a scenario: those of its PTU and of its state-space models.

    Returns
    -------
    inputs, with the scenario's values at the start.
    """
    pointing = (
        Port("point", "1", "1 points the PTU by the demands below, 0 by the scenario", is_whole=True),
        Port("pan_demand_rad", "rad", "demanded pan"),
        Port("tilt_demand_rad", "rad", "demanded tilt"),
    )
    models = [(name, model) for body in scenario.bodies for name, model in body.models.items()]
    held = [
        Port(f"{name}.u[{k + 1}]", "", f"input {k + 1} of the dynamics of {name}", value)
        for name, model in models
        for k, value in enumerate(model.first_inputs)
    ]
    return (*(pointing if scenario.ptu is not None else ()), *held)


OUTPUTS = (*MEASURED, Port("status", "1", "0 no target, 1 target, 2 the scenario is over", is_whole=True))
