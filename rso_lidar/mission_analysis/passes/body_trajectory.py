"""The trajectory of a body of a scenario, whatever its motion: a plan, a sequence, or one relative to another body."""

from __future__ import annotations

import numpy as np

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.motion import Chief
from rso_lidar.orbit import Epochs, format_utc
from rso_lidar.records import BodyState
from rso_lidar.scenario import Scenario, list_lunar_bodies


class BodyTrajectory:
    """The trajectory of a body of a scenario, from the scenario's start on.

    Parameters
    ----------
    scenario : the scenario
    name : of the target, or "follower"

    Raises
    ------
    ScenarioError
        If there is no such body, or if it is not in orbit.
    """

    def __init__(self, scenario: Scenario, name: str) -> None:
        bodies = {body.name: body for body in scenario.bodies}
        if name not in bodies:
            raise ScenarioError(f"{scenario.name}: no body named '{name}' (known: {', '.join(bodies)})")
        if scenario.is_local or not bodies[name].orbits:
            raise ScenarioError(
                f"{scenario.name}: {name} is not in orbit about the Earth; take a scenario with bodies in orbit"
            )
        if name in list_lunar_bodies(scenario.bodies):
            raise ScenarioError(
                f"{scenario.name}: {name} orbits about the Moon, and encounters are searched about the Earth; take a body "
                "about the Earth"
            )
        self._scenario, self._name, self._start_utc = scenario, name, scenario.time.start_utc
        self._chief = Chief(scenario.bodies, name)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            If epochs are before the start of the scenario; its `bad` masks them.
        """
        time_s = epochs.since(self._start_utc)
        bad = time_s < -1e-6
        if bad.any():
            raise PropagationError(
                f"{self._name}: the scenario starts at {format_utc(self._start_utc, 0.0)}; begin the search then", bad
            )
        with self._scenario.locate_errors(f"{self._name}.motion"):
            return self._chief.states(Epochs(self._start_utc, np.maximum(time_s, 0.0)))

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which its motion, or one that it is relative to, has a jump or a corner.

        Parameters
        ----------
        epochs : instants that matter

        Returns
        -------
        times since the `start_utc` of `epochs` [s]
        """
        shift_s = float(Epochs(epochs.start_utc, np.zeros(1)).since(self._start_utc)[0])
        own = Epochs(self._start_utc, np.maximum(epochs.time_s + shift_s, 0.0))
        return np.append(self._chief.list_breaks_s(own), 0.0) - shift_s
