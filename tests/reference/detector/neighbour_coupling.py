"""Coupling of neighbours pixel by pixel: the oracle of `rso_lidar.detector.stages.neighbour_coupling`."""

import numpy as np


def couple_rows(coupling, signal):
    """Return all rows of a signal (row, step) with the shares of their neighbours, by the step of the axis of time."""
    rows, (n_rows, n_cols) = coupling.rows, coupling.shape
    seen = {}  # by pixel: value by step
    for row, pixel in enumerate(rows.pixel):
        of = seen.setdefault(int(pixel), {})
        of.update({step: signal[row, step - rows.start[row]] for step in range(coupling.begin[row], coupling.end[row])})
    total = signal.astype(float)
    for row, pixel in enumerate(rows.pixel):
        for (down, right), factor in zip(coupling.offset, coupling.factor, strict=True):
            at = int(pixel // n_cols + down), int(pixel % n_cols + right)
            if not (0 <= at[0] < n_rows and 0 <= at[1] < n_cols):
                continue
            of = seen.get(at[0] * n_cols + at[1], {})
            total[row] += float(factor) * np.array([of.get(rows.start[row] + step, 0.0) for step in range(rows.length)])
    return total


def merge_bins(pixel, number, light, shape, neighbours, least_photons, most_photons):
    """Return photons, begin and end by pixel and bin, with what neighbours add."""
    total = {}
    for k in range(len(pixel)):
        for j, ((down, right), factor) in enumerate(zip(*neighbours, strict=True)):
            at = pixel[k] // shape[1] - down, pixel[k] % shape[1] - right  # that pixel sees this one at the offset
            if not (0 <= at[0] < shape[0] and 0 <= at[1] < shape[1]):
                continue
            photons = factor * (light[0][k] if j == 0 else min(light[0][k], most_photons))
            before = total.get((int(at[0] * shape[1] + at[1]), int(number[k])), (0.0, np.inf, -np.inf, False))
            total[int(at[0] * shape[1] + at[1]), int(number[k])] = (
                before[0] + photons,
                min(before[1], light[1][k]),
                max(before[2], light[2][k]),
                before[3] or j == 0,
            )
    return {place: found[:3] for place, found in sorted(total.items()) if found[3] or found[0] > least_photons}
