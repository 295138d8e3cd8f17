"""Line sampling in plain loops: pieces of contours, slabs, crossings, rays and variances, one by one.

The oracle of `rso_lidar.optics.rays.contour_images`, `rso_lidar.optics.rays.scan_lines`, `rso_lidar.optics.rays.slabs` and
`rso_lidar.optics.rays.line_rays.place_rays`. `touches` is, pixel by pixel, the oracle of
`rso_lidar.optics.rays.outlines.cover_pixels`.
"""

from itertools import pairwise

import numpy as np

SAME = 1e-6  # pixels: nearer ends are one


def cut_contours(ends, steps, window):
    """Return pieces (pixel of the window, column and row of both ends, slope, step), clipped to each pixel in turn."""
    top, bottom, left, right = window
    pieces = []
    for row in range(top, bottom):
        for col in range(left, right):
            for (x0, y0, x1, y1), step in zip(ends, steps, strict=True):
                if y1 < y0:
                    x0, y0, x1, y1 = x1, y1, x0, y0
                shares = [0.0, 1.0]
                for start, along, low in ((x0, x1 - x0, col), (y0, y1 - y0, row)):
                    if along == 0.0:
                        cut = [0.0, 1.0] if low <= start < low + 1 else [1.0, 0.0]
                    else:
                        cut = sorted([(low - start) / along, (low + 1 - start) / along])
                    shares = [max(shares[0], cut[0]), min(shares[1], cut[1])]
                if shares[0] < shares[1]:
                    at = [(x0 + s * (x1 - x0) - col, y0 + s * (y1 - y0) - row) for s in shares]
                    slope = (x1 - x0) / (y1 - y0) if y1 > y0 else 0.0
                    pieces.append(((row - top) * (right - left) + col - left, *at[0], *at[1], slope, step))
    return np.array(pieces).reshape(-1, 7)


def touches(outline, centre, half):
    """Return whether a convex outline (corner, row_col) comes within `half` of a point along both axes at once.

    Of two convex shapes that do not meet, the normal to one of their sides parts them.
    """
    sides = np.roll(outline, -1, axis=0) - outline
    for normal in [(1.0, 0.0), (0.0, 1.0), *zip(-sides[:, 1], sides[:, 0], strict=True)]:
        along = (outline - centre) @ normal
        reach = half * np.abs(normal).sum()
        if along.min() > reach or along.max() < -reach:
            return False
    return True


def find_ends(pieces, steep):
    """Return the different rows inside a pixel at which its contours end, but for steep ones; the outermost always count."""
    width = np.ptp(pieces[:, [0, 2]])
    counts = np.abs(pieces[:, 2] - pieces[:, 0]) >= steep * width * (pieces[:, 3] - pieces[:, 1])
    rows = np.sort(np.concatenate([pieces[counts][:, [1, 3]].ravel(), [pieces[:, 1].min(), pieces[:, 3].max()]]))
    rows = rows[np.diff(rows, prepend=-1.0) > SAME]
    return rows[(rows > SAME) & (rows < 1.0 - SAME)]


def estimate_slabs(pieces, steps, edges):
    """Return the variance of a pixel's photons by contours that cover a slab only in part.

    Beyond its ends a contour goes on upright. The error is the area between it and the upright line through the point at
    which it is on the middle row of the slab.
    """
    variance = 0.0
    for (x0, upper, x1, lower, _), step in zip(pieces, steps, strict=True):
        for top, bottom in pairwise(edges):
            a, b = max(upper, top), min(lower, bottom)
            if a > b:
                continue
            area, part = min(a - top, bottom - a), 1.0
            if b > a:
                row = np.array([top, a, b, bottom])
                middle = np.interp(0.5 * (top + bottom), [a, b], [0.0, 1.0])
                area, part = np.trapezoid([0.0, 0.0, 1.0, 1.0] - middle, row), (b - a) / (lower - upper)
            variance += (step * (x1 - x0) * part * area) ** 2
    return variance


def cross_line(pieces, row):
    """Return the columns at which a line crosses contours, sorted, and the numbers of the pieces."""
    number = np.flatnonzero((pieces[:, 1] < row) & (row <= pieces[:, 3]))
    column = pieces[number, 0] + pieces[number, 4] * (row - pieces[number, 1])
    order = np.argsort(column)
    return column[order], number[order]


def expect_changes(pieces, steps, row):
    """Return the change of mean light from line to line: a root sum of squares, -1 if no contour has 60 % of the sum."""
    expected = [0.0]
    for above, below in pairwise(row):
        squares = np.zeros(len(pieces))
        for i, (x0, upper, x1, lower, _) in enumerate(pieces):
            if lower > upper:
                share = np.diff(np.interp([above, below], [upper, lower], [0.0, 1.0]))[0]
            else:
                share = float(above < upper < below)
            squares[i] = (steps[i] * (x1 - x0) * share) ** 2
        is_known = squares.max(initial=0.0) >= 0.6 * squares.sum()
        expected.append(np.sqrt(squares.sum()) if is_known else -1.0)
    return np.array(expected)


def estimate_meeting(pieces, steps, gap, row, height):
    """Return the squared light of the area by which two contours may be in the wrong order, towards their farther end."""
    above, below = row - pieces[:, 1].max(), pieces[:, 3].min() - row
    off = np.linspace(0.0, min(0.5 * height, max(above, below)), 20_001)
    behind = np.maximum(off * abs(pieces[0, 4] - pieces[1, 4]) - gap, 0.0)
    return (min(steps) * np.trapezoid(behind, off)) ** 2


def image_straight(ends, pixel_tangent, middle_col, middle_row):
    """Return column and row of both ends (contour, 4); an end over 1e6 from the boresight is moved toward it."""
    far = np.maximum(np.abs(ends.reshape(-1, 2)).max(axis=1, keepdims=True) / 1e6, 1.0)
    return (ends.reshape(-1, 2) / far / pixel_tangent + [middle_col, middle_row]).reshape(-1, 4)


def correct_variance(weight, kind, change, light, is_unexpected, variance, calibration):
    """Return the variance of one pixel, the factor on what contours are expected to leave, and the pixel's photons.

    Parameters
    ----------
    weight, kind, change, light, is_unexpected : (ray); kinds are "line", "contour", "pair" and "texture"
    variance : as expected
    calibration : factors of changes at contours, in textures, of the twist of four rays, and of unexpected light
    """
    begin = np.flatnonzero(kind == "line")
    height = np.add.reduceat(weight, begin)
    mean = np.add.reduceat(weight * light, begin) / height
    between_rays, between_lines = np.diff(light, prepend=np.nan), np.diff(mean, prepend=np.nan)
    of_lines, of_rays = change[begin] > 0.0, kind == "contour"
    factor = 1.0
    if of_lines.any():
        factor = (between_lines[of_lines] ** 2).sum() / (change[begin][of_lines] ** 2).sum()
    elif of_rays.any():
        factor = (between_rays[of_rays] ** 2).sum() / (change[of_rays] ** 2).sum()
    factor = calibration[0] * min(factor, 3.0)
    is_texture = kind == "texture"
    uneven = calibration[3] * ((weight * light)[is_unexpected] ** 2).sum()
    uneven += calibration[1] * ((weight * between_rays)[is_texture] ** 2).sum()
    if is_texture.any():
        is_even = change[begin[1:]] == 0.0
        uneven += (((between_lines * height)[1:][is_even]) ** 2).sum() / 12.0
    if kind.tolist() == ["line", "pair"] * 2:
        uneven += calibration[2] * (weight[0] * (light @ [1.0, -1.0, -1.0, 1.0])) ** 2
    return factor * variance + uneven, factor, weight @ light


def merge_pixels(before, after, is_replaced):
    """Return the places of the entries of two joined lists, sorted by pixel, without the first list's replaced pixels."""
    both = np.concatenate([before, after])
    is_kept = np.concatenate([~is_replaced[before], np.full(len(after), True)])
    return np.flatnonzero(is_kept)[np.argsort(both[is_kept], kind="stable")]


def normalise(direction):
    """Return unit vectors (xyz, ray) along (x, y, 1)."""
    whole = np.stack([direction[0], direction[1], np.ones(direction.shape[1])])
    return whole / np.linalg.norm(whole, axis=0)
