"""Philox4x32-10 in NumPy, as Salmon et al. (SC 2011) write it: the oracle of `rso_lidar.philox.fill_row` and
`rso_lidar.detector.stages.row_noise.fill_rows`.
"""

import numpy as np


def blocks(key, step, row, pixel, stage):
    """Return the four words (..., 4) uint32 at addresses that broadcast."""
    counter = np.broadcast_arrays(*(np.asarray(word, np.uint64) & 0xFFFFFFFF for word in (step, row, pixel, stage)))
    c0, c1, c2, c3 = (word.astype(np.uint64) for word in counter)
    k0, k1 = int(key[0]), int(key[1])
    for _ in range(10):
        p0, p1 = c0 * np.uint64(0xD2511F53), c2 * np.uint64(0xCD9E8D57)
        high, low = np.uint64(32), np.uint64(0xFFFFFFFF)
        c0, c1, c2, c3 = (p1 >> high) ^ c1 ^ np.uint64(k0), p1 & low, (p0 >> high) ^ c3 ^ np.uint64(k1), p0 & low
        k0, k1 = (k0 + 0x9E3779B9) % 2**32, (k1 + 0xBB67AE85) % 2**32
    return np.stack([c0, c1, c2, c3], axis=-1).astype(np.uint32)


def rows(key, row, pixel, stage, n):
    """Return the words (row, n) of rows of n steps: word s // (n / 4) of the block at step s % (n / 4)."""
    drawn = blocks(key, np.arange(n // 4), np.asarray(row)[:, None], np.asarray(pixel)[:, None], stage)
    return drawn.transpose(0, 2, 1).reshape(len(drawn), n)
