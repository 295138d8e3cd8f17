"""Propagation of many element sets side by side by SGP4, in TEME axes.

Distances and speeds are the same in TEME as in GCRS. Where SGP4 has no state the result is NaN, never an exception: among
thousands of objects a few have always decayed.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.orbit.sets.decay import DecayTimes
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.teme import MOST_AGE_S, TOO_OLD, describe_decay, describe_error, find_failures


class Fleet:
    """Element sets propagated side by side.

    Parameters
    ----------
    sets : the element sets; results refer to them by their number in this order
    start_utc : instant from which seconds are counted
    """

    def __init__(self, sets: Sequence[ElementSet], start_utc: datetime.datetime) -> None:
        self.sets = tuple(sets)
        self.start_utc = start_utc
        self._models = [entry.satrec() for entry in self.sets]
        self._decays = DecayTimes(self.sets, self._models, MOST_AGE_S)
        epochs = [entry.epoch_utc for entry in self.sets]
        # SGP4 subtracts dates, so each set keeps the leap seconds of its epoch. They change only at half years.
        start = Epochs(start_utc, np.zeros(1))
        self._since_epoch_s = np.array([float(start.since(epoch)[0]) for epoch in epochs])
        halves = [(epoch.year, epoch.month > 6) for epoch in epochs]
        first = dict(zip(halves, epochs, strict=True))
        self._eras = list(first.values())
        number = {half: k for k, half in enumerate(first)}
        self._era = np.array([number[half] for half in halves], dtype=int)

    def __len__(self) -> int:
        return len(self.sets)

    def grid(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Propagate some sets to common instants.

        Parameters
        ----------
        which : (set,) numbers of the sets
        time_s : (time,) instants [s since the start]

        Returns
        -------
        position_m, velocity_m_s : (set, time, 3) in TEME axes [m], [m/s]; NaN where there is no state
        error : (set, time) SGP4's codes, beyond a decay that of the decay, `TOO_OLD` beyond `MOST_YEARS` from the epoch
        """
        from sgp4.api import SatrecArray

        which = np.asarray(which, dtype=int)
        position = np.empty((len(which), len(time_s), 3))
        velocity = np.empty_like(position)
        error = np.zeros(position.shape[:2], dtype=int)
        for era in np.unique(self._era[which]):
            rows = np.flatnonzero(self._era[which] == era)
            dates = self._dates(time_s, int(era))
            error[rows], position[rows], velocity[rows] = SatrecArray([self._models[k] for k in which[rows]]).sgp4(
                *dates
            )
        since_s = self._since_epoch_s[which]
        self._decays.mark(error, which, since_s, time_s)
        error[np.abs(since_s[:, None] + time_s) > MOST_AGE_S] = TOO_OLD
        return *_mask_failures(position, velocity, error), error

    def at(self, which: np.ndarray, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Propagate sets to one instant each.

        Parameters
        ----------
        which : (pair,) numbers of the sets
        time_s : (pair,) instants [s since the start]

        Returns
        -------
        position_m, velocity_m_s : (pair, 3) in TEME axes [m], [m/s]; NaN where there is no state
        """
        which, time_s = np.asarray(which, dtype=int), np.asarray(time_s, dtype=float)
        position = np.empty((len(which), 3))
        velocity = np.empty_like(position)
        error = np.zeros(len(which), dtype=int)
        for era in np.unique(self._era[which]):
            mine = np.flatnonzero(self._era[which] == era)
            mine = mine[np.argsort(which[mine], kind="stable")]
            whole, fraction = self._dates(time_s[mine], int(era))
            edges = np.flatnonzero(np.diff(which[mine])) + 1
            for begin, end in zip([0, *edges.tolist()], [*edges.tolist(), len(mine)], strict=True):
                rows = mine[begin:end]
                model = self._models[which[rows[0]]]
                error[rows], position[rows], velocity[rows] = model.sgp4_array(whole[begin:end], fraction[begin:end])
        since_s = self._since_epoch_s[which] + time_s
        self._decays.mark(error[:, None], which, since_s, np.zeros(1))
        error[np.abs(since_s) > MOST_AGE_S] = TOO_OLD
        return _mask_failures(position, velocity, error)

    def find_measured_bounds(self, which: np.ndarray) -> np.ndarray | None:
        """Return no bounds: those of element sets follow from their orbits.

        Parameters
        ----------
        which : (set,) numbers of the sets
        """
        return None

    def describe_loss(self, which: int, since_s: float, error: int) -> tuple[str, str]:
        """Describe why a set has no state.

        Parameters
        ----------
        which : number of the set
        since_s : instant [s since the start]
        error : SGP4's code

        Returns
        -------
        its label, and the reason with its instant
        """
        elements = self.sets[which]
        decay_s = self._decays.since_epoch_s(which, float(self._since_epoch_s[which]) + since_s)
        when = describe_decay(elements, decay_s) if error != TOO_OLD else ""
        when = when or f", by {format_utc(self.start_utc, since_s)}"
        return elements.label, f"{describe_error(error)}{when} (elements of {elements.epoch_utc:%Y-%m-%dT%H:%MZ})"

    def _dates(self, time_s: np.ndarray, era: int) -> tuple[np.ndarray, np.ndarray]:
        return Epochs(self.start_utc, time_s).utc_julian(leap_seconds_at=self._eras[era])


def _mask_failures(
    position_km: np.ndarray, velocity_km_s: np.ndarray, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convert states to metres, with NaN where SGP4 failed.

    Parameters
    ----------
    position_km, velocity_km_s : (…, 3) states of SGP4 [km], [km/s]
    error : (…) error codes
    """
    position, velocity = position_km * units.KM, velocity_km_s * units.KM
    bad = find_failures(position, velocity, error)
    position[bad], velocity[bad] = np.nan, np.nan
    return position, velocity
