"""State of a simulation: what its future depends on, and to which scenario it belongs."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rso_lidar import motion
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Frame, SensorSamples, SensorState
from rso_lidar.scenario import Scenario


@dataclass(frozen=True, eq=False)
class SimulationState:
    """State of a simulation at an instant: all that its future depends on, besides scenario and commands. It pickles.

    `scenario` is a digest of the scenario, whatever its seed.
    """

    scenario: str
    seed: int
    row: int
    time_ns: int
    course: motion.CourseState
    aim: motion.AimState
    sensors: Mapping[str, SensorState | None]
    measured_s: float
    samples: tuple[Mapping[str, SensorSamples], ...]
    frame: Frame | None


def digest_scenario(scenario: Scenario, numbers: np.ndarray, *, commanded: bool) -> str:
    """Return a digest of what is flown.

    Parameters
    ----------
    scenario : whatever its seed
    commanded : whether commands may be given
    """
    without_seed = re.sub(r"(?m)^seed = .*$", "", scenario.source.scenario, count=1)  # that of the scenario comes first
    return hashlib.sha256(without_seed.encode() + numbers.tobytes() + bytes([commanded])).hexdigest()


def check_state(state: SimulationState, digest: str, n_frames: int) -> None:
    """Check a state before it is restored.

    Parameters
    ----------
    state : from `Simulation.save`
    n_frames : number of its frames

    Raises
    ------
    ScenarioError
        If it is no state, one of another scenario, or damaged.
    """
    if not isinstance(state, SimulationState):
        raise ScenarioError(f"restore: {state!r:.60} is not a state; give what save() returned")
    if state.scenario != digest:
        raise ScenarioError("restore: the state is one of another scenario; give a state of this one")
    expected = {
        "seed": int,
        "row": int,
        "time_ns": int,
        "course": motion.CourseState,
        "aim": motion.AimState,
        "sensors": Mapping,
        "measured_s": float,
        "samples": tuple,
        "frame": Frame | None,
    }
    wrong = [name for name, kind in expected.items() if not isinstance(getattr(state, name), kind)]
    if not wrong:
        is_possible = 0 <= state.row <= n_frames and state.time_ns >= 0 and math.isfinite(state.measured_s)
        wrong = [] if is_possible else ["row, time_ns or measured_s"]
    if wrong:
        raise ScenarioError(f"restore: the state's {', '.join(wrong)} cannot be; give what save() returned")
