"""NumPy oracle of `rso_lidar.optics.stray.glare`: the scatter of every element in every direction, at once."""

import numpy as np


def sum_scatter(sight, toward, strength, blur, peak, knee, slope):
    """Return the scattered radiance (node) of all elements: Harvey and Shack's law of the differences of cosines."""
    apart = np.linalg.norm(sight[:, None, :] - toward[None, :, :], axis=-1)
    law = peak * (1.0 + (apart**2 + blur) / knee**2) ** (slope / 2)
    return law @ strength
