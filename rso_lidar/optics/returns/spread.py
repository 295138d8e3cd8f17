"""Kernels of the blur: light of groups of returns spread over pixels, and gathered pixel by pixel."""

import math

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.optics.sorting import sort_by
from rso_lidar.ties import EQUAL


@kernel
def locate_rays(
    ray: np.ndarray, direction: np.ndarray, pixel_tangent: float, n_rows: int, n_cols: int
) -> tuple[np.ndarray, np.ndarray]:
    """Locate where in its pixel each hit's ray goes through, behind a lens without distortion.

    Parameters
    ----------
    ray : (hit) index of the ray
    direction : (xyz, ray) unit vectors of all rays
    pixel_tangent : side of a pixel in the tangent plane
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    (hit) distance from the pixel's upper edge, and from its left one [pixels], 0 to 1.
    """
    down, across = np.empty(len(ray)), np.empty(len(ray))
    for k in range(len(ray)):
        x, y, z = direction[0, ray[k]], direction[1, ray[k]], direction[2, ray[k]]
        col, row = x / z / pixel_tangent + 0.5 * n_cols, y / z / pixel_tangent + 0.5 * n_rows
        down[k], across[k] = row - math.floor(row), col - math.floor(col)
    return down, across


@kernel
def interpolate_shares(table: np.ndarray, down: float, across: float, shares: np.ndarray) -> None:
    """Interpolate shares linearly between the middles of sub-cells, so that the centroid of the light is exact.

    Parameters
    ----------
    table : (sub-cell, column), sub-cells by row and column, with one more on each side of the pixel
    down, across : place in the pixel, from its upper and left edges [pixels]
    shares : (column), written
    """
    wide = int(math.sqrt(len(table)) + 0.5)
    y, x = down * (wide - 2) + 0.5, across * (wide - 2) + 0.5  # in sub-cells from the middle of the first
    row, col = min(int(y), wide - 2), min(int(x), wide - 2)
    y, x, at = y - row, x - col, row * wide + col
    for j in range(len(shares)):
        upper = (1.0 - x) * table[at, j] + x * table[at + 1, j]
        lower = (1.0 - x) * table[at + wide, j] + x * table[at + wide + 1, j]
        shares[j] = (1.0 - y) * upper + y * lower


@kernel
def add_between_pixels(image: np.ndarray, row: int, col: int, down: float, across: float, value: float) -> None:
    """Add light to the four pixels about a place, so that its centroid is there. Light beside the image is lost.

    Parameters
    ----------
    image : (row, col), added to
    down, across : the place, from the middle of that pixel [pixels]
    """
    top, left = math.floor(down), math.floor(across)
    y, x = down - top, across - left
    for i in range(2):
        for j in range(2):
            r, c = row + int(top) + i, col + int(left) + j
            if 0 <= r < image.shape[0] and 0 <= c < image.shape[1]:
                image[r, c] += value * (y if i else 1.0 - y) * (x if j else 1.0 - x)


@kernel
def place_light(
    pixel: np.ndarray, down: np.ndarray, across: np.ndarray, photons: np.ndarray, n_rows: int, n_cols: int
) -> np.ndarray:
    """Return an image (row, col) of sources, each divided among the four pixels about its place.

    Parameters
    ----------
    pixel : (source)
    down, across : (source) place, from the middle of the pixel [pixels]
    photons : (source)
    n_rows, n_cols : pixels of the focal plane
    """
    image = np.zeros((n_rows, n_cols))
    for k in range(len(pixel)):
        add_between_pixels(image, pixel[k] // n_cols, pixel[k] % n_cols, down[k], across[k], photons[k])
    return image


@kernel
def group_by_delay(pixel: np.ndarray, delay_s: np.ndarray, bin_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Group the returns of each pixel by bins of delay.

    Parameters
    ----------
    pixel : (return), never falling
    delay_s : (return)

    Returns
    -------
    The returns in order of pixel and bin, and where each group begins in that order, with the number of returns last.
    """
    n = len(pixel)
    order, number, starts = np.empty(n, np.int64), np.empty(n), np.empty(n + 1, np.int64)
    spare = np.empty(n, np.int64), np.empty(n)
    nearest = delay_s.min()
    n_groups, start = 0, 0
    while start < n:
        stop, same = start, True
        while stop < n and pixel[stop] == pixel[start]:
            order[stop] = stop
            number[stop] = math.floor((delay_s[stop] - nearest) / bin_s)
            same = same and number[stop] == number[start]
            stop += 1
        if not same:
            sort_by(number, order, spare, start, stop)
        for k in range(start, stop):
            if k == start or number[k] != number[k - 1]:
                starts[n_groups] = k
                n_groups += 1
        start = stop
    starts[n_groups] = n
    return order, starts[: n_groups + 1].copy()


@kernel
def spread_groups(
    pixel: np.ndarray,
    delay_s: np.ndarray,
    photons: np.ndarray,
    spread_s: np.ndarray,
    coherence_cells: np.ndarray,
    hit: np.ndarray,
    order: np.ndarray,
    starts: np.ndarray,
    place: tuple[np.ndarray, np.ndarray],
    zone: np.ndarray,
    zones: int,
    shares: np.ndarray,
    beyond: np.ndarray,
    n_rows: int,
    n_cols: int,
) -> tuple[
    np.ndarray,
    np.ndarray,
    np.ndarray,
    tuple[np.ndarray, np.ndarray, np.ndarray],
    tuple[np.ndarray, np.ndarray, np.ndarray],
]:
    """Spread the light of groups of returns over the pixels near their own.

    Parameters
    ----------
    pixel, delay_s, photons, spread_s, coherence_cells, hit : (return) light before the lens
    order, starts : groups, as `group_by_delay` returns them
    place : (hit) where in its pixel each hit's ray goes through, from the upper edge and from the left one
    zone : (zone) index in `shares` of each zone of the field
    shares : (index, sub-cell, offset) of a ray's light, by where it lands
    beyond : (index, sub-cell, 3) what lands beyond the offsets: its share, and where it is to be placed times that share
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    Pixel, brightest hit and depth spread of each group. Then its light that lands far: photons, and place from the middle of
    the pixel, down and across. Then photons, mean delay and cells of coherence of the light that lands near (group, offset).
    """
    n_groups, n_offsets = len(starts) - 1, shares.shape[2]
    middle = n_offsets // 2
    at, brightest = np.empty(n_groups, np.int32), np.empty(n_groups, np.int32)
    width_s = np.empty(n_groups)
    away, away_down, away_across = np.zeros(n_groups), np.zeros(n_groups), np.zeros(n_groups)
    cell, outside = np.empty(n_offsets), np.empty(3)
    near = np.zeros((n_groups, n_offsets)), np.zeros((n_groups, n_offsets)), np.zeros((n_groups, n_offsets))
    for g in range(n_groups):
        first = order[starts[g]]
        row, col = pixel[first] // n_cols, pixel[first] % n_cols
        index = zone[row * zones // n_rows * zones + col * zones // n_cols]
        sent, sent_s, sent_cells = near[0][g], near[1][g], near[2][g]
        # Moments of delay about the first return, weighted by light; for the mean of a dark group by rays.
        total, early, square, dark_s, most = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(starts[g], starts[g + 1]):
            r = order[k]
            n, apart = photons[r], delay_s[r] - delay_s[first]
            interpolate_shares(shares[index], place[0][hit[r]], place[1][hit[r]], cell)
            interpolate_shares(beyond[index], place[0][hit[r]], place[1][hit[r]], outside)
            for j in range(n_offsets):
                sent[j] += n * cell[j]
                sent_s[j] += n * cell[j] * apart
                sent_cells[j] += coherence_cells[r] * cell[j]
            away[g] += n * outside[0]
            away_down[g] += n * outside[1]
            away_across[g] += n * outside[2]
            weight = max(n, 1e-30)
            total += weight
            early += weight * apart
            square += weight * (apart * apart + spread_s[r] * spread_s[r] / 12.0)
            dark_s += apart
            most = max(most, n)
        k = starts[g]
        while photons[order[k]] < most * (1.0 - EQUAL):
            k += 1
        best = order[k]
        for j in range(n_offsets):
            if sent[j] > 0.0:
                sent_s[j] = delay_s[first] + sent_s[j] / sent[j]
        if sent[middle] <= 0.0:  # a dark group keeps its return, without light
            sent_s[middle] = delay_s[first] + dark_s / (starts[g + 1] - starts[g])
        if away[g] > 0.0:
            away_down[g] /= away[g]
            away_across[g] /= away[g]
        width_s[g] = math.sqrt(max(12.0 * (square / total - (early / total) * (early / total)), 0.0))
        at[g], brightest[g] = pixel[first], hit[best]
    return at, brightest, width_s, (away, away_down, away_across), near


@kernel
def spread_steady_light(
    pixel: np.ndarray,
    rate_per_s: np.ndarray,
    place: tuple[np.ndarray, np.ndarray],
    zone: np.ndarray,
    zones: int,
    shares: np.ndarray,
    beyond: np.ndarray,
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Spread light without a delay, such as sunlight, over the pixels near its own.

    Parameters
    ----------
    pixel, rate_per_s : (source) pixel, and photons per second
    place : (source) where in its pixel each source is, from the upper edge and from the left one
    zone, shares, beyond, n_rows, n_cols : as for `spread_groups`

    Returns
    -------
    Photons per second that land near (row, col). Those that land farther away, at the places from which the far kernel of
    their zone spreads them (index, row, col).
    """
    side = int(math.sqrt(shares.shape[2]) + 0.5)
    reach = side // 2
    image, away = np.zeros((n_rows, n_cols)), np.zeros((len(shares), n_rows, n_cols))
    share, outside = np.empty(shares.shape[2]), np.empty(3)
    for k in range(len(pixel)):
        row, col, rate = pixel[k] // n_cols, pixel[k] % n_cols, rate_per_s[k]
        index, j = zone[row * zones // n_rows * zones + col * zones // n_cols], 0
        interpolate_shares(shares[index], place[0][k], place[1][k], share)
        interpolate_shares(beyond[index], place[0][k], place[1][k], outside)
        for down in range(row - reach, row + reach + 1):
            for across in range(col - reach, col + reach + 1):
                if 0 <= down < n_rows and 0 <= across < n_cols:
                    image[down, across] += rate * share[j]
                j += 1
        if outside[0] > 0.0:
            down, across = outside[1] / outside[0], outside[2] / outside[0]
            add_between_pixels(away[index], row, col, down, across, rate * outside[0])
    return image, away


@kernel
def order_by_pixel(pixel: np.ndarray, n_pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Return entries in order of their pixel, equal ones in their own order, and where each pixel's entries begin."""
    begins, order = np.zeros(n_pixels + 1, np.int64), np.empty(len(pixel), np.int64)
    for k in range(len(pixel)):
        begins[pixel[k] + 1] += 1
    for p in range(n_pixels):
        begins[p + 1] += begins[p]
    free = begins.copy()
    for k in range(len(pixel)):
        order[free[pixel[k]]] = k
        free[pixel[k]] += 1
    return order, begins


@kernel
def gather_returns(
    at: np.ndarray,
    brightest: np.ndarray,
    width_s: np.ndarray,
    near: tuple[np.ndarray, np.ndarray, np.ndarray],
    far: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    n_rows: int,
    n_cols: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Gather the light of each pixel: what stays there, what comes from near and what from far, ordered by delay.

    Parameters
    ----------
    at, brightest, width_s, near : groups of light, as `spread_groups` returns them
    far : pixel, delay, photons, depth spread, cells of coherence and hit of light from far away
    n_rows, n_cols : pixels of the focal plane

    Returns
    -------
    Pixel, delay, photons, depth spread, cells of coherence and hit of each return.
    """
    sent, sent_s, sent_cells = near
    n_groups, n_offsets = sent.shape
    side = int(math.sqrt(n_offsets) + 0.5)
    reach, middle = side // 2, n_offsets // 2
    # The source of a return is packed into one number: a group and one of its offsets, or an entry of `far` and the slot
    # behind the offsets.
    slots_log2, from_far = 0, n_offsets
    while 1 << slots_log2 <= from_far:
        slots_log2 += 1
    begins = order_by_pixel(at, n_rows * n_cols)[1]
    far_order, far_begins = order_by_pixel(far[0], n_rows * n_cols)
    n = n_groups + len(far_order)
    left, right = n_cols, 0
    for g in range(n_groups):
        left, right = min(left, at[g] % n_cols - reach), max(right, at[g] % n_cols + reach)
        for j in range(n_offsets):
            n += j != middle and sent[g, j] > 0.0
    top, bottom = at[0] // n_cols - reach, at[-1] // n_cols + reach
    if len(far_order) > 0:
        top, bottom, left, right = 0, n_rows, 0, n_cols
    source, delay_s, spare = np.empty(n, np.int64), np.empty(n), (np.empty(n, np.int64), np.empty(n))
    pixel, hit = np.empty(n, np.int32), np.empty(n, np.int32)
    photons, spread_s, coherence_cells = np.empty(n), np.empty(n), np.empty(n)
    n_returns = 0
    for row in range(max(top, 0), min(bottom + 1, n_rows)):
        for col in range(max(left, 0), min(right + 1, n_cols)):
            p, start = row * n_cols + col, n_returns
            for g in range(begins[p], begins[p + 1]):
                source[n_returns], delay_s[n_returns] = (g << slots_log2) + middle, sent_s[g, middle]
                n_returns += 1
            j = 0
            for down in range(row + reach, row - reach - 1, -1):
                for across in range(col + reach, col - reach - 1, -1):
                    if j != middle and 0 <= down < n_rows and 0 <= across < n_cols:
                        q = down * n_cols + across
                        for g in range(begins[q], begins[q + 1]):
                            if sent[g, j] > 0.0:
                                source[n_returns], delay_s[n_returns] = (g << slots_log2) + j, sent_s[g, j]
                                n_returns += 1
                    j += 1
            for k in range(far_begins[p], far_begins[p + 1]):
                source[n_returns], delay_s[n_returns] = (far_order[k] << slots_log2) + from_far, far[1][far_order[k]]
                n_returns += 1
            if n_returns - start > 1:
                sort_by(delay_s, source, spare, start, n_returns)
            for k in range(start, n_returns):
                g, j, pixel[k] = source[k] >> slots_log2, source[k] & ((1 << slots_log2) - 1), p
                if j == from_far:
                    photons[k], spread_s[k], coherence_cells[k], hit[k] = far[2][g], far[3][g], far[4][g], far[5][g]
                else:
                    photons[k], spread_s[k], coherence_cells[k], hit[k] = (
                        sent[g, j],
                        width_s[g],
                        sent_cells[g, j],
                        brightest[g],
                    )
    return (
        pixel[:n_returns],
        delay_s[:n_returns],
        photons[:n_returns],
        spread_s[:n_returns],
        coherence_cells[:n_returns],
        hit[:n_returns],
    )
