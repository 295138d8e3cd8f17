"""The avalanche as one loop over time steps: a look into a table for most, and few more for what light reaches."""

import math

import numpy as np

from rso_lidar.arithmetic import loop
from rso_lidar.detector.alias import NORMAL_PER_SIGMA, NORMAL_ZERO, Table
from rso_lidar.detector.apd import COARSE, PARTS

PART = 1.0 / PARTS  # of a primary
FINE = PARTS * COARSE  # parts in which the coarser table goes up


@loop
def drawn(word: np.uint32, table: Table, row: int) -> np.float32:
    """Return the value that a 32-bit word picks from a row of an alias table."""
    columns_log2, cells, first = table
    column = np.int64(word) >> (32 - columns_log2)
    cell = (row << columns_log2) + column
    own, other = first[row] + column, np.int64(cells[cell, 1])
    return np.float32(own + (word >= cells[cell, 0]) * (other - own))  # both are at hand: no branch to guess


@loop
def multiplied(
    lam: np.ndarray,
    floor: np.float32,
    tables: tuple[Table, ...],
    cumulants: tuple[float, float, float],
    limits: tuple[float, float],
    words: np.ndarray,
    rng: np.random.Generator,
    electrons: np.ndarray,
) -> int:
    """Write the electrons of steps that expect `lam` primaries; return how many steps the words sufficed for.

    Parameters
    ----------
    floor : what most steps expect.
    tables : of `floor`, of 0, 8, 16, ... primaries, of 0, 1/8, ... 63/8, of a single one, and of a normal number.
    limits : means up to which a draw is exact, and beyond which its skewness is told by a parabola.
    words : as many as there are steps, and two more for each exact one whose `lam` is not `floor`.
    """
    normal_zero, normal_per_sigma = float(NORMAL_ZERO), float(NORMAL_PER_SIGMA)
    base, coarse, fine, single, normal = tables
    gain, second, third = cumulants
    exact, parabolic = limits
    spread, skew = math.sqrt(second), third / second**1.5
    used = 0
    for step in range(len(lam)):
        mean = lam[step]
        needed = 1 if mean == floor or mean > exact else 3
        if used + needed > len(words):
            return step
        word, more = words[used], used + 1
        used += needed
        if mean == floor:
            electrons[step] = drawn(word, base, 0)
        elif mean <= exact:
            rest = mean
            if mean > floor and mean - floor < PART:
                total = drawn(word, base, 0)
                rest = mean - floor
            else:
                parts = int(mean * float(PARTS))
                total = drawn(words[more], fine, parts % FINE)
                if parts >= FINE:
                    total += drawn(word, coarse, parts // FINE)
                rest = mean - parts * PART
            # A Poisson number of avalanches of the rest, less than a part: hardly ever one.
            chance = (words[more + 1] + 0.5) * (1.0 / 4294967296.0)
            if chance < rest:
                share = math.exp(-rest)
                none = 1.0 - share
                number = 0
                while chance < none:  # the chance of more than `number`
                    number += 1
                    share *= rest / number
                    none -= share
                    total += drawn(np.uint32(rng.integers(0, 4294967296)), single, 0)
            electrons[step] = total
        else:
            z = (drawn(word, normal, 0) - normal_zero) * (1.0 / normal_per_sigma)
            root = math.sqrt(mean)
            skewness = skew / root
            if mean > parabolic:
                b = skewness * (1.0 / 6.0)
                b += 2.0 / 3.0 * b * b * b
                shape = (1.0 - b * b - 0.5 * b * b * b * b) * z + b * (z * z - 1.0)  # the root of 1 - 2 b², to b⁴
            else:
                t = skewness * (1.0 / 3.0)  # t³ + 3t = skewness, by Newton
                for _ in range(3):
                    t -= (t * (t * t + 3.0) - skewness) / (3.0 * (t * t + 1.0))
                w = math.sqrt(math.log1p(t * t))
                shape = math.expm1(w * (z - 0.5 * w)) / t
            electrons[step] = gain * mean + spread * root * shape
    return len(lam)
