"""Errors of element sets by age, estimated from differences between successive sets of one object.

A set that is propagated to the epoch of a later one is compared with that one there. The difference contains the errors of
both sets. What all sets of the object have in common, such as a bias of the sensors or of SGP4, cancels, and a manoeuvre
between the epochs counts as an error. This is consistency, not accuracy: it needs no truth and cannot replace one.
Osweiler, "Covariance Estimation and Autocorrelation of NORAD Two-Line Element Sets" (AFIT, 2006), uses the same differences.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import CatalogError, ScenarioError
from rso_lidar.files import align_columns
from rso_lidar.orbit import ElementSet, Epochs, Fleet, SetSequence
from rso_lidar.part import to_real_array
from rso_lidar.rpo import rtn_matrix

AGES_DAYS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0)
FEWEST_PAIRS = 8  # a covariance of six components needs more than six differences
_ONE_SIGMA = 0.682_689_492


@dataclass(frozen=True, eq=False)
class SetErrors:
    """Differences between element sets of one object, by age, in the rtn axes of the newer set.

    `label` names the object. `from_days` and `to_days` (bin) bound the ages, `age_days` (bin) is their mean, and `pairs`
    (bin) counts the differences. `mean` (bin, 6) is their mean [m, m/s]. `covariance` (bin, 6, 6) is the second moment about
    zero [m2, m2/s, m2/s2], so that a bias counts as error. `inner_m` (bin, 3) is the size that 68 % of the differences of
    radial, along-track and cross-track position do not exceed, which manoeuvres change little. All are NaN for fewer than
    `FEWEST_PAIRS` pairs.
    """

    label: str
    from_days: np.ndarray
    to_days: np.ndarray
    age_days: np.ndarray
    pairs: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    inner_m: np.ndarray

    @property
    def sigma(self) -> np.ndarray:
        """Root mean square (bin, 6) of each component [m, m/s]."""
        root: np.ndarray = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return root

    def covariance_at(self, age_days: float) -> np.ndarray:
        """Interpolate the covariance (6, 6) at an age linearly between bins; beyond the last one it is an error.

        Parameters
        ----------
        age_days : age of the set [day]

        Returns
        -------
        numpy.ndarray
            (6, 6) in rtn axes [m2, m2/s, m2/s2].

        Raises
        ------
        ScenarioError
            If the age is beyond the known ones, or no bin has enough pairs.
        """
        known = np.flatnonzero(np.isfinite(self.age_days))
        if not len(known):
            raise ScenarioError(f"{self.label}: no age has {FEWEST_PAIRS} pairs of sets; give more sets")
        ages = self.age_days[known]
        if not 0.0 <= age_days <= ages[-1]:
            raise ScenarioError(
                f"age_days: {age_days:g} is beyond the known ages of {self.label}, 0 to {ages[-1]:.3g}; give more sets"
            )
        after = int(np.searchsorted(ages, age_days))
        if after == 0:
            first: np.ndarray = self.covariance[known[0]]
            return first
        share = (age_days - ages[after - 1]) / (ages[after] - ages[after - 1])
        between: np.ndarray = (1.0 - share) * self.covariance[known[after - 1]] + share * self.covariance[known[after]]
        return between

    def table(self) -> str:
        """Return a table of the errors of position by age, with what they are."""
        heads = ["age, d", "pairs", "radial, m", "along, m", "cross, m", "68 %: radial", "along", "cross"]
        rows = [heads]
        for k in range(len(self.pairs)):
            span = f"{self.from_days[k]:g} to {self.to_days[k]:g}"
            values = [*self.sigma[k, :3], *self.inner_m[k]]
            rows.append(
                [span, f"{self.pairs[k]:,}", *("-" if math.isnan(value) else f"{value:,.0f}" for value in values)]
            )
        return "\n".join(
            [
                f"{self.label}: differences between its own element sets by age, root mean square and 68 %, in rtn axes",
                *align_columns(rows, left=()),
                "consistency, not accuracy: errors of both sets count, what all sets share does not, and manoeuvres count",
            ]
        )


def estimate_set_errors(sets: SetSequence | Sequence[ElementSet], ages_days: Sequence[float] = AGES_DAYS) -> SetErrors:
    """Estimate the errors of an object's element sets by age, from differences between them.

    Each set is propagated to the epochs of all later ones within the greatest age. The set of a later epoch serves as
    reference at its own epoch.

    Parameters
    ----------
    sets : element sets of one object
    ages_days : edges of the bins of age, increasing from 0 or more [day]

    Returns
    -------
    SetErrors

    Raises
    ------
    CatalogError
        For sets of several objects, or fewer than two.
    ScenarioError
        For ages that do not increase.
    """
    sequence = sets if isinstance(sets, SetSequence) else SetSequence(tuple(sets))
    edges = to_real_array(ages_days)
    if edges is None or edges.ndim != 1 or len(edges) < 2 or not (np.diff(edges) > 0.0).all() or edges[0] < 0.0:
        raise ScenarioError("ages_days: are not edges of bins; give two or more numbers that increase, from 0 or more")
    known = sequence.sets
    if len(known) < 2:
        raise CatalogError(f"{known[0].label}: has one element set; differences need two or more")
    start = known[0].epoch_utc
    since_s = np.array([-float(Epochs(start, np.zeros(1)).since(entry.epoch_utc)[0]) for entry in known])
    fleet = Fleet(known, start)
    own = np.concatenate(fleet.at(np.arange(len(known)), since_s), axis=1)
    ages: list[np.ndarray] = []
    differences: list[np.ndarray] = []
    for k in range(len(known) - 1):
        age_days = (since_s[k + 1 :] - since_s[k]) / units.DAY_S
        later = k + 1 + np.flatnonzero((age_days >= edges[0]) & (age_days < edges[-1]))
        if not len(later):
            continue
        state = np.concatenate(fleet.at(np.full(len(later), k), since_s[later]), axis=1)
        good = np.isfinite(state).all(axis=1) & np.isfinite(own[later]).all(axis=1)
        there = own[later][good]
        rtn = rtn_matrix(there[:, :3], there[:, 3:])[0]
        off = state[good] - there
        differences.append(
            np.concatenate([np.einsum("nji,nj->ni", rtn, part) for part in (off[:, :3], off[:, 3:])], axis=1)
        )
        ages.append(((since_s[later] - since_s[k]) / units.DAY_S)[good])
    return _sort_into_bins(known[0].label, edges, _join(ages, (0,)), _join(differences, (0, 6)))


def _join(parts: list[np.ndarray], empty: tuple[int, ...]) -> np.ndarray:
    return np.concatenate(parts) if parts else np.empty(empty)


def _sort_into_bins(label: str, edges: np.ndarray, ages: np.ndarray, differences: np.ndarray) -> SetErrors:
    """Sort differences (pair, 6) in rtn axes [m, m/s] by age (pair) [day] into bins, and compute their moments."""
    bins = len(edges) - 1
    age, mean, covariance = np.full(bins, np.nan), np.full((bins, 6), np.nan), np.full((bins, 6, 6), np.nan)
    inner, pairs = np.full((bins, 3), np.nan), np.zeros(bins, dtype=int)
    for k, (low, high) in enumerate(itertools.pairwise(edges)):
        some = differences[(ages >= low) & (ages < high)]
        pairs[k] = len(some)
        if len(some) < FEWEST_PAIRS:
            continue
        age[k] = ages[(ages >= low) & (ages < high)].mean()
        mean[k] = some.mean(axis=0)
        covariance[k] = some.T @ some / len(some)
        inner[k] = np.quantile(np.abs(some[:, :3]), _ONE_SIGMA, axis=0)
    return SetErrors(label, edges[:-1], edges[1:], age, pairs, mean, covariance, inner)
