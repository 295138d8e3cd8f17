"""Linear covariance of a flight, with the closed loop of guidance and navigation in it.

It follows Geller (J. Guid. Control Dyn. 29 (2006) 1404). Each source of error has a column, the deviation that one sigma of
it causes, so that the shares of the sources are known. With a filter, the deviations of its estimate stand in further rows;
its gains are those of a filter along the flight without errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.rpo import ORBIT_STATES, THRUST_STATES, FilterBank, NavigationErrors
from rso_lidar.study.dispersions.dispersed_flight import DispersedFlight, find_root

SOURCES = ("start", "burns", "navigation")
TARGET = "target"  # a further source, where the body approached has errors of its own
_MOST_COLUMNS = 90  # of navigation, before they are replaced by as many as there are rows


@dataclass(frozen=True, eq=False)
class LinearDispersion:
    """Linear covariance of a flight.

    Parameters
    ----------
    covariance : (time, 6, 6) of position [m] and velocity [m/s] in the rotating rtn axes of the body approached
    shares : by source, (time, 3) variance of the position that it causes [m2]
    knowledge : (time, 6, 6) covariance of what guidance knows less what is true, likewise; None without a filter
    """

    covariance: np.ndarray
    shares: dict[str, np.ndarray]
    knowledge: np.ndarray | None = None


class _SourceColumns:
    """Columns of the sources of error: rows of the craft, of the estimate, of the body approached, of the burn on arrival.

    Parameters
    ----------
    craft : (6, column) deviations at the start that errors of the start cause, inertial axes
    estimate_states : states of the filter; 0 without one
    """

    def __init__(self, craft: np.ndarray, estimate_states: int) -> None:
        count = craft.shape[1]
        self.matrix = np.vstack([craft, np.zeros((estimate_states + ORBIT_STATES + 3, count))])
        self.labels = ["start"] * count
        if estimate_states:
            self.estimate[:ORBIT_STATES] = craft

    @property
    def craft(self) -> np.ndarray:
        """Deviations (6, column) of the craft."""
        rows: np.ndarray = self.matrix[:ORBIT_STATES]
        return rows

    @property
    def estimate(self) -> np.ndarray:
        """Deviations (state, column) of the estimate."""
        rows: np.ndarray = self.matrix[ORBIT_STATES : -ORBIT_STATES - 3]
        return rows

    @property
    def target(self) -> np.ndarray:
        """Deviations (6, column) of the body approached."""
        rows: np.ndarray = self.matrix[-ORBIT_STATES - 3 : -3]
        return rows

    @property
    def relative(self) -> np.ndarray:
        """Deviations (6, column) of the craft from the body approached."""
        rows: np.ndarray = self.craft - self.target
        return rows

    @property
    def pending(self) -> np.ndarray:
        """Change of velocity (3, column) on arrival, in rtn axes."""
        rows: np.ndarray = self.matrix[-3:]
        return rows

    def widen(self, count: int, label: str) -> None:
        """Add columns of zeros."""
        self.matrix = np.hstack([self.matrix, np.zeros((len(self.matrix), count))])
        self.labels += [label] * count

    def compress(self) -> None:
        """Replace the columns of navigation by as many as there are rows, with the same covariance."""
        chosen = np.array(self.labels) == "navigation"
        if np.count_nonzero(chosen) <= _MOST_COLUMNS:
            return
        root = np.transpose(np.linalg.qr(self.matrix[:, chosen].T)[1])
        self.matrix = np.hstack([self.matrix[:, ~chosen], root])
        self.labels = [label for label in self.labels if label != "navigation"] + ["navigation"] * root.shape[1]


def list_sources(flight: DispersedFlight) -> tuple[str, ...]:
    """List the names of the sources of errors of a flight."""
    return SOURCES if flight.target_root is None else (*SOURCES, TARGET)


def find_linear_dispersion(flight: DispersedFlight) -> LinearDispersion:
    """Return the linear covariance at the samples of a flight."""
    still = np.zeros((ORBIT_STATES, 1))
    bank = flight.make_filters(still, still) if flight.filter is not None else None
    columns = _SourceColumns(flight.to_inertial(0, flight.root), 0 if bank is None else len(bank.state))
    columns.widen(THRUST_STATES * len(flight.legs), "burns")
    if flight.target_root is not None:
        columns.widen(ORBIT_STATES, TARGET)
        columns.target[:, -ORBIT_STATES:] = flight.target_root
        if flight.shared_root is not None:
            columns.craft[:, -ORBIT_STATES:] = flight.shared_root
        if bank is not None:
            columns.estimate[:ORBIT_STATES, -ORBIT_STATES:] = columns.relative[:, -ORBIT_STATES:]
    if bank is not None:
        assert flight.filter is not None
        columns.widen(ORBIT_STATES, "navigation")
        columns.estimate[:ORBIT_STATES, -ORBIT_STATES:] = flight.to_inertial(0, np.diag(flight.filter.part.start_sigma))
    aim, kept, known_at = -1, {}, {}
    for node in range(flight.last + 1):
        if bank is not None:
            _observe(flight, bank, node, columns)
        axes, change = flight.axes[node], np.zeros_like(columns.pending)
        if node in flight.updates:
            known = _find_known(flight, node, columns)
            velocity, arrival = flight.gains[node]
            change, aim = axes.T @ velocity @ known, flight.updates[node]
            columns.pending[:] = arrival @ known
        elif node == aim:
            change = axes.T @ columns.pending
            columns.pending[:] = 0.0
        if node in flight.burning:
            columns.craft[3:] += axes @ change
            errors = axes @ _find_burn_root(flight, node, change)
            if bank is not None:
                columns.estimate[3:ORBIT_STATES] += axes @ change
                bank.add_burn(np.zeros((3, 1)), (errors @ errors.T)[:, :, None])
            columns.widen(3, "burns")
            columns.craft[3:, -3:] = errors
        labels = np.array(columns.labels)
        kept[node] = flight.to_rotating(node, columns.relative), labels
        if bank is not None:
            known_at[node] = flight.to_rotating(node, columns.estimate[:ORBIT_STATES] - columns.relative)
        if node < flight.last:
            _carry(flight, bank, node, columns)
    rows = [kept[node] for node in flight.sample]
    covariance = np.stack([matrix @ matrix.T for matrix, _ in rows])
    parts = {
        name: np.stack([np.sum(matrix[:3, labels == name] ** 2, axis=1) for matrix, labels in rows])
        for name in list_sources(flight)
    }
    knowledge = np.stack([known_at[node] @ known_at[node].T for node in flight.sample]) if known_at else None
    return LinearDispersion(covariance, parts, knowledge)


def _observe(flight: DispersedFlight, bank: FilterBank, node: int, columns: _SourceColumns) -> None:
    """Add the measurements of a node to the columns."""
    filters = flight.filter
    assert filters is not None
    if node not in filters:
        return
    for update in filters.observe(bank, node, np.zeros((ORBIT_STATES, 1)), np.zeros((filters.per_instant, 1))):
        slope, gain = update.slope[:, 0], update.gain[:, 0]
        apart = slope @ (columns.relative[:3] - columns.estimate[:3])
        columns.estimate[:] += np.outer(gain, apart)
        columns.widen(1, "navigation")
        columns.estimate[:, -1] = gain * update.sigma[0]
    bank.state[:] = 0.0
    columns.compress()


def _find_known(flight: DispersedFlight, node: int, columns: _SourceColumns) -> np.ndarray:
    """Return the deviation (6, column) that guidance knows, inertial axes."""
    errors = flight.flight.navigation
    if not isinstance(errors, NavigationErrors):
        return columns.estimate[:ORBIT_STATES]
    columns.widen(ORBIT_STATES, "navigation")
    known = columns.relative
    known[:, -ORBIT_STATES:] = flight.to_inertial(node, np.diag(errors.sigma))
    return known


def _carry(flight: DispersedFlight, bank: FilterBank | None, node: int, columns: _SourceColumns) -> None:
    """Propagate the columns to the next node; those of held legs gain what thrust adds."""
    leg, start = flight.find_leg(node), flight.root.shape[1]
    columns.craft[:] = flight.transition[node] @ columns.craft
    if flight.target_root is not None:
        columns.target[:] = flight.target_flow.transition(node) @ columns.target
    if leg is not None:
        place = start + THRUST_STATES * leg
        columns.craft[:, place : place + THRUST_STATES] += flight.held[node]
    if bank is None:
        return
    if len(columns.estimate) > ORBIT_STATES and leg is not None and (node == 0 or flight.find_leg(node - 1) != leg):
        columns.estimate[ORBIT_STATES:] = 0.0
    estimate = flight.transition[node] @ columns.estimate[:ORBIT_STATES]
    if leg is not None and len(columns.estimate) > ORBIT_STATES:
        estimate += flight.held[node] @ columns.estimate[ORBIT_STATES:]
    columns.estimate[:ORBIT_STATES] = estimate
    flight.carry_filters(bank, node, np.zeros((ORBIT_STATES, 1)))


def _find_burn_root(flight: DispersedFlight, node: int, change: np.ndarray) -> np.ndarray:
    """Return a root (3, 3) of the covariance of a burn's errors [m2/s2], in rtn axes.

    Parameters
    ----------
    change : (3, column) what guidance adds [m/s]
    """
    planned = flight.burns[node]
    mean = np.zeros(3) if planned is None else planned
    square = np.outer(mean, mean) + change @ change.T  # mean of the square of the command
    return find_root(flight.flight.thrusters.find_covariance(square))
