"""The shadow of the Earth: the visible fraction of the Sun's disc, and the passages through penumbra and umbra.

For orbits about the Moon its shadow counts too. The Earth is a sphere of its equatorial radius, without air. In a low orbit
an eclipse therefore begins and ends up to 3 s early or late, and more where it only grazes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.central_body import check_trajectory, find_center, find_center_states
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.event_search import find_spans_below
from rso_lidar.orbit.sky.geometry import angle_rad
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.orbit.trajectory import Trajectory


def sunlit_fraction(
    position_m: np.ndarray, sun_position_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M
) -> np.ndarray:
    """Return the fraction of the Sun's disc that a spherical Earth leaves visible, or another sphere.

    It is computed from the overlap of two discs on the sky (Montenbruck & Gill, Satellite Orbits, sec. 3.4.2).

    Parameters
    ----------
    position_m : (time, 3) from the centre of the sphere [m]
    sun_position_m : (time, 3) from the centre of the sphere, in the same axes [m]
    radius_m : of the sphere, by default the Earth's [m]

    Returns
    -------
    (time,) 1 in full light, 0 in the umbra and inside the sphere
    """
    to_sun = sun_position_m - position_m
    distance = np.linalg.norm(position_m, axis=-1)
    sun = np.arcsin(
        units.SUN_RADIUS_M / np.linalg.norm(to_sun, axis=-1)
    )  # apparent radius, a of the source; the Earth's is b
    earth = np.arcsin(np.minimum(radius_m / np.maximum(distance, radius_m), 1.0))
    across = np.linalg.norm(np.cross(position_m, to_sun), axis=-1)
    apart = np.arctan2(across, -np.sum(position_m * to_sun, axis=-1))  # c: between the discs' centres
    smaller = np.minimum(sun, earth)
    clear, inside = apart >= sun + earth, apart <= np.abs(sun - earth)
    partly = ~(clear | inside)
    c = np.where(partly, apart, 1.0)
    x = (c**2 + sun**2 - earth**2) / (2.0 * c)  # from the Sun's centre to the common chord of the two discs
    y = np.sqrt(np.maximum(sun**2 - x**2, 0.0))
    lens = sun**2 * np.arctan2(y, x) + earth**2 * np.arctan2(y, c - x) - c * y
    hidden = np.where(clear, 0.0, np.where(inside, np.pi * smaller**2, lens)) / (np.pi * sun**2)
    free: np.ndarray = np.where(distance < radius_m, 0.0, np.clip(1.0 - hidden, 0.0, 1.0))
    return free


@dataclass(frozen=True)
class Eclipse:
    """One passage through the Earth's shadow, accurate to the millisecond.

    Parameters
    ----------
    penumbra_from_s, penumbra_to_s : begin and end of the passage [s since start_utc]; -inf if it had begun before the
        span of the search, inf if it lasts beyond it
    umbra_from_s, umbra_to_s : begin and end of the umbra [s since start_utc], with the same infinities; NaN if there is
        none
    """

    penumbra_from_s: float
    umbra_from_s: float
    umbra_to_s: float
    penumbra_to_s: float

    @property
    def is_total(self) -> bool:
        """Whether the Sun is completely hidden at some time."""
        return not math.isnan(self.umbra_from_s)


def shadow_margins_rad(
    position_m: np.ndarray, sun_m: np.ndarray, radius_m: float = units.EARTH_RADIUS_M
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles by which the Sun's disc is clear of being touched, and of being covered, by a sphere's disk.

    They vanish on the cones that touch both spheres (Montenbruck & Gill, Satellite Orbits, sec. 3.4.2).

    Parameters
    ----------
    position_m : (time, 3) from the centre of the sphere [m]
    sun_m : (time, 3) position of the Sun from there, in the same axes [m]
    radius_m : of the sphere, by default the Earth's [m]

    Returns
    -------
    touched : (time,) [rad], negative in penumbra and umbra, and below the surface
    covered : (time,) [rad], negative in the umbra, and below the surface
    """
    to_sun = sun_m - position_m
    distance = np.sqrt(np.sum(position_m**2, axis=-1))
    earth = np.arcsin(np.minimum(radius_m / np.maximum(distance, radius_m), 1.0))
    sun = np.arcsin(units.SUN_RADIUS_M / np.sqrt(np.sum(to_sun**2, axis=-1)))
    apart = angle_rad(-position_m, to_sun)
    below = distance < radius_m
    touched: np.ndarray = np.where(below, -np.pi, apart - earth - sun)
    covered: np.ndarray = np.where(below, -np.pi, apart - earth + sun)
    return touched, covered


def find_eclipses(trajectory: Trajectory, epochs: Epochs) -> list[Eclipse]:
    """Find the passages through the Earth's shadow between the first and the last of some epochs.

    For a trajectory about the Moon they are passages through the shadow of either body.

    The orbit is scanned once a minute for any epochs between, and grazing passages are searched for.

    Parameters
    ----------
    trajectory : anything that answers `states`
    epochs : the first and the last limit the search

    Returns
    -------
    list of Eclipse, in order of time
    """
    check_trajectory(trajectory, "trajectory")
    start_s, end_s = float(epochs.time_s.min()), float(epochs.time_s.max())

    def margin(which: int) -> Callable[[np.ndarray], np.ndarray]:
        def of(time_s: np.ndarray) -> np.ndarray:
            at = Epochs(epochs.start_utc, time_s)
            place, sun = trajectory.states(at).position_m, sun_position_m(at)
            clear = shadow_margins_rad(place, sun)[which]
            center = find_center_states(trajectory, at)
            if center is None:
                return clear
            radius_m = find_center(trajectory).radius_m
            beside = shadow_margins_rad(place - center.position_m, sun - center.position_m, radius_m)
            nearer: np.ndarray = np.minimum(clear, beside[which])
            return nearer

        return of

    dark = find_spans_below(margin(1), start_s, end_s)
    eclipses = []
    for begins, ends in find_spans_below(margin(0), start_s, end_s):
        within = [span for span in dark if span[0] >= begins and span[1] <= ends]
        umbra = (within[0][0], within[-1][1]) if within else (np.nan, np.nan)
        eclipses.append(Eclipse(begins, *umbra, ends))
    return eclipses
