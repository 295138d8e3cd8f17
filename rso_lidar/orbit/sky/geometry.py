"""What surrounds a body in orbit: Sun, Moon and Earth as it sees them, eclipses to the millisecond, where it may fly.

Vectors are (time, 3) [m] in root axes, from the Earth's centre unless said otherwise. The Earth is a sphere of its
equatorial radius, without air: against the ellipsoid its limb stands up to 21 km too high (0.5 degree seen from 400 km over
a pole, 0.03 degree from GEO), and in a low orbit an eclipse begins and ends up to 3 s off, more where it only grazes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sun import sun_position_m
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.records import BodyState

_SCAN_S = 60.0
_PARTS = 16  # into which a bracket is cut at once
_WITHIN_S = 1e-4
_AT_ONCE = 100_000  # instants of a scan


def angle_rad(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angle (…) [rad] between vectors (…, 3) of any length, good to rounding near 0 and pi too."""
    across = np.cross(a, b)
    angle: np.ndarray = np.arctan2(np.sqrt(np.sum(across * across, axis=-1)), np.sum(a * b, axis=-1))
    return angle


def beta_angle_rad(state: BodyState, sun_m: np.ndarray) -> np.ndarray:
    """Return how high (time) [rad] the Sun stands over the plane of the osculating orbit, positive on the side of r x v."""
    normal = np.cross(state.position_m, state.velocity_m_s)
    beta: np.ndarray = 0.5 * np.pi - angle_rad(normal, sun_m)
    return beta


def phase_angle_rad(target_m: np.ndarray, observer_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Return the angle (time) [rad] at the target between Sun and observer: 0 where the Sun is behind the observer."""
    return angle_rad(sun_m - target_m, observer_m - target_m)


def earth_radius_rad(position_m: np.ndarray) -> np.ndarray:
    """Return half the angle (time) [rad] that the Earth's disk subtends; pi / 2 on the surface, NaN below it."""
    distance = np.sqrt(np.sum(position_m * position_m, axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        radius: np.ndarray = np.arcsin(units.EARTH_RADIUS_M / distance)
    return radius


def earth_limb_angle_rad(boresight: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Return the angle (time) [rad] from a boresight (root axes) to the Earth's limb; negative where the disk covers it."""
    angle: np.ndarray = angle_rad(boresight, -position_m) - earth_radius_rad(position_m)
    return angle


def earth_lit(boresight: np.ndarray, position_m: np.ndarray, sun_m: np.ndarray) -> np.ndarray:
    """Return whether (time) the Earth is in daylight where the boresight meets it, or at the limb nearest to it."""
    ahead = boresight / np.sqrt(np.sum(boresight**2, axis=-1, keepdims=True))
    distance = np.sqrt(np.sum(position_m**2, axis=-1))
    along = -np.sum(position_m * ahead, axis=-1)
    inside = along**2 - distance**2 + units.EARTH_RADIUS_M**2  # of the root for the ray's first point on the sphere
    met = position_m + (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * ahead
    # the limb: where a ray in the plane of boresight and Earth's centre grazes, at cos = R / r from the point below
    up = position_m / distance[..., None]
    aside = ahead - np.sum(ahead * up, axis=-1)[..., None] * up
    aside = aside / np.maximum(np.sqrt(np.sum(aside**2, axis=-1)), 1e-300)[..., None]
    cosine = np.minimum(units.EARTH_RADIUS_M / distance, 1.0)
    limb = cosine[..., None] * up + np.sqrt(1.0 - cosine**2)[..., None] * aside
    place = np.where(((inside > 0.0) & (along > 0.0))[..., None], met, limb)
    lit: np.ndarray = np.sum(place * sun_m, axis=-1) > 0.0
    return lit


def line_height_m(a_m: np.ndarray, b_m: np.ndarray) -> np.ndarray:
    """Return how high (time) [m] over the Earth the straight line from a to b passes at its lowest; negative: blocked."""
    line = b_m - a_m
    length2 = np.sum(line * line, axis=-1)
    share = np.clip(-np.sum(a_m * line, axis=-1) / np.where(length2 > 0.0, length2, 1.0), 0.0, 1.0)
    lowest = a_m + share[..., None] * line
    height: np.ndarray = np.sqrt(np.sum(lowest * lowest, axis=-1)) - units.EARTH_RADIUS_M
    return height


def outside_field_rad(direction: np.ndarray, half_field: np.ndarray) -> np.ndarray:
    """Return by how much (time) [rad] directions lie outside a rectangular field: 0 inside it.

    A disk of angular radius q about the direction cuts the field where this is at most q.

    Parameters
    ----------
    direction : (time, 3) in lidar axes, +z the boresight, of any length.
    half_field : (time, 2) or (2) tangents of the half angles to the right and down.
    """
    unit = direction / np.maximum(np.sqrt(np.sum(direction**2, axis=-1, keepdims=True)), 1e-300)
    # the field is the same in each quadrant: fold the direction into the one with x and y positive
    x, y, z = np.abs(unit[..., 0]), np.abs(unit[..., 1]), unit[..., 2]
    right, down = np.broadcast_to(half_field[..., 0], x.shape), np.broadcast_to(half_field[..., 1], x.shape)
    over_x, over_y = x - right * z, y - down * z
    inside = (over_x <= 0.0) & (over_y <= 0.0) & (z > 0.0)
    corner = angle_rad(np.stack([x, y, z], axis=-1), np.stack([right, down, np.ones_like(x)], axis=-1))
    best = corner
    for over, across, along, edge, reach in ((over_x, x, y, right, down), (over_y, y, x, down, right)):
        norm = np.sqrt(1.0 + edge**2)
        foot = (z + edge * across) / norm  # along the edge's middle, of the direction's foot on the edge's plane
        on_edge = (over > 0.0) & (foot > 0.0) & (along * norm <= reach * foot)
        best = np.where(on_edge, np.arcsin(np.clip(over / norm, -1.0, 1.0)), best)
    angle: np.ndarray = np.where(inside, 0.0, best)
    return angle


def cone_angle_rad(position_m: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the angle (time) [rad] at a cone's apex between its axis and a place, both in the axes of the apex."""
    return angle_rad(position_m, np.broadcast_to(axis, position_m.shape))


# --------------------------------------------------------------------------------------------- when something begins


def spans_below(
    value: Callable[[np.ndarray], np.ndarray], start_s: float, end_s: float, scan_s: float = _SCAN_S
) -> list[tuple[float, float]]:
    """Return the spans [s] within start to end in which a smooth function is negative, their ends to 0.1 ms.

    A span that holds at the start begins at -inf, and one that holds at the end lasts to inf. The function is scanned every
    `scan_s` at most, and each dip between instants of the scan is followed to its bottom, so that a short one is not missed.

    Parameters
    ----------
    value : function of instants (time) [s] that gives (time).
    """
    time_s = np.linspace(start_s, end_s, max(3, int(np.ceil((end_s - start_s) / scan_s)) + 1))
    values = np.concatenate([value(time_s[k : k + _AT_ONCE]) for k in range(0, len(time_s), _AT_ONCE)])
    if end_s <= start_s:
        return [(-np.inf, np.inf)] if values[0] < 0.0 else []
    bottoms_s, bottoms = _bottoms(value, time_s, values)
    order = np.argsort(time_s := np.concatenate([time_s, bottoms_s]), kind="stable")
    time_s, below = time_s[order], np.concatenate([values, bottoms])[order] < 0.0
    turns = np.flatnonzero(below[1:] != below[:-1])
    crossed = _crossings(value, time_s[turns], time_s[turns + 1])
    begins = [
        *([-np.inf] if below[0] else []),
        *(float(t) for t, k in zip(crossed, turns, strict=True) if below[k + 1]),
    ]
    ends = [*(float(t) for t, k in zip(crossed, turns, strict=True) if below[k]), *([np.inf] if below[-1] else [])]
    return list(zip(begins, ends, strict=True))


def least(value: Callable[[np.ndarray], np.ndarray], start_s: float, end_s: float) -> tuple[float, float]:
    """Return when [s] between two instants a smooth function is least, to 0.1 ms, and how much it is there.

    The lowest of 129 instants is followed to the bottom of its dip.
    """
    time_s = np.linspace(start_s, end_s, 129)
    lowest = int(np.argmin(value(time_s)))
    found_s, values = _narrowed(value, time_s[[max(lowest - 1, 0)]], time_s[[min(lowest + 1, 128)]])
    return float(found_s[0]), float(values[0])


def _bottoms(
    value: Callable[[np.ndarray], np.ndarray], time_s: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and values of the bottoms of those dips of a scan that may reach below zero between its instants."""
    before = np.concatenate([[np.inf], values[:-1]])
    after = np.concatenate([values[1:], [np.inf]])
    # between instants a dip goes down by a quarter of how it rises to them if round, by half if sharp; an end tells nothing
    deep = values <= np.maximum(before, after) - values
    dips = np.flatnonzero((values <= before) & (values <= after) & (values >= 0.0) & deep)
    if not len(dips):
        return np.zeros(0), np.zeros(0)
    return _narrowed(value, time_s[np.maximum(dips - 1, 0)], time_s[np.minimum(dips + 1, len(time_s) - 1)])


def _narrowed(
    value: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return where between each low and high the function is least, and its values there."""
    steps = np.arange(_PARTS + 1) / _PARTS
    while True:
        times = low[:, None] + (high - low)[:, None] * steps
        values = value(times.ravel()).reshape(times.shape)
        best = np.argmin(values, axis=1)
        if np.max(high - low) <= _WITHIN_S:
            return np.take_along_axis(times, best[:, None], 1)[:, 0], np.take_along_axis(values, best[:, None], 1)[:, 0]
        low = np.take_along_axis(times, np.maximum(best - 1, 0)[:, None], 1)[:, 0]
        high = np.take_along_axis(times, np.minimum(best + 1, _PARTS)[:, None], 1)[:, 0]


def _crossings(value: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return where between each low and high (time) [s], on whose sides the function's signs differ, it changes sign."""
    steps = np.arange(_PARTS + 1) / _PARTS
    while len(low) and np.max(high - low) > _WITHIN_S:
        times = low[:, None] + (high - low)[:, None] * steps
        below = value(times.ravel()).reshape(times.shape) < 0.0
        first = np.argmax(below != below[:, :1], axis=1)[:, None]
        first = np.maximum(first, 1)
        low, high = np.take_along_axis(times, first - 1, 1)[:, 0], np.take_along_axis(times, first, 1)[:, 0]
    middle: np.ndarray = 0.5 * (low + high)
    return middle


@dataclass(frozen=True)
class Eclipse:
    """One passage through the Earth's shadow, in seconds since start_utc, good to the millisecond.

    -inf: it had begun before the span that was asked for; inf: it lasts beyond it; NaN: there is no umbra in it.
    """

    penumbra_from_s: float
    umbra_from_s: float
    umbra_to_s: float
    penumbra_to_s: float

    @property
    def total(self) -> bool:
        """Return whether the Sun is hidden whole at some time."""
        return not math.isnan(self.umbra_from_s)


def shadow_margins_rad(position_m: np.ndarray, sun_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (time) [rad] the Sun's disc is from being touched and from being covered by the Earth's disk.

    The first is negative in penumbra and umbra, the second in the umbra: where the lines that touch both spheres meet
    the place (Montenbruck & Gill, Satellite Orbits, sec. 3.4.2). Below the Earth's surface both are.
    """
    to_sun = sun_m - position_m
    distance = np.sqrt(np.sum(position_m**2, axis=-1))
    earth = np.arcsin(np.minimum(units.EARTH_RADIUS_M / np.maximum(distance, units.EARTH_RADIUS_M), 1.0))
    sun = np.arcsin(units.SUN_RADIUS_M / np.sqrt(np.sum(to_sun**2, axis=-1)))
    apart = angle_rad(-position_m, to_sun)
    below = distance < units.EARTH_RADIUS_M
    touched: np.ndarray = np.where(below, -np.pi, apart - earth - sun)
    covered: np.ndarray = np.where(below, -np.pi, apart - earth + sun)
    return touched, covered


def eclipses(trajectory: Trajectory, epochs: Epochs) -> list[Eclipse]:
    """Return the passages through the Earth's shadow between the first and the last of the epochs, in order.

    The orbit is scanned once a minute whatever epochs there are between, and grazing passages are searched for.
    """
    start_s, end_s = float(epochs.time_s.min()), float(epochs.time_s.max())

    def margin(which: int) -> Callable[[np.ndarray], np.ndarray]:
        def of(time_s: np.ndarray) -> np.ndarray:
            at = Epochs(epochs.start_utc, time_s)
            return shadow_margins_rad(trajectory.states(at).position_m, sun_position_m(at))[which]

        return of

    dark = spans_below(margin(1), start_s, end_s)
    found = []
    for begins, ends in spans_below(margin(0), start_s, end_s):
        within = [span for span in dark if span[0] >= begins and span[1] <= ends]
        umbra = (within[0][0], within[-1][1]) if within else (np.nan, np.nan)
        found.append(Eclipse(begins, *umbra, ends))
    return found
