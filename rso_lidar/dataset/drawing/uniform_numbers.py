"""Uniform random numbers from 0 to below 1, each with an address: dataset, class, number in the class, and variable.

The counter-based generator Philox computes them from the address. So the numbers of one sample depend neither on other
samples nor on other variables.
"""

from __future__ import annotations

import zlib
from functools import lru_cache
from typing import Any

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_block

_MOST_SEED = 2**63


def hash_name(name: str) -> int:
    """Return a word of 32 bits for a name: its CRC-32."""
    return zlib.crc32(name.encode())


@lru_cache(maxsize=64)
def find_key(seed: int) -> np.ndarray:
    """Return the key (2) uint32 of Philox for the seed of a dataset."""
    return packed(np.random.SeedSequence(seed).generate_state(2, np.uint32))


def draw_shares(seed: int, group: str, number: np.ndarray, variable: str, dimensions: int = 1) -> np.ndarray:
    """Draw uniform numbers (sample, dimension) from 0 to below 1."""
    shares = np.empty((len(number), dimensions))
    fill_shares(find_key(seed), packed(np.asarray(number, np.int64)), hash_name(group), hash_name(variable), shares)
    return shares


def draw_seed(seed: int, group: str, number: int, draw: int) -> int:
    """Draw the random seed of one noise draw of a sample."""
    words = draw_block(find_key(seed), draw, number, hash_name(group), hash_name("noise"))
    return (int(words[0]) << 32 | int(words[1])) % _MOST_SEED


@kernel
def fill_shares(key: np.ndarray, number: np.ndarray, group: int, variable: int, shares: np.ndarray) -> None:
    """Write uniform numbers from 0 to below 1, with 53 random bits each.

    Parameters
    ----------
    key : (2) uint32
    number : (sample) numbers in the class
    group, variable : words of 32 bits
    shares : (sample, dimension), written in place
    """
    for k in range(len(number)):
        for dimension in range(shares.shape[1]):
            block = draw_block(key, dimension, number[k], group, variable)
            high, low = np.int64(block[0]) >> 5, np.int64(block[1]) >> 6
            shares[k, dimension] = (np.float64(high) * 67108864.0 + np.float64(low)) / 9007199254740992.0


class HaltonPoints:
    """Points of a scrambled Halton sequence (Owen 2017, arXiv:1706.02808), one for each sample of a class.

    Parameters
    ----------
    seed : of the dataset
    group : name of the class
    dimensions : of a point
    """

    def __init__(self, seed: int, group: str, dimensions: int) -> None:
        from scipy.stats import qmc

        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, hash_name(group)])))
        self._sequence: Any = qmc.Halton(dimensions, scramble=True, rng=rng)

    def at(self, number: int) -> np.ndarray:
        """Return a point (dimension) of the sequence by its number."""
        self._sequence.num_generated = number  # SciPy's fast_forward makes all points before it
        point: np.ndarray = self._sequence.random(1)[0]
        return point
