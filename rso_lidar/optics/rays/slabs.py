"""Kernels that lay scan lines through pixels: a pixel is cut into slabs, and contours cut the middle line of each slab.

Between two neighbouring contours the light along a line is even. One ray therefore knows the light of the whole interval,
and an edge is known exactly wherever it passes through the slab (line sampling: Jones and Perry 2000; Sun et al. 2013).
What is left is the error of the slabs in which contours end. Slabs end where contours end, as long as they are few.
"""

import math

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.optics.sorting import sort_by

# Choices between error and time, as docs/physics.md states them:
_ALL_EVENTS = 8  # so many ends of contours in a pixel may all be edges of slabs
_FIRST_SLABS, _MOST_SLABS = 3, 64  # with more ends
_BINS = 64  # of rows, in which the ends of contours are sorted
_FEW_INTERVALS = 12  # of a line that all get a ray, however narrow they are
# Steps of sequences that fill an interval evenly, from line to line and from pixel to pixel: 1 / 1.618 (golden ratio), and
# 1 / 1.3247, the root of x³ = x + 1 (Roberts 2018).
_GOLDEN, _PLASTIC = 0.6180339887498949, 0.7548776662466927
_SAME = 1e-6  # pixels: nearer ends are one
_LEAST_WIDTH = 1e-3  # pixels: an upright contour counts as one so wide
# Relation of a ray to its predecessor: first of a line; across a contour; second of a pair; one of many in an interval that
# may have a texture.
LINE, CONTOUR, PAIR, TEXTURE = range(4)
UNKNOWN = -1.0  # change of light between two lines
_MOSTLY = 0.6  # share of the squares of all changes between two lines that the greatest has if it outweighs the others
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
    room : (3, bin), at least `_BINS`, overwritten

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
            if edges[slabs] + _SAME < row[k] < 1.0 - _SAME:
                slabs += 1
                edges[slabs] = row[k]
        edges[slabs + 1] = 1.0
        return slabs + 1, estimate_slabs(pieces, steps, begin, end, edges, slabs + 1)
    if allowed < 0.0:
        allowed = max(rough * 0.5 * brightest * (right - left) * (bottom - top), NOISE_SHARE) ** 2
    if events > _BINS:
        events, every, scale = _BINS, 0.0, _BINS / max(bottom - top, 1e-12)
        total[:_BINS] = 0.0
        largest[:_BINS] = row[:_BINS] = -1.0
        for i in range(begin, end):
            weight = steps[i] * (abs(pieces[i, 2] - pieces[i, 0]) + _LEAST_WIDTH)
            for y in (pieces[i, 1], pieces[i, 3]):
                k = min(int((y - top) * scale), _BINS - 1)
                total[k] += weight
                every += weight
                if weight > largest[k]:
                    largest[k], row[k] = weight, y
    # An end of a contour lies anywhere in its slab: the mean of its squared distance from the nearer edge is h²/12.
    spread = 0.0
    for i in range(begin, end):
        spread += (steps[i] * (pieces[i, 2] - pieces[i, 0])) ** 2
    slabs, variance = 1, 0.0
    wanted = max(_FIRST_SLABS, min(_MOST_SLABS, int((bottom - top) * math.sqrt(spread / (12.0 * allowed)))))
    for _ in range(2):
        slabs, gathered = 0, 0.0
        for k in range(-1, events + 1):
            y = top if k < 0 else (bottom if k == events else row[k])
            gathered += total[k] if 0 <= k < events else every
            if gathered >= every / wanted and edges[slabs] + _SAME < y < 1.0 - _SAME:
                slabs += 1
                edges[slabs] = y
                gathered = 0.0
        slabs += 1
        edges[slabs] = 1.0
        variance = estimate_slabs(pieces, steps, begin, end, edges, slabs)
        if variance <= 1.5 * allowed or wanted >= _MOST_SLABS:
            break
        wanted = min(_MOST_SLABS, int(wanted * math.sqrt(variance / allowed)) + 2)
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
    """Sort the ends of a pixel's contours by row, except those of steep ones; stop after `_BINS` different rows.

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
            if at > 0 and y - row[at - 1] <= _SAME:
                total[at - 1] += weight
            elif at < count and row[at] - y <= _SAME:
                total[at] += weight
            elif count >= _BINS:
                return _BINS + 1, every
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
            if edges[middle] <= upper + _SAME:
                first = middle
            else:
                stop = middle
        last = first
        while edges[last + 1] < lower - _SAME:
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


@kernel
def lay_lines(edges: np.ndarray, slabs: int, sides: int, row: np.ndarray, height: np.ndarray) -> int:
    """Lay one line or several through each slab of a pixel; return how many there are.

    Parameters
    ----------
    edges, slabs : as `choose_slabs` leaves them
    sides : rays along the side of a pixel that no contour crosses
    row, height : (line), written: where each line is, and the height that it stands for [pixels]
    """
    n = 0
    for slab in range(slabs):
        top, tall = edges[slab], edges[slab + 1] - edges[slab]
        lines = max(1, math.ceil(tall * sides - _SAME))
        for line in range(lines):
            row[n], height[n] = top + tall * (line + 0.5) / lines, tall / lines
            n += 1
    return n


@kernel
def cross_lines(
    pieces: np.ndarray,
    begin: int,
    end: int,
    row: np.ndarray,
    lines: int,
    starts: np.ndarray,
    filled: np.ndarray,
    first: np.ndarray,
    crossing: np.ndarray,
    by: np.ndarray,
    spare: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Find where the lines of a pixel cross contours.

    Parameters
    ----------
    begin, end : the pixel's pieces
    row, lines : as `lay_lines` leaves them
    starts : (line + 1), written: where the crossings of each line begin
    filled, first : (line) and (piece of the pixel), overwritten
    crossing, by, spare : (crossing), overwritten if they are long enough

    Returns
    -------
    Columns of the crossings, sorted along each line; the numbers of the pieces (crossing); and room for the next pixel.
    """
    starts[: lines + 1] = 0
    for i in range(begin, end):
        upper, lower = pieces[i, 1], pieces[i, 3]
        line, stop = 0, lines  # the first line below the piece's upper end
        while line < stop:
            middle = (line + stop) // 2
            if row[middle] <= upper:
                line = middle + 1
            else:
                stop = middle
        first[i - begin] = line
        while line < lines and row[line] <= lower:
            starts[line + 1] += 1
            line += 1
    for line in range(lines):
        starts[line + 1] += starts[line]
        filled[line] = starts[line]
    if starts[lines] > len(crossing):
        size = 2 * starts[lines]
        crossing, by, spare = np.empty(size), np.empty(size, np.int64), (np.empty(size, np.int64), np.empty(size))
    for i in range(begin, end):
        line = first[i - begin]
        while line < lines and row[line] <= pieces[i, 3]:
            at = filled[line]
            x = pieces[i, 0] + pieces[i, 4] * (row[line] - pieces[i, 1])
            crossing[at], by[at] = min(max(x, 0.0), 1.0), i
            filled[line] += 1
            line += 1
    for line in range(lines):
        sort_by(crossing, by, spare, starts[line], starts[line + 1])
    return crossing, by, spare


@kernel
def expect_changes(
    pieces: np.ndarray,
    steps: np.ndarray,
    begin: int,
    end: int,
    row: np.ndarray,
    lines: int,
    first: np.ndarray,
    expected: np.ndarray,
    greatest: np.ndarray,
) -> None:
    """Find by how much the mean light of each line may differ from that of the line before, if no contour is hidden.

    A contour that covers the width Δx between two lines changes the light by s Δx, with its step s; the squares are added.
    Where no contour outweighs the others, they may cancel, as both edges of a boom do, and the change is not known.

    Parameters
    ----------
    row, lines, first : as `cross_lines` leaves them
    expected : (line), written: photons of a whole pixel, 0 for the first line, or `UNKNOWN`
    greatest : (line), overwritten
    """
    expected[:lines] = greatest[:lines] = 0.0
    for i in range(begin, end):
        upper, lower = pieces[i, 1], pieces[i, 3]
        width, line = steps[i] * abs(pieces[i, 2] - pieces[i, 0]), max(first[i - begin], 1)
        while line < lines and row[line - 1] < lower:
            share = 1.0
            if lower > upper:
                share = (min(lower, row[line]) - max(upper, row[line - 1])) / (lower - upper)
            expected[line] += (width * share) ** 2
            greatest[line] = max(greatest[line], (width * share) ** 2)
            line += 1
    for line in range(lines):
        expected[line] = math.sqrt(expected[line]) if greatest[line] >= _MOSTLY * expected[line] else UNKNOWN


@kernel
def place_rays(
    starts: np.ndarray,
    pieces: np.ndarray,
    steps: np.ndarray,
    per_side: np.ndarray,
    first_row: int,
    first_col: int,
    n_cols: int,
    allowed: np.ndarray,
    rough: float,
    narrow: float,
    steep: float,
    is_shifted: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Place the rays of the pixels in a window.

    Parameters
    ----------
    starts, pieces, steps : pieces of contours, as `contour_images.cut_contours` returns them
    per_side : (row, col) rays along the side of a pixel that no contour crosses; 0 where nothing can be seen
    first_row, first_col : the window's first pixel
    n_cols : columns of the focal plane
    allowed : (row, col) variance of a pixel's photons, as in `choose_slabs`
    rough : as in `choose_slabs`
    narrow : neighbouring intervals share a ray if they are together narrower than this share of their line's contours
    steep : as in `choose_slabs`
    is_shifted : whether rays of a pixel without contours, if it has three or more a side, lie at different columns and rows
        of their cells; each of them once, so that their mean is the pixel's middle

    Returns
    -------
    Points (col_row, ray) on the focal plane [pixels]. Of each ray (ray): pixel, weight, rms side of its share [pixels],
    relation to its predecessor, and the step of light between the two; for the first ray of a line, the expected change of
    the line's mean light. Variance (row, col) of the photons of the window's pixels, if no contour is hidden.
    """
    height, width = per_side.shape
    variance, most, even = np.zeros(per_side.shape), 0, 0
    for p in range(height * width):
        most = max(most, starts[p + 1] - starts[p])
        even += per_side[p // width, p % width] ** 2
    edges, room = np.empty(_MOST_SLABS + _BINS), np.empty((3, _BINS))
    many = (_MOST_SLABS + 2) * (1 + per_side.max()) if per_side.size else 0
    line_row, line_height, line_starts = np.empty(many), np.empty(many), np.empty(many + 1, np.int64)
    filled, first_line = np.empty(many, np.int64), np.empty(most, np.int64)
    expected, greatest = np.empty(many), np.empty(many)
    crossing, by, spare = np.empty(4096), np.empty(4096, np.int64), (np.empty(4096, np.int64), np.empty(4096))
    size = even + 3 * len(pieces) + 4096
    point, pixel, weight, side = np.empty((2, size)), np.empty(size, np.int32), np.empty(size), np.empty(size)
    kind, change = np.empty(size, np.int8), np.empty(size)
    n = 0
    for p in range(height * width):
        row, col = p // width, p % width
        sides = per_side[row, col]
        if sides == 0:
            continue
        begin, end, pixel_of = starts[p], starts[p + 1], (first_row + row) * n_cols + first_col + col
        lines = sides
        if begin < end:
            slabs, variance[row, col] = choose_slabs(
                pieces, steps, begin, end, allowed[row, col], rough, steep, edges, room
            )
            lines = lay_lines(edges, slabs, sides, line_row, line_height)
            crossing, by, spare = cross_lines(
                pieces, begin, end, line_row, lines, line_starts, filled, first_line, crossing, by, spare
            )
            expect_changes(pieces, steps, begin, end, line_row, lines, first_line, expected, greatest)
        needed = n + lines * (sides + 2) + (line_starts[lines] if begin < end else 0)
        if needed > size:
            size = 2 * needed
            point, pixel, weight, side, kind, change = (
                np.concatenate((point, np.empty((2, size - point.shape[1]))), axis=1),
                np.concatenate((pixel, np.empty(size - len(pixel), np.int32))),
                np.concatenate((weight, np.empty(size - len(weight)))),
                np.concatenate((side, np.empty(size - len(side)))),
                np.concatenate((kind, np.empty(size - len(kind), np.int8))),
                np.concatenate((change, np.empty(size - len(change)))),
            )
        if begin == end:
            n = fill_evenly(point, weight, side, kind, n, sides, first_col + col, first_row + row, pixel_of, is_shifted)
            pixel[n - sides * sides : n] = pixel_of
            change[n - sides * sides : n] = 0.0
            continue
        for line in range(lines):
            first, last = line_starts[line], line_starts[line + 1]
            y, h = line_row[line], line_height[line]
            turn = pixel_of * _PLASTIC + line * _GOLDEN
            turn -= math.floor(turn)
            least = narrow * (crossing[last - 1] - crossing[first]) if last - first > _FEW_INTERVALS else 0.0
            left, step, shared, uncertain, is_first = 0.0, expected[line], 0.0, 0.0, True
            for k in range(first, last + 1):
                across = (crossing[k] if k < last else 1.0) - left
                if k > first:
                    if not is_first:
                        step = max(step, steps[by[k - 1]])
                    if k < last:
                        uncertain += estimate_meeting(
                            pieces, steps, by[k - 1], by[k], crossing[k] - crossing[k - 1], y, h
                        )
                if k < last:
                    following = (crossing[k + 1] if k + 1 < last else 1.0) - left
                    if across <= _SAME:
                        continue
                    if across < least and following < least:
                        shared = max(shared, steps[by[k]])
                        continue
                elif across <= _SAME:
                    continue
                rays = max(1, math.ceil(across * sides - _SAME))
                # Between contours rays keep off the ends: a curved edge is near its chords, not on them.
                at_line = turn if shared > 0.0 else 0.5
                for r in range(rays):
                    point[0, n], point[1, n] = (
                        first_col + col + left + across * (r + at_line) / rays,
                        first_row + row + y,
                    )
                    pixel[n], weight[n] = pixel_of, across * h / rays
                    side[n] = math.sqrt(0.5 * ((across / rays) ** 2 + h * h))
                    kind[n] = (LINE if is_first else CONTOUR) if r == 0 else (PAIR if sides == 2 else TEXTURE)
                    change[n] = step if r == 0 else 0.0
                    n += 1
                if shared > 0.0:
                    uncertain += (shared * across * h) ** 2 / 6.0
                left, step, shared, is_first = left + across, 0.0, 0.0, False
            variance[row, col] += uncertain
    return point[:, :n], pixel[:n], weight[:n], side[:n], kind[:n], change[:n], variance


@kernel
def fill_evenly(
    point: np.ndarray,
    weight: np.ndarray,
    side: np.ndarray,
    kind: np.ndarray,
    n: int,
    sides: int,
    col: int,
    row: int,
    pixel: int,
    is_shifted: bool,
) -> int:
    """Place the rays of a pixel without contours, sides x sides, after the first `n`; return how many there are then.

    Parameters
    ----------
    point, weight, side, kind : (ray), written, as `place_rays` returns them
    col, row : of the pixel
    pixel : its number, which turns the order of columns and rows
    is_shifted : as in `place_rays`
    """
    multiplier = max(1, round(_GOLDEN * sides))
    while math.gcd(multiplier, sides) > 1:
        multiplier += 1
    h, is_lattice = 1.0 / sides, is_shifted and sides > 2
    share, width = h / sides, math.sqrt(0.5 * ((1.0 / sides) ** 2 + h * h))
    of_line = pixel % sides
    for line in range(sides):
        y, at_line, of_ray = (line + 0.5) / sides, 0.5, pixel % sides
        if is_lattice:
            at_line = (of_line + 0.5) / sides
        for r in range(sides):
            at_ray = y
            if is_lattice:
                at_ray = y + h * ((of_ray + 0.5) / sides - 0.5)
                of_ray += multiplier
                of_ray -= sides if of_ray >= sides else 0
            point[0, n], point[1, n] = col + (r + at_line) / sides, row + at_ray
            weight[n], side[n] = share, width
            kind[n] = LINE if r == 0 else (PAIR if sides == 2 else TEXTURE)
            n += 1
        of_line += multiplier
        of_line -= sides if of_line >= sides else 0
    return n


@kernel
def estimate_meeting(
    pieces: np.ndarray, steps: np.ndarray, one: int, other: int, gap: float, row: float, height: float
) -> float:
    """Estimate the variance of the photons of a slab in which two neighbouring contours may cross each other.

    Parameters
    ----------
    one, other : numbers of the pieces
    gap : between them on the slab's line [pixels]
    row, height : of the line, and of its slab [pixels]
    """
    turned = abs(pieces[one, 4] - pieces[other, 4])
    if 0.5 * turned * height <= gap:
        return 0.0
    above, below = row - max(pieces[one, 1], pieces[other, 1]), min(pieces[one, 3], pieces[other, 3]) - row
    behind = turned * min(0.5 * height, max(above, below)) - gap  # how far one is behind the other at the farther end
    if behind <= 0.0:
        return 0.0
    return float((min(steps[one], steps[other]) * behind * behind / (2.0 * turned)) ** 2)
