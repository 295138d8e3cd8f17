"""The truth of a scenario, or of bodies alone, at any instants, without rendering a frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rso_lidar import motion, orbit
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Body
from rso_lidar.records import Truth
from rso_lidar.scenario import Scenario


def truth(
    scenario: Scenario | Sequence[Body], epochs: orbit.Epochs | Sequence[float] | np.ndarray | None = None
) -> Truth:
    """Compute where everything is and how it is turned, at any instants, without rendering a frame.

    All instants are computed as one batch. Nobody is in command: a pan-tilt unit points as it is asked to, without lag and
    jitter. Bodies alone need neither a lidar nor meshes.

    Parameters
    ----------
    scenario : scenario; or bodies alone, such as ``[rl.motion.Body(name="iss", motion=...)]``
    epochs : instants, or seconds since the scenario's `start_utc` (None: those of its frames)

    Returns
    -------
    Truth
        Of all instants; ``truth.pose(a, b)`` is a_from_b, ``truth.states[name]`` an inertial state, ``truth.sunlit[name]``
        the visible share of the Sun, and ``truth.at(k)`` the truth of one instant.

    Raises
    ------
    ScenarioError
        If bodies are given without `Epochs`, or something else than a scenario or bodies.

    Examples
    --------
    >>> import rso_lidar as rl
    >>> where = rl.truth(rl.Scenario.load("examples/tdrs_approach.toml"), [0.0, 60.0, 120.0])
    >>> where.pose("lidar", "tdrs").translation.shape
    (3, 3)
    """
    if isinstance(scenario, Scenario):
        start_utc = scenario.time.start_utc
        if epochs is None:
            at = scenario.epochs()
        elif isinstance(epochs, orbit.Epochs):  # motions count from the start of their run
            at = orbit.Epochs(start_utc, epochs.since(start_utc))
        else:
            at = orbit.Epochs(start_utc, np.asarray(epochs))
        with scenario.locate_errors():
            body_truth = motion.truth(scenario.bodies, at, **scenario.world.motion_arguments)
            ptu = scenario.pan_tilt
            still = np.zeros((len(at), 2))
            pan_tilt_rad = still if ptu is None else motion.compute_demand(ptu, scenario.bodies, body_truth)
        poses = motion.add_lidar(body_truth.poses, ptu, pan_tilt_rad, still, scenario.lidar.mount)
        return Truth(body_truth.time_s, poses, body_truth.states, body_truth.sun_direction, None, body_truth.sunlit)
    if not isinstance(scenario, list | tuple) or not all(hasattr(body, "motion") for body in scenario):
        raise ScenarioError("truth: needs a Scenario, or a list of bodies; Scenario.load reads a file")
    if not isinstance(epochs, orbit.Epochs):
        raise ScenarioError("truth: bodies alone have no start_utc; give rl.orbit.Epochs(start_utc, seconds)")
    return motion.truth(scenario, epochs)
