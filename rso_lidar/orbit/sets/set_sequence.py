"""The trajectory of one object from several element sets: at each instant, the set with the nearest epoch."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.errors import CatalogError, PropagationError, warn
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sets.teme import describe_failure, find_failures, gcrs_from_teme, propagate_in_teme, warn_stale
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState


@dataclass(frozen=True)
class SetJump:
    """A switch from one element set to the next.

    Parameters
    ----------
    at_utc : when it is
    position_m, velocity_m_s : by how much the state jumps [m], [m/s]; NaN where SGP4 has no state from one of the two sets
    """

    at_utc: datetime.datetime
    position_m: float
    velocity_m_s: float


@dataclass(frozen=True, eq=False)
class SetSequence:
    """The trajectory of one object from all its sets.

    It switches half-way between neighbouring epochs, where the state jumps. A jump is as large as the errors of the sets, a
    kilometre or so: motion across one is not smooth.

    Parameters
    ----------
    sets : good element sets of one object; of equal epochs the first is kept

    Raises
    ------
    CatalogError
        if there is no set, a bad one, or sets of more than one object
    """

    sets: tuple[ElementSet, ...]

    def __post_init__(self) -> None:
        if not self.sets:
            raise CatalogError("trajectory: needs at least one element set; choose an object that has one")
        bad = next((entry.problem for entry in self.sets if entry.problem), None)
        if bad is not None:
            raise CatalogError(bad)
        if len({entry.identity for entry in self.sets}) > 1:
            raise CatalogError(
                f"trajectory: contains sets of {self.sets[0].label} and of other objects; choose the sets of one object"
            )
        distinct = {(entry.epoch_utc, entry.epoch_rest_ns): entry for entry in reversed(self.sets)}
        object.__setattr__(self, "sets", tuple(distinct[epoch] for epoch in sorted(distinct)))

    @cached_property
    def _since_first_s(self) -> np.ndarray:
        """Epochs of the sets since that of the first [TAI s]."""
        return np.array([float(self._at_first(0.0).since(entry.epoch_utc)[0]) for entry in self.sets]) * -1.0

    @cached_property
    def _switch_s(self) -> np.ndarray:
        halfway: np.ndarray = 0.5 * (self._since_first_s[1:] + self._since_first_s[:-1])
        return halfway

    def _at_first(self, time_s: float) -> Epochs:
        return Epochs(self.sets[0].epoch_utc, np.array([time_s]))

    def which(self, epochs: Epochs) -> np.ndarray:
        """Return the number (time,) of the set that applies at each epoch.

        Parameters
        ----------
        epochs : instants
        """
        number: np.ndarray = np.searchsorted(self._switch_s, epochs.since(self.sets[0].epoch_utc), side="right")
        return number

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the instants at which it switches between sets, as times since the `start_utc` of `epochs` [s].

        Parameters
        ----------
        epochs : instants
        """
        after: np.ndarray = self._switch_s - float(
            Epochs(epochs.start_utc, np.zeros(1)).since(self.sets[0].epoch_utc)[0]
        )
        return after

    def jumps(self, epochs: Epochs | None = None) -> tuple[SetJump, ...]:
        """Return the switches between sets, with the jump of the state at each.

        Parameters
        ----------
        epochs : only switches within their span; None for all
        """
        first, last = 0, len(self._switch_s)
        if epochs is not None:
            used = self.which(epochs)
            first, last = (int(used.min()), int(used.max())) if len(used) else (0, 0)
        return tuple(self._jump(k) for k in range(first, last))

    def _jump(self, k: int) -> SetJump:
        at = self._at_first(float(self._switch_s[k]))
        before, after = propagate_in_teme(self.sets[k], at), propagate_in_teme(self.sets[k + 1], at)
        sizes = [
            float("nan")
            if find_failures(*before).any() or find_failures(*after).any()
            else float(np.linalg.norm(b - a))
            for a, b in zip(before[:2], after[:2], strict=True)
        ]
        when = self.sets[0].epoch_utc + datetime.timedelta(seconds=float(self._switch_s[k]))
        return SetJump(when, *sizes)

    def ages_days(self, epochs: Epochs) -> np.ndarray:
        """Return the time (time,) between each epoch and the epoch of the set that applies [day], never negative.

        Parameters
        ----------
        epochs : instants
        """
        nearest_s = self._since_first_s[self.which(epochs)]
        age: np.ndarray = np.abs(epochs.since(self.sets[0].epoch_utc) - nearest_s) / units.DAY_S
        return age

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes; a warning names the jumps within their span.

        Raises
        ------
        PropagationError
            if SGP4 has no state at an epoch; its `bad` masks those epochs
        """
        used = self.which(epochs)
        position_m, velocity_m_s = np.empty((len(epochs), 3)), np.empty((len(epochs), 3))
        error = np.zeros(len(epochs), dtype=int)
        for k in np.unique(used):
            mask = used == k
            position_m[mask], velocity_m_s[mask], error[mask] = propagate_in_teme(self.sets[int(k)], epochs.at(mask))
        bad = find_failures(position_m, velocity_m_s, error)
        if bad.any():
            raise PropagationError(describe_failure(self.sets[int(used[np.argmax(bad)])], epochs, bad, error), bad)
        if len(epochs):
            ages = self.ages_days(epochs)
            oldest = int(np.argmax(ages))
            warn_stale(self.sets[int(used[oldest])], float(ages[oldest]))
            warn_jumps(self.sets[0].label, self.jumps(epochs))
        rotation = gcrs_from_teme(epochs)
        return BodyState(rotate_vectors(rotation, position_m), rotate_vectors(rotation, velocity_m_s))


def warn_jumps(label: str, jumps: Sequence[SetJump]) -> None:
    """Warn in one line that a trajectory switches between element sets: how often, and the largest jump."""
    if not jumps:
        return
    worst = max(jumps, key=lambda jump: (jump.position_m == jump.position_m, jump.position_m))
    times = "once" if len(jumps) == 1 else f"{len(jumps)} times"
    warn(
        f"{label}: switches element sets {times} in this span, the largest jump {worst.position_m:.0f} m and "
        f"{worst.velocity_m_s:.2f} m/s at {worst.at_utc:%Y-%m-%dT%H:%M:%SZ}: for smooth motion use one set (nearest)"
    )


make_sequence = functools.lru_cache(maxsize=64)(SetSequence)  # the trajectory of some sets
