"""Element sets and pieces of trajectories, propagated side by side in TEME axes."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Any

import numpy as np

from rso_lidar.orbit.epochs import format_utc
from rso_lidar.orbit.screening.trajectory_piece import NO_STATE, TrajectoryPiece
from rso_lidar.orbit.sets.fleet import Fleet


class MixedFleet:
    """Element sets and pieces of trajectories, with the methods of a `Fleet`.

    Parameters
    ----------
    entries : the sets and pieces; results refer to them by their number in this order
    start_utc : instant from which seconds are counted
    step_s : greatest step of the coarse grid [s]
    """

    def __init__(self, entries: Sequence[Any], start_utc: datetime.datetime, step_s: float) -> None:
        self.sets = tuple(entries)
        self.start_utc = start_utc
        self._is_piece = np.array([isinstance(entry, TrajectoryPiece) for entry in self.sets], dtype=bool)
        self._fleet = Fleet([entry for entry, own in zip(self.sets, self._is_piece, strict=True) if not own], start_utc)
        self._row = np.cumsum(~self._is_piece) - 1  # number in the fleet of element sets
        self._bounds = np.full((len(self.sets), 4), np.nan)
        for k in np.flatnonzero(self._is_piece).tolist():
            bounds = self.sets[k].measure_bounds(step_s)
            self._bounds[k] = bounds.perigee_m, bounds.apogee_m, bounds.speed_m_s, bounds.off_m

    def __len__(self) -> int:
        return len(self.sets)

    def grid(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Propagate some sets and pieces to common instants, as `Fleet.grid` does."""
        which = np.asarray(which, dtype=int)
        position, velocity = np.full((2, len(which), len(time_s), 3), np.nan)
        error = np.zeros((len(which), len(time_s)), dtype=int)
        own = self._is_piece[which]
        rows = np.flatnonzero(~own)
        if len(rows):
            position[rows], velocity[rows], error[rows] = self._fleet.grid(self._row[which[rows]], time_s)
        for row in np.flatnonzero(own).tolist():
            position[row], velocity[row] = self.sets[which[row]].states(time_s)
            error[row, np.isnan(position[row, :, 0])] = NO_STATE
        return position, velocity, error

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Propagate sets and pieces to one instant each, as `Fleet.at` does."""
        which, time_s = np.asarray(which, dtype=int), np.asarray(time_s, dtype=float)
        position, velocity = np.full((2, len(which), 3), np.nan)
        own = self._is_piece[which]
        rows = np.flatnonzero(~own)
        if len(rows):
            position[rows], velocity[rows] = self._fleet.at(self._row[which[rows]], time_s[rows])
        for number in np.unique(which[own]).tolist():
            rows = np.flatnonzero(which == number)
            instants, place = np.unique(time_s[rows], return_inverse=True)
            there = self.sets[number].states(instants)
            position[rows], velocity[rows] = there[0][place], there[1][place]
        return position, velocity

    def find_measured_bounds(self, which: np.ndarray) -> np.ndarray | None:
        """Return bounds (set, 4) of pieces: perigee, apogee [m], speed [m/s] and error of the cubic [m]; NaN for sets."""
        bounds: np.ndarray = self._bounds[which]
        return bounds

    def describe_loss(self, which: int, since_s: float, error: int) -> tuple[str, str]:
        """Describe why a set or a piece has no state, as `Fleet.describe_loss` does.

        Parameters
        ----------
        since_s : instant [s since the start]
        error : SGP4's code, or `NO_STATE`
        """
        if self._is_piece[which]:
            return self.sets[which].label, f"has no state at {format_utc(self.start_utc, since_s)}"
        return self._fleet.describe_loss(int(self._row[which]), since_s, error)
