"""The avalanche in NumPy: the oracle of `rso_lidar.detector.stages.avalanche`.

Steps that expect more than the base are added to, all of a kind at once.
"""

import math

import numpy as np

from rso_lidar.detector import Apd
from rso_lidar.detector.settings.apd import cumulants
from rso_lidar.detector.stages.alias_tables import AliasTable
from rso_lidar.detector.stages.avalanche import COARSE, EXACT_PRIMARIES, PARTS, Avalanche
from rso_lidar.detector.stages.row_noise import RowNoise
from tests.reference.detector.alias_tables import draw

_SMALL_SKEWNESS = 0.25
_NEXT_TO_NONE = 1.0 / 64.0  # primaries


def multiply(primaries: np.ndarray, avalanche: Avalanche, noise: RowNoise, base: float | None = None) -> np.ndarray:
    """Draw the electrons (float32) of time steps in which `primaries` are expected: of the same distribution."""
    rng = np.random.default_rng([*noise.key, *noise.pixel[:1], *np.abs(noise.start[:1])])
    apd, expected = avalanche.apd, np.asarray(primaries, dtype=np.float32)
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
    if floor > EXACT_PRIMARIES or not floor > 0.0:
        floor = np.float32(0.0)
    if floor > 0.0:
        electrons = draw(avalanche.base_table(float(floor)), rng, lam.size)
    else:
        electrons = np.zeros(lam.size, dtype=np.float32)
    excess = lam - floor
    if least < floor:  # a step that expects less than the base starts from nothing
        below = lam < floor
        excess[below] = lam[below]
        electrons[below] = 0.0
    many = lam > np.float32(EXACT_PRIMARIES)
    coarse, fine, single = avalanche.levels
    some = np.flatnonzero((excess >= np.float32(1.0 / PARTS)) & ~many)
    parts = (excess[some] * np.float32(PARTS)).astype(np.intp)
    rest = parts % (PARTS * COARSE)
    electrons[some] += draw(coarse, rng, some.size, parts // (PARTS * COARSE)) + draw(fine, rng, some.size, rest)
    excess[some] -= parts.astype(np.float32) * np.float32(1.0 / PARTS)
    excess[many] = 0.0
    _scatter(excess, single, electrons, rng)
    very = lam > np.float32(avalanche.parabolic_from)
    for some in (np.flatnonzero(many & ~very), np.flatnonzero(many & very)):
        electrons[some] = draw_bent(lam[some], apd, rng)
    return electrons.reshape(expected.shape)


def _scatter(excess: np.ndarray, single: AliasTable, electrons: np.ndarray, rng: np.random.Generator) -> None:
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


def draw_bent(lam: np.ndarray, apd: Apd, rng: np.random.Generator) -> np.ndarray:
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
