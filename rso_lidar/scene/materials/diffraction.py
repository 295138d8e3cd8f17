"""Diffraction: the pattern of light that a round aperture sends back, near and far, averaged over a lens.

Lengths across the pattern are in optical units (Born and Wolf, Principles of Optics, section 8.8). For an angle whose sine
is s, v = π D s / λ, with D the diameter of the aperture. The defocus is u = π D² (1/R₁ + 1/R₂) / (2 λ). R₁ and R₂
are the distances of the point source and of the lens. In the far field u is 0, and the pattern is Airy's.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

_NODES = 16  # of one panel of Gauss-Legendre quadrature
_PHASE_PER_PANEL = 12.0  # [rad], up to twice that in the panel where the integrand turns fastest
_STEP, _STEP_FRACTION = 0.25, 2e-3  # of the table of `mean_irradiance`, in optical units: a ring is π wide


def mean_irradiance(offset: np.ndarray, rim: np.ndarray, defocus: np.ndarray) -> np.ndarray:
    """Return the mean irradiance over a round lens, relative to the middle of the pattern in the far field.

    The mean is 2 ∫₀² δ J₀(v δ) (2 J₁(w δ) / w δ) H(δ, u) dδ, exact in the paraxial approximation. H is the optical transfer
    function of the defocused aperture (Hopkins, Proc. R. Soc. A 231, 91, 1955); its Hankel transform is the pattern. The
    factor of J₁ is the transform of the lens's disc. For a small lens in the far field the mean is (2 J₁(v)/v)²; for a lens
    about the middle of that pattern it is 4 (1 − J₀² − J₁²) / w² (Rayleigh 1881).

    Parameters
    ----------
    offset : (hit) f8, v of the lens's middle from the middle of the pattern [optical units]
    rim : (hit) f8, w of the lens's rim from the lens's middle [optical units]
    defocus : (hit) f8, u, at least 0 [optical units]

    Returns
    -------
    (hit) f8. Many hits are interpolated in a table, to 1e-3 of the brightest.

    >>> float(mean_irradiance(np.zeros(1), np.zeros(1), np.zeros(1))[0].round(9))
    1.0
    """
    wide = np.maximum(np.maximum(offset, rim), np.maximum(defocus, 1e-6))
    # For one lens and aperture, all three increase in proportion towards the lidar: logarithm and ratios vary least.
    columns = [np.log(wide), offset / wide, rim / wide, defocus / wide]
    widest = float(wide.max(initial=0.0))
    step = _STEP + _STEP_FRACTION * widest
    spread = [float(np.ptp(column)) * widest / step if len(column) else 0.0 for column in columns]
    counts = [1 if n < 0.01 else max(4, math.ceil(n) + 1) for n in spread]
    if math.prod(counts) >= len(offset):
        cases = np.stack([offset, rim, defocus], axis=1)
        return np.array([_mean(*case) for case in cases.tolist()]).reshape(len(offset))
    axes = [
        np.linspace(column.min(), column.max(), n) if n > 1 else np.array([column.mean()])
        for column, n in zip(columns, counts, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    scale = np.exp(grid[..., 0])
    table = np.array(
        [
            _mean(w * v_share, w * rim_share, w * u_share)
            for w, (_, v_share, rim_share, u_share) in zip(
                scale.ravel().tolist(), grid.reshape(-1, 4).tolist(), strict=True
            )
        ]
    ).reshape(counts)
    along = [k for k, n in enumerate(counts) if n > 1]
    if not along:
        return np.full(len(offset), float(table.item()))
    from scipy.interpolate import RegularGridInterpolator

    table = table.reshape([counts[k] for k in along])
    look_up = RegularGridInterpolator([axes[k] for k in along], table, method="cubic")
    mean: np.ndarray = np.maximum(look_up(np.stack([columns[k] for k in along], axis=1)), 0.0)
    return mean


def transfer(shift: np.ndarray, defocus: float) -> np.ndarray:
    """Return the optical transfer function H of a defocused round aperture (Hopkins 1955), 1 without shift.

    Parameters
    ----------
    shift : (shift) f8, how far the aperture and its copy are apart, in radii, from 0 to 2
    defocus : u [optical units]
    """
    x, weight = _panels(0.5 * defocus)
    edge = np.arccos(np.minimum(0.5 * shift, 1.0))[:, None]
    theta = edge * x
    phase = defocus * shift[:, None] * (np.cos(theta) - 0.5 * shift[:, None])
    integral = 4.0 / math.pi * (np.cos(phase) * np.sin(theta) ** 2 * weight).sum(axis=1)
    transfer: np.ndarray = edge[:, 0] * integral
    return transfer


def _mean(offset: float, rim: float, defocus: float) -> float:
    """Return the mean irradiance over one lens, relative to that in the middle of the pattern of a perfect lens.

    Parameters
    ----------
    offset : distance of the lens from the axis of the pattern [optical units]
    rim : radius of the lens [optical units]
    defocus : u [optical units]
    """
    from scipy.special import j0, j1

    # δ = 2 (1 − z²): H ends as (2 − δ)^{3/2}, and is smooth in z. It is computed in pieces, which bounds the memory.
    z, weight = _panels(4.0 * (offset + rim) + 2.0 * defocus)
    total = 0.0
    for start in range(0, len(z), 4096):
        piece = slice(start, start + 4096)
        shift = 2.0 * (1.0 - z[piece] ** 2)
        across = np.maximum(rim * shift, 1e-9)
        disc = 2.0 * j1(across) / across
        of_shift = 8.0 * z[piece] * shift * j0(offset * shift) * disc * transfer(shift, defocus)
        total += float((weight[piece] * of_shift).sum())
    return total


def _panels(phase: float) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes and weights on [0, 1] of Gauss-Legendre panels, as many as a function needs that turns by `phase`."""
    n_panels = math.ceil(max(phase, 1.0) / _PHASE_PER_PANEL)
    coarse = 1 << max(0, n_panels.bit_length() - 3)  # three bits decide, so that few rules are kept
    return _rule(-(-n_panels // coarse) * coarse)


@lru_cache(maxsize=32)
def _rule(n_panels: int) -> tuple[np.ndarray, np.ndarray]:
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    nodes = (np.arange(n_panels)[:, None] + 0.5 * (node + 1.0)) / n_panels
    weights = np.tile(0.5 * weight / n_panels, n_panels)
    return nodes.ravel(), weights
