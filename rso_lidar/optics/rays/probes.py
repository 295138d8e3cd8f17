"""Probes: a few rays in each pixel that tell which contours are hidden, so that these do not cut scan lines.

A contour is hidden if it is behind the planes of the facets that the four probes about it meet. Neighbours that meet the
same plane hide what is close behind it; where planes differ, what is near them may be visible and is kept. Something that
is seen through a gap between probes has fewer contours than it should have; the edges of the gap still cut the lines.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel

# Probes in all and along the side of a pixel, and how far behind the fronts a contour is hidden, over the distance of
# neighbouring probes. All hold for this error and grow with the accuracy that is asked for. They are chosen so that the
# scenes of tests/physics/sampling_scenes.py have the errors that they have without probes, by the fewest rays.
_ERROR = 0.02
_PROBES, _MOST_PER_SIDE, _LEAST_PER_SIDE = 4000.0, 4.0, 2
_FINEST_PER_SIDE = 16  # for whatever error
_LEAST_BEHIND, _MOST_BEHIND = 0.02, 0.15
_PART = 0.25  # of the difference between neighbouring fronts, which is added to the least distance
_STEEPEST = 20.0  # slope of a facet, over which it hides nothing


def count_probes(sides: np.ndarray, error: float) -> int:
    """Count the probes along the side of a pixel.

    Parameters
    ----------
    sides : (row, col), 0 in pixels that are not covered
    error : `Receiver.sampling_error`
    """
    wanted = min(math.sqrt(_PROBES / max(int(np.count_nonzero(sides)), 1)), _MOST_PER_SIDE)
    return min(max(round(wanted * _ERROR / error), _LEAST_PER_SIDE), _FINEST_PER_SIDE)


@kernel
def place_probes(
    sides: np.ndarray, per_side: int, first_row: int, first_col: int, n_cols: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place an even grid of probes in the covered pixels of a window.

    Parameters
    ----------
    sides : (row, col), 0 in pixels that are not covered
    per_side : probes along the side of a pixel
    first_row, first_col : the window's first pixel
    n_cols : columns of the focal plane

    Returns
    -------
    Points (col_row, probe) on the focal plane [pixels]; pixel and weight of each probe (probe).
    """
    count = np.count_nonzero(sides) * per_side * per_side
    point, pixel, n = np.empty((2, count)), np.empty(count, np.int32), 0
    for row in range(sides.shape[0]):
        for col in range(sides.shape[1]):
            if sides[row, col] == 0:
                continue
            for i in range(per_side):
                for j in range(per_side):
                    point[0, n] = first_col + col + (j + 0.5) / per_side
                    point[1, n] = first_row + row + (i + 0.5) / per_side
                    pixel[n] = (first_row + row) * n_cols + first_col + col
                    n += 1
    return point, pixel, np.full(count, 1.0 / (per_side * per_side))


@kernel
def image_fronts(
    sides: np.ndarray, per_side: int, direction: np.ndarray, fronts: np.ndarray, apart: float, error: float
) -> np.ndarray:
    """Return what probes met as an image.

    Parameters
    ----------
    sides, per_side : as in `place_probes`
    direction : (xyz, probe), unit vectors
    fronts : (abc, probe), as in `ScanLines.lay`
    apart : distance between neighbouring probes in the tangent plane
    error : `Receiver.sampling_error`

    Returns
    -------
    (4, row, col) of the probes: 1/z of what they met, and its change from probe to probe along rows and down columns [1/m],
    zeros where a probe hides nothing. Last, for this probe and the next ones in both directions, by what factor 1/z of a
    hidden point must be less.
    """
    image, n = np.zeros((4, sides.shape[0] * per_side, sides.shape[1] * per_side)), 0
    least, most = _LEAST_BEHIND * apart * _ERROR / error, _MOST_BEHIND * apart * _ERROR / error
    for row in range(sides.shape[0]):
        for col in range(sides.shape[1]):
            if sides[row, col] == 0:
                continue
            for i in range(row * per_side, (row + 1) * per_side):
                for j in range(col * per_side, (col + 1) * per_side):
                    a, b, c = fronts[0, n], fronts[1, n], fronts[2, n]
                    w = c + (a * direction[0, n] + b * direction[1, n]) / direction[2, n]
                    if max(abs(a), abs(b)) <= _STEEPEST * w:
                        image[0, i, j], image[1, i, j], image[2, i, j] = w, a * apart, b * apart
                    n += 1
    for i in range(image.shape[1] - 1):
        for j in range(image.shape[2] - 1):
            differ = 0.0
            for here in range(4):
                r, c = i + here // 2, j + here % 2
                if image[0, r, c] == 0.0:
                    differ = np.inf
                    break
                for there in range(4):
                    down, right = there // 2 - here // 2, there % 2 - here % 2
                    w = image[0, r, c] + image[1, r, c] * right + image[2, r, c] * down
                    differ = max(differ, abs(w / max(image[0, r + down, c + right], 1e-12) - 1.0))
            image[3, i, j] = 1.0 + min(_PART * differ + least, most) if differ < np.inf else np.inf
    return image


@kernel
def is_hidden(x: float, y: float, dx: float, dy: float, w: float, dw: float, fronts: np.ndarray, per_side: int) -> bool:
    """Return whether what probes met hides a piece of a contour: three of its points, or one for each probe along it.

    Parameters
    ----------
    x, y, dx, dy : column and row of one end in the window, and the way to the other end [pixels]
    w, dw : 1/z of this end, and its change along the way [1/m]
    fronts, per_side : what `image_fronts` returned, and its `per_side`
    """
    length = max(abs(dx), abs(dy)) * per_side
    points = min(int(length + 0.5) + 1, max(3, math.ceil(length - 1.0)))
    for point in range(points):
        share = (point + 0.5) / points
        right, down = (x + share * dx) * per_side - 0.5, (y + share * dy) * per_side - 0.5
        i, j = math.floor(down), math.floor(right)
        if min(i, j) < 0 or i + 1 >= fronts.shape[1] or j + 1 >= fronts.shape[2]:
            return False
        least = (w + share * dw) * fronts[3, i, j]
        for r in range(i, i + 2):
            for c in range(j, j + 2):
                if fronts[0, r, c] + fronts[1, r, c] * (right - c) + fronts[2, r, c] * (down - r) < least:
                    return False
    return True


@kernel
def find_unexpected(
    point: np.ndarray,
    ray: np.ndarray,
    depth_m: np.ndarray,
    first_row: int,
    first_col: int,
    fronts: np.ndarray,
    per_side: int,
) -> np.ndarray:
    """Find the rays that meet what should be hidden: there the probes missed a gap.

    Parameters
    ----------
    point : (col_row, ray) on the focal plane [pixels]
    ray, depth_m : (hit) number of the ray, and z of what it meets [m]
    first_row, first_col : the window's first pixel
    fronts, per_side : as in `is_hidden`; nothing is unexpected if `per_side` is 0

    Returns
    -------
    Whether each ray does (ray).
    """
    is_unexpected = np.zeros(point.shape[1], np.bool_)
    if per_side > 0:
        for h in range(len(ray)):
            x, y = point[0, ray[h]] - first_col, point[1, ray[h]] - first_row
            is_unexpected[ray[h]] = is_hidden(x, y, 0.0, 0.0, 1.0 / depth_m[h], 0.0, fronts, per_side)
    return is_unexpected


@kernel
def distrust_fronts(fronts: np.ndarray, per_side: int, pixels: np.ndarray) -> None:
    """Change fronts so that they hide nothing in some pixels (row, col) of the window."""
    for row in range(pixels.shape[0]):
        for col in range(pixels.shape[1]):
            if pixels[row, col]:
                top, left = max(row * per_side - 1, 0), max(col * per_side - 1, 0)
                fronts[3, top : (row + 1) * per_side, left : (col + 1) * per_side] = np.inf
