"""Dispersions of a flight: by linear covariance, and by many runs with errors of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from rso_lidar import units
from rso_lidar.rpo import FilterBank, NavigationErrors, apply_matrix
from rso_lidar.study.dispersions.dispersed_flight import DispersedFlight
from rso_lidar.study.dispersions.linear_dispersion import LinearDispersion, find_linear_dispersion, list_sources

_Push = Callable[[int], np.ndarray]  # acceleration (3, run) [m/s2] at a stage of the integrator
_INITIAL, _PER_BURN, _PER_UPDATE, _PER_LEG = 6, 8, 6, 4  # standard normal numbers


@dataclass(frozen=True, eq=False)
class KnowledgePaths:
    """What the filters of flights know, in the rtn axes of the body approached.

    Parameters
    ----------
    error_m : (run, time, 3) estimated less true position [m]
    sigma_m : (run, time, 3) standard deviations that the filters state [m]
    nees : (run, time) normalised estimation error squared, of six degrees of freedom
    """

    error_m: np.ndarray
    sigma_m: np.ndarray
    nees: np.ndarray


@dataclass(frozen=True, eq=False)
class DispersedPaths:
    """Flights with errors.

    Parameters
    ----------
    deviation_m : (run, time, 3) positions less the nominal ones [m], in the rtn axes of the body approached
    delta_v_m_s : (run,) what the flights commanded [m/s], thrust that holds a path left out
    knowledge : what their filters know; None without a filter
    """

    deviation_m: np.ndarray
    delta_v_m_s: np.ndarray
    knowledge: KnowledgePaths | None = None


class Disperser:
    """Runs of a flight with errors, and their linear covariance.

    Parameters
    ----------
    nodes : of the flight, with the errors of its start
    """

    def __init__(self, nodes: DispersedFlight) -> None:
        self.nodes, self.flight, self.sample_s = nodes, nodes.flight, nodes.sample_s
        self._wanted: dict[int, list[int]] = {}
        for k, node in enumerate(self.nodes.sample.tolist()):
            self._wanted.setdefault(node, []).append(k)

    @property
    def n_numbers(self) -> int:
        """How many standard normal numbers a run takes."""
        return sum(self._list_counts())

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources of errors."""
        return list_sources(self.nodes)

    def find_linear(self) -> LinearDispersion:
        """Return the linear covariance at the samples."""
        return find_linear_dispersion(self.nodes)

    def fly(self, numbers: np.ndarray, *, without_burns: bool = False) -> DispersedPaths:
        """Fly many runs.

        Parameters
        ----------
        numbers : (run, number) standard normal numbers, `n_numbers` for each run
        without_burns : whether all burns, corrections and held thrust are missing; a filter then has no effect
        """
        at, n_runs = self.nodes, len(numbers)
        pieces = np.split(numbers.T, np.cumsum(self._list_counts())[:-1])
        drawn = iter(pieces)
        state, beside = at.spread_start(next(drawn), pieces[-1])  # of the craft, and of the body approached
        held, bank = next(drawn), None
        if at.filter is not None:
            bank = at.make_filters(state - beside, next(drawn))
        bank = None if without_burns else bank
        notes = _KnowledgeNotes(at, n_runs) if bank is not None else None
        pending, aim, spent = np.zeros((3, n_runs)), -1, np.zeros(n_runs)
        deviations = np.empty((len(self.sample_s), 3, n_runs))
        for node in range(at.last + 1):
            axes, change = at.axes[node], np.zeros((3, n_runs))
            if at.filter is not None and node in at.filter:
                measured = next(drawn)
                if bank is not None:
                    at.filter.observe(bank, node, state - beside, measured)
            if node in at.updates:
                known = self._find_known(node, state - beside, bank, drawn)
                if not without_burns:
                    velocity, arrival = (apply_matrix(gain, known) for gain in at.gains[node])
                    is_executed = np.sqrt(np.sum(velocity**2, axis=0)) >= self.flight.least_m_s
                    change = np.where(is_executed, apply_matrix(axes.T, velocity), 0.0)
                    pending, aim = np.where(is_executed, arrival, 0.0), at.updates[node]
            elif node == aim:
                change, pending = apply_matrix(axes.T, pending), np.zeros((3, n_runs))
            if node in at.burning:
                errors = next(drawn)
                planned = at.burns[node]
                planned = np.zeros((3, 1)) if planned is None else planned[:, None]
                if without_burns:
                    carried = np.broadcast_to(-planned, (3, n_runs))
                else:
                    command = planned + change
                    spent += np.sqrt(np.sum(command**2, axis=0))
                    carried = self._carry_out(command, errors) - planned
                    if bank is not None:
                        turned = apply_matrix(axes, command)
                        covariance = self.flight.thrusters.find_covariance(turned[:, None] * turned[None])
                        bank.add_burn(apply_matrix(axes, change), covariance)
                state[3:] += apply_matrix(axes, carried)
            for k in self._wanted.get(node, ()):
                deviations[k] = apply_matrix(axes.T, state[:3] - beside[:3])
                if notes is not None and bank is not None:
                    notes.write(k, node, state - beside, bank)
            if node < at.last:
                state = self._advance(node, state, bank, self._find_push(node, held, without_burns=without_burns))
                beside = at.carry_target(node, beside)
        paths = np.ascontiguousarray(deviations.transpose(2, 0, 1))
        return DispersedPaths(paths, spent, None if notes is None else notes.paths)

    def _find_known(
        self, node: int, state: np.ndarray, bank: FilterBank | None, drawn: Iterator[np.ndarray]
    ) -> np.ndarray:
        """Return the deviations (6, run) that guidance knows, of the true ones (6, run), inertial axes."""
        errors = self.flight.navigation
        if not isinstance(errors, NavigationErrors):
            return state if bank is None else bank.orbit
        noise = apply_matrix(np.diag(errors.sigma), next(drawn))
        known: np.ndarray = state + self.nodes.to_inertial(node, noise)
        return known

    def _find_push(self, node: int, held: np.ndarray, *, without_burns: bool) -> _Push | None:
        """Return the error of held thrust from a node to the next, from normal numbers (4 x leg, run)."""
        leg, thrust = self.nodes.find_leg(node), self.nodes.thrust
        if leg is None or thrust is None:
            return None
        return thrust.stop() if without_burns else thrust.make_push(held[_PER_LEG * leg : _PER_LEG * (leg + 1)])

    def _advance(self, node: int, state: np.ndarray, bank: FilterBank | None, push: _Push | None) -> np.ndarray:
        """Return true deviations (6, run) at the next node, and propagate the filters with them, in one integration."""
        if bank is None:
            return self.nodes.flow.advance(node, state, push)
        n_runs = state.shape[1]
        both = None
        if push is not None:
            still = np.zeros((3, n_runs))
            both = partial(_push_truth, push, still)
        moved = self.nodes.flow.advance(node, np.hstack([state, bank.orbit]), both)
        self.nodes.carry_filters(bank, node, moved[:, n_runs:])
        true: np.ndarray = moved[:, :n_runs]
        return true

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

    def _list_counts(self) -> list[int]:
        """Return how numbers are divided: start, held legs, filter, by node measurements, update, burn; last the target."""
        at = self.nodes
        counts = [_INITIAL, _PER_LEG * len(at.legs)] + [_INITIAL] * (at.filter is not None)
        states_errors = isinstance(self.flight.navigation, NavigationErrors)
        for node in range(len(at.node_s)):
            counts += [at.filter.per_instant] if at.filter is not None and node in at.filter else []
            counts += [_PER_UPDATE] * (states_errors and node in at.updates) + [_PER_BURN] * (node in at.burning)
        return counts + [_INITIAL] * (at.target_root is not None)


def _push_truth(push: _Push, still: np.ndarray, stage: int) -> np.ndarray:
    """Return the error of held thrust for true states, and none for estimates.

    Parameters
    ----------
    still : (3, run) zeros
    """
    return np.hstack([np.broadcast_to(push(stage), still.shape), still])


class _KnowledgeNotes:
    """What the filters of runs know at the samples, while the runs are flown.

    Parameters
    ----------
    at : the flight
    n_runs : number of runs
    """

    def __init__(self, at: DispersedFlight, n_runs: int) -> None:
        self.nodes = at
        shape = n_runs, len(at.sample_s)
        self.paths = KnowledgePaths(np.empty((*shape, 3)), np.empty((*shape, 3)), np.empty(shape))

    def write(self, sample: int, node: int, state: np.ndarray, bank: FilterBank) -> None:
        """Write the knowledge at a sample.

        Parameters
        ----------
        sample, node : indices of the sample and its node
        state : (6, run) true deviations, inertial axes
        """
        error = self.nodes.to_rotating(node, bank.orbit - state)
        covariance = bank.find_orbit_covariance(self.nodes.axes[node], self.nodes.turn_rad_s[node])
        self.paths.error_m[:, sample] = error[:3].T
        self.paths.sigma_m[:, sample] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)[:, :3])
        self.paths.nees[:, sample] = find_nees(error, covariance)


def find_nees(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the normalised estimation errors squared (run,); chi-square with six degrees of freedom if consistent.

    Parameters
    ----------
    error : (6, run) estimates less true states
    covariance : (run, 6, 6) of the filters, in the same axes
    """
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    unit = covariance / (scale[:, :, None] * scale[:, None, :])
    normal = error.T / scale
    nees: np.ndarray = np.sum(normal * np.linalg.solve(unit, normal[..., None])[..., 0], axis=1)
    return nees
