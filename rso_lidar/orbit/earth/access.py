"""When one spacecraft, or a station on the ground, sees another."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.central_body import EARTH, check_trajectory, find_center
from rso_lidar.orbit.earth.ground import GroundStation
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.eclipse import shadow_margins_rad
from rso_lidar.orbit.sky.event_search import find_minimum, find_spans_below
from rso_lidar.orbit.sky.geometry import angle_rad, line_altitude_m, phase_angle_rad
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.orbit.trajectory import Trajectory

Margin = Callable[[Epochs, np.ndarray, np.ndarray], np.ndarray]  # of epochs, observer and target [m]; negative is good
Span = tuple[float, float]


@dataclass(frozen=True)
class Access:
    """One span in which an observer sees a target, to the millisecond.

    Parameters
    ----------
    from_s, to_s : begin and end [s since start_utc]; -inf if it had begun before the span of the search, inf if it lasts
        beyond it
    closest_s : when the distance is least [s since start_utc]
    closest_m : that distance [m]
    """

    from_s: float
    to_s: float
    closest_s: float
    closest_m: float


def find_access(
    observer: Trajectory,
    target: Trajectory,
    epochs: Epochs,
    *,
    max_range_m: float | None = None,
    sunlit: bool = False,
    dark: bool = False,
    sun_exclusion_deg: float | None = None,
    max_phase_deg: float | None = None,
    grazing_height_m: float = 0.0,
) -> list[Access]:
    """Find the spans in which an observer sees a target, between the first and the last of some epochs.

    The Earth must not be in between. It is a sphere of its equatorial radius; for a `GroundStation`, what counts is the
    elevation above its horizon. Every condition is followed to 0.1 ms, and short spans are searched for between the
    instants of a scan, one minute apart.

    Parameters
    ----------
    observer, target : anything that answers `states`, such as `Tle`, `Kepler`, an `Ephemeris` or a `GroundStation`
    epochs : the first and the last limit the search

    Other Parameters
    ----------------
    max_range_m : greatest distance [m]
    sunlit : whether at least half of the Sun's disc must light the target
    dark : whether the observer must be in shadow; at a station, the Sun 6 degrees or more below the horizon
    sun_exclusion_deg : least angle at the observer between the target and the Sun [deg]
    max_phase_deg : greatest angle at the target between the Sun and the observer [deg]
    grazing_height_m : least height of the line of sight above the Earth [m], such as that of the air

    Returns
    -------
    list of Access, in order of time

    Raises
    ------
    ScenarioError
        if a limit makes no sense, or a body orbits about the Moon or has no states alone
    """
    for name, body in (("observer", observer), ("target", target)):
        check_trajectory(body, name)
        if find_center(body) is not EARTH:
            raise ScenarioError(
                f"{name}: orbits about {find_center(body).name}, and access counts the Earth alone as what hides it; give a "
                "body about the Earth"
            )
    conditions = [_make_clear(observer, grazing_height_m)]
    if max_range_m is not None:
        _check_limit("max_range_m", max_range_m, math.inf)
        conditions.append(lambda _, a, b: np.sqrt(np.sum((b - a) ** 2, axis=-1)) - max_range_m)
    if sunlit:
        conditions.append(lambda at, _, b: -_sun_above_limb_rad(b, at))
    if dark:
        conditions.append(_make_dark(observer))
    if sun_exclusion_deg is not None:
        _check_limit("sun_exclusion_deg", sun_exclusion_deg, 180.0)
        conditions.append(lambda at, a, b: sun_exclusion_deg * units.DEG - angle_rad(b - a, sun_position_m(at) - a))
    if max_phase_deg is not None:
        _check_limit("max_phase_deg", max_phase_deg, 180.0)
        conditions.append(lambda at, a, b: phase_angle_rad(b, a, sun_position_m(at)) - max_phase_deg * units.DEG)
    start_s, end_s = float(epochs.time_s.min()), float(epochs.time_s.max())

    def evaluate(condition: Margin) -> Callable[[np.ndarray], np.ndarray]:
        def margin(time_s: np.ndarray) -> np.ndarray:
            at = Epochs(epochs.start_utc, time_s)
            return condition(at, observer.states(at).position_m, target.states(at).position_m)

        return margin

    spans: list[Span] = [(-math.inf, math.inf)]
    for condition in conditions:
        spans = _intersect(spans, find_spans_below(evaluate(condition), start_s, end_s))
        if not spans:
            return []
    distance = evaluate(lambda _, a, b: np.sqrt(np.sum((b - a) ** 2, axis=-1)))
    accesses = []
    for begin, end in spans:
        first, last = max(begin, start_s), min(end, end_s)
        closest_s, closest_m = find_minimum(distance, first, last) if first < last else (first, float("nan"))
        accesses.append(Access(begin, end, closest_s, closest_m))
    return accesses


def _make_clear(observer: Trajectory, grazing_height_m: float) -> Margin:
    if not isinstance(observer, GroundStation):
        return lambda _, a, b: grazing_height_m - line_altitude_m(a, b)
    least = observer.least_elevation_deg * units.DEG
    return lambda at, _, b: least - observer.elevation_rad(b, at)


def _make_dark(observer: Trajectory) -> Margin:
    if not isinstance(observer, GroundStation):
        return lambda at, a, _: _sun_above_limb_rad(a, at)
    return lambda at, *_: observer.elevation_rad(sun_position_m(at), at) + 6.0 * units.DEG  # civil twilight


def _sun_above_limb_rad(position_m: np.ndarray, at: Epochs) -> np.ndarray:
    """Return the angle (time,) [rad] of the Sun's centre above the Earth's limb, where half of its disc is visible."""
    touched, covered = shadow_margins_rad(position_m, sun_position_m(at))
    above: np.ndarray = 0.5 * (touched + covered)
    return above


def _check_limit(name: str, value: float, most: float) -> None:
    """Raise `ScenarioError` unless a limit is above 0 and not above the most it can be."""
    if not 0.0 < value <= most:
        raise ScenarioError(
            f"{name}: needs a number above 0{f' and to {most:g}' if most < math.inf else ''}, not {value!r}"
        )


def _intersect(some: list[Span], others: list[Span]) -> list[Span]:
    """Return the parts that spans, each list in order, have in common."""
    overlaps = []
    for begin, end in some:
        for first, last in others:
            if max(begin, first) < min(end, last):
                overlaps.append((max(begin, first), min(end, last)))
    return overlaps
