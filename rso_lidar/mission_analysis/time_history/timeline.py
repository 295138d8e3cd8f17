"""One encounter frame by frame: geometry, light and pointing over time, without rendering the frames.

Geometry is exact at every frame. Light is computed from rays at up to some hundred frames. Between them it is
interpolated relative to the target's projected bounds and to the light of a filled white pixel.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import motion
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.budgets.pixel_light import filled_pixel_photons
from rso_lidar.mission_analysis.time_history.open_loop import choose_rows, find_umbras, fly_open_loop, format_utc
from rso_lidar.mission_analysis.time_history.opportunities import DetectionOpportunity, find_opportunities
from rso_lidar.mission_analysis.time_history.sky_light import tabulate_sky
from rso_lidar.mission_analysis.time_history.timeline_figure import timeline_figure
from rso_lidar.picture import SavedResult
from rso_lidar.pose import ROOT, cross, dot, rotate_vectors
from rso_lidar.processes import check_workers
from rso_lidar.records import PtuAngles, Truth, compute_viewing_geometry
from rso_lidar.scenario import Scenario, find_target, require_scenario
from rso_lidar.scene import Surface

CASTS = 300  # greatest number of frames at which rays are cast
_WHITE_PER_SR = 1.0 / np.pi
_EPOCHS = 2000  # in one batch of projected hulls
_RATE_S = 2e-3  # step of the central difference for the rate of the demand
_AT_LIMIT = 1e-3  # relative distance to the greatest rate within which a drive counts as at its limit


@dataclass(frozen=True, eq=False)
class Timeline(SavedResult):
    """One encounter over time: `table` holds columns (time) by name, with units in the names.

    The column ``cast`` is 1 where rays were cast, and 0 where light is interpolated. `travel_rad` are the limits of pan and
    tilt, and `max_rate_rad_s` is the greatest rate of the PTU, infinite without a limit. `shadow_s` are the spans [s] in
    which the target is in the umbra (None: those of `sunlit_fraction`).
    """

    title: str
    target: str
    table: dict[str, np.ndarray]
    half_field_rad: float
    travel_rad: tuple[tuple[float, float], tuple[float, float]] | None = None
    max_rate_rad_s: float = np.inf
    shadow_s: tuple[tuple[float, float], ...] | None = None

    def figure(self) -> Any:
        """Return a matplotlib Figure: panels over one time axis, shaded in shadow and out of the field."""
        return timeline_figure(
            self.table,
            self.target,
            self.title,
            half_field_rad=self.half_field_rad,
            travel_rad=self.travel_rad,
            max_rate_rad_s=self.max_rate_rad_s,
            shadow_s=self.shadow_s,
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table by name."""
        return self.table


def timeline(
    scenario: Scenario,
    target: str | None = None,
    *,
    every_s: float | None = None,
    casts: int = CASTS,
    executor: Executor | None = None,
) -> Timeline:
    """Compute an encounter with a target frame by frame: geometry, illumination, pointing and expected returns.

    Parameters
    ----------
    scenario : what to fly, in open loop
    target : name of the target (None: the first)
    every_s : time from row to row [s], rounded to whole frames; the last frame is always included (None: every frame)
    casts : greatest number of frames at which rays are cast, spread evenly
    executor : in the manner of `concurrent.futures`, whose workers cast rays in place of threads of this process: a pool of
        processes, or ``client.get_executor()`` of dask. It changes no bit of the result

    Returns
    -------
    Timeline
        The table, which can draw itself.

    Raises
    ------
    ScenarioError
        For a scenario without targets, a name that is not known, and values outside their limits.
    """
    require_scenario(scenario, "timeline")
    check_workers(None, executor)
    number = find_target(scenario, target, "timeline")
    if casts < 1:
        raise ScenarioError(f"casts: needs a whole number from 1, not {casts}")
    frames = choose_rows(scenario, every_s)
    truth, angles = fly_open_loop(scenario, frames)
    name = scenario.target[number].name
    table: dict[str, np.ndarray] = {"time_s": truth.time_s, "utc": format_utc(scenario, truth.time_s)}
    table |= _tabulate_geometry(truth, name)
    table |= tabulate_sky(scenario, truth, frames, executor)
    table |= _tabulate_pointing(scenario, truth.time_s, angles)
    table |= _tabulate_light(scenario, truth, number, casts, executor)
    edge = scenario.instrument.at(0.0).receiver.field_edge
    shadows = find_umbras(scenario).get(name)
    response = scenario.ptu.response if scenario.ptu else None
    return Timeline(
        title=scenario.name,
        target=name,
        table=table,
        half_field_rad=float(np.arctan(edge.min())),
        travel_rad=response.travel_rad if response else None,
        max_rate_rad_s=getattr(response, "max_rate_rad_s", np.inf),
        shadow_s=None if shadows is None else tuple(shadows),
    )


def _tabulate_geometry(truth: Truth, name: str) -> dict[str, np.ndarray]:
    """Tabulate range, directions and their rates, and the Sun's angles."""
    seen = compute_viewing_geometry(truth, name)
    table = {"range_m": seen.range_m, "range_rate_m_s": seen.range_rate_m_s}
    shape = (seen.time_s.size, 3)
    line_m, velocity_m_s = (
        np.broadcast_to(values, shape)
        for values in (truth.poses.link("lidar", name).translation_m, truth.rates("lidar", name)[0])
    )
    turning = np.broadcast_to(truth.rates(ROOT, "lidar")[1], shape)
    squared = np.where(seen.range_m > 0.0, seen.range_m, np.inf) ** 2
    unturned = velocity_m_s + cross(turning, line_m)  # relative velocity in axes that do not rotate
    table["line_of_sight_rate_rad_s"] = np.linalg.norm(cross(line_m, unturned), axis=-1) / squared
    table["azimuth_rad"], table["elevation_rad"] = seen.azimuth_rad, seen.elevation_rad
    link = truth.poses.link("follower", name)
    x, y, z = np.broadcast_to(link.translation_m, shape).T
    vx, vy, vz = np.broadcast_to(link.velocity_m_s, shape).T
    level = np.hypot(x, y)
    with np.errstate(divide="ignore", invalid="ignore"):
        table["azimuth_rate_rad_s"] = (x * vy - y * vx) / level**2
        table["elevation_rate_rad_s"] = (vz * level - z * (x * vx + y * vy) / level) / (level**2 + z**2)
    table["off_boresight_rad"] = seen.off_boresight_rad
    across = velocity_m_s - line_m * (dot(line_m, velocity_m_s) / squared)[:, None]
    table["image_rate_rad_s"] = np.linalg.norm(across, axis=-1) / np.sqrt(squared)
    if np.isfinite(seen.phase_rad).any():
        table["phase_rad"], table["sun_off_boresight_rad"] = seen.phase_rad, seen.sun_off_boresight_rad
    if np.isfinite(seen.sunlit).any():
        table["sunlit_fraction"] = seen.sunlit
    return table


def _tabulate_pointing(scenario: Scenario, time_s: np.ndarray, angles: tuple[PtuAngles, ...]) -> dict[str, np.ndarray]:
    """Tabulate demand and response of the PTU, and where it is at a limit; nothing without a PTU."""
    if scenario.ptu is None:
        return {}
    response = scenario.ptu.response
    most_rad_s = getattr(response, "max_rate_rad_s", np.inf)
    demand, actual, rate = (
        np.stack([getattr(ptu_angles, name) for ptu_angles in angles])
        for name in ("demand_rad", "actual_rad", "rate_rad_s")
    )
    with scenario.locate_errors():
        asked = motion.make_demand(scenario.ptu, scenario.bodies, *scenario.span, **scenario.world.motion_arguments)
    before, after = np.maximum(time_s - _RATE_S, 0.0), np.minimum(time_s + _RATE_S, max(scenario.span[1], _RATE_S))
    demand_rate = (asked(after) - asked(before)) / (after - before)[:, None]
    table = {}
    for axis, word in enumerate(("pan", "tilt")):
        low, high = response.travel_rad[axis]
        table[f"{word}_demand_rad"], table[f"{word}_actual_rad"] = demand[:, axis], actual[:, axis]
        table[f"{word}_demand_rate_rad_s"], table[f"{word}_rate_rad_s"] = demand_rate[:, axis], rate[:, axis]
        beyond = (demand[:, axis] < low) | (demand[:, axis] > high)
        fastest = np.maximum(np.abs(demand_rate[:, axis]), np.abs(rate[:, axis]))
        table[f"{word}_beyond_travel"] = beyond.astype(int)
        table[f"{word}_at_greatest_rate"] = (fastest >= (1.0 - _AT_LIMIT) * most_rad_s).astype(int)
    missed = actual - demand
    table["pointing_error_rad"] = np.hypot(missed[:, 0] * np.cos(actual[:, 1]), missed[:, 1])
    return table


# ------------------------------------------------------------------------------------------------- bounds and light


def _tabulate_light(
    scenario: Scenario, truth: Truth, number: int, casts: int, executor: Executor | None
) -> dict[str, np.ndarray]:
    """Tabulate bounds and light of the target: light is cast at up to `casts` frames, interpolated at the others."""
    time_s = truth.time_s
    lidars = [scenario.instrument.at(float(at)) for at in time_s]
    edge = np.array([lidar.receiver.field_edge for lidar in lidars])
    pitch = np.array([lidar.receiver.pixel_tangent for lidar in lidars])
    name = scenario.target[number].name
    low, high = _project_bounds(scenario, truth, number)
    sides, inside = _clip_bounds(low, high, edge)
    box_pixels = np.prod(inside, axis=1) / pitch**2
    within = _clip_bounds(*_project_bounds(scenario, truth, None), edge)[1]
    cast = np.unique(np.linspace(0, time_s.size - 1, casts).round().astype(int))
    everything = np.prod(within, axis=1) / pitch**2
    opportunities = find_opportunities(
        scenario, truth, cast.tolist(), number, np.where(box_pixels > 0.0, everything, 0.0), executor
    )

    range_m = np.linalg.norm(np.broadcast_to(truth.poses.link("lidar", name).translation_m, (time_s.size, 3)), axis=-1)
    white = np.array(
        [
            filled_pixel_photons(lidar.laser, lidar.receiver, _WHITE_PER_SR, max(r, 1e-3))
            for lidar, r in zip(lidars, range_m, strict=True)
        ]
    )
    carried = _interpolate_opportunities(opportunities, cast, time_s, box_pixels, white)
    sides = np.where(np.isfinite(sides), sides, 2.0 * edge)
    span = np.where(box_pixels[:, None] > 0.0, sides / pitch[:, None], 0.0)
    share = inside / np.where(sides > 0.0, sides, np.inf)
    table = {
        "in_field_fraction": np.where(box_pixels > 0.0, np.prod(share, axis=1), 0.0),
        "width_pixels": span[:, 0],
        "height_pixels": span[:, 1],
    }
    return table | carried | {"cast": np.isin(np.arange(time_s.size), cast).astype(int)}


def _interpolate_opportunities(
    opportunities: list[DetectionOpportunity],
    cast: np.ndarray,
    time_s: np.ndarray,
    box_pixels: np.ndarray,
    white: np.ndarray,
) -> dict[str, np.ndarray]:
    """Interpolate opportunities to all frames, relative to bounds and to a white pixel's light, linearly in time.

    Parameters
    ----------
    opportunities : at the frames of `cast`
    cast : indices of those frames
    time_s : (time) times of all frames [s]
    box_pixels : (time) area of the target's bounds in the field [pixels]
    white : (time) photons of a filled white pixel at the target's range
    """
    seen = {
        field: np.array([getattr(opportunity, field) for opportunity in opportunities], dtype=float)
        for field in DetectionOpportunity.__dataclass_fields__
    }
    scale = {
        "target_pixels": box_pixels,
        "filled_pixels": box_pixels,
        "brightest_photons": white,
        "median_photons": white,
        "detection_probability": np.ones_like(white),
        "expected_returns": box_pixels,
        "found_probability": np.ones_like(white),
    }
    table = {}
    for name, per in scale.items():
        known = box_pixels[cast] > 0.0
        at, share = time_s[cast][known], seen[name][known] / np.where(per[cast] > 0.0, per[cast], 1.0)[known]
        between = np.interp(time_s, at, share) if at.size else np.zeros_like(time_s)
        values = np.where(box_pixels > 0.0, between * per, 0.0)
        values[cast] = seen[name]
        table[name] = values
    return table


def in_field_fraction(scenario: Scenario, truth: Truth, number: int) -> np.ndarray:
    """Return the share (time) of a target's projected bounds that is in the field; 0 where none of it is.

    Parameters
    ----------
    scenario : what is flown
    truth : batch over epochs
    number : index of the target
    """
    edge = np.array([scenario.instrument.at(float(at)).receiver.field_edge for at in truth.time_s])
    sides, inside = _clip_bounds(*_project_bounds(scenario, truth, number), edge)
    sides = np.where(np.isfinite(sides), sides, 2.0 * edge)
    fraction: np.ndarray = np.prod(inside / np.where(sides > 0.0, sides, np.inf), axis=1)
    return fraction


def _project_bounds(scenario: Scenario, truth: Truth, number: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Project the bounds of a target, or of all targets, onto the tangent plane.

    Parameters
    ----------
    number : index of the target (None: all)

    Returns
    -------
    low, high : (time, 2) least and greatest x/z and y/z. Low exceeds high where the target is behind the lidar. They are
        infinite where a target close to the lidar extends from ahead to behind.
    """
    n = truth.time_s.size
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    for surface in scenario.surfaces if number is None else scenario.surfaces_of(number):
        translation, matrix = truth.poses.place("lidar", surface.name)
        place, turn = np.broadcast_to(translation, (n, 3)), np.broadcast_to(matrix, (n, 3, 3))
        points = surface.outline
        for first in range(0, n, _EPOCHS):
            rows = slice(first, first + _EPOCHS)
            there = rotate_vectors(turn[rows, None], points[None]) + place[rows, None]
            ahead = there[..., 2] > 0.0
            depth = np.where(ahead, there[..., 2], 1.0)[..., None]
            tangent = there[..., :2] / depth
            least, most = (np.where(ahead[..., None], tangent, none * np.inf) for none in (1.0, -1.0))
            around = ahead.any(axis=1) & ~ahead.all(axis=1) & _is_near(surface, place[rows], turn[rows])
            low[rows] = np.minimum(low[rows], np.where(around[:, None], -np.inf, least.min(axis=1)))
            high[rows] = np.maximum(high[rows], np.where(around[:, None], np.inf, most.max(axis=1)))
    return low, high


def _is_near(surface: Surface, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return whether (time) the lidar is within a radius of the sphere about a surface.

    Parameters
    ----------
    place, turn : (time, 3) [m] and (time, 3, 3) of lidar_from_surface
    """
    centre, radius_m = surface.sphere
    near: np.ndarray = np.linalg.norm(rotate_vectors(turn, centre) + place, axis=-1) < 2.0 * radius_m
    return near


def _clip_bounds(low: np.ndarray, high: np.ndarray, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides (time, 2) of bounds, and those of their part in the half field (time, 2); 0 where none is."""
    with np.errstate(invalid="ignore"):
        sides = np.where(low <= high, high - low, 0.0)
    inside = np.where(low <= high, np.maximum(np.minimum(high, edge) - np.maximum(low, -edge), 0.0), 0.0)
    return sides, inside
