"""Random words with an address: Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).

The generator has no state: four 32-bit words are a function of a key and of a counter of four words. The key belongs to
one frame, and the counter tells what a word is for: (step, row, pixel, stage). So each word can be drawn by itself, in any
order, by any thread, worker or device, and is the same.
"""

from typing import Any

import numpy as np

from rso_lidar.kernels import kernel, packed

_LOW, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
_FACTOR_0, _FACTOR_1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL_0, _WEYL_1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_ROUNDS = 10


def draw_key(rng: np.random.Generator) -> np.ndarray:
    """Draw a key (2) uint32 from a generator that is itself keyed by seed, frame and stage."""
    return packed(rng.integers(0, 1 << 32, 2, dtype=np.uint32))


@kernel
def draw_block(key: np.ndarray, step: int, row: int, pixel: int, stage: int) -> Any:
    """Return the four random words at one address.

    Parameters
    ----------
    key : (2) uint32
    step, row, pixel, stage : the four words of the counter, first to last; 32 bits of each count

    Returns
    -------
    Four words of 32 bits, held as uint64: a tuple.
    """
    counter = np.uint64(step) & _LOW, np.uint64(row) & _LOW, np.uint64(pixel) & _LOW, np.uint64(stage) & _LOW
    return _block(np.uint64(key[0]), np.uint64(key[1]), *counter)


@kernel
def fill_row(key: np.ndarray, row: int, pixel: int, stage: int, words: np.ndarray) -> None:
    """Write one random word for each step of a row.

    With n steps in a row, step s takes word ``s // (n / 4)`` of the block at ``step = s % (n / 4)``. Neighbours come
    from different blocks, which the compiler makes side by side in vector instructions.

    Parameters
    ----------
    key : (2) uint32
    row, pixel, stage : address of the row
    words : (step) uint32, written; a multiple of four steps
    """
    n = len(words) // 4
    k0, k1 = np.uint64(key[0]), np.uint64(key[1])
    c1, c2, c3 = np.uint64(row) & _LOW, np.uint64(pixel) & _LOW, np.uint64(stage) & _LOW
    for step in range(n):  # one array and one index: the compiler sees that the four places differ
        block = _block(k0, k1, np.uint64(step), c1, c2, c3)
        words[step] = np.uint32(block[0])
        words[step + n] = np.uint32(block[1])
        words[step + 2 * n] = np.uint32(block[2])
        words[step + 3 * n] = np.uint32(block[3])


@kernel
def _block(k0: Any, k1: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> Any:
    """Return the four words of a counter; every value is 32 bits held as uint64."""
    for _ in range(_ROUNDS):
        c0, c1, c2, c3 = _turn(c0, c1, c2, c3, k0, k1)
        k0, k1 = (k0 + _WEYL_0) & _LOW, (k1 + _WEYL_1) & _LOW
    return c0, c1, c2, c3


@kernel
def _turn(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> Any:
    """Return a counter after one round."""
    p0, p1 = c0 * _FACTOR_0, c2 * _FACTOR_1
    return (p1 >> _HALF) ^ c1 ^ k0, p1 & _LOW, (p0 >> _HALF) ^ c3 ^ k1, p0 & _LOW
