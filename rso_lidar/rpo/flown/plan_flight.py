"""The flight of a plan: its impulses and held legs carried out by thrusters, integrated under forces, and corrected."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from threading import RLock

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Burn, Epochs, Forces, Impulse, IntegratedOrbit
from rso_lidar.part import make_answer_error, to_real_array
from rso_lidar.records import BodyState
from rso_lidar.rpo.flown.filtered_flight import CarriedBurn, FilteredFlight, FilterEstimate
from rso_lidar.rpo.flown.guidance import Guidance, GuidanceUpdate, TwoImpulseGuidance, check_impulses
from rso_lidar.rpo.flown.held_thrust import HeldThrust, hold_legs
from rso_lidar.rpo.flown.thrusters import (
    IMPULSES,
    NAVIGATION,
    NavigationErrors,
    Thrusters,
    make_generator,
)
from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
from rso_lidar.rpo.plans.plan import Plan, PlannedImpulse
from rso_lidar.rpo.relative.reference_orbit import ReferenceOrbit

_MOST_UPDATES = 10_000


@dataclass(frozen=True)
class FlightSettings:
    """How a plan is flown: forces on the craft, thrusters, guidance, navigation, and the seed of their errors."""

    forces: Forces
    thrusters: Thrusters
    guidance: TwoImpulseGuidance | Guidance | None
    navigation: NavigationErrors | RelativeFilter
    seed: int


class PlanFlight:
    """A plan in flight. It is integrated as far as it is asked for, and always in the same pieces.

    Parameters
    ----------
    plan : the plan
    reference : orbit of the body that is approached
    settings : forces, thrusters, guidance and navigation
    start : inertial state (3,) of the craft at the start, before any impulse; None for that of the plan
    """

    def __init__(
        self, plan: Plan, reference: ReferenceOrbit, settings: FlightSettings, start: BodyState | None = None
    ) -> None:
        self.plan, self.reference, self.settings = plan, reference, settings
        if start is None:
            start = _place_on_plan(plan, reference)
        self._row = np.concatenate([start.position_m, start.velocity_m_s])
        self._pending = tuple(sorted(plan.impulses, key=_time_s))
        self._held = tuple(hold_legs(plan, settings.thrusters, settings.seed))
        self._burns: list[Impulse | Burn] = []  # carried out
        self._commands: list[PlannedImpulse] = []  # what was asked of them
        self._mass_kg = settings.thrusters.mass_kg or math.nan
        self._carried: list[CarriedBurn] = []  # in the last piece
        self._filter: FilteredFlight | None = None
        if isinstance(settings.navigation, RelativeFilter):
            craft = settings.forces, settings.thrusters, settings.seed
            self._filter = FilteredFlight(settings.navigation, self._held, reference, *craft)
        self._begins_s, self._orbits = list[float](), list[IntegratedOrbit]()
        self._updates_s: list[float] = []
        self._next_s = self._find_next_s(-1.0)
        self._lock = RLock()

    def relative(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the body's rotating rtn axes; at an impulse, those after it.

        Parameters
        ----------
        time_s : instants (time,) since the start of the plan [s]
        """
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        rows = np.empty((len(times), 6))
        with self._lock:
            self._reach(float(times.max(initial=0.0)))
            piece = np.maximum(np.searchsorted(self._begins_s, times, side="right") - 1, 0)
            for k in np.unique(piece):
                rows[piece == k] = self._orbits[k](times[piece == k])
        return self.reference.express(BodyState(rows[:, :3], rows[:, 3:]), Epochs(self.reference.start_utc, times))

    def breaks_s(self, until_s: float) -> np.ndarray:
        """Return the instants [s] at which velocity or acceleration is discontinuous.

        Parameters
        ----------
        until_s : last instant of interest [s]
        """
        edges = [edge for push in (*self.list_maneuvers(until_s), *self._held) for edge in push.edges_s]
        return np.unique([0.0, *(edge for edge in edges if edge <= until_s)])

    def list_maneuvers(self, until_s: float) -> tuple[Impulse | Burn, ...]:
        """Return the impulses and burns that begin by an instant, as they were carried out, without held legs.

        Parameters
        ----------
        until_s : the instant [s]
        """
        with self._lock:
            self._reach(until_s)
            return tuple(maneuver for maneuver in self._burns if maneuver.edges_s[0] <= until_s)

    def list_commands(self, until_s: float) -> tuple[PlannedImpulse, ...]:
        """Return the changes of velocity that the craft commanded up to an instant, those of corrections among them.

        Parameters
        ----------
        until_s : the instant [s]
        """
        with self._lock:
            self._reach(until_s)
            return tuple(command for command in self._commands if command.time_s <= until_s)

    def list_updates_s(self, until_s: float) -> tuple[float, ...]:
        """Return the instants of the updates of guidance up to an instant [s].

        Parameters
        ----------
        until_s : the instant [s]
        """
        with self._lock:
            self._reach(until_s)
            return tuple(at_s for at_s in self._updates_s if at_s <= until_s)

    def list_estimates(self, until_s: float) -> tuple[FilterEstimate, ...]:
        """Return what the navigation filter knew after each measurement, up to the last update of guidance by an instant.

        Parameters
        ----------
        until_s : the instant [s]
        """
        with self._lock:
            self._reach(until_s)
            known = () if self._filter is None else tuple(self._filter.estimates)
            return tuple(estimate for estimate in known if estimate.time_s <= until_s)

    def thrust_m_s2(self, time_s: np.ndarray) -> np.ndarray:
        """Return the acceleration (time, 3) by thrust [m/s2] in the chief's rtn axes; impulses are left out.

        Parameters
        ----------
        time_s : instants (time,) since the start of the plan [s]
        """
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        until_s = float(times.max(initial=0.0))
        total, axes = np.zeros((len(times), 3)), ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        for push in (*self.list_maneuvers(until_s), *self._held):
            if isinstance(push, Impulse):
                continue
            on = np.flatnonzero((times >= push.from_s) & (times < push.until_s))
            if isinstance(push, HeldThrust):
                total[on] += self.plan.control_m_s2(times[on]) @ push.factor.T
                continue
            for k in on:
                total[k] += push.acceleration(float(times[k]), *axes)
        return total

    @property
    def end_s(self) -> float:
        """Instant at which the plan ends, and a burn that has begun by then [s]."""
        planned_s = self.plan.duration_s
        burns = [maneuver for maneuver in self.list_maneuvers(planned_s) if isinstance(maneuver, Burn)]
        return max([planned_s, *(burn.until_s for burn in burns)])

    def find_miss_m(self) -> np.ndarray:
        """Return how far the craft is from the plan at `end_s` (3,) [m], in the chief's rtn axes."""
        end = np.array([self.end_s])
        miss: np.ndarray = self.relative(end)[0][0] - self.plan.relative(end)[0][0]
        return miss

    def describe(self) -> str:
        """Return the flight in lines of text: where it ends, and what it costs."""
        end_s, miss = self.end_s, self.find_miss_m()
        commands = self.list_commands(end_s)
        radial, along, cross = (f"{part:+.4g}" for part in miss)
        updates = sum(at_s <= end_s for at_s in self._updates_s)
        lines = [
            f"  flown     ends {float(np.linalg.norm(miss)):.4g} m off the plan at {end_s:.1f} s: "
            f"radial {radial}, along {along}, cross {cross} m",
            f"  commands  {len(commands)} impulses of {math.fsum(command.size_m_s for command in commands):.5f} m/s, "
            f"after {updates} updates of guidance; the plan {self.plan.impulsive_delta_v_m_s:.5f} m/s",
        ]
        if self._filter is not None and (known := self.list_estimates(end_s)):
            blind = sum(not estimate.sensors for estimate in known)
            sigma = ", ".join(f"{sigma_m:.2g}" for sigma_m in np.sqrt(np.diagonal(known[-1].covariance)[:3]))
            lines.append(
                f"  filter    {len(known)} instants of measurement, {blind} without a sensor; sigma of the position at "
                f"{known[-1].time_s:.0f} s: {sigma} m"
            )
        return "\n".join(lines)

    def _find_next_s(self, after_s: float) -> float:
        """Return the instant of the first update of guidance after an instant [s]; infinite if there is none."""
        guidance = self.settings.guidance
        if guidance is None:
            return math.inf
        next_s = to_real_array(guidance.next_s(after_s))
        if next_s is None or next_s.shape != () or not next_s > after_s:
            raise make_answer_error(guidance, "next_s", next_s, f"return a time after {after_s:g} s, or infinity")
        return max(float(next_s), 0.0)

    def _reach(self, until_s: float) -> None:
        """Make pieces until the last one holds an instant [s]."""
        while not self._orbits or self._next_s <= until_s:
            begin_s = 0.0
            if self._orbits:
                begin_s = self._next_s
                self._row = self._orbits[-1](np.array([begin_s]))[0]
                if self._filter is not None:
                    self._filter.follow(self._orbits[-1], self._begins_s[-1], begin_s, self._carried)
            if self._next_s <= begin_s:
                self._update(begin_s)
            self._begin_piece(begin_s)

    def _update(self, now_s: float) -> None:
        """Ask guidance for the impulses from now on."""
        guidance = self.settings.guidance
        assert guidance is not None
        if len(self._updates_s) >= _MOST_UPDATES:
            raise ScenarioError(
                f"guidance: more than {_MOST_UPDATES:,} updates by {now_s:g} s; leave more time between them"
            )
        position, velocity = self._know(now_s)
        self._updates_s.append(now_s)
        self._next_s = self._find_next_s(now_s)

        def predict(until_s: float, impulses: Sequence[PlannedImpulse]) -> tuple[np.ndarray, np.ndarray]:
            return self._predict(now_s, (position, velocity), until_s, impulses)

        update = GuidanceUpdate(now_s, position, velocity, self.plan, self._pending, self._next_s, predict)
        self._pending = check_impulses(guidance, guidance.replan(update), now_s)

    def _know(self, now_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the relative position [m] and velocity [m/s] (3,) as navigation knows them at an update."""
        if self._filter is not None:
            return self._filter.know(now_s, self._row)
        body = BodyState(self._row[None, :3], self._row[None, 3:])
        true = self.reference.express(body, Epochs(self.reference.start_utc, np.array([now_s])))
        draw = make_generator(self.settings.seed, NAVIGATION, len(self._updates_s))
        assert isinstance(self.settings.navigation, NavigationErrors)
        return self.settings.navigation.disturb((true[0][0], true[1][0]), draw)

    def _predict(
        self,
        now_s: float,
        state: tuple[np.ndarray, np.ndarray],
        until_s: float,
        impulses: Sequence[PlannedImpulse],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Propagate a relative state by the forces that guidance knows, with perfect thrust.

        Parameters
        ----------
        state : position [m] and velocity [m/s], each (3,), before impulses at this instant
        until_s : instant wanted [s]
        impulses : those on the way; one at `until_s` is not made
        """
        known: Forces | None = getattr(self.settings.guidance, "forces", None)
        reference, forces = self.reference, known or self.settings.forces
        if known is not None:
            chief = self.reference.states(Epochs(self.reference.start_utc, np.array([now_s])))
            place = tuple(chief.position_m[0].tolist()), tuple(chief.velocity_m_s[0].tolist())
            reference = ReferenceOrbit(reference.start_utc, *place, known, reference.maneuvers, now_s)
        now = [impulse.delta_v_m_s for impulse in impulses if impulse.time_s <= now_s]
        start = reference.place(state[0], np.sum([state[1], *now], axis=0), now_s)
        pushes: list[Impulse | HeldThrust] = [
            Impulse(at_s=impulse.time_s, delta_v_m_s=tuple(impulse.delta_v_m_s.tolist()), axes="chief_rtn")
            for impulse in impulses
            if now_s < impulse.time_s < until_s
        ]
        pushes += [HeldThrust(self.plan, leg.from_s, leg.until_s, np.eye(3), leg.number) for leg in self._held]
        row = _integrate(start, reference, forces, pushes, now_s)(np.array([until_s]))
        at = Epochs(reference.start_utc, np.array([until_s]))
        position, velocity = reference.express(BodyState(row[:, :3], row[:, 3:]), at)
        return position[0], velocity[0]

    def _begin_piece(self, begin_s: float) -> None:
        """Begin a piece of the flight, up to the next update: carry out the impulses that begin in it.

        An update that falls into a burn waits for its end: before, the velocity that is still to come is unknown.
        """
        thrusters, kept = self.settings.thrusters, list[PlannedImpulse]()
        self._carried.clear()
        ignitions = [
            max(impulse.time_s - 0.5 * thrusters.find_duration_s(impulse.size_m_s, self._mass_kg), begin_s)
            for impulse in self._pending
        ]
        for ignition_s, impulse in sorted(zip(ignitions, self._pending, strict=True), key=operator.itemgetter(0)):
            if ignition_s >= self._next_s:
                kept.append(impulse)
                continue
            draw = make_generator(self.settings.seed, IMPULSES, len(self._commands))
            done = thrusters.disturb(impulse.delta_v_m_s, draw)
            maneuver = thrusters.make_maneuver(ignition_s, done, self._mass_kg)
            self._commands.append(impulse)
            duration_s = thrusters.find_duration_s(float(np.linalg.norm(done)), self._mass_kg)
            self._carried.append(CarriedBurn(ignition_s + 0.5 * duration_s, impulse.delta_v_m_s, done))
            self._mass_kg = thrusters.spend(self._mass_kg, float(np.linalg.norm(done)))
            if maneuver is not None:
                self._burns.append(maneuver)
                self._next_s = max(self._next_s, maneuver.edges_s[-1])
        self._pending = tuple(kept)
        start = BodyState(self._row[:3], self._row[3:])
        pushes = (*self._burns, *self._held)
        self._begins_s.append(begin_s)
        self._orbits.append(_integrate(start, self.reference, self.settings.forces, pushes, begin_s))


def _integrate(
    start: BodyState,
    reference: ReferenceOrbit,
    forces: Forces,
    pushes: Sequence[Impulse | Burn | HeldThrust],
    begin_s: float,
) -> IntegratedOrbit:
    """Return the orbit of the craft from a state, with thrust in the axes of the reference.

    Parameters
    ----------
    start : inertial state (3,)
    reference : orbit of the body that is approached
    """
    place = tuple(start.position_m.tolist()), tuple(start.velocity_m_s.tolist())
    return IntegratedOrbit(*place, reference.start_utc, forces, tuple(pushes), reference.orbit, begin_s)


def _place_on_plan(plan: Plan, reference: ReferenceOrbit) -> BodyState:
    """Return the inertial state (3,) at the start of a plan, before its first impulses."""
    position, velocity = (rows[0] for rows in plan.relative(np.zeros(1)))
    jumps_m_s = [impulse.delta_v_m_s for impulse in plan.impulses if impulse.time_s <= 0.0]
    return reference.place(position, velocity - np.sum([np.zeros(3), *jumps_m_s], axis=0))


def _time_s(impulse: PlannedImpulse) -> float:
    return impulse.time_s
