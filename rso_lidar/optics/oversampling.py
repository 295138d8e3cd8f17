"""The scene on the grid of rays, before it is summed to pixels: Fuller et al., figs. 9 and 11."""

import numpy as np

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.radiometry import collect
from rso_lidar.records import Hits, Oversampled


def oversample(hits: Hits, laser: Laser, receiver: Receiver) -> Oversampled:
    """Draw the range and the photon image of one flash on the grid of rays, k x k cells to a pixel, before any PSF.

    Where rays are finer than cells their photons add, and the nearest gives the range.

    Parameters
    ----------
    hits : the hits of the flash
    laser, receiver : the instrument

    Returns
    -------
    Both images (fine_row, fine_col).
    """
    photons = collect(hits, laser, receiver.replace(psf=None))
    k = receiver.rays_per_side
    n_rows, n_cols = receiver.n_rows * k, receiver.n_cols * k
    direction = hits.rays.direction[hits.ray]
    col, row = receiver.image_of(direction[:, 0] / direction[:, 2], direction[:, 1] / direction[:, 2])
    fine_row = np.clip((row * k).astype(np.int64), 0, n_rows - 1)
    fine_col = np.clip((col * k).astype(np.int64), 0, n_cols - 1)
    cell = fine_row * n_cols + fine_col
    sent = np.bincount(photons.hit, photons.photons, len(hits.ray))
    image = np.bincount(cell, sent, n_rows * n_cols)
    range_m = np.full(n_rows * n_cols, np.inf)
    np.minimum.at(range_m, cell, hits.range_m)
    range_m[np.isinf(range_m)] = np.nan
    return Oversampled(range_m.reshape(n_rows, n_cols), image.reshape(n_rows, n_cols))
