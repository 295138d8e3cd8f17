"""Where the lidar points, as the spacecraft knows it: its pose on the follower by the encoders, and the error of that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import motion, units
from rso_lidar.pose import ROOT, Link, PoseTree
from rso_lidar.records import Observation
from rso_lidar.scenario import Scenario

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform


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
