"""What a mission with bodies about the Moon cannot have: what is modelled for orbits about the Earth only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rso_lidar.motion import Body, find_center_of_body
from rso_lidar.orbit import EARTH
from rso_lidar.scenario.tables.dispersion import Dispersion
from rso_lidar.scenario.tables.lidar import Lidar
from rso_lidar.scenario.tables.world import World
from rso_lidar.sensors import Gnss, RelativeGnss, StarTracker


def list_lunar_bodies(bodies: Sequence[Body]) -> list[str]:
    """List the names of the bodies that orbit about the Moon.

    Parameters
    ----------
    bodies : all bodies of a scenario, with those that motions are relative to

    Returns
    -------
    list of str
    """
    by_name = {body.name: body for body in bodies}
    return [body.name for body in bodies if body.orbits and find_center_of_body(body, by_name) is not EARTH]


def check_lunar_orbits(
    bodies: Sequence[Body], world: World, lidar: Lidar, sensors: Sequence[Any], dispersion: Dispersion | None
) -> None:
    """Check that nothing is asked of bodies about the Moon that is modelled for the Earth only.

    Raises
    ------
    ValueError
        If so; the message names the table.
    """
    lunar = list_lunar_bodies(bodies)
    if not lunar:
        return
    where = f"'{lunar[0]}' orbits about the Moon"
    if world.earth_albedo is not None:
        raise ValueError(f"world.earth_albedo: {where}, which may hide the Earth and adds its own light; leave it out")
    if dispersion is not None:
        raise ValueError(
            f"dispersion: {where}, and deviations are integrated with the Earth's gravity; leave the table out"
        )
    if "follower" not in lunar:
        return
    if lidar.receiver.glare is not None:
        raise ValueError(
            "lidar.receiver.glare: the follower orbits about the Moon, whose disk is too large for the glare of a small "
            "source; leave the table out"
        )
    for sensor in sensors:
        if isinstance(sensor, Gnss | RelativeGnss):
            raise ValueError(f"sensor '{sensor.name}': GNSS does not serve an orbit about the Moon; leave it out")
        if isinstance(sensor, StarTracker):
            raise ValueError(
                f"sensor '{sensor.name}': its exclusion angle is from the Moon's centre, and the follower orbits about the "
                "Moon, whose limb matters; leave it out"
            )
