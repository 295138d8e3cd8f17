"""The body about which an orbit goes: the Earth, or the Moon where a user's kernel gives its position.

States are always in GCRS axes from the Earth's centre. A trajectory about another body has two more members:
`central_body`, and `center_states(epochs)` with the state of that body's centre in the same axes. Their difference,
`subtract_center`, is what orbital axes, elements and relative motions need.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.records import BodyState


@dataclass(frozen=True)
class CentralBody:
    """A body with point-mass gravity, about which others orbit.

    Parameters
    ----------
    name : with its article, as within a sentence
    gm_m3_s2 : gravitational parameter [m3/s2]
    radius_m : radius of its surface [m]
    j2 : second zonal harmonic, for estimates of what a two-body model leaves out
    reach_m : twice its Hill radius [m]; what is farther orbits another body
    """

    name: str
    gm_m3_s2: float
    radius_m: float
    j2: float
    reach_m: float


# Hill radii are a (m / 3 M)^(1/3): 1.5e9 m for the Earth about the Sun, 6.1e7 m for the Moon about the Earth (Murray &
# Dermott, Solar System Dynamics, sec. 3.13). At twice that, no orbit is bound.
EARTH = CentralBody("the Earth", units.EARTH_GM_M3_S2, units.EARTH_RADIUS_M, units.EARTH_J2, 3.0e9)
MOON = CentralBody("the Moon", units.MOON_GM_M3_S2, units.MOON_RADIUS_M, units.MOON_J2, 1.2e8)


def check_trajectory(trajectory: Any, name: str) -> None:
    """Raise `ScenarioError` unless an object answers `states`; a motion relative to another body does not."""
    if callable(getattr(trajectory, "states", None)):
        return
    kind, chief = type(trajectory).__name__, getattr(trajectory, "relative_to", None)
    if isinstance(chief, str):
        raise ScenarioError(
            f"{name}: {kind} is relative to '{chief}' and has no states alone; give "
            "rl.study.BodyTrajectory(scenario, 'follower')"
        )
    raise ScenarioError(
        f"{name}: {kind} has no method states; give a motion about the Earth such as Tle or Kepler, an Ephemeris, or "
        "for an element set SetSequence((elements,))"
    )


def find_center(trajectory: Any) -> CentralBody:
    """Return the body about which a trajectory goes: the Earth, unless it states another.

    Parameters
    ----------
    trajectory : any object; one about another body has the attribute `central_body`
    """
    center = getattr(trajectory, "central_body", None)
    return center if isinstance(center, CentralBody) else EARTH


def find_center_states(trajectory: Any, epochs: Epochs) -> BodyState | None:
    """Return the states (time, 3) of the centre of a trajectory's central body in GCRS axes; None for the Earth, the origin.

    Parameters
    ----------
    trajectory : anything that answers `states`
    epochs : instants
    """
    if find_center(trajectory) is EARTH:
        return None
    states: BodyState = trajectory.center_states(epochs)
    return states


def subtract_center(states: BodyState, center: BodyState | None) -> BodyState:
    """Return states relative to the centre of their central body.

    Parameters
    ----------
    states : in GCRS axes from the Earth's centre
    center : of that body, in the same axes; None for the Earth
    """
    if center is None:
        return states
    return BodyState(
        np.subtract(states.position_m, center.position_m), np.subtract(states.velocity_m_s, center.velocity_m_s)
    )
