"""Kernels that cut a pixel into slabs, through the middle of which scan lines are laid.

Slabs end where contours end, as long as they are few. An edge is known exactly wherever it passes through a slab; what is
left is the error of the slabs in which contours end.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel

# Choices between error and time, as docs/physics.md states them:
_ALL_EVENTS = 8  # so many ends of contours in a pixel may all be edges of slabs
_FIRST_SLABS, MOST_SLABS = 3, 64  # with more ends
BINS = 64  # of rows, in which the ends of contours are sorted
SAME = 1e-6  # pixels: nearer ends are one
_LEAST_WIDTH = 1e-3  # pixels: an upright contour counts as one so wide
NOISE_SHARE = 1.0 / 3.0  # of its photon noise: so much error a pixel may have in any case


@kernel
def choose_slabs(
    pieces: np.ndarray,
    steps: np.ndarray,
    begin: int,
    end: int,
    allowed: float,
    rough: float,
    steep: float,
    edges: np.ndarray,
    room: np.ndarray,
) -> tuple[int, float]:
    """Choose the slabs of a pixel.

    Parameters
    ----------
    pieces, steps : pieces of contours, as `contour_images.cut_contours` returns them
    begin, end : the pixel's pieces
    allowed : variance of the pixel's photons that is aimed at, if no contour is hidden; negative if it is not known
    rough : if `allowed` is not known, the error that is aimed at, over the light of half of the contours' box
    steep : the ends of a contour do not count that leans less, over the width of all contours of the pixel
    edges : (edge), written: edges of the slabs, from 0 to 1
    room : (3, bin), at least `BINS`, overwritten

    Returns
    -------
    The number of slabs, and the variance of the pixel's photons if no contour is hidden.
    """
    edges[0], edges[1] = 0.0, 1.0
    if begin == end:
        return 1, 0.0
    top, bottom, left, right, brightest = 1.0, 0.0, 1.0, 0.0, 0.0
    for i in range(begin, end):
        brightest = max(brightest, steps[i])
        left, right = min(left, pieces[i, 0], pieces[i, 2]), max(right, pieces[i, 0], pieces[i, 2])
        top, bottom = min(top, pieces[i, 1]), max(bottom, pieces[i, 3])
    total, row, largest = room[0], room[1], room[2]
    events, every = sort_ends(pieces, steps, begin, end, steep * (right - left), top, bottom, total, row)
    if events <= _ALL_EVENTS:
        slabs = 0
        for k in range(events):
            if edges[slabs] + SAME < row[k] < 1.0 - SAME:
                slabs += 1
                edges[slabs] = row[k]
        edges[slabs + 1] = 1.0
        return slabs + 1, estimate_slabs(pieces, steps, begin, end, edges, slabs + 1)
    if allowed < 0.0:
        allowed = max(rough * 0.5 * brightest * (right - left) * (bottom - top), NOISE_SHARE) ** 2
    if events > BINS:
        events, every, scale = BINS, 0.0, BINS / max(bottom - top, 1e-12)
        total[:BINS] = 0.0
        largest[:BINS] = row[:BINS] = -1.0
        for i in range(begin, end):
            weight = steps[i] * (abs(pieces[i, 2] - pieces[i, 0]) + _LEAST_WIDTH)
            for y in (pieces[i, 1], pieces[i, 3]):
                k = min(int((y - top) * scale), BINS - 1)
                total[k] += weight
                every += weight
                if weight > largest[k]:
                    largest[k], row[k] = weight, y
    # An end of a contour lies anywhere in its slab: the mean of its squared distance from the nearer edge is h²/12.
    spread = 0.0
    for i in range(begin, end):
        spread += (steps[i] * (pieces[i, 2] - pieces[i, 0])) ** 2
    slabs, variance = 1, 0.0
    wanted = max(_FIRST_SLABS, min(MOST_SLABS, int((bottom - top) * math.sqrt(spread / (12.0 * allowed)))))
    for _ in range(2):
        slabs, gathered = 0, 0.0
        for k in range(-1, events + 1):
            y = top if k < 0 else (bottom if k == events else row[k])
            gathered += total[k] if 0 <= k < events else every
            if gathered >= every / wanted and edges[slabs] + SAME < y < 1.0 - SAME:
                slabs += 1
                edges[slabs] = y
                gathered = 0.0
        slabs += 1
        edges[slabs] = 1.0
        variance = estimate_slabs(pieces, steps, begin, end, edges, slabs)
        if variance <= 1.5 * allowed or wanted >= MOST_SLABS:
            break
        wanted = min(MOST_SLABS, int(wanted * math.sqrt(variance / allowed)) + 2)
    return slabs, variance


@kernel
def sort_ends(
    pieces: np.ndarray,
    steps: np.ndarray,
    begin: int,
    end: int,
    steep: float,
    top: float,
    bottom: float,
    total: np.ndarray,
    row: np.ndarray,
) -> tuple[int, float]:
    """Sort the ends of a pixel's contours by row, except those of steep ones; stop after `BINS` different rows.

    Parameters
    ----------
    steep : greatest change of column with row of a contour whose ends do not count
    top, bottom : first and last row of the pixel's contours, which count in any case
    total, row : (end), written: width times step of the contours that end in a row, and the row

    Returns
    -------
    The number of different rows, and the sum of `total`.
    """
    count, every = 0, 0.0
    for i in range(begin - 1, end):
        upper, lower, weight = top, bottom, 0.0
        if i >= begin:
            upper, lower = pieces[i, 1], pieces[i, 3]
            width = abs(pieces[i, 2] - pieces[i, 0])
            if width < steep * (lower - upper):
                continue
            weight = steps[i] * (width + _LEAST_WIDTH)
        for y in (upper, lower):
            at = count
            while at > 0 and row[at - 1] > y:
                at -= 1
            every += weight
            if at > 0 and y - row[at - 1] <= SAME:
                total[at - 1] += weight
            elif at < count and row[at] - y <= SAME:
                total[at] += weight
            elif count >= BINS:
                return BINS + 1, every
            else:
                for j in range(count, at, -1):
                    row[j], total[j] = row[j - 1], total[j - 1]
                row[at], total[at] = y, weight
                count += 1
    return count, every


@kernel
def estimate_slabs(pieces: np.ndarray, steps: np.ndarray, begin: int, end: int, edges: np.ndarray, slabs: int) -> float:
    """Estimate the variance of a pixel's photons that is due to contours that end inside slabs.

    A contour that covers the width Δx within half of a slab, at the mean distance d from the slab's nearer edge, leaves an
    error of s Δx d, with its step s. One of the lean c that crosses the middle line, with m and n of the slab's height
    left above and below, leaves s c (m² - n²) / 2.
    """
    variance = 0.0
    for i in range(begin, end):
        upper, lower = pieces[i, 1], pieces[i, 3]
        width = abs(pieces[i, 2] - pieces[i, 0])
        first, stop = 0, slabs  # the slab in which the piece begins
        while stop - first > 1:
            middle = (first + stop) // 2
            if edges[middle] <= upper + SAME:
                first = middle
            else:
                stop = middle
        last = first
        while edges[last + 1] < lower - SAME:
            last += 1
        for j in (first, last):
            a, b, middle_row = max(upper, edges[j]), min(lower, edges[j + 1]), 0.5 * (edges[j] + edges[j + 1])
            if a < middle_row < b:
                lean = width / (lower - upper)
                wrong = lean * abs(a + b - 2.0 * middle_row) * 0.5 * (edges[j + 1] - edges[j] - (b - a))
            else:
                part = width * (max(b - a, 0.0) / (lower - upper) if lower > upper else 1.0)
                wrong = part * max(min(0.5 * (a + b) - edges[j], edges[j + 1] - 0.5 * (a + b)), 0.0)
            variance += (steps[i] * wrong) ** 2
            if first == last:
                break
    return variance
