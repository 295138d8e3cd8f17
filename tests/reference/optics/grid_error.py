"""Oracle of `rso_lidar.optics.rays.grid_error`: the bends of light between the rays of each pixel, as images."""

import numpy as np

from rso_lidar.optics.rays.grid_error import VARIANCE_PER_BEND


def sum_squared_bends(pixel, weight, col, row, light, variance):
    """Write the variance of each pixel."""
    for p in np.unique(pixel):
        on = pixel == p
        side = np.sqrt(weight[on].min())
        r, c = (np.floor((at[on] - np.floor(at[on])) / side + 1e-9).astype(int) for at in (row, col))
        image = np.zeros((round(1.0 / side),) * 2)
        image[r, c] = light[on]
        # The cells with rays, and one of sky beside them where the pixel has one.
        image = image[max(r.min() - 1, 0) : r.max() + 2, max(c.min() - 1, 0) : c.max() + 2]
        squares = 0.0
        for lines in (image, image.T):
            if lines.shape[1] > 1:
                squares += ((lines[:, 1:-1] - 0.5 * (lines[:, :-2] + lines[:, 2:])) ** 2).sum()
                squares += 0.75 * ((lines[:, 0] - lines[:, 1]) ** 2 + (lines[:, -1] - lines[:, -2]) ** 2).sum()
        variance[p] = VARIANCE_PER_BEND * squares * weight[on].min() ** 2
