"""Kernels that lay scan lines through pixels: a pixel is cut into slabs, and contours cut the middle line of each slab.

Between two neighbouring contours the light along a line is even. One ray therefore knows the light of the whole interval,
and an edge is known exactly wherever it passes through the slab (line sampling: Jones and Perry 2000; Sun et al. 2013).
What is left is the error of the slabs in which contours end. Slabs end where contours end, as long as they are few.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel

# Choices between error and time, as docs/physics.md states them:
_ALL_EVENTS = 12  # so many ends of contours in a pixel may all be edges of slabs
_FIRST_SLABS, _MOST_SLABS = 6, 64  # with more ends
_BINS = 64  # of rows, in which the ends of contours are sorted
_FEW_INTERVALS = 8  # of a line that all get a ray, however narrow they are
_WIDE = 0.5  # pixels: wider intervals and taller slabs get two rays or lines, at the points of Gauss
_GAUSS = 0.5 - 0.5 / math.sqrt(3.0)
_GOLDEN = 0.6180339887498949  # steps of a sequence that fills an interval evenly
_SAME = 1e-6  # pixels: nearer ends are one
# How a ray follows the one before it, in `jump`: the line's first, the second of a pair, one of many in a texture. A
# positive number is the step of the contour between the two.
LINE, PAIR, TEXTURE = -1.0, 0.0, -2.0


@kernel
def choose_slabs(
    pieces: np.ndarray, steps: np.ndarray, begin: int, end: int, error: float, edges: np.ndarray, room: np.ndarray
) -> tuple[int, float]:
    """Choose the slabs of a pixel.

    Parameters
    ----------
    pieces, steps : pieces of contours, as `contour_images.cut_contours` returns them
    begin, end : the pixel's pieces
    error : relative error of the pixel's light that is aimed at
    edges : (edge), written: edges of the slabs, from 0 to 1
    room : (3, bin), at least `_BINS`, overwritten

    Returns
    -------
    The number of slabs, and the variance of the pixel's photons if no contour is hidden.
    """
    edges[0], edges[1] = 0.0, 1.0
    if begin == end:
        return 1, 0.0
    top, bottom, left, right, brightest = 1.0, 0.0, 1.0, 0.0, 0.0
    events = 0  # ends of contours at different rows, the upper ones sorted in `edges`
    for i in range(begin, end):
        brightest = max(brightest, steps[i])
        left, right = min(left, pieces[i, 0], pieces[i, 2]), max(right, pieces[i, 0], pieces[i, 2])
        for y in (pieces[i, 1], pieces[i, 3]):
            top, bottom = min(top, y), max(bottom, y)
            if events <= _ALL_EVENTS:
                at = events + 1
                while edges[at - 1] > y:
                    at -= 1
                if y - edges[at - 1] > _SAME and (at > events or edges[at] - y > _SAME) and y < 1.0 - _SAME:
                    for j in range(events, at - 1, -1):
                        edges[j + 1] = edges[j]
                    edges[at] = y
                    events += 1
    if events <= _ALL_EVENTS:
        edges[events + 1] = 1.0
        return events + 1, 0.0
    expected = 0.5 * brightest * max((right - left) * (bottom - top), 1e-6)
    allowed = max(error * expected, math.sqrt(max(expected, 1.0)) * NOISE_SHARE) ** 2
    total, largest, row = room[0], room[1], room[2]
    total[:_BINS] = 0.0
    largest[:_BINS] = -1.0
    scale, every = _BINS / max(bottom - top, 1e-12), 0.0
    for i in range(begin, end):
        weight = steps[i] * (abs(pieces[i, 2] - pieces[i, 0]) + 1e-3)
        for y in (pieces[i, 1], pieces[i, 3]):
            b = min(int((y - top) * scale), _BINS - 1)
            total[b] += weight
            every += weight
            if weight > largest[b]:
                largest[b], row[b] = weight, y
    slabs, wanted, variance = 1, _FIRST_SLABS, 0.0
    for _ in range(3):
        slabs, gathered = 0, 0.0
        for b in range(-1, _BINS):
            y = top if b < 0 else row[b]
            gathered += 0.0 if b < 0 else total[b]
            if (b < 0 or gathered >= every / wanted) and edges[slabs] + _SAME < y < 1.0 - _SAME:
                slabs += 1
                edges[slabs] = y
                gathered = 0.0
        slabs += 1
        edges[slabs] = 1.0
        variance = estimate_slabs(pieces, steps, begin, end, edges, slabs)
        if variance <= allowed or wanted >= _MOST_SLABS:
            break
        wanted = min(_MOST_SLABS, int(wanted * math.sqrt(variance / allowed)) + 2)
    return slabs, variance


NOISE_SHARE = 1.0 / 3.0  # of its photon noise: so much error a pixel may have in any case


@kernel
def estimate_slabs(pieces: np.ndarray, steps: np.ndarray, begin: int, end: int, edges: np.ndarray, slabs: int) -> float:
    """Estimate the variance of a pixel's photons that is due to contours that end inside slabs.

    A contour that covers the width Δx within a slab, at the distance d from the slab's nearer edge, leaves an error of
    s Δx d, with its step s.
    """
    variance = 0.0
    for i in range(begin, end):
        upper, lower = pieces[i, 1], pieces[i, 3]
        width = abs(pieces[i, 2] - pieces[i, 0])
        first, stop = 0, slabs  # the slab in which the piece begins
        while stop - first > 1:
            middle = (first + stop) // 2
            if edges[middle] <= upper + _SAME:
                first = middle
            else:
                stop = middle
        last = first
        while edges[last + 1] < lower - _SAME:
            last += 1
        for j in (first, last):
            a, b = max(upper, edges[j]), min(lower, edges[j + 1])
            if a > edges[j] + _SAME or b < edges[j + 1] - _SAME:
                part = width * ((b - a) / (lower - upper) if lower > upper else 1.0)
                variance += (steps[i] * part * min(0.5 * (a + b) - edges[j], edges[j + 1] - 0.5 * (a + b))) ** 2
            if first == last:
                break
    return variance


@kernel
def place_rays(
    starts: np.ndarray,
    pieces: np.ndarray,
    steps: np.ndarray,
    per_side: np.ndarray,
    first_row: int,
    first_col: int,
    n_cols: int,
    error: float,
    narrow: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Place the rays of the pixels in a window.

    Parameters
    ----------
    starts, pieces, steps : pieces of contours, as `contour_images.cut_contours` returns them
    per_side : (row, col) rays along the side of a pixel that no contour crosses; 0 where nothing can be seen
    first_row, first_col : the window's first pixel
    n_cols : columns of the focal plane
    error : relative error of a pixel's light that is aimed at
    narrow : neighbouring intervals share a ray if they are together narrower than this share of their line's contours

    Returns
    -------
    Points (col_row, ray) on the focal plane [pixels]; pixels and weights (ray); how each ray follows the one before, as
    at the top of this module (ray). Variance (row, col) of the photons of the window's pixels if no contour is hidden.
    """
    height, width = per_side.shape
    variance, most = np.zeros(per_side.shape), 1
    for p in range(height * width):
        most = max(most, starts[p + 1] - starts[p])
    crossing, slope, strength = np.empty(most + 1), np.empty(most + 1), np.empty(most + 1)
    edges, room = np.empty(max(_MOST_SLABS, _ALL_EVENTS, _BINS) + 4), np.empty((3, _BINS))
    size = 3 * len(pieces) + 4 * height * width + 4096
    point, pixel, weight, jump = np.empty((2, size)), np.empty(size, np.int32), np.empty(size), np.empty(size)
    n, turn = 0, 0.0
    for p in range(height * width):
        row, col = p // width, p % width
        sides = per_side[row, col]
        begin, end = starts[p], starts[p + 1]
        if sides == 0:
            continue
        slabs, variance[row, col] = choose_slabs(pieces, steps, begin, end, error, edges, room)
        for slab in range(slabs):
            tall = edges[slab + 1] - edges[slab]
            lines = 1 if tall <= 1.0 / sides else (sides if sides == 2 else math.ceil(tall * sides))
            for line in range(lines):
                h = tall / lines
                y = edges[slab] + (line + 0.5) * h
                if lines == 2:
                    y = edges[slab] + tall * (_GAUSS if line == 0 else 1.0 - _GAUSS)
                count = cross_line(pieces, steps, begin, end, y, crossing, slope, strength)
                room_for = n + 2 * (count + 1) * sides + 2
                if room_for > size:
                    size = 2 * room_for
                    point, pixel, weight, jump = (
                        extend_rows(point, size),
                        extend(pixel, size),
                        extend(weight, size),
                        extend(jump, size),
                    )
                turn += _GOLDEN
                turn -= math.floor(turn)
                variance[row, col] += estimate_crossings(crossing, slope, strength, count, h)
                least = narrow * (crossing[count - 1] - crossing[0]) if count > _FEW_INTERVALS else 0.0
                left, step, shared = 0.0, LINE, 0.0
                for k in range(count + 1):
                    right = crossing[k] if k < count else 1.0
                    across = right - left
                    if k > 0 and step != LINE:
                        step = max(step, strength[k - 1])
                    if k < count and (
                        across <= _SAME or (across < least and crossing_after(crossing, k, count) - left < least)
                    ):
                        shared = max(shared, strength[k])
                        continue
                    if across <= _SAME and k == count:
                        continue
                    rays = 1 if across <= 1.0 / sides else (2 if sides == 2 else math.ceil(across * sides))
                    for r in range(rays):
                        at = (r + turn) / rays
                        if rays == 1 and shared == 0.0 and sides == 2:
                            at = 0.5
                        elif rays == 2 and sides == 2:
                            at = _GAUSS if r == 0 else 1.0 - _GAUSS
                        point[0, n], point[1, n] = first_col + col + left + across * at, first_row + row + y
                        pixel[n], weight[n] = (first_row + row) * n_cols + first_col + col, across * h / rays
                        jump[n] = step if r == 0 else (PAIR if sides == 2 else TEXTURE)
                        n += 1
                    if shared > 0.0:
                        variance[row, col] += (shared * across * h) ** 2 / 6.0
                    left, step, shared = right, 0.0, 0.0
    return point[:, :n], pixel[:n], weight[:n], jump[:n], variance


@kernel
def crossing_after(crossing: np.ndarray, k: int, count: int) -> float:
    """Return where the interval after number k ends."""
    return float(crossing[k + 1]) if k + 1 < count else 1.0


@kernel
def extend(values: np.ndarray, size: int) -> np.ndarray:
    """Return a longer copy of values."""
    longer = np.empty(size, values.dtype)
    longer[: len(values)] = values
    return longer


@kernel
def extend_rows(values: np.ndarray, size: int) -> np.ndarray:
    """Return a copy of values (row, column) with more columns."""
    longer = np.empty((values.shape[0], size))
    longer[:, : values.shape[1]] = values
    return longer


@kernel
def cross_line(
    pieces: np.ndarray,
    steps: np.ndarray,
    begin: int,
    end: int,
    y: float,
    crossing: np.ndarray,
    slope: np.ndarray,
    strength: np.ndarray,
) -> int:
    """Find where a line crosses contours, sorted along the line; return how many there are.

    Parameters
    ----------
    y : row of the line within the pixel
    crossing, slope, strength : (crossing), written: column, change of column with row, and step
    """
    count = 0
    for i in range(begin, end):
        upper, lower = pieces[i, 1], pieces[i, 3]
        if not upper < y <= lower:
            continue
        lean = (pieces[i, 2] - pieces[i, 0]) / (lower - upper)
        x = pieces[i, 0] + lean * (y - upper)
        at = count
        while at > 0 and crossing[at - 1] > x:
            crossing[at], slope[at], strength[at] = crossing[at - 1], slope[at - 1], strength[at - 1]
            at -= 1
        crossing[at], slope[at], strength[at] = x, lean, steps[i]
        count += 1
    return count


@kernel
def estimate_crossings(
    crossing: np.ndarray, slope: np.ndarray, strength: np.ndarray, count: int, height: float
) -> float:
    """Estimate the variance of the photons of a slab in which neighbouring contours cross each other.

    Parameters
    ----------
    crossing, slope, strength, count : as `cross_line` leaves them
    height : of the slab [pixels]
    """
    variance = 0.0
    for k in range(count - 1):
        turned = abs(slope[k + 1] - slope[k])
        behind = 0.5 * turned * height - (crossing[k + 1] - crossing[k])  # at the slab's edge, if positive
        if behind > 0.0:
            variance += (min(strength[k], strength[k + 1]) * behind**2 / (2.0 * turned)) ** 2
    return variance


@kernel
def correct_variance(
    pixel: np.ndarray,
    weight: np.ndarray,
    jump: np.ndarray,
    light: np.ndarray,
    variance: np.ndarray,
    per_step: float,
    per_texture: float,
    per_twist: float,
) -> None:
    """Correct the variance of pixels by what their rays met.

    A hidden contour changes nothing: the variance due to contours is multiplied by the squared steps of light that were
    met, over those that were expected. In pixels without contours, differences of light between rays are added.

    Parameters
    ----------
    pixel, weight, jump : (ray) as `place_rays` returns them
    light : (ray) photons of a whole pixel that is as bright as the ray's hit
    variance : (pixel), changed
    per_step, per_texture, per_twist : variance over what is expected, over squared differences of neighbours, and over
        the squared twist of four rays
    """
    n, i = len(pixel), 0
    while i < n:
        first = i
        met, expected, uneven = 0.0, 0.0, 0.0
        while i < n and pixel[i] == pixel[first]:
            if jump[i] > 0.0:
                met += min((light[i] - light[i - 1]) ** 2, jump[i] ** 2)
                expected += jump[i] ** 2
            elif jump[i] == TEXTURE:
                uneven += per_texture * (weight[i] * (light[i] - light[i - 1])) ** 2
            i += 1
        if i - first == 4 and jump[first + 1] == PAIR and jump[first + 3] == PAIR:
            twist = light[first] - light[first + 1] - light[first + 2] + light[first + 3]
            uneven += per_twist * (weight[first] * twist) ** 2
        share = met / expected if expected > 0.0 else 1.0
        variance[pixel[first]] = per_step * share * variance[pixel[first]] + uneven
