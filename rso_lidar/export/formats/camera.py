"""Camera models fitted to lines of sight: a pinhole, with Brown and Conrady's distortion where needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_STRAIGHT_PX = 1e-6  # below it a lens bends nothing: the rounding of the table
_SIDE = 33  # rows and columns that are fitted; the error is taken over all


@dataclass(frozen=True)
class PinholeCamera:
    """A camera in pixels: column = focal_px x_d + centre_px[0], row = focal_px y_d + centre_px[1].

    (0, 0) is the centre of the first pixel. (x_d, y_d) are the tangents (x/z, y/z) of a direction in lidar axes after
    the distortion k1, k2, p1, p2, k3. Their order and meaning are those of plumb_bob in ROS and of OpenCV. `error_px`
    is the greatest error over all pixels. A focal length of 0 means that the table determines no camera, as with a
    single pixel.
    """

    focal_px: float
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float]
    error_px: float

    @property
    def matrix(self) -> tuple[float, ...]:
        """The 3 x 3 camera matrix, row by row [px]."""
        col, row = self.centre_px
        return (self.focal_px, 0.0, col, 0.0, self.focal_px, row, 0.0, 0.0, 1.0)

    def measure_bend_px(self, n_rows: int, n_cols: int) -> float:
        """Return how far the distortion moves points of the pixels' grid, at most [px].

        Parameters
        ----------
        n_rows, n_cols : size of the image [pixels]
        """
        x, y = np.meshgrid(*((np.arange(n) - 0.5 * (n - 1)) / self.focal_px for n in (n_cols, n_rows)))
        k1, k2, p1, p2, k3 = self.distortion
        along_x, along_y = (
            np.tensordot((k1, k2, k3, p1, p2), np.stack(columns[1:]), axes=1) for columns in _list_basis(x, y)
        )
        return float(self.focal_px * np.hypot(along_x, along_y).max())


def fit_camera(line_of_sight: np.ndarray) -> PinholeCamera:
    """Fit a camera with square pixels to lines of sight, without distortion if that suffices.

    Parameters
    ----------
    line_of_sight : (row, col, xyz) unit vectors of the pixels in lidar axes

    Returns
    -------
    PinholeCamera
        Focal length, centre and distortion in the convention of OpenCV [pixels], with the greatest error.
    """
    n_rows, n_cols = line_of_sight.shape[:2]
    centre = 0.5 * (n_cols - 1), 0.5 * (n_rows - 1)
    if n_rows * n_cols < 2:
        return PinholeCamera(0.0, centre, (0.0,) * 5, 0.0)
    straight = _fit_model(line_of_sight, terms=1)
    if straight.error_px < _STRAIGHT_PX:
        return straight
    return min(straight, _fit_model(line_of_sight, terms=6), key=lambda camera: camera.error_px)


def _fit_model(line_of_sight: np.ndarray, terms: int) -> PinholeCamera:
    """Fit the first of the terms focal length, k1, k2, k3, p1, p2 by linear least squares."""
    n_rows, n_cols = line_of_sight.shape[:2]
    x, y = (line_of_sight[..., axis] / line_of_sight[..., 2] for axis in (0, 1))
    scale = float(np.sqrt(np.max(x**2 + y**2))) or 1.0
    basis = [columns[:terms] for columns in _list_basis(x / scale, y / scale)]
    pixel = np.broadcast_arrays(np.arange(n_cols, dtype=float)[None, :], np.arange(n_rows, dtype=float)[:, None])
    few = np.ix_(*(np.unique(np.linspace(0, n - 1, min(n, _SIDE)).round().astype(int)) for n in (n_rows, n_cols)))
    equations, wanted = [], []
    for axis in (0, 1):
        at_centre = [np.full(x[few].shape, float(axis == centre_axis)) for centre_axis in (0, 1)]
        equations.append(
            np.stack([*(column[few] for column in basis[axis]), *at_centre], axis=-1).reshape(-1, terms + 2)
        )
        wanted.append(pixel[axis][few].ravel())
    solution = np.linalg.lstsq(np.concatenate(equations), np.concatenate(wanted), rcond=1e-14)[0]
    factors, centre = solution[:terms].tolist(), (float(solution[-2]), float(solution[-1]))
    errors = [
        sum(f * column for f, column in zip(factors, basis[axis], strict=True)) + centre[axis] - pixel[axis]
        for axis in (0, 1)
    ]
    error_px = float(np.sqrt(np.max(errors[0] ** 2 + errors[1] ** 2)))
    bends = [factor / factors[0] if factors[0] else 0.0 for factor in factors[1:]]
    k1, k2, k3, p1, p2 = bends + [0.0] * (6 - terms)
    distortion = (k1 / scale**2, k2 / scale**4, p1 / scale, p2 / scale, k3 / scale**6)
    return PinholeCamera(factors[0] / scale, centre, distortion, error_px)


def _list_basis(x: np.ndarray, y: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """List the basis functions of x_d and y_d: x or y, and the factors of k1, k2, k3, p1 and p2."""
    r2 = x**2 + y**2
    radial = [np.ones_like(r2), r2, r2**2, r2**3]
    return (
        [*(x * r for r in radial), 2.0 * x * y, r2 + 2.0 * x**2],
        [*(y * r for r in radial), r2 + 2.0 * y**2, 2.0 * x * y],
    )
