"""Images of contours on the focal plane: edges of targets, and those of the beam."""

import math

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.probes import is_hidden
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Contours

_FEWEST_SIDES, _OFF_CIRCLE = 8, 0.01  # sides and distance [pixels] of the polygon that stands for a round beam's edge
_PIECES_OF_BENT = 8  # of a contour that a lens bends
_STRAIGHT = 0.01  # pixels: a contour that is bent less stays whole, so that its ends alone are edges of slabs
# Light over that on the axis, at the contours that stand for the profile of a narrow Gaussian beam: equal steps, and a tail
_RINGS = (0.9375, 0.8125, 0.6875, 0.5625, 0.4375, 0.3125, 0.1875, 0.0625, 0.02, 0.005, 0.001)
_NARROW = 2.0  # pixels: half the width of a Gaussian beam that needs them
_BRIGHT = 1e12  # photons: so many that no error of a beam alone is excused as noise
_NEVER_HIDDEN = 1e9  # 1/z [1/m]: nearer than anything
_FARTHEST = 1e6  # tangent of the greatest angle from the boresight at which an end keeps its place
GAUSSIAN_REACH = 3.5  # 1/e² radii; 2e-11 of the energy lands farther out


def image_contours(receiver: Receiver, laser: Laser, contours: Contours) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image the contours of targets and the edge of the beam onto the focal plane.

    Parameters
    ----------
    receiver, laser : the instrument
    contours : contours in the tangent plane

    Returns
    -------
    Columns and rows of both ends (contour, 4) [pixels]; steps of light (contour) [photons of a whole pixel]; 1/z of both
    ends (contour, 2) [1/m]. The edge of the beam has so large a 1/z that nothing is in front of it.
    """
    gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission
    steps = contours.step_per_sr_m2 * (laser.density_on_axis * gathered)
    ends, per_depth = contours.ends, contours.inverse_depth_per_m
    edge, share = _outline_beam(laser, receiver)
    if len(edge):
        typical = float(np.median(steps)) if len(steps) else _BRIGHT
        ends, steps = np.concatenate([ends, edge]), np.concatenate([steps, typical * share])
        per_depth = np.concatenate([per_depth, np.full((len(edge), 2), _NEVER_HIDDEN)])
    if receiver.distortion is None:
        middle = 0.5 * receiver.n_cols, 0.5 * receiver.n_rows
        return image_straight(packed(ends), receiver.pixel_tangent, *middle), packed(steps), packed(per_depth)
    ends, steps, per_depth = _bend_contours(ends, steps, per_depth, receiver)
    images = np.empty_like(ends)
    for end in (0, 2):
        images[:, end], images[:, end + 1] = receiver.image_of(ends[:, end], ends[:, end + 1])
    return images, packed(steps), packed(per_depth)


@kernel
def image_straight(ends: np.ndarray, pixel_tangent: float, middle_col: float, middle_row: float) -> np.ndarray:
    """Image ends of contours through a lens without distortion; an end far outside keeps its direction only.

    Parameters
    ----------
    ends : (contour, 4) right and down of both ends in the tangent plane
    middle_col, middle_row : where the boresight is [pixels]

    Returns
    -------
    Column and row of both ends (contour, 4) [pixels].
    """
    images = np.empty(ends.shape)
    for c in range(len(ends)):
        for end in (0, 2):
            x, y = ends[c, end], ends[c, end + 1]
            far = max(abs(x), abs(y)) / _FARTHEST
            if far > 1.0:
                x, y = x / far, y / far
            images[c, end], images[c, end + 1] = x / pixel_tangent + middle_col, y / pixel_tangent + middle_row
    return images


def _bend_contours(
    ends: np.ndarray, steps: np.ndarray, per_depth: np.ndarray, receiver: Receiver
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return contours within the field of a lens that distorts, those that it bends in pieces."""
    shares = np.broadcast_to([[0.0], [1.0]], (2, len(ends))).copy()
    for axis, edge in enumerate(receiver.field_edge):
        start, along = ends[:, axis], ends[:, axis + 2] - ends[:, axis]
        with np.errstate(divide="ignore", invalid="ignore"):
            cuts = np.sort([(-edge - start) / along, (edge - start) / along], axis=0)
        shares[0], shares[1] = np.fmax(shares[0], cuts[0]), np.fmin(shares[1], cuts[1])
    is_seen = shares[0] < shares[1]
    ends, steps, per_depth, shares = ends[is_seen], steps[is_seen], per_depth[is_seen], shares[:, is_seen]

    def point_at(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return right and down at shares (…, contour) of the way along contours."""
        x, y = (ends[:, axis] + share * (ends[:, axis + 2] - ends[:, axis]) for axis in (0, 1))
        return x, y

    at = shares[0] + (np.arange(_PIECES_OF_BENT + 1) / _PIECES_OF_BENT)[:, None] * (shares[1] - shares[0])
    image = np.stack(receiver.image_of(*point_at(at)))
    off = image[:, _PIECES_OF_BENT // 2] - 0.5 * (image[:, 0] + image[:, -1])
    is_bent = np.hypot(*off) > _STRAIGHT
    right, down = point_at(at)
    whole = np.stack([right[0], down[0], right[-1], down[-1]], axis=-1)[~is_bent]
    pieces = np.stack([right[:-1], down[:-1], right[1:], down[1:]], axis=-1)[:, is_bent]
    steps = np.concatenate([steps[~is_bent], np.tile(steps[is_bent], _PIECES_OF_BENT)])
    depth = per_depth[:, 0] + at * (per_depth[:, 1] - per_depth[:, 0])  # 1/z is even along a straight line's image
    of_both = np.stack([depth[:-1], depth[1:]], axis=-1)[:, is_bent].reshape(-1, 2)
    per_depth = np.concatenate([np.stack([depth[0], depth[-1]], axis=-1)[~is_bent], of_both])
    return np.concatenate([whole, pieces.reshape(-1, 4)]), steps, per_depth


def _outline_beam(laser: Laser, receiver: Receiver) -> tuple[np.ndarray, np.ndarray]:
    """Return the edge of the beam as contours (contour, 4) in the tangent plane, and their steps over the beam's light.

    A Gaussian beam has no edge. Where it is narrow, rings stand for it, with half the step of light to both neighbours.
    """
    half_width = laser.half_width_tangent
    covered = receiver.field_edge.max() * (1.0 if laser.footprint in ("square", "as_printed") else math.sqrt(2.0))
    if laser.offset is not None or half_width >= covered * (1.0 - 1e-12):
        return np.empty((0, 4)), np.empty(0)
    # No more sides than needed: a pixel's slabs end at all of their ends only while these are few.
    quarter = math.pi / math.sqrt(2.0 * _OFF_CIRCLE * receiver.pixel_tangent / half_width) / 4.0
    steps = np.ones(1)
    radii, corners, first = np.array([half_width]), max(_FEWEST_SIDES, 4 * math.ceil(quarter)), 0.0
    if laser.footprint == "gaussian":
        if half_width > _NARROW * receiver.pixel_tangent:
            return np.empty((0, 4)), np.empty(0)
        radii = half_width * np.sqrt(-0.5 * np.log(_RINGS))
        around = np.concatenate([[2.0 - _RINGS[0]], _RINGS, [0.0]])
        steps = 0.5 * (around[:-2] - around[2:])
    elif laser.footprint != "circle":
        radii, corners, first = radii * math.sqrt(2.0), 4, 0.25 * math.pi
    if corners > 4:
        radii = radii * math.sqrt(2.0 * math.pi / (corners * math.sin(2.0 * math.pi / corners)))
    angle = first + np.arange(corners) * (2.0 * math.pi / corners)
    right, down = radii[:, None] * np.cos(angle), radii[:, None] * np.sin(angle)
    ends = np.stack([right, down, np.roll(right, -1, axis=1), np.roll(down, -1, axis=1)], axis=-1).reshape(-1, 4)
    return ends, np.repeat(steps, corners)


@kernel
def cut_contours(
    ends: np.ndarray,
    steps: np.ndarray,
    per_depth: np.ndarray,
    sides: np.ndarray,
    top: int,
    left: int,
    fronts: np.ndarray,
    per_side: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut contours into the pieces that lie within single pixels of a window, and leave out those that are hidden.

    Parameters
    ----------
    ends : (contour, 4) column and row of the first end, then of the second [pixels]
    steps : (contour) steps of light
    per_depth : (contour, 2) 1/z of both ends [1/m]
    sides : (row, col) of the window, 0 in pixels whose pieces are left out
    top, left : the window's first row and column
    fronts, per_side : as in `probes.is_hidden`; no piece is hidden if `per_side` is 0

    Returns
    -------
    Where the pieces of each pixel of the window begin (pixel + 1), row by row. Column and row of both ends, within their
    pixel, the upper end first, and the change of column with row (piece, 5). Steps (piece).
    """
    n_rows, n_cols = sides.shape
    n, size = 0, 2 * len(ends) + 1024
    pixel, cut = np.empty(size, np.int32), np.empty((size, 6))  # in the order of contours
    for s in range(len(ends)):
        x0, y0, x1, y1 = ends[s, 0] - left, ends[s, 1] - top, ends[s, 2] - left, ends[s, 3] - top
        w0, w1 = per_depth[s, 0], per_depth[s, 1]
        if y1 < y0:
            x0, y0, x1, y1, w0, w1 = x1, y1, x0, y0, w1, w0
        if y1 <= 0.0 or y0 >= n_rows or max(x0, x1) <= 0.0 or min(x0, x1) >= n_cols:
            continue
        slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
        is_level = abs(x1 - x0) > y1 - y0
        deeper = (w1 - w0) / ((x1 - x0) if is_level else max(y1 - y0, 1e-12))  # along the longer side
        for row in range(max(0, math.floor(y0)), min(n_rows - 1, math.floor(y1)) + 1):
            up, down = max(y0, float(row)), min(y1, row + 1.0)
            begin = x0 + (up - y0) * slope
            end = x0 + (down - y0) * slope if down < y1 else x1
            low, high = min(begin, end), max(begin, end)
            for col in range(max(0, math.floor(low)), min(n_cols - 1, math.floor(high)) + 1):
                if sides[row, col] == 0:
                    continue
                first, last = min(max(begin - col, 0.0), 1.0), min(max(end - col, 0.0), 1.0)
                upper, lower = up - row, down - row
                if high > low:
                    rise = (down - up) / (end - begin)
                    upper = min(max(up - row + (first + col - begin) * rise, 0.0), 1.0)
                    lower = min(max(up - row + (last + col - begin) * rise, 0.0), 1.0)
                if per_side > 0:
                    w = w0 + deeper * ((first + col - x0) if is_level else (upper + row - y0))
                    dw = deeper * ((last - first) if is_level else (lower - upper))
                    if is_hidden(col + first, row + upper, last - first, lower - upper, w, dw, fronts, per_side):
                        continue
                if n == size:
                    size *= 2
                    pixel = np.concatenate((pixel, np.empty(n, np.int32)))
                    cut = np.concatenate((cut, np.empty((n, 6))))
                pixel[n] = row * n_cols + col
                cut[n, 0], cut[n, 1], cut[n, 2], cut[n, 3], cut[n, 4], cut[n, 5] = (
                    first,
                    upper,
                    last,
                    lower,
                    slope,
                    steps[s],
                )
                n += 1
    starts = np.zeros(n_rows * n_cols + 1, np.int64)
    for i in range(n):
        starts[pixel[i] + 1] += 1
    for p in range(n_rows * n_cols):
        starts[p + 1] += starts[p]
    pieces, strength, at = np.empty((n, 5)), np.empty(n), starts[:-1].copy()
    for i in range(n):
        place = at[pixel[i]]
        for k in range(5):
            pieces[place, k] = cut[i, k]
        strength[place] = cut[i, 5]
        at[pixel[i]] += 1
    return starts, pieces, strength
