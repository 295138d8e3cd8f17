"""The navigation filter of one flight: what it measures along the path that was flown, and what it then knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.orbit import Epochs, Forces, IntegratedOrbit, rtn_matrix, state_matrix
from rso_lidar.records import BodyState
from rso_lidar.rpo.flown.held_thrust import HeldThrust, HeldThrustErrors
from rso_lidar.rpo.flown.thrusters import HELD_LEGS, MEASUREMENTS, Thrusters, make_generator
from rso_lidar.rpo.navigation.filter_bank import ORBIT_STATES, THRUST_STATES, FilterBank, apply_matrix
from rso_lidar.rpo.navigation.navigation_sensors import find_clear_views
from rso_lidar.rpo.navigation.relative_filter import RelativeFilter
from rso_lidar.rpo.relative.deviation_flow import DeviationFlow, Path
from rso_lidar.rpo.relative.reference_orbit import ReferenceOrbit


@dataclass(frozen=True, eq=False)
class CarriedBurn:
    """A burn as it was commanded and as it was carried out.

    Parameters
    ----------
    middle_s : instant at which half of it is done [s]
    command_m_s, done_m_s : (3,) changes of velocity in the rtn axes of the body that is approached [m/s]
    """

    middle_s: float
    command_m_s: np.ndarray
    done_m_s: np.ndarray


@dataclass(frozen=True, eq=False)
class FilterEstimate:
    """What the navigation filter of a flight knows after the measurements of an instant.

    Parameters
    ----------
    time_s : the instant since the start of the plan [s]
    position_m, velocity_m_s : (3,) estimates in the rotating rtn axes of the body that is approached [m], [m/s]
    covariance : (6, 6) of their errors, as the filter states it
    sensors : indices of the sensors that measured
    """

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance: np.ndarray
    sensors: tuple[int, ...]


class FilteredFlight:
    """The filter of one flight. It follows the path that was flown, piece by piece.

    The deviation of its estimate from that path is propagated, so the forces of the flight are those of the filter.

    Parameters
    ----------
    part : the filter
    held : thrust that holds legs, with its true errors
    reference : orbit of the body that is approached
    forces : on the craft
    thrusters : whose errors the filter knows by their standard deviations
    seed : of the flight
    """

    def __init__(
        self,
        part: RelativeFilter,
        held: Sequence[HeldThrust],
        reference: ReferenceOrbit,
        forces: Forces,
        thrusters: Thrusters,
        seed: int,
    ) -> None:
        self._part, self._held, self._reference, self._forces = part, held, reference, forces
        self._thrusters, self._seed = thrusters, seed
        axes, turn = self._find_axes(np.zeros(1))
        root = state_matrix(axes[0], turn[0]) * part.start_sigma
        numbers = make_generator(seed, MEASUREMENTS, 0).standard_normal((ORBIT_STATES, 1))
        errors = thrusters.magnitude_sigma_fraction > 0.0 or thrusters.pointing_sigma_deg > 0.0
        self._has_thrust = bool(held) and errors
        self._bank = FilterBank(apply_matrix(root, numbers), root @ root.T, has_thrust=self._has_thrust)
        self._true_thrust = np.zeros((THRUST_STATES, 1))
        self.estimates: list[FilterEstimate] = []

    def know(self, now_s: float, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the position [m] and velocity [m/s] (3,) that the filter knows, in rtn axes.

        Parameters
        ----------
        now_s : instant up to which it has followed the path [s]
        row : (6,) true inertial state [m], [m/s]
        """
        known = row[None] + self._bank.orbit.T
        at = Epochs(self._reference.start_utc, np.array([now_s]))
        position, velocity = self._reference.express(BodyState(known[:, :3], known[:, 3:]), at)
        return position[0], velocity[0]

    def follow(self, orbit: IntegratedOrbit, begin_s: float, now_s: float, burns: Sequence[CarriedBurn]) -> None:
        """Follow a piece of the path that was flown: propagate the estimate along it, and measure."""
        instants = self._part.list_instants_s(begin_s, now_s)
        edges = [edge for leg in self._held for edge in leg.edges_s if begin_s < edge < now_s]
        middles = [burn.middle_s for burn in burns]
        nodes = np.unique(np.concatenate([[begin_s, now_s], instants, edges, middles]))
        nodes = nodes[np.append(True, np.diff(nodes) > DeviationFlow.TIE_S)]
        if len(nodes) < 2:
            return
        path: Path = lambda time_s: orbit(time_s)[:, :3]  # noqa: E731
        flow = DeviationFlow(nodes, path, self._forces, self._reference.start_utc)
        epochs = Epochs(self._reference.start_utc, nodes)
        chief = self._reference.states(epochs)
        rows = orbit(nodes)
        away_m = rows[:, :3] - chief.position_m
        clear = find_clear_views(self._part.sensors, epochs, chief.position_m, rows[:, :3])
        axes, _ = self._find_axes(nodes)
        legs = [leg for leg in self._held if self._has_thrust and leg.from_s < now_s and leg.until_s > begin_s]
        held = [(leg, self._find_errors(leg, flow.stage_s)) for leg in legs]
        for k in range(len(nodes) - 1):
            for burn in burns:
                if abs(burn.middle_s - nodes[k]) <= DeviationFlow.TIE_S:
                    self._add_burn(burn, axes[k])
            self._step(flow, k, held)
            if np.any(np.abs(instants - nodes[k + 1]) <= DeviationFlow.TIE_S):
                self._measure(float(nodes[k + 1]), rows[k + 1], away_m[k + 1], clear[k + 1])

    def _find_axes(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rtn axes of the body as columns (time, 3, 3) in inertial axes, and their angular velocity there."""
        state = self._reference.states(Epochs(self._reference.start_utc, time_s))
        return rtn_matrix(state.position_m, state.velocity_m_s)

    def _add_burn(self, burn: CarriedBurn, axes: np.ndarray) -> None:
        """Add a burn in rtn axes (columns): the estimate gains what was commanded, the path what was carried out."""
        expected = self._thrusters.mean_factor @ burn.command_m_s
        inside = axes @ burn.command_m_s
        covariance = self._thrusters.find_covariance(np.outer(inside, inside))
        self._bank.add_burn((axes @ (expected - burn.done_m_s))[:, None], covariance[:, :, None])

    def _step(self, flow: DeviationFlow, node: int, held: Sequence[tuple[HeldThrust, HeldThrustErrors]]) -> None:
        """Propagate the estimate to the next node."""
        begin_s, end_s = float(flow.node_s[node]), float(flow.node_s[node + 1])
        thrust = None
        for leg, errors in held:
            if leg.from_s <= 0.5 * (begin_s + end_s) < leg.until_s:
                if abs(leg.from_s - begin_s) <= DeviationFlow.TIE_S:
                    self._bank.begin_leg()
                    drawn = make_generator(self._seed, HELD_LEGS, leg.number).standard_normal(THRUST_STATES)
                    self._true_thrust = drawn[:, None]
                thrust = flow.advance(
                    node, np.zeros((ORBIT_STATES, THRUST_STATES)), errors.make_push(np.eye(THRUST_STATES))
                )
        moved = flow.advance(node, self._bank.orbit)
        if thrust is not None:  # the path has the true errors of thrust, so the estimate lacks them
            moved = moved - thrust @ self._true_thrust
        self._bank.predict(moved, flow.transition(node), self._part.find_noise(end_s - begin_s), thrust)

    def _find_errors(self, leg: HeldThrust, stage_s: np.ndarray) -> HeldThrustErrors:
        """Return what the errors of the thrust of a leg do at instants (stage,) [s]."""
        control = lambda time_s: leg.plan.control_m_s2(np.clip(time_s, leg.from_s, np.nextafter(leg.until_s, -np.inf)))  # noqa: E731
        return HeldThrustErrors(stage_s, self._find_axes, control, self._thrusters)

    def _measure(self, at_s: float, row: np.ndarray, away_m: np.ndarray, clear: np.ndarray) -> None:
        """Measure with all sensors that can, and keep the estimate.

        Parameters
        ----------
        at_s : instant [s]
        row : (6,) true inertial state [m], [m/s]
        away_m : (3,) true position relative to the target [m], inertial axes
        clear : (sensor,) whether the Sun lets it measure
        """
        number = round(at_s / self._part.every_s)
        numbers = make_generator(self._seed, MEASUREMENTS, number).standard_normal((len(clear), 3, 1))
        used = []
        for k, sensor in enumerate(self._part.sensors):
            if clear[k]:
                updates = self._bank.observe(sensor, away_m[:, None], away_m[:, None], numbers[k])
                used += [k] * bool(np.any(updates[0].gain))
        position, velocity = self.know(at_s, row)
        axes, turn = self._find_axes(np.array([at_s]))
        covariance = self._bank.find_orbit_covariance(axes[0], turn[0])[0]
        self.estimates.append(FilterEstimate(at_s, position, velocity, covariance, tuple(used)))
