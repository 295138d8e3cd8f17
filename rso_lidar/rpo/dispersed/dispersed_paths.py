"""Dispersions of a flight: by linear covariance, and by many runs with errors of their own.

Linear covariance follows Geller (J. Guid. Control Dyn. 29 (2006) 1404): the closed loop of guidance is part of it. Here each
source of error has a column, the deviation that one sigma of it causes, so that the shares of the sources are known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.rpo.dispersed.deviation_flow import DeviationFlow, Push
from rso_lidar.rpo.dispersed.nominal_flight import NominalFlight

SOURCES = ("start", "burns", "navigation")
TARGET = "target"  # a further source, where the body approached has errors of its own
_WEAK = 1e-3  # share of the strongest direction below which a component of the aim cannot be commanded
_TIE_S = 1e-6  # instants nearer than this are one
_INITIAL, _PER_BURN, _PER_UPDATE, _PER_LEG = 6, 8, 6, 4  # standard normal numbers


@dataclass(frozen=True, eq=False)
class LinearDispersion:
    """Linear covariance of a flight.

    Parameters
    ----------
    covariance : (time, 6, 6) of position [m] and velocity [m/s] in the rotating rtn axes of the body approached
    shares : by source, (time, 3) variance of the position that it causes [m2]
    """

    covariance: np.ndarray
    shares: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class DispersedPaths:
    """Flights with errors.

    Parameters
    ----------
    deviation_m : (run, time, 3) positions less the nominal ones [m], in the rtn axes of the body approached
    delta_v_m_s : (run,) what the flights commanded [m/s], thrust that holds a path left out
    """

    deviation_m: np.ndarray
    delta_v_m_s: np.ndarray


class Disperser:
    """A flight that is dispersed, from the errors of its start on.

    Parameters
    ----------
    flight : the flight without random errors
    sample_s : (time,) ascending instants at which deviations are wanted [s]
    covariance : (6, 6) of the state at the start in the rotating rtn axes [m2, m2/s, m2/s2]
    target_covariance : the same of the body approached, whose path then deviates too; None for none
    """

    def __init__(
        self,
        flight: NominalFlight,
        sample_s: np.ndarray,
        covariance: np.ndarray,
        target_covariance: np.ndarray | None = None,
    ) -> None:
        self.flight, self.sample_s = flight, sample_s
        node_s = flight.list_nodes_s(float(sample_s[-1]), sample_s)
        self.node_s = node_s[np.append(True, np.diff(node_s) > _TIE_S)]
        self._flow = DeviationFlow(self.node_s, flight.craft_m, flight.forces, flight.start_utc)
        self._axes, self._turn_rad_s = flight.chief_axes(self.node_s)
        self._sample = np.array([self._index(at_s) for at_s in sample_s])
        self._burns = [self._sum_burns(node) for node in range(len(self.node_s))]
        self._updates = {
            self._index(one.time_s): self._index(one.aim_s) for one in flight.updates if self._holds(one.aim_s)
        }
        self._root, self._target = _find_root(covariance), None
        if target_covariance is not None:
            assert flight.chief_m is not None
            self._target = DeviationFlow(self.node_s, flight.chief_m, flight.forces, flight.start_utc)
            self._target_root = _find_root(target_covariance)
        self._transition = [self._flow.transition(node) for node in range(len(self.node_s) - 1)]
        self._gains = {now: self._find_gain(now, aim) for now, aim in self._updates.items()}
        due = set(self._updates.values())
        self._burning = [
            k for k in range(len(self.node_s)) if self._burns[k] is not None or k in self._updates or k in due
        ]
        self._legs = [k for k, span in enumerate(flight.held_s) if span[0] < self.node_s[-1]]
        self._prepare_held_thrust()

    @property
    def n_numbers(self) -> int:
        """How many standard normal numbers a run takes."""
        own = _INITIAL + _PER_LEG * len(self._legs) + _PER_BURN * len(self._burning) + _PER_UPDATE * len(self._updates)
        return own if self._target is None else own + _INITIAL

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources of errors."""
        return SOURCES if self._target is None else (*SOURCES, TARGET)

    # ------------------------------------------------------------------------------------------------- linear

    def find_linear(self) -> LinearDispersion:
        """Return the linear covariance at the samples."""
        columns, pending = self._to_inertial(0, self._root), np.zeros((3, 6))
        labels = ["start"] * 6
        aim, kept = -1, {}
        of_legs = _PER_LEG * len(self._legs)
        labels += ["burns"] * of_legs
        columns, pending = _widen(columns, of_legs), _widen(pending, of_legs)
        beside = np.zeros_like(columns)  # deviations of the body approached
        if self._target is not None:
            columns, pending = _widen(columns, _INITIAL), _widen(pending, _INITIAL)
            beside = np.hstack([beside, self._to_inertial(0, self._target_root)])
            labels += [TARGET] * _INITIAL
        for node in range(len(self.node_s)):
            axes, change = self._axes[node], np.zeros_like(pending)
            if node in self._updates:
                known = np.hstack([columns - beside, self._to_inertial(node, self._navigation_root())])
                columns, pending = _widen(columns, 6), _widen(pending, 6)
                labels += ["navigation"] * 6
                velocity, arrival = self._gains[node]
                change, pending, aim = axes.T @ velocity @ known, arrival @ known, self._updates[node]
            elif node == aim:
                change, pending = axes.T @ pending, np.zeros_like(pending)
            if node in self._burning:
                columns[3:] += axes @ change
                errors = axes @ self._burn_root(self._burns[node], change)
                columns, pending = _widen(columns, 3), _widen(pending, 3)
                columns[3:, -3:] = errors
                labels += ["burns"] * 3
            beside = _widen(beside, columns.shape[1] - beside.shape[1])
            kept[node] = self._to_rotating(node, columns - beside)
            if node + 1 < len(self.node_s):
                columns = self._carry(node, columns)
                if self._target is not None:
                    beside = self._target.transition(node) @ beside
        chosen = np.array(labels)
        rows = [kept[node] for node in self._sample]
        made = np.stack([one @ one.T for one in rows])
        parts = {
            name: np.stack([np.sum(one[:3, chosen[: one.shape[1]] == name] ** 2, axis=1) for one in rows])
            for name in self.sources
        }
        return LinearDispersion(made, parts)

    def _carry(self, node: int, columns: np.ndarray) -> np.ndarray:
        """Return the columns of the linear covariance at the next node; those of held legs gain what thrust adds."""
        moved: np.ndarray = self._transition[node] @ columns
        if self._is_held(node):
            count = _PER_LEG * len(self._legs)
            moved[:, _INITIAL : _INITIAL + count] += self._flow.advance(
                node, np.zeros((6, count)), self._make_push(np.eye(count), node)
            )
        return moved

    def _navigation_root(self) -> np.ndarray:
        errors = self.flight.navigation
        root: np.ndarray = np.diag([errors.position_sigma_m] * 3 + [errors.velocity_sigma_m_s] * 3)
        return root

    def _burn_root(self, planned: np.ndarray | None, change: np.ndarray) -> np.ndarray:
        """Return a root (3, 3) of the covariance of a burn's errors [m2/s2], in rtn axes.

        Parameters
        ----------
        planned : (3,) the burn of the flight without errors [m/s], None for none
        change : (3, source) columns of what guidance adds [m/s]
        """
        thrusters = self.flight.thrusters
        mean = np.zeros(3) if planned is None else planned
        square = np.outer(mean, mean) + change @ change.T  # mean of the square of the command
        total = float(np.trace(square))
        along = square / total if total > 0.0 else np.zeros((3, 3))
        turned = total * np.eye(3) - square
        made = thrusters.magnitude_sigma_fraction**2 * square + (thrusters.pointing_sigma_deg * units.DEG) ** 2 * turned
        if total > 0.0:
            made += thrusters.magnitude_sigma_m_s**2 * along + thrusters.pointing_sigma_m_s**2 * (np.eye(3) - along)
        values, vectors = np.linalg.eigh(made)
        root: np.ndarray = vectors * np.sqrt(np.maximum(values, 0.0))
        return root

    # ------------------------------------------------------------------------------------------------- runs

    def fly(self, numbers: np.ndarray, *, without_burns: bool = False) -> DispersedPaths:
        """Fly many runs.

        Parameters
        ----------
        numbers : (run, number) standard normal numbers, `n_numbers` for each run
        without_burns : whether all burns, corrections and held thrust are missing
        """
        pieces = np.split(numbers.T, self._list_splits())
        drawn = iter(pieces)
        state = self._to_inertial(0, _apply(self._root, next(drawn)))
        held = next(drawn)
        n_runs = len(numbers)
        beside = np.zeros((6, n_runs))  # deviations of the body approached
        if self._target is not None:
            beside = self._to_inertial(0, _apply(self._target_root, pieces[-1]))
        pending, aim, spent = np.zeros((3, n_runs)), -1, np.zeros(n_runs)
        deviations = np.empty((len(self.sample_s), 3, n_runs))
        wanted: dict[int, list[int]] = {}
        for k, node in enumerate(self._sample.tolist()):
            wanted.setdefault(node, []).append(k)
        for node in range(len(self.node_s)):
            axes, change = self._axes[node], np.zeros((3, n_runs))
            if node in self._updates:
                noise = _apply(self._navigation_root(), next(drawn))
                if not without_burns:
                    known = state - beside + self._to_inertial(node, noise)
                    velocity, arrival = (_apply(gain, known) for gain in self._gains[node])
                    made = np.sqrt(np.sum(velocity**2, axis=0)) >= self.flight.least_m_s
                    change = np.where(made, _apply(axes.T, velocity), 0.0)
                    pending, aim = np.where(made, arrival, 0.0), self._updates[node]
            elif node == aim:
                change, pending = _apply(axes.T, pending), np.zeros((3, n_runs))
            if node in self._burning:
                errors = next(drawn)
                planned = self._burns[node]
                planned = np.zeros((3, 1)) if planned is None else planned[:, None]
                if without_burns:
                    carried = np.broadcast_to(-planned, (3, n_runs))
                else:
                    command = planned + change
                    spent += np.sqrt(np.sum(command**2, axis=0))
                    carried = self._carry_out(command, errors) - planned
                state[3:] += _apply(axes, carried)
            for k in wanted.get(node, ()):
                deviations[k] = _apply(axes.T, state[:3] - beside[:3])
            if node + 1 < len(self.node_s):
                push = None
                if self._is_held(node):
                    push = self._stop_thrust() if without_burns else self._make_push(held, node)
                state = self._flow.advance(node, state, push)
                if self._target is not None:
                    beside = self._target.advance(node, beside)
        return DispersedPaths(np.ascontiguousarray(deviations.transpose(2, 0, 1)), spent)

    def _carry_out(self, command: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return changes of velocity (3, run) [m/s] with the errors of Gates (1963), as `Thrusters.disturb` makes them.

        Parameters
        ----------
        command : (3, run) as commanded [m/s]
        numbers : (8, run) standard normal
        """
        errors = self.flight.thrusters
        size = np.sqrt(np.sum(command**2, axis=0))
        along = command / np.where(size > 0.0, size, 1.0)
        turn = errors.pointing_sigma_deg * units.DEG * numbers[1:4]
        angle = np.sqrt(np.sum(turn**2, axis=0))
        axis = turn / np.where(angle > 0.0, angle, 1.0)
        turned = (
            command * np.cos(angle)
            + np.cross(axis, command, axis=0) * np.sin(angle)
            + axis * np.sum(axis * command, axis=0) * (1.0 - np.cos(angle))
        )
        across = numbers[5:8] - along * np.sum(numbers[5:8] * along, axis=0)
        fixed = errors.magnitude_sigma_m_s * numbers[4] * along + errors.pointing_sigma_m_s * across
        done: np.ndarray = turned * (1.0 + errors.magnitude_sigma_fraction * numbers[0]) + np.where(
            size > 0.0, fixed, 0.0
        )
        return done

    def _list_splits(self) -> list[int]:
        """Return where the numbers of a run are divided: start, held legs, then node by node update and burn."""
        counts = [_INITIAL, _PER_LEG * len(self._legs)]
        for node in range(len(self.node_s)):
            counts += [_PER_UPDATE] * (node in self._updates) + [_PER_BURN] * (node in self._burning)
        if self._target is not None:
            counts.append(_INITIAL)
        return [int(place) for place in np.cumsum(counts)[:-1]]

    # ------------------------------------------------------------------------------------------------- parts of both

    def _index(self, at_s: float) -> int:
        return min(int(np.searchsorted(self.node_s, at_s - _TIE_S)), len(self.node_s) - 1)

    def _holds(self, at_s: float) -> bool:
        return bool(at_s <= self.node_s[-1] + _TIE_S)

    def _sum_burns(self, node: int) -> np.ndarray | None:
        at_s = self.node_s[node]
        here = [one.delta_v_m_s for one in self.flight.burns if abs(one.time_s - at_s) <= _TIE_S]
        return np.sum(here, axis=0) if here else None

    def _find_gain(self, now: int, aim: int) -> tuple[np.ndarray, np.ndarray]:
        """Return by what a known deviation is multiplied for the correction and for the one on arrival (3, 6) [m/s].

        Parameters
        ----------
        now, aim : nodes of the correction and of the arrival
        """
        through = np.eye(6)
        for node in range(now, aim):
            through = self._transition[node] @ through
        reach = through[:3, 3:]
        velocity = -np.linalg.pinv(reach, rcond=_WEAK) @ through[:3]
        arrival = -(through[3:] + through[3:, 3:] @ velocity)
        return velocity, arrival

    def _to_inertial(self, node: int, rotating: np.ndarray) -> np.ndarray:
        """Return states (6, n) in inertial axes from those in the rotating rtn axes of a node."""
        axes, turn = self._axes[node], self._turn_rad_s[node]
        moved = rotating[3:] + np.cross(turn[:, None], rotating[:3], axis=0)
        return np.concatenate([_apply(axes, rotating[:3]), _apply(axes, moved)])

    def _to_rotating(self, node: int, inertial: np.ndarray) -> np.ndarray:
        """Return states (6, n) in the rotating rtn axes of a node from those in inertial axes."""
        axes, turn = self._axes[node], self._turn_rad_s[node]
        position = _apply(axes.T, inertial[:3])
        velocity = _apply(axes.T, inertial[3:]) - np.cross(turn[:, None], position, axis=0)
        return np.concatenate([position, velocity])

    def _prepare_held_thrust(self) -> None:
        """Compute the thrust that holds legs at the stages of the integrator, in inertial axes."""
        self._thrust = np.zeros((0, 3))
        self._turned = np.zeros((0, 3, 3))
        if not self._legs or self.flight.control_m_s2 is None:
            return
        stage_s = self._flow.stage_s
        axes, _ = self.flight.chief_axes(stage_s)
        control = self.flight.control_m_s2(stage_s)
        self._thrust = np.einsum("tij,tj->ti", axes, control)
        x, y, z = control.T
        zero = np.zeros_like(x)
        crossed = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)  # p x a = crossed @ p
        self._turned = np.einsum("tij,tjk->tik", axes, crossed)

    def _is_held(self, node: int) -> bool:
        if not len(self._thrust):
            return False
        middle = 0.5 * (self.node_s[node] + self.node_s[node + 1])
        return any(begin <= middle < end for begin, end in self.flight.held_s)

    def _make_push(self, numbers: np.ndarray, node: int) -> Push:
        """Return the error of the thrust that holds the leg at a node: to first order, proportional and turned.

        Parameters
        ----------
        numbers : (4 x leg, n) standard normal
        node : at which the leg is held
        """
        errors = self.flight.thrusters
        middle = 0.5 * (self.node_s[node] + self.node_s[node + 1])
        place = next(k for k, leg in enumerate(self._legs) if _is_inside(self.flight.held_s[leg], middle))
        own = numbers[_PER_LEG * place : _PER_LEG * (place + 1)]
        size = errors.magnitude_sigma_fraction * own[0]
        turn = errors.pointing_sigma_deg * units.DEG * own[1:]
        return lambda stage: self._thrust[stage][:, None] * size + _apply(self._turned[stage], turn)

    def _stop_thrust(self) -> Push:
        return lambda stage: -self._thrust[stage][:, None]


def _apply(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the product of a matrix (m, k) and columns (k, n); a column has the same bits alone and among others."""
    made: np.ndarray = matrix[:, :1] * columns[0]
    for k in range(1, matrix.shape[1]):
        made = made + matrix[:, k : k + 1] * columns[k]
    return made


def _find_root(covariance: np.ndarray) -> np.ndarray:
    """Return a matrix (6, 6) whose product with its own transpose is a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    root: np.ndarray = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _is_inside(span: tuple[float, float], at_s: float) -> bool:
    return span[0] <= at_s < span[1]


def _widen(columns: np.ndarray, count: int) -> np.ndarray:
    """Return columns with as many more of zeros."""
    return np.hstack([columns, np.zeros((len(columns), count))])
