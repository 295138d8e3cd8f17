"""Draws of whole numbers from tabulated distributions: alias tables (Walker 1977), a random word and a look into a table."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.kernels import kernel

_WORD = 1 << 32  # probabilities are whole multiples of one part in this
NORMAL_PER_SIGMA = 64
NORMAL_ZERO = 8 * NORMAL_PER_SIGMA


class AliasTable(NamedTuple):
    """Alias tables of one size, one a row: a 32-bit word picks a column, then one of its two values."""

    columns_log2: int
    cells: np.ndarray  # (row * column * 2) uint32: words below the first take the column's own value, others the second
    first: np.ndarray  # (row) int64: value of a row's first column; each next is one more


@lru_cache(maxsize=1)
def build_normal_table() -> AliasTable:
    """Return the table of a normal number: `NORMAL_ZERO` and `NORMAL_PER_SIGMA` times a standard one, up to 6.3 of those.

    On so fine a grid the sums for its moments are their integrals, to exp(−2π² 64²) (Poisson's summation).
    """
    number = np.arange(2 * NORMAL_ZERO + 1) - NORMAL_ZERO
    return build_tables([np.exp(-0.5 * (number / NORMAL_PER_SIGMA) ** 2)])


def build_tables(pmfs: list[np.ndarray]) -> AliasTable:
    """Return the alias tables of some distributions over 0, 1, 2, ...; their sums are right to 2⁻³³."""
    weights, firsts = [], []
    for pmf in pmfs:
        total = np.cumsum(pmf)
        weight = np.diff(np.rint(total / total[-1] * _WORD).astype(np.int64), prepend=0)
        first, last = np.flatnonzero(weight)[[0, -1]]
        weights.append(weight[first : last + 1])
        firsts.append(first)
    log2 = max(1, (max(len(weight) for weight in weights) - 1).bit_length())
    cells = [_alias(first, weight, log2) for first, weight in zip(firsts, weights, strict=True)]
    return AliasTable(log2, np.concatenate(cells).ravel(), np.array(firsts))


@kernel
def draw_from_table(word: Any, columns_log2: Any, cells: np.ndarray, table: Any, first: Any) -> Any:
    """Return the value that a random word picks from an alias table.

    Everything is unsigned: an index that may be negative, or a tuple that holds an array, costs as much as the rest.

    Parameters
    ----------
    word : 32 random bits
    columns_log2, cells : those of `AliasTable`
    """
    column = np.uint64(word) >> (np.uint64(32) - np.uint64(columns_log2))
    place = np.uint64(2) * ((np.uint64(table) << np.uint64(columns_log2)) + column)
    bound, other = np.uint64(cells[place]), np.uint64(cells[place + np.uint64(1)])
    return np.int64(other if np.uint64(word) >= bound else np.uint64(first) + column)


def _alias(first: int, weight: np.ndarray, columns_log2: int) -> np.ndarray:
    """Return the cells of one alias table, by one sweep over light and heavy columns.

    Light columns fill up from the current heavy one. When that has no excess left, the next heavy one fills it up
    (Hübschle-Schneider and Sanders, arXiv:1903.00227). Prefix sums and two searches take the place of a loop.

    Parameters
    ----------
    weight : (value) whole multiples of one part in 2³²
    columns_log2 : logarithm of the number of columns
    """
    size, share = 1 << columns_log2, _WORD >> columns_log2
    weight = np.concatenate([weight, np.zeros(size - len(weight), dtype=np.int64)])
    light, heavy = np.flatnonzero(weight < share), np.flatnonzero(weight >= share)
    needed, spare = np.cumsum(share - weight[light]), np.cumsum(weight[heavy] - share)
    kept, other = np.full(size, share), np.arange(size)
    giver = np.searchsorted(spare, needed - (share - weight[light]), side="right")
    kept[light], other[light] = weight[light], heavy[giver]
    taken = np.searchsorted(needed, spare, side="right")
    spent = np.flatnonzero(taken < len(light))
    kept[heavy[spent]] = share - (needed[taken[spent]] - spare[spent])
    other[heavy[spent]] = heavy[spent + 1]
    bounds = np.minimum(np.arange(size) * share + kept, _WORD - 1)
    return np.stack([bounds, first + other], axis=1).astype(np.uint32)
