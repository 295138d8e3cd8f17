"""The pan-tilt unit: its mount, the motion of its drive, and the readings of its encoders.

follower_from_ptu = mount * Rz(pan) * Ry(-tilt), intrinsic: pan > 0 turns left, tilt > 0 turns up, and at zero the
boresight is +x of the mount. The same steps serve open and closed loop::

    head = start(ptu, demand)
    for time_s in flashes:
        head = step(ptu, head, demand, until_s=time_s, command=command)
        pointing = sense(ptu, head, rng)

The drive runs on a grid of 1 ms from t = 0, independent of the times of flashes, and holds its demand over each tick. The
state at a tick therefore has the same bits for any sequence of steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion.gimbal.demand import Demand, FixedPoint, ScanPoint, TrackPoint
from rso_lidar.motion.gimbal.drive import TICK_S, FirstOrder, Ideal, Pair, SecondOrder, StateSpaceDrive
from rso_lidar.motion.gimbal.fmu_drive import FmuDrive
from rso_lidar.motion.mount import Mount
from rso_lidar.part import GREATEST, NotNegative, Number, Part
from rso_lidar.pose import Link
from rso_lidar.records import Command, PtuAngles

TICKS_PER_S = 1000
CHUNK = 20_000  # ticks in one evaluation of the demand; bounds memory


class PointingErrors(Part):
    """Errors of pointing and of the encoders; random ones are one standard deviation for each axis.

    Actual = drive + misalignment + jitter. Measured = drive + encoder noise, rounded to the encoder's resolution.
    Demands and commands reach the drive `command_latency_s` late, rounded to its ticks of 1 ms.
    """

    misalignment_deg: tuple[Number, Number] = Field(
        default=(0.0, 0.0), description="Constant offset of the boresight from the encoders, in pan and tilt [deg]."
    )
    jitter_deg: NotNegative = Field(default=0.0, description="Pointing jitter from flash to flash, 1 sigma [deg].")
    encoder_noise_deg: NotNegative = Field(default=0.0, description="Noise of the encoders, 1 sigma [deg].")
    encoder_resolution_deg: NotNegative = Field(
        default=0.0, description="Step to which measured angles are rounded [deg]; 0 disables rounding."
    )
    command_latency_s: Annotated[NotNegative, Field(le=3600)] = Field(
        default=0.0, description="Delay until a demand or a command reaches the drive [s]."
    )


class Ptu(Part):
    """A pan-tilt unit on the follower."""

    mount: Mount = Field(
        default=Mount(), description="Pose follower_from_mount: where the unit is mounted on the follower."
    )
    point: Annotated[FixedPoint | TrackPoint | ScanPoint, Field(discriminator="type")] = Field(
        default=FixedPoint(), description="Demanded pointing."
    )
    response: Annotated[Ideal | FirstOrder | SecondOrder | StateSpaceDrive | FmuDrive, Field(discriminator="type")] = (
        Field(default=Ideal(), description="Dynamics of the drive.")
    )
    errors: PointingErrors = Field(default=PointingErrors(), description="Errors of pointing and encoders.")


def make_ptu_link(
    mount: Mount,
    pan_rad: np.ndarray | float,
    tilt_rad: np.ndarray | float,
    pan_rate_rad_s: np.ndarray | float = 0.0,
    tilt_rate_rad_s: np.ndarray | float = 0.0,
) -> Link:
    """Compute the link of the PTU in follower axes, single or batched like the angles.

    Parameters
    ----------
    mount : of the PTU on the follower
    pan_rad, tilt_rad : angles (…) [rad]
    pan_rate_rad_s, tilt_rate_rad_s : their rates (…) [rad/s]

    Returns
    -------
    link follower_from_ptu (…), with the angular velocity of the PTU in its own axes [rad/s]

    Examples
    --------
    >>> make_ptu_link(Mount(), 0.0, 0.5).pose.apply([1, 0, 0]).round(3)  # the boresight looks up
    array([0.878, 0.   , 0.479])
    """
    pan, tilt, pan_rate, tilt_rate = np.broadcast_arrays(pan_rad, tilt_rad, pan_rate_rad_s, tilt_rate_rad_s)
    cos_pan, sin_pan, cos_tilt, sin_tilt = np.cos(pan), np.sin(pan), np.cos(tilt), np.sin(tilt)
    matrix = np.empty((*pan.shape, 3, 3))  # Rz(pan) Ry(-tilt)
    matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 0, 2] = cos_pan * cos_tilt, -sin_pan, -cos_pan * sin_tilt
    matrix[..., 1, 0], matrix[..., 1, 1], matrix[..., 1, 2] = sin_pan * cos_tilt, cos_pan, -sin_pan * sin_tilt
    matrix[..., 2, 0], matrix[..., 2, 1], matrix[..., 2, 2] = sin_tilt, 0.0, cos_tilt
    rates = np.stack([pan_rate * sin_tilt, -tilt_rate, pan_rate * cos_tilt], axis=-1)
    return mount.link * Link((np.zeros(3), matrix), np.zeros(3), rates)


@dataclass(frozen=True, slots=True)
class PtuState:
    """State of the drive at an instant, and at the previous tick, from which it continues.

    Parameters
    ----------
    time_s : instant [s]
    angle_rad, rate_rad_s : pan and tilt [rad] at `time_s`, and their rates [rad/s]
    demand_rad : demanded pan and tilt at `time_s`, before latency and limits [rad]
    tick : number of the previous tick
    grid : (angle [rad], rate [rad/s]) of pan and of tilt at `tick`
    commands : commands that still matter, each with the first tick at which the drive obeys it
    further : further entries of the state of a state-space drive at `tick`, or the point of an FMU's run
    """

    time_s: float
    angle_rad: Pair
    rate_rad_s: Pair
    demand_rad: Pair
    tick: int
    grid: tuple[Pair, Pair]
    commands: tuple[tuple[int, Command], ...] = ()
    further: tuple[Any, ...] = ()


def start(ptu: Ptu, demand: Demand) -> PtuState:
    """Return the state at t = 0: at rest on the demand, within the travel.

    An `Ideal` drive has the rate of the demand.

    Parameters
    ----------
    ptu : the pan-tilt unit
    demand : of the scenario
    """
    demanded = _pair(demand(np.zeros(1))[0])
    pan, tilt = (
        min(max(angle, low), high) for angle, (low, high) in zip(demanded, ptu.response.travel_rad, strict=True)
    )
    grid: tuple[Pair, Pair] = ((pan, 0.0), (tilt, 0.0))
    further = getattr(ptu.response, "further_state", ())
    if isinstance(ptu.response, FmuDrive):
        grid, further = ptu.response.begin(pan, tilt)
    state = PtuState(0.0, (grid[0][0], grid[1][0]), (0.0, 0.0), demanded, 0, grid, further=further)
    return step(ptu, state, demand, 0.0)


def step(ptu: Ptu, state: PtuState, demand: Demand, until_s: float, command: Command | None = None) -> PtuState:
    """Advance the drive to a later instant.

    Parameters
    ----------
    ptu : the pan-tilt unit
    state : at the previous flash
    demand : of the scenario, the same function at every step
    until_s : instant of the next flash, not before `state.time_s` [s]. Between ticks, a copy of the state at the
        previous tick is advanced, so that the grid does not depend on flashes
    command : given at `state.time_s`, it holds until `until_s`. An axis that is None, or no command, keeps the demand

    Returns
    -------
    state at `until_s`

    Raises
    ------
    ValueError
        If `until_s` is before `state.time_s`
    ScenarioError
        If the command is not an angle
    """
    if until_s < state.time_s:
        raise ValueError(f"ptu: cannot step back from {state.time_s:g} s to {until_s:g} s; start from t = 0 to go back")
    command = check_angles(command or Command())
    latency = round(ptu.errors.command_latency_s * TICKS_PER_S)
    commands = _select_commands(state, command, latency)
    tick, rest_s = _split_time(until_s)
    travel = ptu.response.travel_rad
    demanded = _find_demanded(demand, command, until_s)

    if isinstance(ptu.response, Ideal):
        angle, rate = _follow_demand(ptu.response, demand, commands, until_s, latency)
        return PtuState(until_s, angle, rate, demanded, tick, ((angle[0], 0.0), (angle[1], 0.0)), commands)

    grid, further = state.grid, state.further
    for first in range(state.tick, tick, CHUNK):
        held = _sample_demand(demand, commands, first, min(first + CHUNK, tick), latency, travel)
        grid, further = ptu.response.advance(first / TICKS_PER_S, TICK_S, grid, further, held)
    here = grid
    if rest_s:
        held = _sample_demand(demand, commands, tick, tick + 1, latency, travel)
        here, _ = ptu.response.advance(tick / TICKS_PER_S, rest_s, grid, further, held)
    (pan, pan_rate), (tilt, tilt_rate) = here
    return PtuState(until_s, (pan, tilt), (pan_rate, tilt_rate), demanded, tick, grid, commands, further)


def sense(ptu: Ptu, state: PtuState, rng: np.random.Generator) -> PtuAngles:
    """Draw jitter and encoder noise, and return demanded, actual and measured angles.

    Parameters
    ----------
    ptu : the pan-tilt unit
    state : at the flash
    rng : always gives four numbers, so that its sequence does not depend on settings

    Returns
    -------
    demanded, actual and measured angles, and the rates of the drive
    """
    errors = ptu.errors
    draws = rng.standard_normal(4)
    angle = np.array(state.angle_rad)
    off = np.array(errors.misalignment_deg) + errors.jitter_deg * draws[:2]
    measured = angle + errors.encoder_noise_deg * units.DEG * draws[2:]
    if errors.encoder_resolution_deg:
        resolution = errors.encoder_resolution_deg * units.DEG
        measured = resolution * np.rint(measured / resolution)
    return PtuAngles(
        demand_rad=np.array(state.demand_rad),
        actual_rad=angle + off * units.DEG,
        measured_rad=measured,
        rate_rad_s=np.array(state.rate_rad_s),
    )


# ---------------------------------------------------------------------------------------------------- demands and commands


def _pair(angles: np.ndarray) -> Pair:
    return float(angles[0]), float(angles[1])


def check_angles(command: Command) -> Command:
    """Check the angles of a command.

    Parameters
    ----------
    command : whose pan and tilt are angles [rad] or None

    Returns
    -------
    a command of these alone

    Raises
    ------
    ScenarioError
        If one is no angle
    """
    for name in ("pan_rad", "tilt_rad"):
        angle = getattr(command, name)
        number = isinstance(angle, int | float | np.floating | np.integer) and not isinstance(angle, bool)
        if angle is not None and not (number and abs(angle) <= GREATEST):
            raise ScenarioError(
                f"command: {name} is {angle!r:.60}; return an angle, or None to keep the scenario's demand"
            )
    return Command(command.pan_rad, command.tilt_rad)


def _split_time(time_s: float) -> tuple[int, float]:
    """Split an instant [s] into the last tick and a remainder [s]; less than a nanosecond before a tick counts as it."""
    tick = math.floor(time_s * TICKS_PER_S + 1e-6)
    rest_s = time_s - tick / TICKS_PER_S
    return tick, rest_s if rest_s > 1e-9 else 0.0


def _find_demanded(demand: Demand, command: Command, time_s: float) -> Pair:
    """Return pan and tilt [rad] that a command or else the scenario demands.

    Parameters
    ----------
    demand : of the scenario, evaluated for the axes without a command only
    time_s : instant [s]
    """
    if command.pan_rad is not None and command.tilt_rad is not None:
        return float(command.pan_rad), float(command.tilt_rad)
    return _pair(_apply_command(demand(np.array([time_s]))[0], command))


def _apply_command(angles: np.ndarray, command: Command) -> np.ndarray:
    pan = angles[0] if command.pan_rad is None else command.pan_rad
    tilt = angles[1] if command.tilt_rad is None else command.tilt_rad
    return np.array([pan, tilt], dtype=float)


def _select_commands(state: PtuState, command: Command, latency: int) -> tuple[tuple[int, Command], ...]:
    """List the commands that still matter from the state's tick on, each with its first tick, the new one last."""
    tick, rest_s = _split_time(state.time_s)
    commands = state.commands
    if command != (commands[-1][1] if commands else Command()):
        commands = (*commands, (tick + (rest_s > 0.0) + latency, command))
    while len(commands) > 1 and commands[1][0] <= state.tick:
        commands = commands[1:]
    return commands


def _sample_demand(
    demand: Demand,
    commands: tuple[tuple[int, Command], ...],
    first: int,
    end: int,
    latency: int,
    travel: tuple[Pair, Pair],
) -> np.ndarray:
    """Sample demand and commands at ticks (tick, 2) [rad], within the travel."""
    both = all(command.pan_rad is not None and command.tilt_rad is not None for _, command in commands)
    if commands and commands[0][0] <= first and both:
        demanded = np.empty((end - first, 2))
    else:
        free = demand(np.maximum(np.arange(first, end) - latency, 0) / TICKS_PER_S)
        demanded = np.clip(free, *np.transpose(travel))
    ends = [tick for tick, _ in commands[1:]] + [end]
    for (begin, command), finish in zip(commands, ends, strict=True) if commands else ():
        rows = slice(max(begin - first, 0), max(finish - first, 0))
        for axis, angle in enumerate((command.pan_rad, command.tilt_rad)):
            if angle is not None:
                low, high = travel[axis]
                demanded[rows, axis] = min(max(angle, low), high)
    return demanded


# ------------------------------------------------------------------------------------------------------- responses


def _follow_demand(
    response: Ideal, demand: Demand, commands: tuple[tuple[int, Command], ...], time_s: float, latency: int
) -> tuple[Pair, Pair]:
    """Evaluate the demand [rad] of an ideal drive, and its rates [rad/s] by central difference over a tick."""
    now = time_s - latency / TICKS_PER_S
    around = np.maximum([now, now - TICK_S / 2, now + TICK_S / 2], 0.0)
    demanded = demand(around)
    rates = (demanded[2] - demanded[1]) / (around[2] - around[1] or TICK_S)
    obeyed = [command for tick, command in commands if tick <= _split_time(time_s)[0]]
    command = obeyed[-1] if obeyed else Command()
    low, high = np.transpose(response.travel_rad)
    angles = _apply_command(demanded[0], command)
    commanded = np.array([command.pan_rad is not None, command.tilt_rad is not None])
    rates = np.where(commanded | (angles < low) | (angles > high), 0.0, rates)
    return _pair(np.clip(angles, low, high)), _pair(rates)
