"""The flight that is dispersed: its path, its burns, its updates of guidance, and the axes of the body approached."""

from __future__ import annotations

import datetime
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Body, Chief, find_flight, find_plan, get_flown_motion
from rso_lidar.orbit import Epochs, Forces
from rso_lidar.rpo import (
    NavigationErrors,
    PlannedImpulse,
    RelativeFilter,
    Thrusters,
    TwoImpulseGuidance,
    rtn_matrix,
)


@dataclass(frozen=True)
class GuidanceInstant:
    """An update of guidance at `time_s` that corrects the path up to `aim_s` [s]."""

    time_s: float
    aim_s: float


@dataclass(frozen=True, eq=False)
class NominalFlight:
    """A flight without random errors.

    Parameters
    ----------
    start_utc : start of the run
    craft_m : function of instants (time,) [s] that returns the position (time, 3) [m] of the craft, inertial axes
    chief_axes : function of instants (time,) [s] that returns the rtn axes of the body approached, as columns (time, 3, 3)
        in inertial axes, and their angular velocity (time, 3) [rad/s] in rtn axes
    forces : whose gravity moves deviations
    burns : changes of velocity [m/s] in those rtn axes
    updates : updates of guidance
    held_s : spans (leg, 2) [s] that are held by thrust
    control_m_s2 : function of instants (time,) [s] that returns the thrust there (time, 3) [m/s2] in the rtn axes
    thrusters, navigation : whose random errors disperse the flight
    least_m_s : a correction smaller than this is not made [m/s]
    chief_m : function of instants (time,) [s] that returns the position (time, 3) [m] of the body approached, inertial
        axes; a filter needs it, and errors of that body do
    """

    start_utc: datetime.datetime
    craft_m: Callable[[np.ndarray], np.ndarray]
    chief_axes: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    forces: Forces
    burns: tuple[PlannedImpulse, ...] = ()
    updates: tuple[GuidanceInstant, ...] = ()
    held_s: tuple[tuple[float, float], ...] = ()
    control_m_s2: Callable[[np.ndarray], np.ndarray] | None = None
    thrusters: Thrusters = field(default_factory=Thrusters)
    navigation: NavigationErrors | RelativeFilter = field(default_factory=NavigationErrors)
    least_m_s: float = 0.0
    chief_m: Callable[[np.ndarray], np.ndarray] | None = None

    def list_nodes_s(self, until_s: float, sample_s: np.ndarray) -> np.ndarray:
        """Return the instants (node,) [s] at which something happens or is sampled, from 0.

        Parameters
        ----------
        until_s : last instant [s]
        sample_s : (time,) instants of the samples [s]
        """
        ends = [edge for span in self.held_s for edge in span]
        events = [*(burn.time_s for burn in self.burns), *ends]
        events += [at_s for update in self.updates for at_s in (update.time_s, update.aim_s)]
        if isinstance(self.navigation, RelativeFilter):
            events += self.navigation.list_instants_s(0.0, until_s).tolist()
        inside = [at_s for at_s in events if 0.0 <= at_s <= until_s]
        nodes: np.ndarray = np.unique(np.concatenate([[0.0], inside, sample_s]))
        return nodes


def find_nominal_flight(
    body: Body, bodies: Sequence[Body], start_utc: datetime.datetime, chief: str, until_s: float
) -> NominalFlight:
    """Find the flight of a body without random errors, and the errors that disperse it.

    Parameters
    ----------
    chief : name of the body that is approached, whose rtn axes count
    until_s : last instant of interest [s]

    Raises
    ------
    ScenarioError
        If its guidance is an object of the user's, which is not known in all runs at once.
    """
    motion, plan, held = get_flown_motion(body), None, []
    commands: tuple[PlannedImpulse, ...] = ()
    updates: list[GuidanceInstant] = []
    forces, thrusters, least = Forces(), Thrusters(), 0.0
    navigation: NavigationErrors | RelativeFilter = NavigationErrors()
    if motion is not None:
        if motion.guidance is not None and not isinstance(motion.guidance, TwoImpulseGuidance):
            raise ScenarioError(
                'follower.motion.guidance: an object of your own cannot be dispersed; use type = "two_impulse"'
            )
        thrusters, navigation = motion.thrusters, motion.navigation
        exact = body.replace(motion=motion.without_random_errors())
        bodies = [exact if other is body else other for other in bodies]
        flight = find_flight(exact, bodies, start_utc)
        assert flight is not None
        plan, forces, commands = flight.plan, flight.settings.forces, flight.list_commands(until_s)
        if motion.guidance is not None:
            guidance, instants = motion.guidance, flight.list_updates_s(until_s)
            least = guidance.least_m_s
            updates = [
                GuidanceInstant(now_s, guidance.find_aim_s(plan, now_s, next_s))
                for now_s, next_s in itertools.pairwise((*instants, math.inf))
            ]
    elif (plan := find_plan(body, bodies, start_utc)) is not None:
        commands = tuple(impulse for impulse in plan.impulses if impulse.time_s <= until_s)
    if plan is not None:
        ends = [*(leg.begin_s for leg in plan.legs[1:]), math.inf]
        held = [
            (leg.begin_s, min(end_s, until_s))
            for leg, end_s in zip(plan.legs, ends, strict=True)
            if leg.acceleration_m_s2 is not None and leg.begin_s < min(end_s, until_s)
        ]

    def place(time_s: np.ndarray) -> np.ndarray:
        return Chief(bodies, body.name).states(Epochs(start_utc, time_s)).position_m

    def place_chief(time_s: np.ndarray) -> np.ndarray:
        return Chief(bodies, chief).states(Epochs(start_utc, time_s)).position_m

    def find_axes(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state = Chief(bodies, chief).states(Epochs(start_utc, time_s))
        return rtn_matrix(state.position_m, state.velocity_m_s)

    return NominalFlight(
        start_utc, place, find_axes, forces, commands, tuple(updates), tuple(held),
        plan.control_m_s2 if plan is not None and held else None, thrusters, navigation, least, place_chief,
    )  # fmt: skip
