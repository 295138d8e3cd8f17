"""Plans of proximity operations: legs of free flight or forced motion, the impulses between them, and their costs.

Everything is in the rotating rtn axes of the body that is approached. Free flight follows Clohessy and Wiltshire's
equations. So does the acceleration a_control that a given path requires: x'' - 3 n^2 x - 2 n y', y'' + 2 n x', z'' +
n^2 z (Hill's equations; Fehse, Automated Rendezvous and Docking of Spacecraft, ch. 3 and app. A, with his axes turned
into ours).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rso_lidar import units
from rso_lidar.rpo.limits import check_horizon
from rso_lidar.rpo.plans.minimum_distance import find_closest_approach
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
SAFE_REVOLUTIONS = 2.0  # free drift after thrust stops, without a given horizon
_PER_REVOLUTION = 360  # samples of a path before the least distance is refined
_FINE_REVOLUTIONS = 100.0  # a path is sampled this finely up to here; the rest gets as many samples in all
_FAILURES = 121  # instants along a forced leg at which its thrust may stop
_FINE_DRIFT = 10.0  # the same for the drifts from these instants
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_PANELS = 32


@dataclass(frozen=True, eq=False)
class PlannedImpulse:
    """A change of velocity (3) [m/s], rtn axes, at `time_s`."""

    time_s: float
    delta_v_m_s: np.ndarray

    @property
    def size_m_s(self) -> float:
        """Return how large it is [m/s]."""
        return float(np.linalg.norm(self.delta_v_m_s))


@dataclass(frozen=True, eq=False)
class Leg:
    """One stretch of a plan, until the next begins.

    Parameters
    ----------
    begin_s : begin of the leg since the start of the plan [s]
    path : function of time since `begin_s` (time,) [s] that returns position [m] and velocity [m/s] (time, 3)
    acceleration_m_s2 : the path's own acceleration in the rotating axes (time, 3), where thrust holds it; None in free
        flight
    """

    begin_s: float
    path: Path
    acceleration_m_s2: Callable[[np.ndarray], np.ndarray] | None = None


def make_coast(begin_s: float, position_m: np.ndarray, velocity_m_s: np.ndarray, mean_motion_rad_s: float) -> Leg:
    """Return a leg of free flight, from its state (3,) at the begin."""
    start = np.array(position_m, dtype=float), np.array(velocity_m_s, dtype=float)
    return Leg(begin_s, lambda time_s: clohessy_wiltshire(*start, time_s, mean_motion_rad_s))


def make_line(begin_s: float, position_m: np.ndarray, velocity_m_s: np.ndarray | None = None) -> Leg:
    """Return a leg held to a straight line at a constant velocity, or to a point.

    Parameters
    ----------
    position_m : (3,) position at its begin [m]
    velocity_m_s : (3,) [m/s]; None holds the position
    """
    start = np.array(position_m, dtype=float)
    speed = np.zeros(3) if velocity_m_s is None else np.array(velocity_m_s, dtype=float)

    def path(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return start + speed * time_s[:, None], np.broadcast_to(speed, (len(time_s), 3)).copy()

    return Leg(begin_s, path, lambda time_s: np.zeros((len(time_s), 3)))


@dataclass(frozen=True, eq=False)
class PassiveSafety:
    """The least distance to the body if thrust stops for good at the worst instant.

    Parameters
    ----------
    distance_m : least distance [m]
    failure_s : instant at which thrust stops [s]
    nearest_s : instant of the least distance [s]
    horizon_s : for how long the drift is followed [s]
    """

    distance_m: float
    failure_s: float
    nearest_s: float
    horizon_s: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Legs in order, the first from time 0 and the last without end, and the impulses that join them.

    Parameters
    ----------
    name : name of the operation
    mean_motion_rad_s : mean motion of the body that is approached [rad/s]
    duration_s : time over which totals are counted [s]: to the end of the operation, or one turn of an endless one
    legs : the legs
    impulses : the impulses
    adrift : path if the first impulse fails; None for Clohessy-Wiltshire's
    """

    name: str
    mean_motion_rad_s: float
    duration_s: float
    legs: tuple[Leg, ...]
    impulses: tuple[PlannedImpulse, ...] = ()
    adrift: Path | None = None
    _begins: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_begins", np.array([leg.begin_s for leg in self.legs]))

    def relative(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in rtn axes; at an impulse, those after it.

        Parameters
        ----------
        time_s : instants (time,) since the start of the plan [s]
        """
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        position, velocity = np.empty((len(times), 3)), np.empty((len(times), 3))
        leg = np.maximum(np.searchsorted(self._begins, times, side="right") - 1, 0)
        for k in np.unique(leg):
            of = leg == k
            position[of], velocity[of] = self.legs[k].path(times[of] - self._begins[k])
        return position, velocity

    @property
    def revolution_s(self) -> float:
        """Period of the body that is approached [s]."""
        return math.tau / self.mean_motion_rad_s

    def control_m_s2(self, time_s: np.ndarray) -> np.ndarray:
        """Return the acceleration (time, 3) [m/s2] by which thrust holds the path, in rtn axes; zero in free flight.

        Parameters
        ----------
        time_s : instants (time,) since the start of the plan [s]
        """
        times = np.atleast_1d(np.asarray(time_s, dtype=float))
        n, leg = self.mean_motion_rad_s, np.maximum(np.searchsorted(self._begins, times, side="right") - 1, 0)
        control = np.zeros((len(times), 3))
        for k in np.unique(leg):
            held = self.legs[k].acceleration_m_s2
            if held is not None:
                since = times[leg == k] - self._begins[k]
                (x, _, z), (u, v, _) = (values.T for values in self.legs[k].path(since))
                pull = np.stack([3.0 * n * n * x + 2.0 * n * v, -2.0 * n * u, -n * n * z], axis=1)
                control[leg == k] = held(since) - pull
        return control

    @property
    def thrust(self) -> tuple[tuple[float, float, float], ...]:
        """Intervals of continuous thrust up to `duration_s`: begin [s], end [s], delta-v [m/s]."""
        return tuple(
            (begin_s, end_s, self.continuous_between_m_s(begin_s, end_s))
            for leg, begin_s, end_s in self.stretches()
            if leg.acceleration_m_s2 is not None and end_s > begin_s
        )

    @property
    def impulsive_delta_v_m_s(self) -> float:
        """Sum of the impulses [m/s]."""
        return math.fsum(impulse.size_m_s for impulse in self.impulses)

    @property
    def continuous_delta_v_m_s(self) -> float:
        """Delta-v of continuous thrust up to `duration_s` [m/s]: the integral of |a_control|."""
        return math.fsum(cost for _, _, cost in self.thrust)

    @property
    def delta_v_m_s(self) -> float:
        """Total delta-v up to `duration_s` [m/s], impulses and continuous thrust."""
        return self.impulsive_delta_v_m_s + self.continuous_delta_v_m_s

    def nearest(self) -> tuple[float, float]:
        """Return the least distance [m] to the body on the planned path up to `duration_s`, and when it occurs [s].

        A leg is sampled 360 times a revolution for 100 revolutions, and 36 000 times over the rest, and refined about
        the 64 nearest samples. Between later samples a lower point may be missed, by half the distance that the path
        moves in a step.
        """
        return min(
            find_closest_approach(leg.path, begin_s, *span)
            for leg, begin_s, end_s in self.stretches()
            for span in self._spans(end_s - begin_s, _FINE_REVOLUTIONS)
        )

    def free_s(self, time_s: np.ndarray) -> float:
        """Return the time of free flight from time 0 to the last of these instants, or back to the first [s].

        Parameters
        ----------
        time_s : instants (time,) since the start of the plan [s]
        """
        last_s, first_s = float(np.max(time_s, initial=0.0)), float(np.min(time_s, initial=0.0))
        ends = [*self._begins[1:].tolist(), math.inf]
        free = [(leg, end_s) for leg, end_s in zip(self.legs, ends, strict=True) if leg.acceleration_m_s2 is None]
        ahead_s = math.fsum(max(0.0, min(end_s, last_s) - leg.begin_s) for leg, end_s in free)
        return max(ahead_s, -first_s if self.legs[0].acceleration_m_s2 is None else 0.0)

    @property
    def nearest_m(self) -> float:
        """Least distance [m] to the body on the planned path, up to `duration_s`."""
        return self.nearest()[0]

    def passive_safety_m(self, horizon_s: float | None = None) -> float:
        """Return the least distance to the body if thrust stops for good at any instant [m]; see `passive_safety`.

        Parameters
        ----------
        horizon_s : time for which the drift after the failure is followed [s]; None for two revolutions of the body
        """
        return self.passive_safety(horizon_s).distance_m

    def passive_safety(self, horizon_s: float | None = None) -> PassiveSafety:
        """Return how near free drift leads if thrust stops for good at the worst instant up to `duration_s`.

        Any impulse may fail, with all after it; thrust along a path may stop at any instant. The drift follows
        Clohessy-Wiltshire's equations (a free leg its own path) and is sampled as `nearest` samples legs. On a forced
        leg, the worst instant is searched for among 121, with refinement. Drifts are sampled 360 times a revolution for
        ten revolutions, and 3600 times over the rest: a brief approach later on may be missed.

        Parameters
        ----------
        horizon_s : how long after the failure the drift is followed [s]; two revolutions of the body if left out
        """
        horizon = SAFE_REVOLUTIONS * self.revolution_s if horizon_s is None else check_horizon(horizon_s)
        drifts: list[tuple[float, float, float]] = []  # distance, failure, nearest
        first = self.impulses[0] if self.impulses else None
        if first is not None and first.time_s <= 0.0:  # the first impulse fails
            position, velocity = self.relative(np.zeros(1))
            before = make_coast(0.0, position[0], velocity[0] - first.delta_v_m_s, self.mean_motion_rad_s).path
            drifts.append(self._find_nearest_adrift(self.adrift or before, 0.0, 0.0, horizon))
        for leg, begin_s, end_s in self.stretches():
            if leg.acceleration_m_s2 is None:  # the impulse that ends it fails, and it continues
                drifts.append(self._find_nearest_adrift(leg.path, begin_s, end_s - begin_s, end_s - begin_s + horizon))
                continue
            spans = self._spans(horizon, _FINE_DRIFT)
            drifts += [self._worst_stop(leg, begin_s, end_s - begin_s, span) for span in spans]
        return PassiveSafety(*min(drifts), horizon)

    def _find_nearest_adrift(
        self, path: Path, begin_s: float, failure_s: float, until_s: float
    ) -> tuple[float, float, float]:
        """Find the closest approach of a drift after a failure: distance [m], instant of the failure, and its own [s]."""
        spans = self._spans(until_s, _FINE_REVOLUTIONS)
        distance, nearest_s = min(find_closest_approach(path, begin_s, *span) for span in spans)
        return distance, begin_s + failure_s, nearest_s

    def _worst_stop(
        self, leg: Leg, begin_s: float, length_s: float, span: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        """Find the worst instant at which thrust may stop along a forced leg: distance, failure and nearest approach.

        Parameters
        ----------
        span : from, to and step of the samples of the drift [s]
        """
        n, (from_s, to_s, step_s) = self.mean_motion_rad_s, span
        low, high, best = 0.0, length_s, (math.inf, 0.0, 0.0)
        for _ in range(8):  # refine the instant of the failure
            stops = np.linspace(low, high, _FAILURES)
            position, velocity = leg.path(stops)
            if np.all(position == position[0]) and np.all(velocity == velocity[0]):  # it holds its position
                stops, position, velocity = stops[:1], position[:1], velocity[:1]
            drift = np.arange(from_s, to_s + step_s, step_s)
            away = clohessy_wiltshire(position[:, None], velocity[:, None], drift, n)[0]
            nearest = np.sqrt(np.min(np.sum(away * away, axis=-1), axis=1))
            worst = np.unique(np.argsort(nearest, kind="stable")[:5])
            for k in worst:
                freely = make_coast(begin_s + stops[k], position[k], velocity[k], n)
                distance, nearest_s = find_closest_approach(freely.path, freely.begin_s, *span)
                best = min(best, (distance, begin_s + stops[k], nearest_s))
            width = (high - low) / (_FAILURES - 1)
            centre = best[1] - begin_s
            low, high = max(0.0, centre - 2.0 * width), min(length_s, centre + 2.0 * width)
            if width < 1e-3 or len(stops) == 1:
                break
        return best

    def stretches(self, until_s: float | None = None) -> list[tuple[Leg, float, float]]:
        """Return each leg that begins by an instant, with its begin and end [s].

        Parameters
        ----------
        until_s : the instant since the start of the plan [s]; `duration_s` if left out
        """
        last_s, ends = self.duration_s if until_s is None else until_s, [*self._begins[1:], math.inf]
        return [
            (leg, leg.begin_s, min(float(end_s), last_s))
            for leg, end_s in zip(self.legs, ends, strict=True)
            if leg.begin_s <= last_s
        ]

    def _spans(self, until_s: float, fine_revolutions: float) -> list[tuple[float, float, float]]:
        """Return from, to and step [s] of the samples of a duration: fine at first, then as many again over the rest."""
        fine_s, step_s = fine_revolutions * self.revolution_s, self.revolution_s / _PER_REVOLUTION
        spans = [(0.0, min(until_s, fine_s), min(step_s, max(until_s, 1e-6) / 48.0))]
        if until_s > fine_s:
            later_s = max(step_s, (until_s - fine_s) / (fine_revolutions * _PER_REVOLUTION))
            spans.append((fine_s, until_s, later_s))
        return spans

    def continuous_between_m_s(self, begin_s: float, end_s: float) -> float:
        """Return the integral of |a_control| between two instants [m/s], by Gauss-Legendre quadrature in panels.

        Parameters
        ----------
        begin_s, end_s : the two instants [s]
        """
        edges = np.linspace(begin_s, end_s, _PANELS + 1)
        half = 0.5 * np.diff(edges)
        times = (edges[:-1] + half)[:, None] + half[:, None] * _NODES
        control = self.control_m_s2(times.ravel())
        size = np.sqrt(np.sum(control * control, axis=1)).reshape(times.shape)
        return float(np.sum(half[:, None] * _WEIGHTS * size))

    def table(self) -> tuple[tuple[str, ...], ...]:
        """Return the maneuvers as rows of text under a heading: time, kind, delta-v in r, t and n, and its magnitude."""
        rows: list[tuple[float, tuple[str, ...]]] = []
        for impulse in self.impulses:
            parts = (*impulse.delta_v_m_s, impulse.size_m_s)
            rows.append((impulse.time_s, (f"{impulse.time_s:.1f}", "impulse", *(f"{part:+.5f}" for part in parts[:3]))))
            rows[-1] = (impulse.time_s, (*rows[-1][1], f"{parts[3]:.5f}"))
        for begin_s, end_s, cost_m_s in self.thrust:
            rows.append((begin_s, (f"{begin_s:.1f} to {end_s:.1f}", "thrust", "", "", "", f"{cost_m_s:.5f}")))
        heading = ("time_s", "what", "radial_m_s", "along_m_s", "cross_m_s", "delta_v_m_s")
        return (heading, *(row for _, row in sorted(rows, key=lambda pair: pair[0])))

    def describe(self) -> str:
        """Return the plan as lines of text: maneuvers, totals, least distance as planned, and passive safety."""
        rows = self.table()
        lines = [f"{self.name}: {self.duration_s:.1f} s, {self.duration_s / self.revolution_s:.3f} revolutions"]
        if len(rows) > 1:
            lines += format_rows(rows)
        nearest_m, at_s = self.nearest()
        safety, free = self.passive_safety(), len(rows) == 1
        lines += [
            f"  delta-v {self.delta_v_m_s:.5f} m/s (impulses {self.impulsive_delta_v_m_s:.5f}, "
            f"continuous {self.continuous_delta_v_m_s:.5f})",
            f"  nearest as planned {format_length(nearest_m)}, at {at_s:.1f} s",
            f"  passive safety {format_length(safety.distance_m)}, at {safety.nearest_s:.1f} s, "
            + f"within {safety.horizon_s:.0f} s "
            + (
                "of free drift after the plan" if free else f"of free drift if thrust stops at {safety.failure_s:.1f} s"
            ),
        ]
        return "\n".join(lines)


def format_rows(rows: tuple[tuple[str, ...], ...]) -> list[str]:
    """Return rows of words as indented lines of columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  " + "  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]


def format_length(length_m: float) -> str:
    """Format a length, in metres or from 10 km on in kilometres."""
    return f"{length_m:.2f} m" if length_m < 10.0 * units.KM else f"{length_m / units.KM:.3f} km"
