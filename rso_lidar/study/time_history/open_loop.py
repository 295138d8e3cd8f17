"""A scenario flown with the shutter closed: where everything is, and where the PTU points, without rendering a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rso_lidar import motion, orbit, rpo, units
from rso_lidar.orbit.sky.eclipse import find_eclipses
from rso_lidar.records import BodyState, PtuAngles, Truth
from rso_lidar.scenario import Scenario
from rso_lidar.simulate import POINTING, frame_numbers
from rso_lidar.viewing_geometry import tabulate_truth


def fly_open_loop(
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


def tabulate_run(scenario: Scenario, truth: Truth, angles: tuple[PtuAngles, ...] = ()) -> dict[str, np.ndarray]:
    """Return the truth as columns (time) by name, as `tabulate_truth` names them."""
    return tabulate_truth(
        truth, [target.name for target in scenario.target], format_utc(scenario, truth.time_s), angles
    )


def format_utc(scenario: Scenario, time_s: np.ndarray) -> np.ndarray:
    """Return the instants [s since start_utc] as ISO UTC text to the microsecond."""
    return np.array(orbit.Epochs(scenario.time.start_utc, time_s).skyfield_time().utc_iso(places=6))


def find_plan(scenario: Scenario, target: str | None) -> rpo.Plan | None:
    """Return the plan that the follower flies about `target`; None for a motion without one."""
    follower = scenario.bodies[-1]
    if motion.chief_of(follower.motion) != target:
        return None
    with scenario.placed("follower.motion"):
        return motion.plan_of(follower, scenario.bodies, scenario.time.start_utc)


_BESIDE_S = 1e-3  # before an impulse: what is left out of an ephemeris there


def sample_between_impulses(
    scenario: Scenario, name: str, time_s: np.ndarray
) -> tuple[orbit.Epochs, BodyState, list[float]]:
    """Return epochs, GCRS states of a body there, and the instants [s] of its impulses and of those it moves about.

    The epochs are those asked for and, so that each stretch between impulses has its ends, those at the impulses.
    """
    breaks = find_velocity_jumps_s(scenario, name)
    inside = sorted(at for at in breaks if time_s[0] + _BESIDE_S < at < time_s[-1])
    ends = [at - back for at in inside for back in (_BESIDE_S, 0.0)]
    kept = [t for t in time_s.tolist() if not any(at - 2.0 * _BESIDE_S < t < at for at in inside)]
    epochs = orbit.Epochs(scenario.time.start_utc, np.union1d(kept, ends))
    world: Any = {"local": scenario.local, "sun_direction": scenario.world.sun_direction}
    return epochs, motion.truth(scenario.bodies, epochs, **world).states[name], inside


def find_velocity_jumps_s(scenario: Scenario, name: str) -> set[float]:
    """Return the instants [s] at which the velocity of a body jumps: its impulses, and those of what it moves about."""
    by_name = {body.name: body for body in scenario.bodies}
    chain: list[Any] = [by_name[name]]
    while (relative_to := motion.chief_of(chain[-1].motion)) is not None:
        chain.append(by_name[relative_to])
    breaks: set[float] = set()
    for body in chain:
        plan = motion.plan_of(body, scenario.bodies, scenario.time.start_utc)
        breaks |= {float(one.time_s) for one in plan.impulses} if plan else set()
        breaks |= set(getattr(body.motion, "impulses_s", ()))
    return breaks


def find_umbras(scenario: Scenario) -> dict[str, list[tuple[float, float]]]:
    """Return by body in orbit when it is wholly in the Earth's shadow, from and to [s]; for runs of up to 30 days."""
    if scenario.local or scenario.span[1] > 30.0 * units.DAY_S:
        return {}
    ends = orbit.Epochs(scenario.time.start_utc, np.array([0.0, max(scenario.span[1], 1.0)]))
    return {
        body.name: [
            (one.umbra_from_s, one.umbra_to_s)
            for one in find_eclipses(motion.Chief(scenario.bodies, body.name), ends)
            if one.is_total
        ]
        for body in scenario.bodies
        if body.orbits
    }
