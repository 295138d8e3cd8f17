"""What the follower knows of itself: its burns, by the commands of its proximity operation, and where the lidar points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import motion, rpo, units
from rso_lidar.motion import find_plan, follows_plan, list_commands
from rso_lidar.pose import ROOT, Link, PoseTree
from rso_lidar.records import Observation
from rso_lidar.scenario import Scenario

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform

_LEAST_M_S = 1e-9  # velocity change between two frames below which the flight counts as free


def list_known_burns(scenario: Scenario, time_s: np.ndarray) -> list[tuple[rpo.PlannedImpulse, int]]:
    """List the follower's burns after the first of some ascending times (time) [s], each with the index of the next time.

    Burns are in the rtn axes of the approached body. These differ from the follower's own by separation over radius only.
    Continuous thrust along a path becomes one impulse half way between two times, from the acceleration there. A follower
    without a plan has no known burns, because tables, state-space models and controllers do not state theirs.
    """
    # without a plan no code that the follower may name is needed
    if not follows_plan(scenario.follower):
        return []
    plan = find_plan(scenario.follower, scenario.bodies, scenario.time.start_utc)
    if plan is None or time_s.size < 2:
        return []
    commands = list_commands(scenario.follower, scenario.bodies, scenario.time.start_utc, float(time_s[-1]))
    burns = [command for command in commands if time_s[0] < command.time_s]
    burns = sorted([*burns, *_sample_control(plan, time_s)], key=lambda burn: burn.time_s)
    places = np.minimum(np.searchsorted(time_s, [burn.time_s for burn in burns]), time_s.size - 1)
    return list(zip(burns, places.tolist(), strict=True))


def _sample_control(plan: rpo.Plan, time_s: np.ndarray) -> list[rpo.PlannedImpulse]:
    """Return the velocity change of thrust along a path from each time to the next, as impulses."""
    step_s = np.diff(time_s)
    middle_s = time_s[:-1] + 0.5 * step_s
    given = plan.control_m_s2(middle_s) * step_s[:, None]
    size = np.sqrt((given**2).sum(axis=1))
    return [rpo.PlannedImpulse(float(middle_s[k]), given[k]) for k in np.flatnonzero(size > _LEAST_M_S)]


def find_measured_mount(scenario: Scenario, observation: Observation) -> RigidTransform:
    """Return follower_from_lidar, from the encoders where there is a PTU."""
    alone = PoseTree({}, {}).with_node("follower", ROOT, Link.still())
    measured = observation.pan_tilt_rad
    angles = np.zeros(2) if measured is None else measured
    return motion.add_lidar(alone, scenario.ptu, angles, np.zeros(2), scenario.lidar.mount).pose("follower", "lidar")


def find_pointing_error_rad(scenario: Scenario) -> float:
    """Return the pointing error of the encoders [rad], one standard deviation of each axis."""
    if scenario.ptu is None:
        return 0.0
    errors = scenario.ptu.errors
    return float(np.hypot(errors.jitter_deg, errors.encoder_noise_deg)) * units.DEG
