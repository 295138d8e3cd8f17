"""The avalanche photodiode: electrons out for electrons in, with McIntyre's distribution of the gain.

A primary electron leaves the avalanche as n electrons with McIntyre's probability P(n|1) (IEEE Trans. Electron Devices
13, 164 (1966) and 19, 703 (1972)); the primaries of a time step are Poisson, so the electrons of a step are compound
Poisson. With p = (1−k)(M−1)/M, P(n|a) = (a/n) [wⁿ⁻ᵃ] (1−p+pw)^(n/(1−k)), Lagrange's inversion: the generating function
w of a single primary solves w = z (1−p+pw)^(1/(1−k)). All closed forms here follow from that.
"""

import math
from functools import lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.arithmetic import compiled
from rso_lidar.detector.alias import Table, draw, normal_table, table, words
from rso_lidar.part import NotNegative, Number, Part

_EXACT_PRIMARIES = 100.0  # up to this mean a step is drawn from its exact distribution
_SMALL_SKEWNESS = 0.25  # less than it is told by a parabola
COARSE = 8  # means are made of a multiple of this, and of parts of a primary below it
PARTS = 8  # of a primary, in which the finer table goes up; a power of two, so that nothing is rounded
_NEXT_TO_NONE = 1.0 / 64.0  # primaries
_NEGLIGIBLE = 1e-14  # tails below this probability are cut
_LONGEST_TAIL_ELECTRONS = 1e4  # beyond this 1/e tail of a single avalanche the tables would fill memory


class Apd(Part):
    """An avalanche photodiode of mean `gain` M and McIntyre's `ionisation_ratio` k (0.02 Si, 0.2 InAlAs, 0.4 InP).

    `dark_current_na` is the part that is multiplied, before multiplication (1 nA is assumed for a 100 µm InGaAs pixel at
    room temperature). ``statistics = "gaussian"`` keeps mean and variance and loses the tail that false alarms come from.
    """

    gain: Annotated[Number, Field(ge=1)] = Field(
        default=10.0,
        description="Mean avalanche gain M, electrons per photoelectron. Default: Fuller et al., sec. 3.3 (about 10).",
    )
    ionisation_ratio: Annotated[Number, Field(ge=0, lt=1)] = Field(
        default=0.2,
        description=(
            "Ratio k of the ionisation rates of holes and electrons: 0.02 for Si, 0.2 for InAlAs, 0.4 for InP. "
            "Default: assumed InAlAs; low confidence."
        ),
    )
    dark_current_na: NotNegative = Field(
        default=1.0,
        description=(
            "Dark current of one pixel before multiplication [nA]. Default: assumed, 0.1 to 10 nA is usual for such a "
            "pixel at room temperature; low confidence."
        ),
    )
    statistics: Literal["mcintyre", "gaussian"] = Field(
        default="mcintyre",
        description=(
            "Statistics of the avalanche gain. `gaussian` lacks the upper tail, which causes false alarms. Default: "
            "McIntyre 1966, 1972."
        ),
    )

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if self.statistics == "mcintyre":
            s = tail_per_electron(self.gain, self.ionisation_ratio)
            if s * _LONGEST_TAIL_ELECTRONS < 1.0:
                raise ValueError(
                    f"gain {self.gain:g} at ionisation_ratio {self.ionisation_ratio:g} makes single avalanches of "
                    f'{_LONGEST_TAIL_ELECTRONS:g} electrons common; lower one, or set statistics = "gaussian"'
                )
        return self

    @property
    def excess_noise_factor(self) -> float:
        """Return F = k M + (1−k)(2 − 1/M), the mean square gain over M² (McIntyre 1966).

        >>> round(Apd(gain=10.0, ionisation_ratio=0.2).excess_noise_factor, 2)
        3.52
        """
        k = self.ionisation_ratio
        return k * self.gain + (1.0 - k) * (2.0 - 1.0 / self.gain)

    @property
    def dark_electrons_per_s(self) -> float:
        """Return the primary electrons of the dark current [1/s]."""
        return self.dark_current_na * units.NA / units.ELEMENTARY_CHARGE_C


def cumulants(apd: Apd) -> tuple[float, float, float]:
    """Return E[n], E[n²], E[n³] of one primary's electrons n.

    Times the mean number of primaries they are the first three cumulants of a step. From the derivatives at w = 1 of
    y(w) = ln w − ln(1−p+pw)/(1−k), whose inverse is the moment generating function.
    """
    p, rest = _share(apd.gain, apd.ionisation_ratio), 1.0 - apd.ionisation_ratio
    y2, y3 = p**2 / rest - 1.0, 2.0 - 2.0 * p**3 / rest
    gain = apd.gain
    return gain, -y2 * gain**3, (3.0 * y2**2 - y3 / gain) * gain**5


def mcintyre_pmf(primaries: int, gain: float, ionisation_ratio: float) -> tuple[int, np.ndarray]:
    """Return (n_min, P(n_min), P(n_min + 1), ...) of the electrons n that `primaries` electrons become (McIntyre 1972)."""
    from scipy.special import gammaln

    if primaries == 0 or gain == 1.0:
        return primaries, np.ones(1)
    a, k = primaries, ionisation_ratio
    p = _share(gain, k)
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


def multiply(primaries: np.ndarray, apd: Apd, rng: np.random.Generator, base: float | None = None) -> np.ndarray:
    """Return the electrons (float32) of time steps in which `primaries` electrons are expected, Poisson and avalanche.

    Exact up to 100 expected primaries, to 1e-9 in the distribution of each draw; above that a shifted log-normal whose
    mean, variance and third central moment are those of the compound Poisson, from one normal number. Fast where most
    steps expect the same: `base`, by default the least of all. A sum of compound Poissons is one, so every step is drawn
    from the table of `base`, and only those that expect more are added to.
    """
    expected = np.asarray(primaries, dtype=np.float32)
    lam = expected.ravel()
    least, most = (float(lam.min()), float(lam.max())) if lam.size else (0.0, 0.0)
    if not (least >= 0.0 and math.isfinite(most)):
        raise ValueError("expected primaries must be finite and not negative; subtract baselines after the avalanche")
    if apd.statistics == "gaussian":
        variance = np.float32(cumulants(apd)[1])
        electrons: np.ndarray = rng.standard_normal(lam.size, dtype=np.float32)
        electrons = np.float32(apd.gain) * lam + np.sqrt(variance * lam) * electrons
        return electrons.reshape(expected.shape)

    floor = np.float32(least if base is None else base)
    if floor > _EXACT_PRIMARIES or not floor > 0.0:
        floor = np.float32(0.0)
    if compiled():
        return _multiplied_by_loops(lam, floor, apd, rng).reshape(expected.shape)
    if floor > 0.0:
        electrons = draw(_base_table(apd.gain, apd.ionisation_ratio, float(floor)), rng, lam.size)
    else:
        electrons = np.zeros(lam.size, dtype=np.float32)
    excess = lam - floor
    if least < floor:  # a step that expects less than the base starts from nothing
        below = lam < floor
        excess[below] = lam[below]
        electrons[below] = 0.0
    many = lam > np.float32(_EXACT_PRIMARIES)
    coarse, fine, single = _level_tables(apd.gain, apd.ionisation_ratio)
    some = np.flatnonzero((excess >= np.float32(1.0 / PARTS)) & ~many)
    parts = (excess[some] * np.float32(PARTS)).astype(np.intp)
    rest = parts % (PARTS * COARSE)
    electrons[some] += draw(coarse, rng, some.size, parts // (PARTS * COARSE)) + draw(fine, rng, some.size, rest)
    excess[some] -= parts.astype(np.float32) * np.float32(1.0 / PARTS)
    excess[many] = 0.0
    _scatter(excess, single, electrons, rng)
    very = lam > np.float32(_parabolic_from(apd))
    for some in (np.flatnonzero(many & ~very), np.flatnonzero(many & very)):
        electrons[some] = _matched(lam[some], apd, rng)
    return electrons.reshape(expected.shape)


def _multiplied_by_loops(lam: np.ndarray, floor: np.float32, apd: Apd, rng: np.random.Generator) -> np.ndarray:
    from rso_lidar.detector.apd_loops import multiplied

    base = _base_table(apd.gain, apd.ionisation_ratio, float(floor))
    tables = base, *_level_tables(apd.gain, apd.ionisation_ratio), normal_table()
    electrons = np.empty(lam.size, np.float32)
    apart = int(np.count_nonzero((lam != floor) & (lam <= np.float32(_EXACT_PRIMARIES))))  # these take three words
    done = multiplied(
        lam,
        floor,
        tables,
        cumulants(apd),
        (_EXACT_PRIMARIES, _parabolic_from(apd)),
        words(rng, lam.size + 2 * apart),
        rng,
        electrons,
    )
    assert done == lam.size, "words: too few for these steps"
    return electrons


def _scatter(excess: np.ndarray, single: "Table", electrons: np.ndarray, rng: np.random.Generator) -> None:
    """Add the avalanches of steps that expect few primaries: all drawn at once, each strewn on a step by its share.

    Steps that expect next to none are most: they share primaries evenly, and keep as many as they expect (thinning).
    """
    strewn = rng.integers(0, max(excess.size, 1), rng.poisson(excess.size * _NEXT_TO_NONE))
    share = excess[strewn]
    strewn = strewn[(rng.random(strewn.size) * _NEXT_TO_NONE < share) & (share < _NEXT_TO_NONE)]
    some = np.flatnonzero(excess >= _NEXT_TO_NONE)
    edge = np.cumsum(excess[some].astype(float))
    place = np.sort(rng.random(rng.poisson(edge[-1]))) * edge[-1] if edge.size else edge
    step = np.concatenate([strewn, some[np.minimum(np.searchsorted(edge, place, side="right"), edge.size - 1)]])
    np.add.at(electrons, step, draw(single, rng, step.size))


def _parabolic_from(apd: Apd) -> float:
    """Return the primaries above which a step's skewness counts as small."""
    _, second, third = cumulants(apd)
    return third**2 / second**3 / _SMALL_SKEWNESS**2


def _matched(lam: np.ndarray, apd: Apd, rng: np.random.Generator) -> np.ndarray:
    """Return electrons for large means, from one normal number with the compound Poisson's first three moments.

    The skewness γ of a shifted log-normal (exp(w z − w²/2) − 1)/t with t² = exp(w²) − 1 is t³ + 3t; Cardano's
    t = 2 sinh(asinh(γ/2)/3). Where γ is small the same tails come of a z + b (z² − 1), a² = 1 − 2 b²: its skewness is
    6b − 4b³, so b = x + 2x³/3 to x⁵ with x = γ/6.
    """
    mean, second, third = cumulants(apd)
    skewness = np.float32(third / second**1.5) / np.sqrt(lam)
    normal = rng.standard_normal(lam.size, dtype=np.float32)
    if float(skewness.max(initial=0.0)) < _SMALL_SKEWNESS:
        b = skewness * np.float32(1.0 / 6.0)
        b += np.float32(2.0 / 3.0) * b * b * b
        bent = np.sqrt(np.float32(1.0) - np.float32(2.0) * b * b) * normal + b * (normal * normal - np.float32(1.0))
        small: np.ndarray = np.float32(mean) * lam + np.sqrt(np.float32(second) * lam) * bent
        return small
    t = np.float32(2.0) * np.sinh(np.arcsinh(np.float32(0.5) * skewness) * np.float32(1.0 / 3.0))
    w = np.sqrt(np.log1p(t * t))
    shape = np.expm1(w * (normal - np.float32(0.5) * w)) / t
    electrons: np.ndarray = np.float32(mean) * lam + np.sqrt(np.float32(second) * lam) * shape
    return electrons


@lru_cache(maxsize=32)
def _base_table(gain: float, ionisation_ratio: float, primaries: float) -> Table:
    return table([compound_pmf(primaries, gain, ionisation_ratio)])


@lru_cache(maxsize=4)
def _level_tables(gain: float, ionisation_ratio: float) -> tuple[Table, Table, Table]:
    """Return the tables of 0, 8, 16, ... primaries expected, of 0, 1/8, ... 63/8, and of a single primary."""
    coarse = [compound_pmf(float(m), gain, ionisation_ratio) for m in range(0, int(_EXACT_PRIMARIES) + 1, COARSE)]
    fine = [compound_pmf(m / PARTS, gain, ionisation_ratio) for m in range(PARTS * COARSE)]
    first, single = mcintyre_pmf(1, gain, ionisation_ratio)
    return table(coarse), table(fine), table([np.concatenate([np.zeros(first), single])])


def _share(gain: float, ionisation_ratio: float) -> float:
    return (1.0 - ionisation_ratio) * (gain - 1.0) / gain


def _greatest_w(gain: float, ionisation_ratio: float) -> float:
    """Return where the generating function w of a single primary ends, capped at 1e4: dy/dw = 0 there."""
    p, k = _share(gain, ionisation_ratio), ionisation_ratio
    return 1e4 if k * p == 0.0 else min((1.0 - p) * (1.0 - k) / (k * p), 1e4)


def _log_z(w: np.ndarray, gain: float, ionisation_ratio: float) -> np.ndarray:
    """Return y = ln z at which a single primary's generating function is w: its moment generating function, inverted."""
    y: np.ndarray = np.log(w) - np.log1p(_share(gain, ionisation_ratio) * (w - 1.0)) / (1.0 - ionisation_ratio)
    return y


def tail_per_electron(gain: float, ionisation_ratio: float) -> float:
    """Return the rate [1/electron] at which the tail of a single avalanche falls off."""
    return float(_log_z(np.array(_greatest_w(gain, ionisation_ratio)), gain, ionisation_ratio))


def _longest(gain: float, ionisation_ratio: float, ones: int = 0, poisson: float = 0.0) -> int:
    """Return electrons that are exceeded with a negligible probability (Chernoff's bound, best of many)."""
    w = 1.0 + (_greatest_w(gain, ionisation_ratio) - 1.0) * np.geomspace(1e-7, 1.0, 500)
    exponent = ones * np.log(w) + poisson * (w - 1.0) - math.log(_NEGLIGIBLE)
    return int(np.min(exponent / _log_z(w, gain, ionisation_ratio))) + 1
