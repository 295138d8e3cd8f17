"""The truth of an open-loop run, PTU included, without rendering a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from rso_lidar import motion, orbit, rpo, units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Chief, find_flight, find_plan, get_chief_name, list_commands
from rso_lidar.orbit import find_eclipses
from rso_lidar.records import BodyState, PtuAngles, Truth, tabulate_truth
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import POINTING


def fly_open_loop(
    scenario: Scenario, frames: slice | Iterable[int] | None = None, *, drive: bool = True
) -> tuple[Truth, tuple[PtuAngles, ...]]:
    """Compute the truth of an open-loop run as one batch, with PTU and lidar, and the PTU's angles frame by frame.

    It equals the truth of the frames of such a run, including jitter and encoder noise. The PTU's drive is integrated in
    steps of 1 ms up to the last frame, which takes about 2 s per hour of run.

    Parameters
    ----------
    scenario : what to fly
    frames : which frames, as a slice or indices (None: all)
    drive : whether to simulate the drive. Otherwise the PTU stands on its demand, and there are no angles

    Returns
    -------
    truth : batch over the frames, with ptu and lidar.
    angles : of the PTU, one for each frame; empty without a PTU.
    """
    numbers = scenario.time.choose_frames(frames)
    ptu, mount = scenario.pan_tilt, scenario.lidar.mount
    with scenario.locate_errors():
        world = scenario.world.motion_arguments
        truth = motion.truth(scenario.bodies, scenario.epochs(numbers), **world)
        angles: tuple[PtuAngles, ...] = ()
        pan_tilt_rad = rate_rad_s = np.zeros((numbers.size, 2))
        if ptu is not None and drive:
            asked = motion.make_demand(ptu, scenario.bodies, *scenario.span, **world)
            angles = tuple(_pointing(scenario, ptu, numbers, truth.time_s, asked))
            pan_tilt_rad = np.stack([angle.actual_rad for angle in angles])
            rate_rad_s = np.stack([angle.rate_rad_s for angle in angles])
        elif ptu is not None:
            pan_tilt_rad = motion.compute_demand(ptu, scenario.bodies, truth)
    poses = motion.add_lidar(truth.poses, ptu, pan_tilt_rad, rate_rad_s, mount)
    return Truth(truth.time_s, poses, truth.states, truth.sun_direction, None, truth.sunlit), angles


def _pointing(
    scenario: Scenario, ptu: motion.Ptu, numbers: np.ndarray, time_s: np.ndarray, asked: Any
) -> Iterable[PtuAngles]:
    """Step the PTU from frame to frame, and yield its angles at each; numbers and times [s] are (time)."""
    state = motion.start(ptu, asked)
    for k, until_s in zip(numbers.tolist(), time_s.tolist(), strict=True):
        state = motion.step(ptu, state, asked, until_s=until_s)
        yield motion.sense(ptu, state, scenario.rng(k, POINTING))


def tabulate_run(scenario: Scenario, truth: Truth, angles: tuple[PtuAngles, ...] = ()) -> dict[str, np.ndarray]:
    """Tabulate the truth of a run as columns (time) by name, as `tabulate_truth` names them."""
    return tabulate_truth(
        truth, [target.name for target in scenario.target], format_utc(scenario, truth.time_s), angles
    )


def choose_rows(scenario: Scenario, every_s: float | None) -> np.ndarray:
    """Return the indices of frames that are `every_s` [s] apart, in whole frames, and of the last one; None: of all.

    Raises
    ------
    ScenarioError
        For a time that is not above 0, or shorter than from frame to frame.
    """
    stride, last, step_s = 1, scenario.time.n_frames - 1, 1.0 / scenario.time.frame_rate_hz
    if every_s is not None:
        if not 0.0 < every_s < np.inf:
            raise ScenarioError(f"every_s {every_s:g}: needs seconds above 0")
        if every_s < step_s * (1.0 - 1e-9):
            raise ScenarioError(
                f"every_s {every_s:g}: frames are {step_s:g} s apart; give at least that, or --set time.frame_rate_hz"
            )
        stride = round(every_s / step_s)
    return np.union1d(np.arange(0, last + 1, stride), last)  # the last frame too, so that a table covers the whole run


def format_utc(scenario: Scenario, time_s: np.ndarray) -> np.ndarray:
    """Format times [s since start_utc] as ISO UTC texts to the microsecond."""
    return np.array(orbit.Epochs(scenario.time.start_utc, time_s).skyfield_time().utc_iso(places=6))


def find_mission_plan(scenario: Scenario, target: str | None) -> rpo.Plan | None:
    """Return the plan of the follower's proximity operation about `target`; None for another motion."""
    follower = scenario.bodies[-1]
    if get_chief_name(follower.motion) != target:
        return None
    with scenario.locate_errors("follower.motion"):
        return find_plan(follower, scenario.bodies, scenario.time.start_utc)


_BESIDE_S = 1e-5  # step before an impulse at which an ephemeris ends
_CLEAR_S = 2e-3  # before an impulse without other states, which would spoil the interpolation up to its end


def sample_between_impulses(
    scenario: Scenario, name: str, time_s: np.ndarray
) -> tuple[orbit.Epochs, BodyState, list[float]]:
    """Compute the states of a body at some times, and just before and at each impulse.

    Parameters
    ----------
    time_s : (time) ascending times [s since start_utc]

    Returns
    -------
    epochs : those times and the ends of each stretch between impulses.
    states : GCRS states of the body at the epochs.
    impulses_s : times of the impulses of the body and of the bodies that its motion is relative to [s since start_utc].
    """
    breaks = find_velocity_jumps_s(scenario, name)
    inside = sorted(at for at in breaks if time_s[0] + _BESIDE_S < at < time_s[-1])
    ends = [at - back for at in inside for back in (_BESIDE_S, 0.0)]
    kept = [t for t in time_s.tolist() if not any(at - _CLEAR_S < t < at for at in inside)]
    epochs = orbit.Epochs(scenario.time.start_utc, np.union1d(kept, ends))
    return epochs, motion.truth(scenario.bodies, epochs, **scenario.world.motion_arguments).states[name], inside


def find_velocity_jumps_s(scenario: Scenario, name: str) -> set[float]:
    """Find the times of velocity jumps of a body: its impulses, and those of bodies that its motion is relative to.

    Parameters
    ----------
    scenario : what is flown
    name : of the body

    Returns
    -------
    set of float
        Times [s since start_utc].

    Raises
    ------
    KeyError
        For a name that no body has.
    """
    by_name = {body.name: body for body in scenario.bodies}
    chain: list[Any] = [by_name[name]]
    while (relative_to := get_chief_name(chain[-1].motion)) is not None:
        chain.append(by_name[relative_to])
    breaks: set[float] = set()
    for body in chain:
        breaks |= _find_jumps_s(scenario, body)
    return breaks


def _find_jumps_s(scenario: Scenario, body: motion.Body) -> set[float]:
    """Find the instants [s] at which the velocity of a body jumps."""
    flight = find_flight(body, scenario.bodies, scenario.time.start_utc)
    if flight is not None:
        return {
            maneuver.at_s for maneuver in flight.list_maneuvers(scenario.span[1]) if isinstance(maneuver, orbit.Impulse)
        }
    dated = getattr(body.motion, "list_impulses_s", None)  # where maneuvers have dates, not times of the run
    if dated is not None:
        return set(dated(scenario.time.start_utc))
    planned = {float(command.time_s) for command in list_commands(body, scenario.bodies, *scenario.span)}
    return planned | set(getattr(body.motion, "impulses_s", ()))


def find_umbras(scenario: Scenario) -> dict[str, list[tuple[float, float]]]:
    """Find by body in orbit the spans [s] in the Earth's umbra; nothing for runs of more than 30 days."""
    if scenario.is_local or scenario.span[1] > 30.0 * units.DAY_S:
        return {}
    ends = orbit.Epochs(scenario.time.start_utc, np.array([0.0, max(scenario.span[1], 1.0)]))
    return {
        body.name: [
            (eclipse.umbra_from_s, eclipse.umbra_to_s)
            for eclipse in find_eclipses(Chief(scenario.bodies, body.name), ends)
            if eclipse.is_total
        ]
        for body in scenario.bodies
        if body.orbits
    }
