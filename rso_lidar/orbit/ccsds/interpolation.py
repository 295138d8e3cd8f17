"""Polynomial interpolation of a table: Lagrange's, and Hermite's where rates are given too.

Each instant uses only its own window of rows, so the bits of its value do not depend on the other instants.
"""

from __future__ import annotations

import numpy as np

GREATEST_DEGREE = 31


def interpolate_lagrange(
    time_s: np.ndarray, nodes_s: np.ndarray, values: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate by the polynomial through the degree + 1 nearest rows.

    Parameters
    ----------
    time_s : (time,) instants within the nodes [s]
    nodes_s : (row,) increasing [s]
    values : (row, n)
    degree : degree of the polynomial; with fewer rows, the highest that they allow

    Returns
    -------
    values, rates : (time, n)
    """
    rows = _window(time_s, nodes_s, degree + 1)
    basis, slope, _ = _basis(time_s, nodes_s[rows])
    return _sums(values, rows, time_s, nodes_s, [(basis, None), (slope, None)], None)


def interpolate_hermite(
    time_s: np.ndarray, nodes_s: np.ndarray, values: np.ndarray, rates: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate by the polynomial that meets the values and the rates of the nearest rows.

    Parameters
    ----------
    time_s : (time,) instants within the nodes [s]
    nodes_s : (row,) increasing [s]
    values, rates : (row, n)
    degree : 2 m - 1 uses m rows; an even degree is raised by one

    Returns
    -------
    values, rates : (time, n)
    """
    rows = _window(time_s, nodes_s, (degree + 2) // 2)
    near = nodes_s[rows]
    basis, slope, own_slope = _basis(time_s, near)
    since = time_s[:, None] - near
    # H_k = (1 - 2 (t - t_k) l_k'(t_k)) l_k^2 for the values, (t - t_k) l_k^2 for the rates (Burden & Faires, thm. 3.9)
    lean = 1.0 - 2.0 * since * own_slope
    of_value = lean * basis**2, since * basis**2
    of_rate = 2.0 * (lean * slope - own_slope * basis) * basis, (basis + 2.0 * since * slope) * basis
    return _sums(values, rows, time_s, nodes_s, [of_value, of_rate], rates)


def _window(time_s: np.ndarray, nodes_s: np.ndarray, width: int) -> np.ndarray:
    """Return the numbers (time, width) of the rows around each instant, centred where the table allows.

    Parameters
    ----------
    nodes_s : (row,) increasing [s]
    width : number of rows
    """
    width = min(width, len(nodes_s))
    before = np.clip(np.searchsorted(nodes_s, time_s, side="right") - 1, 0, len(nodes_s) - 1)
    first = np.clip(before - (width - 1) // 2, 0, len(nodes_s) - width)
    return np.asarray(first[:, None] + np.arange(width))


def _basis(time_s: np.ndarray, near_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Lagrange's l_k(t), l_k'(t) and l_k'(t_k), all (time, width)."""
    width = near_s.shape[1]
    basis, slope, own = (np.empty_like(near_s) for _ in range(3))
    for k in range(width):
        others = [j for j in range(width) if j != k]
        per_s = {j: 1.0 / (near_s[:, k] - near_s[:, j]) for j in others}
        factor = {j: (time_s - near_s[:, j]) * per_s[j] for j in others}
        product, rate, own_rate = np.ones(len(time_s)), np.zeros(len(time_s)), np.zeros(len(time_s))
        for j in others:  # (p f)' = p' f + p f'
            rate = rate * factor[j] + product * per_s[j]
            product = product * factor[j]
            own_rate = own_rate + per_s[j]
        basis[:, k], slope[:, k], own[:, k] = product, rate, own_rate
    return basis, slope, own


def _sums(
    values: np.ndarray,
    rows: np.ndarray,
    time_s: np.ndarray,
    nodes_s: np.ndarray,
    weights: list[tuple[np.ndarray, np.ndarray | None]],
    rates: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the weighted sums for the value and for its rate, of differences to the nearest row, which cancel less.

    Parameters
    ----------
    values, rates : (row, n); rates may be None
    rows : (time, width) numbers of the rows in each window
    time_s, nodes_s : instants and nodes [s]
    weights : of the value and of its rate: weights (time, width) of the values, and of the rates or None
    """
    after = np.clip(np.searchsorted(nodes_s, time_s), 1, len(nodes_s) - 1)
    nearest = np.where(nodes_s[after] - time_s < time_s - nodes_s[after - 1], after, after - 1)
    middle = values[nearest]
    sums = []
    for of_values, of_rates in weights:
        total = np.zeros_like(middle)
        for k in range(rows.shape[1]):
            total += of_values[:, k, None] * (values[rows[:, k]] - middle)
            if of_rates is not None and rates is not None:
                total += of_rates[:, k, None] * rates[rows[:, k]]
        sums.append(total)
    return middle + sums[0], sums[1]
