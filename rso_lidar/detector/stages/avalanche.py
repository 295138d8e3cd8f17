"""The avalanche: electrons out for electrons in, drawn step by step from tables.

A primary electron leaves the avalanche as n electrons with McIntyre's probability P(n|1) (IEEE Trans. Electron Devices
13, 164 (1966) and 19, 703 (1972)); the primaries of a time step are Poisson, so the electrons of a step are compound
Poisson. With p = (1−k)(M−1)/M, P(n|a) = (a/n) [wⁿ⁻ᵃ] (1−p+pw)^(n/(1−k)), Lagrange's inversion: the generating function
w of a single primary solves w = z (1−p+pw)^(1/(1−k)).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar.detector.settings.apd import Apd, avalanche_share, cumulants, greatest_w, log_z
from rso_lidar.detector.stages.alias_tables import (
    NORMAL_PER_SIGMA,
    NORMAL_ZERO,
    AliasTable,
    build_normal_table,
    build_tables,
    draw_from_table,
)
from rso_lidar.detector.stages.row_noise import (
    AVALANCHE,
    AVALANCHE_MORE,
    RowNoise,
)
from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_block

EXACT_PRIMARIES = 100.0  # up to this mean a step is drawn from its exact distribution
_SMALL_SKEWNESS = 0.25  # below it a parabola in a normal number has the right tails
COARSE = 8  # means are made of a multiple of this, and of parts of a primary below it
PARTS = 8  # of a primary: the step of the finer table; a power of two, so that nothing is rounded
PART = 1.0 / PARTS  # of a primary
FINE = PARTS * COARSE  # parts: the step of the coarser table
_PER_WORD = 1.0 / 4294967296.0
_NEGLIGIBLE = 1e-14  # tails below this probability are cut


@dataclass(frozen=True, eq=False)
class Avalanche:
    """A photodiode ready to draw from: moments of its avalanches, and their tables."""

    apd: Apd
    cumulants: tuple[float, float, float]  # mean, and second and third cumulant of the electrons of a primary
    parabolic_from: float  # primaries above which a parabola gives the skewness of a step
    levels: tuple[AliasTable, AliasTable, AliasTable]  # of 0, 8, 16, ... primaries, of 0, 1/8, ... 63/8, and of one
    base_table: Callable[[float], AliasTable]  # of the primaries that most steps expect, kept


def build_avalanche(apd: Apd) -> Avalanche:
    """Tabulate the avalanches of a photodiode."""
    gain, second, third = cumulants(apd)

    @lru_cache(maxsize=32)
    def tabulate(primaries: float) -> AliasTable:
        return build_tables([compound_pmf(primaries, apd.gain, apd.ionisation_ratio)])

    levels = tabulate_levels(apd.gain, apd.ionisation_ratio)
    return Avalanche(apd, (gain, second, third), third**2 / second**3 / _SMALL_SKEWNESS**2, levels, tabulate)


def multiply(primaries: np.ndarray, avalanche: Avalanche, noise: RowNoise, base: float | None = None) -> np.ndarray:
    """Draw the electrons (float32) of time steps in which `primaries` photoelectrons are expected: Poisson and avalanche.

    Up to 100 expected primaries a draw is exact to 1e-9 in its distribution. Above that it is a shifted log-normal whose
    mean, variance and third central moment are those of the compound Poisson, from one normal number. Most steps of a row
    expect the same, `base`: they take one look into its table.

    Parameters
    ----------
    primaries : (row, step) expected photoelectrons of each step, or of one row only (step)
    noise : addresses of the random words of the rows
    base : what most steps expect (None: the least of all)

    Raises
    ------
    ValueError : where an expected number is negative or not finite.
    """
    expected = np.asarray(primaries, dtype=np.float32)
    least, most = (float(expected.min()), float(expected.max())) if expected.size else (0.0, 0.0)
    if not (least >= 0.0 and math.isfinite(most)):
        raise ValueError("expected primaries must be finite and not negative; subtract baselines after the avalanche")
    floor = np.float32(least if base is None else base)
    if floor > EXACT_PRIMARIES or not floor > 0.0:
        floor = np.float32(0.0)
    gain, second, third = avalanche.cumulants
    limits = EXACT_PRIMARIES, avalanche.parabolic_from
    if avalanche.apd.statistics == "gaussian":  # every step is a normal number, without skewness
        floor, third, limits = np.float32(-1.0), 0.0, (-1.0, -1.0)
    tables = avalanche.base_table(max(float(floor), 0.0)), *avalanche.levels
    rows = packed(expected.reshape(len(noise.pixel), -1) if expected.size else np.zeros((0, 4)), np.float32)
    electrons = np.empty(rows.shape, np.float32)
    words = noise.draw(AVALANCHE, 3, rows.shape[1])
    multiply_rows(rows, floor, (*tables, build_normal_table()), (gain, second, third), limits, words, noise, electrons)
    return electrons.reshape(expected.shape)


@kernel
def multiply_rows(
    expected: np.ndarray,
    floor: np.float32,
    tables: tuple[AliasTable, ...],
    cumulants: tuple[float, float, float],
    limits: tuple[float, float],
    words: np.ndarray,
    noise: RowNoise,
    electrons: np.ndarray,
) -> None:
    """Write the electrons (row, step) of steps by their expected primaries.

    Parameters
    ----------
    expected : (row, step) primaries
    floor : what most steps expect
    tables : of `floor`, of 0, 8, 16, ... primaries, of 0, 1/8, ... 63/8, of a single one, and of a normal number
    cumulants : mean, and second and third cumulant of the electrons of a primary
    limits : means up to which a draw is exact, and beyond which a parabola gives its skewness
    words : (3, row, step) random words: for the tables of many and of few primaries, and for the rest
    noise : addresses of more of them
    electrons : (row, step), written
    """
    (base_log2, base, base_first), (coarse_log2, coarse, coarse_first) = tables[0], tables[1]
    (fine_log2, fine, fine_first), (single_log2, single, single_first) = tables[2], tables[3]
    normal_log2, normal, normal_first = tables[4]
    least, least_one, least_normal = base_first[0], single_first[0], normal_first[0]
    gain, second, third = cumulants
    exact, parabolic = np.float32(limits[0]), np.float32(limits[1])
    part, parts_of_one, parts_of_table = np.float32(PART), np.float32(PARTS), np.uint64(FINE)
    spread, skew = math.sqrt(second), third / second**1.5
    n_rows, n = expected.shape
    rare, rest_of = np.empty(n, np.int64), np.empty(n, np.float32)
    for row in range(n_rows):
        means, drawn = expected[row], electrons[row]
        word, fine_word, rest_word = words[0, row], words[1, row], words[2, row]
        n_rare = 0  # the slow steps have separate loops, so that the variables of this one stay in registers
        for step in range(n):
            mean = means[step]
            if mean == floor:
                drawn[step] = draw_from_table(word[step], base_log2, base, 0, least)
            elif mean <= exact:
                rest = mean - floor
                if rest > np.float32(0.0) and rest < part:
                    total = draw_from_table(word[step], base_log2, base, 0, least)
                else:
                    parts = np.uint64(mean * parts_of_one)
                    few, many = parts % parts_of_table, parts // parts_of_table
                    total = draw_from_table(fine_word[step], fine_log2, fine, few, fine_first[few])
                    if many > 0:
                        total += draw_from_table(word[step], coarse_log2, coarse, many, coarse_first[many])
                    rest = mean - np.float32(parts) * part
                drawn[step] = total
                if (rest_word[step] + 0.5) * _PER_WORD < rest:  # rarely, for that is less than a part
                    rare[n_rare], rest_of[n_rare] = step, rest
                    n_rare += 1
            else:
                number = draw_from_table(word[step], normal_log2, normal, 0, least_normal)
                z = (number - float(NORMAL_ZERO)) * (1.0 / float(NORMAL_PER_SIGMA))
                root = math.sqrt(np.float64(mean))
                if mean > parabolic:
                    b = skew * (1.0 / 6.0) / max(root, 1e-30)  # 0 for a mean of 0, drawn here without skewness only
                    b += 2.0 / 3.0 * b * b * b
                    shape = (1.0 - b * b - 0.5 * b * b * b * b) * z + b * (z * z - 1.0)  # the root of 1 - 2 b², to b⁴
                    drawn[step] = gain * mean + spread * root * shape
                else:
                    drawn[step] = z
                    rare[n_rare], rest_of[n_rare] = step, 0.0
                    n_rare += 1
        for k in range(n_rare):
            step, rest = rare[k], rest_of[k]
            mean = means[step]
            if mean > exact:
                z, root = np.float64(drawn[step]), math.sqrt(np.float64(mean))
                skewness = skew / root
                t = skewness * (1.0 / 3.0)  # t³ + 3t = skewness, by Newton
                for _ in range(3):
                    t -= (t * (t * t + 3.0) - skewness) / (3.0 * (t * t + 1.0))
                w = math.sqrt(math.log1p(t * t))
                drawn[step] = gain * mean + spread * root * math.expm1(w * (z - 0.5 * w)) / t
                continue
            # A Poisson number of avalanches of the rest.
            chance, share = (rest_word[step] + 0.5) * _PER_WORD, math.exp(-np.float64(rest))
            none = 1.0 - share
            number, stage = 0, int(AVALANCHE_MORE)
            while chance < none:  # the chance of more than `number`
                number += 1
                share *= rest / number
                none -= share
                more = draw_block(noise.key, step, noise.start[row], noise.pixel[row], stage)
                stage += 1
                drawn[step] += draw_from_table(more[0], single_log2, single, 0, least_one)


@lru_cache(maxsize=4)  # 20 ms, and cameras that differ in other settings share them
def tabulate_levels(gain: float, ionisation_ratio: float) -> tuple[AliasTable, AliasTable, AliasTable]:
    """Return the tables of 0, 8, 16, ... primaries expected, of 0, 1/8, ... 63/8, and of a single primary."""
    coarse = [compound_pmf(float(m), gain, ionisation_ratio) for m in range(0, int(EXACT_PRIMARIES) + 1, COARSE)]
    fine = [compound_pmf(m / PARTS, gain, ionisation_ratio) for m in range(PARTS * COARSE)]
    first, single = mcintyre_pmf(1, gain, ionisation_ratio)
    return build_tables(coarse), build_tables(fine), build_tables([np.concatenate([np.zeros(first), single])])


def mcintyre_pmf(primaries: int, gain: float, ionisation_ratio: float) -> tuple[int, np.ndarray]:
    """Return (n_min, P(n_min), P(n_min + 1), ...) of the electrons n that some primaries become (McIntyre 1972)."""
    from scipy.special import gammaln

    if primaries == 0 or gain == 1.0:
        return primaries, np.ones(1)
    a, k = primaries, ionisation_ratio
    p = avalanche_share(gain, k)
    n = np.arange(a, _longest(gain, k, ones=a) + 1, dtype=float)
    logarithm = (
        np.log(a / n)
        + gammaln(n / (1.0 - k) + 1.0)
        - gammaln(n - a + 1.0)
        - gammaln(k * n / (1.0 - k) + a + 1.0)
        + (a + k * n / (1.0 - k)) * math.log1p(-p)
        + (n - a) * math.log(p)
    )
    return a, np.exp(logarithm)


def compound_pmf(mean_primaries: float, gain: float, ionisation_ratio: float) -> np.ndarray:
    """Return P(0), P(1), ... of the electrons of a Poisson number of primaries, by Fourier transform (to 1e-14)."""
    from scipy import fft

    first, single = mcintyre_pmf(1, gain, ionisation_ratio)
    longest = _longest(gain, ionisation_ratio, poisson=mean_primaries)
    size = fft.next_fast_len(max(longest, first + len(single)) + 1, real=True)
    padded = np.zeros(size)
    padded[first : first + len(single)] = single
    pmf: np.ndarray = np.maximum(fft.irfft(np.exp(mean_primaries * (fft.rfft(padded) - 1.0)), size), 0.0)
    return pmf[: longest + 1]


def _longest(gain: float, ionisation_ratio: float, ones: int = 0, poisson: float = 0.0) -> int:
    """Return electrons that a fixed and a Poisson number of primaries hardly exceed (Chernoff's bound, best of many)."""
    w = 1.0 + (greatest_w(gain, ionisation_ratio) - 1.0) * np.geomspace(1e-7, 1.0, 500)
    exponent = ones * np.log(w) + poisson * (w - 1.0) - math.log(_NEGLIGIBLE)
    return int(np.min(exponent / log_z(w, gain, ionisation_ratio))) + 1
