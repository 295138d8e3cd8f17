"""When another object is in the exhaust of a body of a scenario that follows a plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Chief, find_flight, find_plan, get_flown_motion
from rso_lidar.orbit import Epochs, Impulse, PairSamples, find_spans_below
from rso_lidar.pose import rotate_vectors
from rso_lidar.rpo import plume_margin, rtn_matrix
from rso_lidar.scenario import Scenario

IMPULSE_S = 1.0  # for how long an impulse counts as firing (assumed: plans do not say)
_PER_REVOLUTION = 360  # samples of held thrust
_LEAST_SAMPLES = 48


class PlanExhaust:
    """The impulses, burns and held thrust of a body's plan.

    Parameters
    ----------
    scenario, name : the scenario, and the body that follows the plan
    until_s : last instant of interest, from the scenario's start on [s]
    shift_s : start of the search, from the scenario's start on [s]
    """

    def __init__(self, scenario: Scenario, name: str, until_s: float, shift_s: float) -> None:
        self.start_utc, self._shift_s = scenario.time.start_utc, shift_s
        body = {body.name: body for body in scenario.bodies}[name]
        with scenario.locate_errors(f"{name}.motion"):
            plan = find_plan(body, scenario.bodies, self.start_utc)
            flight = find_flight(body, scenario.bodies, self.start_utc)
            maneuvers = () if flight is None else flight.list_maneuvers(until_s)
        if plan is None:
            raise ScenarioError(
                f"when: plume needs a plan, and {name} of {scenario.name} flies none; give it a motion that is a "
                "proximity operation, such as v_bar_approach or sequence"
            )
        motion: Any = body.motion
        operation = getattr(motion, "plan", None) if get_flown_motion(body) else motion
        # of a sequence, the only operation with limits of its own
        self.half_angle_deg: float | None = getattr(operation, "plume_half_angle_deg", None)
        self.range_m: float | None = getattr(operation, "plume_range_m", None)
        self._plan, self._chief = plan, Chief(scenario.bodies, motion.relative_to)
        # instants and pushes in the rtn axes of the body that is approached, of the plan or as they fly
        self._impulses: list[tuple[float, np.ndarray]] = []
        if flight is None:
            self._impulses += [
                (impulse.time_s, impulse.delta_v_m_s) for impulse in plan.impulses if impulse.time_s <= until_s
            ]
        self._thrusts = [
            (begin_s, end_s, plan.control_m_s2)
            for leg, begin_s, end_s in plan.stretches(until_s)
            if leg.acceleration_m_s2 is not None
        ]
        for maneuver in maneuvers:
            if isinstance(maneuver, Impulse):
                self._impulses.append((maneuver.at_s, np.array(maneuver.delta_v_m_s)))
            else:
                push = maneuver.acceleration_m_s2 or maneuver.thrust_n
                self._thrusts.append((maneuver.from_s, maneuver.until_s, partial(_repeat, np.array(push))))

    def find(
        self,
        sample: Callable[[np.ndarray], PairSamples],
        windows: Sequence[tuple[float, float]],
        half_angle_rad: float,
        range_m: float,
    ) -> list[tuple[float, float]]:
        """Find the spans in which the exhaust reaches an object, within windows or from an impulse before them [s].

        An impulse counts for `IMPULSE_S`, with the geometry at its instant; a burn as long as it lasts.

        Parameters
        ----------
        sample : ``sample(time_s) -> PairSamples`` of the body and the object, in seconds of the search
        windows : of the search [s]
        half_angle_rad, range_m : of the exhaust's cone
        """
        spans: list[tuple[float, float]] = []
        if self._impulses:
            time_s = np.array([at_s for at_s, _ in self._impulses]) - self._shift_s
            push = np.array([push for _, push in self._impulses])
            near = [any(begin - IMPULSE_S < at < end for begin, end in windows) for at in time_s]
            time_s, push = time_s[near], push[near]
            if len(time_s):
                hits = self._margin(sample, time_s, push, half_angle_rad, range_m) < 0.0
                spans += [(at, at + IMPULSE_S) for at in time_s[hits].tolist()]
        for first_s, last_s, control in self._thrusts:

            def margin(time_s: np.ndarray, control: Callable[[np.ndarray], np.ndarray] = control) -> np.ndarray:
                return self._margin(sample, time_s, control(time_s + self._shift_s), half_angle_rad, range_m)

            for begin, end in windows:
                low, high = max(begin, first_s - self._shift_s), min(end, last_s - self._shift_s)
                if high <= low:
                    continue
                # at the end of a stretch the plan is in the next one already
                inner = high - min(1e-6, 0.5 * (high - low))
                step_s = max(min(self._plan.revolution_s / _PER_REVOLUTION, (inner - low) / _LEAST_SAMPLES), 1e-3)
                below = find_spans_below(margin, low, inner, step_s)
                spans += [(max(from_s, low), high if to_s >= inner else to_s) for from_s, to_s in below]
        return sorted(spans)

    def _margin(
        self,
        sample: Callable[[np.ndarray], PairSamples],
        time_s: np.ndarray,
        push: np.ndarray,
        half_angle_rad: float,
        range_m: float,
    ) -> np.ndarray:
        """Compute how far the object is outside the exhaust (time,), as `plume_margin` does.

        Parameters
        ----------
        time_s : instants (time,) of the search [s]
        push : (time, 3) in the rtn axes of the body that is approached
        """
        chief = self._chief.states(Epochs(self.start_utc, time_s + self._shift_s))
        pushed = rotate_vectors(rtn_matrix(chief.position_m, chief.velocity_m_s)[0], push)
        return plume_margin(pushed, -sample(time_s).line_m, half_angle_rad, range_m)


def _repeat(push: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Return a push (3,) at each of some instants: (time, 3)."""
    return np.broadcast_to(push, (len(time_s), 3))
