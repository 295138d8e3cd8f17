"""Holds without continuous thrust: a perch on the V-bar, and station keeping by pulses."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Number, Positive, Vector
from rso_lidar.rpo.limits import MOST_PIECES, Duration
from rso_lidar.rpo.plans.operation import ProximityOperation
from rso_lidar.rpo.plans.plan import Plan, make_coast
from rso_lidar.rpo.plans.two_impulse import plan_arcs, solve_departure_m_s
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

_LONGEST_ARC = 0.45  # revolutions: below half of one, where every arc across the orbit still comes back
_TRIALS = 400  # durations of an arc before the longest is refined
_SAMPLES = 65  # of an arc


class Perch(ProximityOperation):
    """Rest on the V-bar in free flight, without end: the craft follows or leads the body on its orbit.

    Unlike `station_keeping`, no thrust holds it there against forces that the plan leaves out.
    """

    type: Literal["perch"] = "perch"
    along_track_m: Number = Field(description="Along-track position, ahead positive [m].")
    duration_s: Duration | None = Field(
        default=None,
        description=(
            "Time over which totals are counted [s]; the rest continues. If omitted, one revolution of the body."
        ),
    )

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        leg = make_coast(0.0, np.array([0.0, self.along_track_m, 0.0]), np.zeros(3), mean_motion_rad_s)
        return Plan(self.name, mean_motion_rad_s, self.duration_s or math.tau / mean_motion_rad_s, (leg,))


class PulsedStationKeeping(ProximityOperation):
    """A position kept by pulses, from rest to rest: between them the craft leaves it by `arc_m` at most and comes back.

    Arcs are as long as that allows, and of equal durations. As they become short, delta-v tends to that of
    `station_keeping`. After `duration_s` the position is held by thrust.
    """

    type: Literal["pulsed_station_keeping"] = "pulsed_station_keeping"
    position_m: Vector = Field(description="Position that is kept, in the body's rtn axes [m].")
    arc_m: Positive = Field(description="Greatest distance from that position between two pulses [m].")
    duration_s: Duration | None = Field(
        default=None, description="Duration of the whole [s]. If omitted, one revolution of the body."
    )

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n, place = mean_motion_rad_s, np.array(self.position_m)
        duration_s = self.duration_s or math.tau / n
        arcs = math.ceil(duration_s / self._find_longest_arc_s(n) * (1.0 - 1e-12))
        if arcs > MOST_PIECES:
            raise ScenarioError(
                f"arc_m: {duration_s:.1f} s take {arcs} arcs of at most {self.arc_m:g} m, and a plan has at most "
                f"{MOST_PIECES}; give a larger arc_m or a shorter duration_s"
            )
        times_s = np.linspace(0.0, duration_s, arcs + 1)
        return plan_arcs(self.name, n, times_s, np.broadcast_to(place, (arcs + 1, 3)), stop=True)

    def _find_longest_arc_s(self, n: float) -> float:
        """Return the longest duration [s] of an arc that stays within `arc_m`, at a mean motion [rad/s]."""
        longest_s = _LONGEST_ARC * math.tau / n
        trials_s = longest_s * np.arange(1, _TRIALS + 1) / _TRIALS
        beyond = [k for k, trial_s in enumerate(trials_s) if self._find_excursion_m(n, float(trial_s)) > self.arc_m]
        if not beyond:
            return longest_s
        high_s = float(trials_s[beyond[0]])
        low_s = high_s - longest_s / _TRIALS
        while low_s < (middle_s := 0.5 * (low_s + high_s)) < high_s:
            if self._find_excursion_m(n, middle_s) > self.arc_m:
                high_s = middle_s
            else:
                low_s = middle_s
        return max(low_s, high_s * 1e-6)

    def _find_excursion_m(self, n: float, duration_s: float) -> float:
        """Return the greatest distance [m] from the position during an arc of some duration [s]."""
        place = np.array(self.position_m)
        departure = solve_departure_m_s(place, place, duration_s, n)
        away = clohessy_wiltshire(place, departure, np.linspace(0.0, duration_s, _SAMPLES), n)[0] - place
        return float(np.sqrt(np.sum(away * away, axis=1)).max())
