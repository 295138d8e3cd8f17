"""Sums over neighbours, pixel by pixel: the oracle of `rso_lidar.detector.chain.report_flags`."""

import numpy as np


def sum_neighbours(range_m, counts, offset, factor, near_m, explained):
    """Write the counts that each pixel's neighbours explain, by whole images moved against each other."""
    explained[:] = 0.0
    n_rows, n_cols = range_m.shape
    for (down, right), share in zip(offset, factor, strict=True):
        rows, cols = np.arange(n_rows) + down, np.arange(n_cols) + right
        inside = np.ix_((rows >= 0) & (rows < n_rows), (cols >= 0) & (cols < n_cols))
        here = np.ix_(np.flatnonzero((rows >= 0) & (rows < n_rows)), np.flatnonzero((cols >= 0) & (cols < n_cols)))
        there = np.ix_(rows[(rows >= 0) & (rows < n_rows)], cols[(cols >= 0) & (cols < n_cols)])
        assert range_m[here].shape == range_m[inside].shape
        with np.errstate(invalid="ignore"):
            near = np.abs(range_m[there] - range_m[here]) <= near_m
        explained[here] += share * np.where(near, counts[there], 0.0)


def sum_near_light(
    first, delay_s, photons, depth_spread_s, reported_s, n_cols, offset, factor, most_photons, near_s, sums
):
    """Sum the light about each reported delay, by masks over all returns."""
    own, coupled, mean_s, square_s2 = sums
    pixel = np.repeat(np.arange(len(first) - 1), np.diff(first))
    neighbours = [((0, 0), 1.0), *zip(offset, factor, strict=True)]
    for at in np.flatnonzero(np.isfinite(reported_s)):
        for j, ((down, right), share) in enumerate(neighbours):
            row, col = at // n_cols + down, at % n_cols + right
            if not (0 <= row < len(reported_s) // n_cols and 0 <= col < n_cols):
                continue
            some = (pixel == row * n_cols + col) & (np.abs(delay_s - reported_s[at]) <= near_s)
            light = photons[some].sum()
            if j > 0 and light > 0.0:
                share = share * min(light, most_photons) / light
            after_s = delay_s[some] - reported_s[at]
            (own if j == 0 else coupled)[at] += share * light
            mean_s[at] += share * (photons[some] * after_s).sum()
            square_s2[at] += share * (photons[some] * (after_s**2 + depth_spread_s[some] ** 2 / 12.0)).sum()
