"""Hat weights: a blur kernel brought to a grid, ready to be summed over pixels.

The hat weight of a grid point is the kernel's integral against a product of triangles of half-width h, the grid's step.
With h = pitch / sub no information is lost. A point of the kernel displaces the light of a sub-cell of side h. Its
overlap with a pixel is linear between multiples of h. Sums of hat weights over the steps from sub-cell to pixel are
therefore exact.
"""

import math
from typing import NamedTuple

import numpy as np

_POINTS = 2**19  # points of a kernel processed at a time, to bound memory


class HatGrid(NamedTuple):
    """Grid of a kernel: step `step_m`, out to `reach_steps` each way, turned by `turn_rad`."""

    step_m: float
    reach_steps: int
    blur_m: float  # wavelength times f-number
    turn_rad: float = 0.0


def gaussian_hats(sigma_m: float, at: HatGrid) -> np.ndarray:
    """Return the hat weights (row, col) of a Gaussian, exactly: its second antiderivative, differenced twice."""
    from scipy.special import erf

    x = np.arange(-at.reach_steps - 1, at.reach_steps + 2) * at.step_m
    bell = sigma_m / math.sqrt(2.0 * math.pi) * np.exp(-0.5 * (x / sigma_m) ** 2)
    twice = 0.5 * x * erf(x / (math.sqrt(2.0) * sigma_m)) + bell  # up to a linear function, which differences remove
    line = np.diff(twice, 2).clip(0.0) / at.step_m
    hats: np.ndarray = np.multiply.outer(line, line)
    return hats


def halo_hats(radius_m: float, at: HatGrid) -> np.ndarray:
    """Return the hat weights of R (R² + r²)^(-3/2) / 2π: its mixed fourth antiderivative, differenced twice each way."""
    x = np.arange(-at.reach_steps - 1, at.reach_steps + 2) * (at.step_m / radius_m)
    y = x[:, None]
    far = np.sqrt(1.0 + x * x + y * y)
    xy = x * y * np.arctan(x * y / far)
    x_log = x * np.arcsinh(x / np.sqrt(1.0 + y * y))
    y_log = y * np.arcsinh(y / np.sqrt(1.0 + x * x))
    fourth = (xy + x_log + y_log - far) / (2.0 * math.pi)
    hats: np.ndarray = np.diff(np.diff(fourth, 2, axis=0), 2, axis=1) * (radius_m / at.step_m) ** 2
    return hats.clip(0.0)


def encircled_energy(radius_m: np.ndarray, blur_m: float) -> np.ndarray:
    """Return the share of an Airy pattern's energy within a radius (Born & Wolf, 8.5).

    E(r) = 1 - J0²(v) - J1²(v) with v = π r / (λ N): 83.8 % within the first dark ring. `blur_m` is λ N, wavelength
    times f-number [m].
    """
    from scipy.special import j0, j1

    v = math.pi * np.asarray(radius_m) / blur_m
    share: np.ndarray = 1.0 - j0(v) ** 2 - j1(v) ** 2
    return share


def airy_hats(at: HatGrid) -> np.ndarray:
    """Return the hat weights of an Airy pattern, from points on rings of known energy."""
    blur_m, step_m, reach_steps = at.blur_m, at.step_m, at.reach_steps
    edge = math.sqrt(2.0) * (reach_steps + 1) * step_m
    widest = step_m / 8.0
    radii = [0.0]
    while radii[-1] < edge:
        radii.append(radii[-1] + min(blur_m / 16.0 + radii[-1] / 32.0, widest))
    bounds = np.array(radii)
    energy, radius = np.diff(encircled_energy(bounds, blur_m)), 0.5 * (bounds[1:] + bounds[:-1])
    count = np.maximum(8, np.ceil(0.5 * math.pi * radius / widest)).astype(int)  # in one quadrant
    hats = np.zeros((2 * reach_steps + 1,) * 2)
    for some in np.split(np.arange(len(radius)), np.flatnonzero(np.diff(count.cumsum() // _POINTS)) + 1):
        n = count[some]
        angle = (np.arange(n.sum()) - np.repeat(n.cumsum() - n, n) + 0.5) * (0.5 * math.pi / np.repeat(n, n))
        r = np.repeat(radius[some] / step_m, n)
        _deposit(hats, r * np.sin(angle), r * np.cos(angle), np.repeat(energy[some] / n, n))
    return 0.25 * (hats + hats[::-1] + hats[:, ::-1] + hats[::-1, ::-1])


def grid_hats(values: np.ndarray, middle: tuple[float, float], spacing_m: float, at: HatGrid) -> np.ndarray:
    """Return the hat weights of a table of intensities, each point standing for the square about it.

    Parameters
    ----------
    values : (row, col) intensities
    """
    spacing = spacing_m / at.step_m
    # Points represent pieces of the squares: an eighth of the step or less, and four to a side unless they are very small.
    cuts = min(max(min(4, math.ceil(50.0 * spacing)), math.ceil(8.0 * spacing)), 64)
    row, col = np.nonzero(values > 0.0)
    part = (np.arange(cuts) + 0.5) / cuts - 0.5
    cos, sin = math.cos(at.turn_rad), math.sin(at.turn_rad)
    hats = np.zeros((2 * at.reach_steps + 1,) * 2)
    weight = values[row, col] / (values.sum() * cuts**2)
    for some in np.array_split(np.arange(len(row)), 1 + len(row) * cuts**2 // _POINTS):
        down = (row[some, None, None] + part[:, None] - middle[0]) * spacing
        right = (col[some, None, None] + part - middle[1]) * spacing
        _deposit(
            hats,
            (cos * down + sin * right).ravel(),
            (cos * right - sin * down).ravel(),
            np.repeat(weight[some], cuts**2),
        )
    return hats


def _deposit(hats: np.ndarray, row: np.ndarray, col: np.ndarray, weight: np.ndarray) -> None:
    """Add weighted points to hat weights; points beyond the grid are left out.

    Parameters
    ----------
    hats : (row, col) hat weights, added to
    row, col : (point) positions in steps from the middle
    weight : (point)
    """
    reach, width = hats.shape[0] // 2, hats.shape[1]
    inside = np.flatnonzero((np.abs(row) < reach) & (np.abs(col) < reach))
    if len(inside) < len(row):
        row, col, weight = row[inside], col[inside], weight[inside]
    r, c = np.floor(row).astype(np.intp), np.floor(col).astype(np.intp)
    down, right = row - r, col - c
    first = (r + reach) * width + c + reach
    flat = hats.reshape(-1)
    for step, share in (
        (0, (1.0 - down) * (1.0 - right)),
        (1, (1.0 - down) * right),
        (width, down * (1.0 - right)),
        (width + 1, down * right),
    ):
        flat += np.bincount(first + step, weight * share, minlength=flat.size)
