"""How well a fixed grid of rays knows the light of each pixel."""

from dataclasses import replace

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Hits

# The variance of a cell's light over the sum of its two squared bends. White noise gives 1/3. Rays through the middles of
# cells that an edge crosses do better: fitted to eight spacecraft.
VARIANCE_PER_BEND = 0.15


def estimate_grid_variance(hits: Hits, photons: np.ndarray, receiver: Receiver) -> Hits:
    """Return hits with the variance of each pixel's photons, estimated from how light bends between the pixel's rays.

    What lies between the rays of a grid and is met by none of them is not in the estimate. `Receiver.sampling_error`
    without `rays_per_pixel` looks for it.

    Parameters
    ----------
    hits : hits of a fixed grid of rays
    photons : (hit) expected photons of a whole pixel that is as bright as the hit
    receiver : the lens and the focal plane
    """
    rays = hits.rays
    light = np.zeros(len(rays.pixel))
    light[hits.ray] = photons
    toward = rays.direction
    col, row = receiver.image_of(toward[:, 0] / toward[:, 2], toward[:, 1] / toward[:, 2])
    variance = np.zeros(rays.shape)
    sum_squared_bends(packed(rays.pixel), packed(rays.weight), packed(col), packed(row), light, variance.reshape(-1))
    return replace(hits, photons_variance=variance)


@kernel
def sum_squared_bends(
    pixel: np.ndarray, weight: np.ndarray, col: np.ndarray, row: np.ndarray, light: np.ndarray, variance: np.ndarray
) -> None:
    """Sum the squared bends of light between three rays in a row or column of a pixel's grid, times the squared weight.

    Parameters
    ----------
    pixel, weight : (ray), ordered by pixel
    col, row : (ray) where rays meet the focal plane [pixels]
    light : (ray) photons of a whole pixel that is as bright as the ray's hit
    variance : (pixel), written
    """
    start, n = 0, len(pixel)
    room = np.zeros(1024)
    while start < n:
        stop, finest = start, weight[start]
        left, right, top, bottom = col[start], col[start], row[start], row[start]
        while stop < n and pixel[stop] == pixel[start]:
            finest = min(finest, weight[stop])
            left, right = min(left, col[stop]), max(right, col[stop])
            top, bottom = min(top, row[stop]), max(bottom, row[stop])
            stop += 1
        side = np.sqrt(finest)
        # Beside the cells that have rays is the sky, as far as the pixel reaches.
        left, right = left - side * (left - np.floor(left) > side), right + side * (np.ceil(right) - right > side)
        top, bottom = top - side * (top - np.floor(top) > side), bottom + side * (np.ceil(bottom) - bottom > side)
        width, height = int((right - left) / side + 1.5), int((bottom - top) / side + 1.5)
        if width * height > len(room):
            room = np.zeros(2 * width * height)
        for i in range(start, stop):
            room[int((row[i] - top) / side + 0.5) * width + int((col[i] - left) / side + 0.5)] = light[i]
        squares = 0.0
        for r in range(height):
            for c in range(width):
                at = r * width + c
                if 0 < c < width - 1:
                    squares += (room[at] - 0.5 * (room[at - 1] + room[at + 1])) ** 2
                elif width > 1:
                    squares += 0.75 * (room[at] - room[at + 1 if c == 0 else at - 1]) ** 2
                if 0 < r < height - 1:
                    squares += (room[at] - 0.5 * (room[at - width] + room[at + width])) ** 2
                elif height > 1:
                    squares += 0.75 * (room[at] - room[at + width if r == 0 else at - width]) ** 2
        for i in range(start, stop):
            room[int((row[i] - top) / side + 0.5) * width + int((col[i] - left) / side + 0.5)] = 0.0
        variance[pixel[start]] = VARIANCE_PER_BEND * squares * finest * finest
        start = stop
