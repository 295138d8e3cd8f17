"""Numbers of 53 bits from words of Philox: the oracle of `rso_lidar.dataset.drawing.uniform_numbers.fill_shares`."""

import numpy as np

from tests.reference import philox


def fill_shares(key, number, group, variable, shares):
    """Write even numbers (sample, dimension): 27 bits of the first word and 26 of the second."""
    words = philox.blocks(key, np.arange(shares.shape[1]), number[:, None], group, variable).astype(np.uint64)
    shares[:] = ((words[..., 0] >> 5) * 2.0**26 + (words[..., 1] >> 6)) / 2.0**53
