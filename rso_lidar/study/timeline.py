"""A scenario flown with the shutter closed: where everything is, and where the PTU points, without rendering a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rso_lidar import motion, orbit, rpo, units
from rso_lidar.orbit.environment import eclipses
from rso_lidar.picture.sight import sight
from rso_lidar.pose import quaternion_xyzw
from rso_lidar.records import BodyState, PtuAngles, Truth, specs
from rso_lidar.scenario import Scenario
from rso_lidar.simulate import POINTING, frame_numbers

XYZ = ("x", "y", "z")


def course(
    scenario: Scenario, frames: slice | Iterable[int] | None = None, *, drive: bool = True
) -> tuple[Truth, tuple[PtuAngles, ...]]:
    """Return the truth at some frames (None: all) as one batch, ptu and lidar in it, and the PTU's angles frame by frame.

    It is the truth that the frames of an open-loop run carry, jitter and encoder noise included. The PTU's drive is stepped
    at 1 ms up to the last frame, some 2 s of work for each hour flown; with `drive` = False the PTU stands on
    its demand and the angles are left out, as they are without a PTU.
    """
    numbers = frame_numbers(scenario, frames)
    ptu, mount = scenario.ptu, scenario.lidar.mount
    with scenario.placed():
        world: Any = {"local": scenario.local, "sun_direction": scenario.world.sun_direction}
        truth = motion.truth(scenario.bodies, scenario.epochs(numbers), **world)
        angles: tuple[PtuAngles, ...] = ()
        pan_tilt_rad = rate_rad_s = np.zeros((numbers.size, 2))
        if ptu is not None and drive:
            asked = motion.demand(ptu, scenario.bodies, *scenario.span, **world)
            angles = tuple(_pointing(scenario, numbers, truth.time_s, asked))
            pan_tilt_rad = np.stack([angle.actual_rad for angle in angles])
            rate_rad_s = np.stack([angle.rate_rad_s for angle in angles])
        elif ptu is not None:
            pan_tilt_rad = motion.asked(ptu, scenario.bodies, truth)
    poses = motion.with_lidar(truth.poses, ptu, pan_tilt_rad, rate_rad_s, mount)
    return Truth(truth.time_s, poses, truth.states, truth.sun_direction, None, truth.sunlit), angles


def _pointing(scenario: Scenario, numbers: np.ndarray, time_s: np.ndarray, asked: Any) -> Iterable[PtuAngles]:
    assert scenario.ptu is not None
    state = motion.start(scenario.ptu, asked)
    for k, until_s in zip(numbers.tolist(), time_s.tolist(), strict=True):
        state = motion.step(scenario.ptu, state, asked, until_s=until_s)
        yield motion.sense(scenario.ptu, state, scenario.rng(k, POINTING))


def columns(scenario: Scenario, truth: Truth, angles: tuple[PtuAngles, ...] = ()) -> dict[str, np.ndarray]:
    """Return the truth as columns (time) by name, units in the names: one table of where everything is.

    ``utc`` is text, all else numbers. Positions and velocities of bodies are inertial (GCRS, or the root of a local world);
    ``lidar_from_<target>`` is the target's position in lidar axes and the quaternion that turns target into lidar
    coordinates; `sight` defines the angles. Without a Sun, or a PTU, their columns are missing.
    """
    n = truth.time_s.size
    table: dict[str, np.ndarray] = {"time_s": truth.time_s, "utc": utc(scenario, truth.time_s)}

    def vectors(name: str, values: np.ndarray, unit: str = "") -> None:
        for axis, column in zip(XYZ, np.broadcast_to(values, (n, 3)).T, strict=True):
            table[f"{name}_{axis}{unit}"] = column

    for name, state in truth.states.items():
        vectors(f"{name}_position", state.position_m, "_m")
        vectors(f"{name}_velocity", state.velocity_m_s, "_m_s")
    for target in scenario.target:
        name = target.name
        lidar_from_target = truth.pose("lidar", name)
        seen = sight(truth, name)
        vectors(f"lidar_from_{name}", lidar_from_target.translation, "_m")
        quaternion = np.broadcast_to(quaternion_xyzw(lidar_from_target.rotation), (n, 4))
        for axis, column in zip((*XYZ, "w"), quaternion.T, strict=True):
            table[f"lidar_from_{name}_quaternion_{axis}"] = column
        table[f"{name}_range_m"] = seen.range_m
        table[f"{name}_range_rate_m_s"] = seen.range_rate_m_s
        table[f"{name}_azimuth_rad"], table[f"{name}_elevation_rad"] = seen.azimuth_rad, seen.elevation_rad
        table[f"{name}_off_boresight_rad"] = seen.off_boresight_rad
        if np.isfinite(seen.phase_rad).any():
            table[f"{name}_phase_rad"] = seen.phase_rad
            table["sun_off_boresight_rad"] = seen.sun_off_boresight_rad
    for spec in specs(PtuAngles) if angles else ():
        stem, unit = spec.split("_", 1)
        for place, axis in enumerate(("pan", "tilt")):
            table[f"{axis}_{stem}_{unit}"] = np.array([getattr(angle, spec)[place] for angle in angles])
    if np.isfinite(truth.sun_direction).all():
        vectors("sun_direction", truth.sun_direction)
    for name, share in truth.sunlit.items():
        table[f"{name}_sunlit_fraction"] = np.asarray(share)
    return table


def utc(scenario: Scenario, time_s: np.ndarray) -> np.ndarray:
    """Return the instants [s since start_utc] as ISO UTC text to the microsecond."""
    return np.array(orbit.Epochs(scenario.time.start_utc, time_s).skyfield_time().utc_iso(places=6))


def plan_of(scenario: Scenario, target: str | None) -> rpo.Plan | None:
    """Return the plan that the follower flies about `target`; None for a motion without one."""
    flown = scenario.bodies[-1].motion
    if not isinstance(flown, rpo.ProximityOperation) or flown.relative_to != target:
        return None
    with scenario.placed("follower.motion"):
        return flown.plan(scenario.time.start_utc, motion.Chief(scenario.bodies, flown.relative_to))


_BESIDE_S = 1e-3  # before an impulse: what is left out of an ephemeris there


def burned(scenario: Scenario, name: str, time_s: np.ndarray) -> tuple[orbit.Epochs, BodyState, list[float]]:
    """Return epochs, GCRS states of a body there, and the instants [s] of its impulses and of those it moves about.

    The epochs are those asked for and, so that each stretch between impulses has its ends, those at the impulses.
    """
    by_name = {body.name: body for body in scenario.bodies}
    chain: list[Any] = [by_name[name]]
    while (relative_to := getattr(chain[-1].motion, "relative_to", None)) is not None:
        chain.append(by_name[relative_to])
    breaks: set[float] = set()
    for body in chain:
        flown = body.motion
        if isinstance(flown, rpo.ProximityOperation):
            chief = motion.Chief(scenario.bodies, flown.relative_to)
            breaks |= {float(one.time_s) for one in flown.plan(scenario.time.start_utc, chief).impulses}
        if isinstance(flown, orbit.Numerical):
            breaks |= {one.at_s for one in flown.maneuvers if isinstance(one, orbit.Impulse)}
    inside = sorted(at for at in breaks if time_s[0] + _BESIDE_S < at < time_s[-1])
    ends = [at - back for at in inside for back in (_BESIDE_S, 0.0)]
    kept = [t for t in time_s.tolist() if not any(at - 2.0 * _BESIDE_S < t < at for at in inside)]
    epochs = orbit.Epochs(scenario.time.start_utc, np.union1d(kept, ends))
    world: Any = {"local": scenario.local, "sun_direction": scenario.world.sun_direction}
    return epochs, motion.truth(scenario.bodies, epochs, **world).states[name], inside


def umbras(scenario: Scenario) -> dict[str, list[tuple[float, float]]]:
    """Return by body in orbit when it is wholly in the Earth's shadow, from and to [s]; for runs of up to 30 days."""
    if scenario.local or scenario.span[1] > 30.0 * units.DAY_S:
        return {}
    ends = orbit.Epochs(scenario.time.start_utc, np.array([0.0, max(scenario.span[1], 1.0)]))
    return {
        body.name: [
            (one.umbra_from_s, one.umbra_to_s)
            for one in eclipses(motion.Chief(scenario.bodies, body.name), ends)
            if one.total
        ]
        for body in scenario.bodies
        if body.orbits
    }
