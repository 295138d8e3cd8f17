"""A flight that is dispersed, at its nodes: transitions, axes, gains of guidance, held thrust and the filter's instants."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit import Epochs, invert_state_matrix, state_matrix
from rso_lidar.rpo import (
    ORBIT_STATES,
    THRUST_STATES,
    DeviationFlow,
    FilterBank,
    HeldThrustErrors,
    NavigationErrors,
    RelativeFilter,
    ScalarUpdate,
    TwoImpulseGuidance,
    apply_matrix,
    find_clear_views,
)
from rso_lidar.study.dispersions.nominal_flight import NominalFlight

_PER_SENSOR = 3  # standard normal numbers of a measurement


class DispersedFlight:
    """Nodes of a flight: its transitions, axes, gains of guidance, held thrust, and the instants of its filter.

    Parameters
    ----------
    flight : the flight without random errors
    sample_s : (time,) ascending instants at which deviations are wanted [s]
    covariance : (6, 6) of the state at the start in the rotating rtn axes [m2, m2/s, m2/s2]
    target_covariance : the same of the body approached, whose path then deviates too; None for none
    cross_covariance : (6, 6) of the state of the craft (rows) with that of the body approached; None for independent errors
    """

    def __init__(
        self,
        flight: NominalFlight,
        sample_s: np.ndarray,
        covariance: np.ndarray,
        target_covariance: np.ndarray | None = None,
        cross_covariance: np.ndarray | None = None,
    ) -> None:
        self.flight, self.sample_s = flight, sample_s
        # A correction aims at an instant that may lie behind the last sample; the runs end there all the same.
        last_s = float(sample_s[-1])
        due = [update for update in flight.updates if update.time_s <= last_s + DeviationFlow.TIE_S]
        node_s = flight.list_nodes_s(max([last_s, *(update.aim_s for update in due)]), sample_s)
        self.node_s = node_s[np.append(True, np.diff(node_s) > DeviationFlow.TIE_S)]
        self.flow = DeviationFlow(self.node_s, flight.craft_m, flight.forces, flight.start_utc)
        self.axes, self.turn_rad_s = flight.chief_axes(self.node_s)
        self._from_rotating = state_matrix(self.axes, self.turn_rad_s)
        self._from_inertial = invert_state_matrix(self._from_rotating)
        self.sample = np.array([self.find_node(at_s) for at_s in sample_s])
        self.burns = [self._sum_burns(node) for node in range(len(self.node_s))]
        self.last = int(self.sample[-1])
        self.updates = {self.find_node(update.time_s): self.find_node(update.aim_s) for update in due}
        self.root = find_root(covariance)
        # what one sigma of each error of the body approached does to that body, and to the craft with it
        self.target_root: np.ndarray | None = None
        self.shared_root: np.ndarray | None = None
        if target_covariance is not None:
            assert flight.chief_m is not None
            root = find_root(target_covariance)
            self.target_root = self.to_inertial(0, root)
            if cross_covariance is not None:
                shared = cross_covariance @ np.linalg.pinv(root).T
                self.shared_root = self.to_inertial(0, shared)
                self.root = find_root(covariance - shared @ shared.T)
            self.target_flow = DeviationFlow(self.node_s, flight.chief_m, flight.forces, flight.start_utc)
        self.transition = [self.flow.transition(node) for node in range(len(self.node_s) - 1)]
        self.gains = {now: self._find_gain(now, aim) for now, aim in self.updates.items()}
        ends = set(self.updates.values())
        self.burning = [
            k for k in range(len(self.node_s)) if self.burns[k] is not None or k in self.updates or k in ends
        ]
        self.legs = [k for k, span in enumerate(flight.held_s) if span[0] < self.node_s[-1]]
        self.thrust: HeldThrustErrors | None = None
        if self.legs and flight.control_m_s2 is not None:
            self.thrust = HeldThrustErrors(self.flow.stage_s, flight.chief_axes, flight.control_m_s2, flight.thrusters)
        # (6, 4) what the errors of held thrust do to the next node
        self.held = {
            node: self.flow.advance(
                node, np.zeros((ORBIT_STATES, THRUST_STATES)), self.thrust.make_push(np.eye(THRUST_STATES))
            )
            for node in range(len(self.node_s) - 1)
            if self.thrust is not None and self.find_leg(node) is not None
        }
        navigation = flight.navigation
        self.filter = None if isinstance(navigation, NavigationErrors) else FilterNodes(navigation, flight, self.node_s)

    @property
    def filter_is_held(self) -> bool:
        """Whether the filter estimates errors of held thrust."""
        errors = self.flight.thrusters
        return bool(self.held) and (errors.magnitude_sigma_fraction > 0.0 or errors.pointing_sigma_deg > 0.0)

    def make_filters(self, state: np.ndarray, numbers: np.ndarray) -> FilterBank:
        """Return the filters of runs at the start, whose errors are drawn from their covariance.

        Parameters
        ----------
        state : (6, run) true deviations, inertial axes
        numbers : (6, run) standard normal
        """
        assert self.filter is not None
        root = self.to_inertial(0, np.diag(self.filter.part.start_sigma))
        return FilterBank(state + apply_matrix(root, numbers), root @ root.T, has_thrust=self.filter_is_held)

    def spread_start(self, numbers: np.ndarray, target_numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return deviations (6, run) at the start of the craft and of the body approached, inertial axes.

        Parameters
        ----------
        numbers : (6, run) standard normal, of the craft alone
        target_numbers : (6, run) standard normal, of the body approached; without rows where it has no errors
        """
        state = self.to_inertial(0, apply_matrix(self.root, numbers))
        if self.target_root is None:
            return state, np.zeros((ORBIT_STATES, numbers.shape[1]))
        if self.shared_root is not None:
            state = state + apply_matrix(self.shared_root, target_numbers)
        return state, apply_matrix(self.target_root, target_numbers)

    def carry_target(self, node: int, deviations: np.ndarray) -> np.ndarray:
        """Return deviations (6, run) of the body approached at the next node, inertial axes."""
        return deviations if self.target_root is None else self.target_flow.advance(node, deviations)

    def carry_filters(self, bank: FilterBank, node: int, moved: np.ndarray) -> None:
        """Propagate filters to the next node.

        Parameters
        ----------
        bank : the filters
        node : where they are
        moved : (6, run) estimates at the next node, without errors of held thrust
        """
        assert self.filter is not None
        leg = self.find_leg(node)
        if leg is not None and (node == 0 or self.find_leg(node - 1) != leg):
            bank.begin_leg()
        thrust = self.held.get(node) if self.filter_is_held else None
        noise = self.filter.part.find_noise(float(self.node_s[node + 1] - self.node_s[node]))
        bank.predict(moved, self.transition[node], noise, thrust)

    def find_leg(self, node: int) -> int | None:
        """Return the number of the leg that thrust holds from a node to the next; None if there is none."""
        if self.thrust is None:
            return None
        middle = 0.5 * (self.node_s[node] + self.node_s[node + 1])
        spans = (self.flight.held_s[leg] for leg in self.legs)
        return next((k for k, span in enumerate(spans) if span[0] <= middle < span[1]), None)

    def find_node(self, at_s: float) -> int:
        """Return the index of the node at an instant [s]."""
        return min(int(np.searchsorted(self.node_s, at_s - DeviationFlow.TIE_S)), len(self.node_s) - 1)

    def _sum_burns(self, node: int) -> np.ndarray | None:
        at_s = self.node_s[node]
        here = [burn.delta_v_m_s for burn in self.flight.burns if abs(burn.time_s - at_s) <= DeviationFlow.TIE_S]
        return np.sum(here, axis=0) if here else None

    def _find_gain(self, now: int, aim: int) -> tuple[np.ndarray, np.ndarray]:
        """Return by what a known deviation is multiplied for the correction and for the one on arrival (3, 6) [m/s]."""
        through = np.eye(6)
        for node in range(now, aim):
            through = self.transition[node] @ through
        reach = through[:3, 3:]
        velocity = -np.linalg.pinv(reach, rcond=TwoImpulseGuidance.WEAK_SHARE) @ through[:3]
        arrival = -(through[3:] + through[3:, 3:] @ velocity)
        return velocity, arrival

    def to_inertial(self, node: int, rotating: np.ndarray) -> np.ndarray:
        """Return states (6, n) in inertial axes from those in the rotating rtn axes of a node."""
        return apply_matrix(self._from_rotating[node], rotating)

    def to_rotating(self, node: int, inertial: np.ndarray) -> np.ndarray:
        """Return states (6, n) in the rotating rtn axes of a node from those in inertial axes."""
        return apply_matrix(self._from_inertial[node], inertial)


def find_root(covariance: np.ndarray) -> np.ndarray:
    """Return a matrix whose product with its own transpose is a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    root: np.ndarray = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


class FilterNodes:
    """Where the filters of a dispersed flight measure.

    Parameters
    ----------
    part : the filter
    flight : the flight without random errors
    node_s : (node,) instants of the nodes [s]
    """

    def __init__(self, part: RelativeFilter, flight: NominalFlight, node_s: np.ndarray) -> None:
        assert flight.chief_m is not None
        self.part = part
        instants = part.list_instants_s(0.0, float(node_s[-1]))
        nodes = np.minimum(np.searchsorted(node_s, instants - DeviationFlow.TIE_S), len(node_s) - 1)
        chief, craft = flight.chief_m(node_s[nodes]), flight.craft_m(node_s[nodes])
        clear = find_clear_views(part.sensors, Epochs(flight.start_utc, node_s[nodes]), chief, craft)
        self._reference = dict(zip(nodes.tolist(), craft - chief, strict=True))
        self._clear = dict(zip(nodes.tolist(), clear, strict=True))

    def __contains__(self, node: int) -> bool:
        return node in self._clear

    @property
    def per_instant(self) -> int:
        """How many standard normal numbers the measurements of an instant take."""
        return _PER_SENSOR * len(self.part.sensors)

    def observe(self, bank: FilterBank, node: int, state: np.ndarray, numbers: np.ndarray) -> list[ScalarUpdate]:
        """Measure with all sensors that can, and update the filters.

        Parameters
        ----------
        bank : the filters
        node : at which they measure
        state : (6, run) true deviations, inertial axes
        numbers : (number, run) standard normal
        """
        reference = self._reference[node][:, None]
        true_m = reference + state[:3]
        updates: list[ScalarUpdate] = []
        for k, sensor in enumerate(self.part.sensors):
            if self._clear[node][k]:
                own = numbers[_PER_SENSOR * k : _PER_SENSOR * (k + 1)]
                updates += bank.observe(sensor, reference, true_m, own)
        return updates
