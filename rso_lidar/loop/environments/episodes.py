"""Scenarios of the environments, and the random beginnings of their episodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Tumble
from rso_lidar.part import Part
from rso_lidar.scenario import Scenario
from rso_lidar.shipped import shipped

_SMALL = ("lidar.receiver.n_rows=32", "lidar.receiver.n_cols=32")
# Of a thin-walled cylinder with mass, length and radius of the model: 2247 kg, 12.7 m, 1.5 m. The mass is published
# (source in models/index.toml), its distribution is assumed.
_STAGE_INERTIA_KG_M2 = (5200.0, 32700.0, 32700.0)


def load_pass() -> Scenario:
    """Load the default scenario of `PointAndTrack`: `examples/closed_loop.toml` for 60 s, with 32 x 32 pixels."""
    return Scenario.load(shipped("examples/closed_loop.toml"), settings=(*_SMALL, "time.duration_s=60"))


def draw_pass(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Draw a tumbling stage, the follower's pass by it, and an imperfect first pointing.

    In rtn axes of the first target, the follower begins 300 to 500 m away, within 30 degrees of the orbital plane. Its
    velocity is 1 to 3 m/s across the line of sight and up to 0.5 m/s along it. The stage tumbles at up to 2 deg/s about its
    long axis and up to 3 deg/s about the others. The boresight begins up to a quarter of the field of view off.

    Parameters
    ----------
    scenario : with a `hill` motion and an `rtn` attitude of the follower, and a PTU with a `fixed` point
    rng : of the episode

    Returns
    -------
    the scenario of one episode.

    Raises
    ------
    ScenarioError
        If the scenario has other parts.
    """
    stage, follower, ptu = scenario.target[0], scenario.follower, scenario.ptu
    if ptu is None:
        raise ScenarioError("draw_pass: the scenario has no PTU; add [ptu], or give draw=None")
    azimuth, elevation = rng.uniform(-math.pi, math.pi), rng.uniform(-30.0, 30.0) * units.DEG
    outward = np.array(
        [math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation), math.sin(elevation)]
    )
    east = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    across, speed = rng.uniform(-math.pi, math.pi), rng.uniform(1.0, 3.0)
    sideways = math.cos(across) * east + math.sin(across) * np.cross(outward, east)
    velocity = speed * sideways + rng.uniform(-0.5, 0.5) * outward
    toward, quarter_deg = -outward, 0.25 * scenario.lidar.receiver.fov_rad / units.DEG
    pan_deg = math.atan2(toward[1], toward[0]) / units.DEG + rng.uniform(-1.0, 1.0) * quarter_deg / math.cos(elevation)
    tilt_deg = math.asin(toward[2]) / units.DEG + rng.uniform(-1.0, 1.0) * quarter_deg
    turn = rng.standard_normal(4)
    tumble = Tumble(
        inertia_kg_m2=_STAGE_INERTIA_KG_M2,
        body_rate_deg_s=tuple((rng.uniform(-1.0, 1.0, 3) * [2.0, 3.0, 3.0]).tolist()),
        quaternion_xyzw=tuple((turn / np.linalg.norm(turn)).tolist()),
    )
    position_m = tuple((rng.uniform(300.0, 500.0) * outward).tolist())
    motion = _change(follower.motion, "motion", position_m=position_m, velocity_m_s=tuple(velocity.tolist()))
    return scenario.replace(
        target=(stage.replace(attitude=tumble), *scenario.target[1:]),
        follower=follower.replace(motion=motion),
        ptu=ptu.replace(point=_change(ptu.point, "point", pan_deg=pan_deg, tilt_deg=tilt_deg)),
    )


def _change(part: Any, place: str, **fields: Any) -> Any:
    """Return a part with other fields, or raise one error that says what it should be."""
    known = type(part).model_fields if isinstance(part, Part) else {}
    for name in fields:
        if name not in known:
            raise ScenarioError(
                f"{place}: has no {name}, which the episodes draw; give draw=None, or a function of your own"
            )
    return part.replace(**fields)


def load_approach() -> Scenario:
    """Load the default scenario of `Approach`: `examples/thrusters.toml` for 300 s, with 32 x 32 pixels."""
    return Scenario.load(shipped("examples/thrusters.toml"), settings=(*_SMALL, "time.duration_s=300"), trust_code=True)


def draw_approach(scenario: Scenario, rng: np.random.Generator) -> Scenario:
    """Draw the follower's first position and velocity in the stage's rtn axes.

    It begins 100 to 140 m behind and up to 5 m off on the other axes, with up to 0.15 m/s along-track and 0.03 m/s on the
    other axes.

    Parameters
    ----------
    scenario : with a `state_space` motion of the follower in rtn axes
    rng : of the episode

    Returns
    -------
    the scenario of one episode.

    Raises
    ------
    ScenarioError
        If the scenario has another motion.
    """
    follower = scenario.follower
    radial, along, normal, *rates = rng.uniform(-1.0, 1.0, 6) * [5.0, 20.0, 5.0, 0.03, 0.15, 0.03]
    state = (radial, along - 120.0, normal, *rates, *getattr(follower.motion, "initial_state", ())[6:])
    moved = _change(follower.motion, "motion", initial_state=tuple(float(entry) for entry in state))
    return scenario.replace(follower=follower.replace(motion=moved))
