"""The simplest estimate of a target's position: the mean of its points, with a covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import ScenarioError

_NEIGHBOURS = ((0, 1), (1, 0))  # along rows and along columns


@dataclass(frozen=True, eq=False)
class Fix:
    """Estimated position of a target, in the axes of the points.

    Parameters
    ----------
    position_m : mean of the points (xyz) [m]
    covariance_m2 : of the mean (3, 3) [m²]
    points_m : points (n, 3) that were used [m]
    found_fraction : fraction of the target's pixels that returned
    """

    position_m: np.ndarray
    covariance_m2: np.ndarray
    points_m: np.ndarray
    found_fraction: float

    @property
    def range_m(self) -> float:
        """Distance of the mean from the origin [m]."""
        return float(np.linalg.norm(self.position_m))


def locate_centroid(
    points_m: np.ndarray,
    *,
    pixel_rad: float,
    range_noise_m: float = 0.05,
    gate_m: float = 20.0,
    min_points: int = 4,
) -> Fix | None:
    """Locate a target by the mean of its points, seen from the origin.

    The range window of depth `gate_m` with most points is the target. Of its points, those within `gate_m` of their
    median count; false triggers, which are uniform in range, are seldom among them. The covariance of the mean of n
    points is a sum of three terms, for pixels of width p at that range:

    * σ² / n along the line of sight, where σ is `range_noise_m`.
    * p² / (12 √n) across it, because a pixel along the edge either returns or does not. For squares and discs in any
      orientation the true value is 0.3 to 1 times this. An edge along the rows shifts all its pixels together, which
      gives up to p² / 12.
    * (1 − f) C / n, where f is the fraction of pixels that returned and C the scatter of the shape. In an
      organised cloud f is counted among the pixels between two that returned.

    If the target turns, the visible centroid moves on it. That is not noise, and not part of the covariance.

    Parameters
    ----------
    points_m : (n, 3), or an organised cloud (row, col, 3) with NaN where nothing came back [m]
    pixel_rad : angle that a pixel covers [rad]
    range_noise_m : standard deviation of one range [m]
    gate_m : depth and radius of the gate [m], about the size of the target
    min_points : fewest points that make a target

    Returns
    -------
    position with covariance; None for fewer than `min_points` points

    Raises
    ------
    ScenarioError
        If a setting is not positive, or `points_m` has another shape
    """
    if not (pixel_rad > 0.0 and range_noise_m > 0.0 and gate_m > 0.0 and min_points >= 1):
        raise ScenarioError("centroid: needs pixel_rad, range_noise_m and gate_m above 0 and min_points from 1")
    cloud = np.asarray(points_m, dtype=float)
    if cloud.ndim not in (2, 3) or cloud.shape[-1] != 3:
        raise ScenarioError(f"centroid: points are (n, 3) or (row, col, 3), not {cloud.shape}")
    taken = select_target_points(cloud, gate_m)
    n = int(taken.sum())
    if n < min_points:
        return None
    points = cloud[taken]
    middle = points.mean(axis=0)
    found_fraction = _count_found_fraction(taken) if cloud.ndim == 3 else 1.0
    range_m = float(np.linalg.norm(middle))
    ahead = np.outer(middle, middle) / range_m**2
    edge_m2 = (pixel_rad * range_m) ** 2 / (12.0 * np.sqrt(n))
    off = points - middle
    scatter = np.einsum("ni,nj->ij", off, off) / n - ahead * range_noise_m**2  # the shape's own
    covariance = ahead * range_noise_m**2 / n + (np.eye(3) - ahead) * edge_m2 + (1.0 - found_fraction) / n * scatter
    return Fix(middle, covariance, points, found_fraction)


def select_target_points(cloud: np.ndarray, gate_m: float) -> np.ndarray:
    """Select the points of a cloud that are the target's: close together, in the fullest range window.

    Parameters
    ----------
    cloud : (…, 3) points from the lidar [m]; NaN where nothing came back
    gate_m : depth and radius of the gate [m], about the size of the target

    Returns
    -------
    numpy.ndarray
        (…) bool, whether a point is selected
    """
    range_m = np.sqrt((cloud**2).sum(axis=-1))
    rising = np.sort(range_m[np.isfinite(range_m)])
    if not rising.size:
        return np.zeros(range_m.shape, dtype=bool)
    counts = np.searchsorted(rising, rising + gate_m, side="right") - np.arange(rising.size)
    nearest_m = rising[np.argmax(counts)]
    window = (range_m >= nearest_m) & (range_m <= nearest_m + gate_m)
    apart = cloud - np.median(cloud[window], axis=0)
    together: np.ndarray = window & ((apart**2).sum(axis=-1) <= gate_m**2)
    return together


def _count_found_fraction(taken: np.ndarray) -> float:
    """Count the fraction of pixels that returned, among those (row, col) between two that did."""
    inside = returned = 0
    for down, right in _NEIGHBOURS:
        rows, cols = taken.shape
        before = taken[: rows - 2 * down, : cols - 2 * right]
        after = taken[2 * down :, 2 * right :]
        between = taken[down : rows - down, right : cols - right]
        both = before & after
        inside += int(both.sum())
        returned += int((both & between).sum())
    return returned / inside if inside else 1.0
