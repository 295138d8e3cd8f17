"""When one spacecraft, or a station on the ground, sees another."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.central_body import EARTH, check_trajectory, find_center
from rso_lidar.orbit.earth.ground import GroundStation
from rso_lidar.orbit.earth.pair_conditions import (
    EARTH_RAD_S,
    LINE_ALTITUDE_M,
    PHASE_RAD,
    RANGE_M,
    SUN_ANGLE_RAD,
    PairCondition,
    PairQuantity,
    PairSamples,
    elevation_rad,
    sun_height_rad,
)
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.event_search import Span, find_bounded_spans, find_minima, join_spans
from rso_lidar.orbit.trajectory import Trajectory, find_breaks_s

_BEFORE_S = 1e-4  # a window ends this long before a break


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
    elevation above its horizon. Edges are followed to 0.1 ms. Bounds on the rate of each condition say how finely the time
    is divided, so that no span of 0.1 s is missed.

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
        conditions.append(RANGE_M.less_than(max_range_m))
    if sunlit:
        conditions.append(sun_height_rad(of_target=True).more_than(0.0))
    if dark:
        conditions.append(_make_dark(observer))
    if sun_exclusion_deg is not None:
        _check_limit("sun_exclusion_deg", sun_exclusion_deg, 180.0)
        conditions.append(SUN_ANGLE_RAD.more_than(sun_exclusion_deg * units.DEG))
    if max_phase_deg is not None:
        _check_limit("max_phase_deg", max_phase_deg, 180.0)
        conditions.append(PHASE_RAD.less_than(max_phase_deg * units.DEG))
    start_s, end_s = float(epochs.time_s.min()), float(epochs.time_s.max())

    def pair(time_s: np.ndarray) -> PairSamples:
        at = Epochs(epochs.start_utc, time_s)
        return PairSamples(at, observer.states(at), target.states(at))

    breaks = np.unique(np.concatenate([find_breaks_s(body, epochs) for body in (observer, target)]))
    edges = [start_s, *breaks[(breaks > start_s) & (breaks < end_s)].tolist(), end_s]
    spans: list[Span] = [
        (begin, end if end == end_s else end - _BEFORE_S) for begin, end in itertools.pairwise(edges)
    ]  # at a break the states are those after it
    for condition in conditions:
        spans = find_bounded_spans(PairCondition(pair, condition), spans)
    spans = join_spans(spans)
    if not spans:
        return []
    begins, ends = np.array(spans).T
    closest_s, closest_m = find_minima(lambda time_s: pair(time_s).range_m, begins, ends)
    begins, ends = np.where(begins <= start_s, -math.inf, begins), np.where(ends >= end_s, math.inf, ends)
    columns = (column.tolist() for column in (begins, ends, closest_s, closest_m))
    return [Access(*row) for row in zip(*columns, strict=True)]


def _make_clear(observer: Trajectory, grazing_height_m: float) -> PairQuantity:
    if not isinstance(observer, GroundStation):
        return LINE_ALTITUDE_M.more_than(grazing_height_m)
    return elevation_rad(observer).more_than(observer.least_elevation_deg * units.DEG)


def _make_dark(observer: Trajectory) -> PairQuantity:
    if not isinstance(observer, GroundStation):
        return sun_height_rad(of_target=False).less_than(0.0)
    sun = PairQuantity(
        lambda pair: observer.elevation_rad(pair.sun_m, pair.epochs),
        lambda bounds: np.full_like(bounds.step_s, EARTH_RAD_S),
    )
    return sun.less_than(-6.0 * units.DEG)  # civil twilight


def _check_limit(name: str, value: float, most: float) -> None:
    """Raise `ScenarioError` unless a limit is above 0 and not above the most it can be."""
    if not 0.0 < value <= most:
        raise ScenarioError(
            f"{name}: needs a number above 0{f' and to {most:g}' if most < math.inf else ''}, not {value!r}"
        )
