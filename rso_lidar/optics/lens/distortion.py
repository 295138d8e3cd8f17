"""Distortion: the image of a direction on the focal plane, and the direction that a point of the focal plane sees.

Undistorted (x, y) and distorted (xd, yd) points are both tangents in lidar axes: x to the right, y down, in units of
the focal length. A pixel at (xd, yd) looks along `undistort(xd, yd)`.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.optics.tables import zemax
from rso_lidar.optics.tables.number_text import cache_by_file
from rso_lidar.part import Number, Part, Text

WORST_FIT = 0.005  # rms residual of a fit over the field's radius beyond which five coefficients do not describe a lens
_LEAST_SLOPE = 0.05  # a lens that shrinks an area more than this, or flips it, has a wrong coefficient
Coefficients = tuple[float, float, float, float, float]


class DistortionPart(Part):
    """Base of all distortions: the mapping of five Brown-Conrady coefficients."""

    @property
    @abstractmethod
    def coefficients(self) -> Coefficients:
        """Coefficients k1, k2, k3, p1, p2, in powers of the tangent of the field angle."""

    def read_bands(self) -> tuple[zemax.FileBand, ...]:
        """Read the wavelengths for which the file of the distortion was computed; empty if it does not state them."""
        return ()

    def distort(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the image points (xd, yd) of directions (x, y) (Brown 1966, Conrady 1919).

        x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)

        y_d = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p2 x y + p1 (r² + 2 y²)

        The order of p1 and p2 is that of camera calibration: p1 belongs to y.

        Parameters
        ----------
        x, y : tangents of the directions
        """
        k1, k2, k3, p1, p2 = self.coefficients
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
        )

    def undistort(self, xd: np.ndarray, yd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions that are imaged to points, by Newton's method to below 1e-12.

        Parameters
        ----------
        xd, yd : image points, tangents

        Returns
        -------
        x and y, tangents of the directions.

        Raises
        ------
        ScenarioError
            If no direction is imaged to a point.
        """
        xd, yd = np.broadcast_arrays(np.asarray(xd, dtype=float), np.asarray(yd, dtype=float))
        return self._solve(xd, yd, xd, yd)

    def area(self, xd: np.ndarray, yd: np.ndarray) -> np.ndarray:
        """Return d(x, y) / d(xd, yd): the area of the undistorted plane for a unit of area at image points.

        Parameters
        ----------
        xd, yd : image points, tangents
        """
        return self.area_at_direction(*self.undistort(xd, yd))

    def area_at_direction(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return `area` at the images of directions.

        Parameters
        ----------
        x, y : tangents of the directions
        """
        xx, xy, yy = self._slopes(x, y)
        seen: np.ndarray = 1.0 / (xx * yy - xy * xy)
        return seen

    def check(self, half_x: float, half_y: float) -> None:
        """Check that the mapping does not fold within the focal plane; raise `ScenarioError` if it folds.

        Parameters
        ----------
        half_x, half_y : half the width and half the height of the focal plane, tangents
        """
        edge = np.linspace(-1.0, 1.0, 33)
        ones = np.ones_like(edge)
        to_x = half_x * np.concatenate([edge, edge, -ones, ones])
        to_y = half_y * np.concatenate([-ones, ones, edge, edge])
        x, y = np.zeros_like(to_x), np.zeros_like(to_y)
        # Outwards from the axis: each solution is the first guess of the next, so that none jumps over a fold.
        for part in np.linspace(0.0, 1.0, 33)[1:]:
            x, y = self._solve(part * to_x, part * to_y, x, y)
            xx, xy, yy = self._slopes(x, y)
            if np.min(xx * yy - xy * xy) < _LEAST_SLOPE or np.min(xx + yy) < 0.0:
                radius = float(np.min(np.hypot(part * to_x, part * to_y)))
                raise ScenarioError(
                    f"distortion: folds the image over within the focal plane, near {radius:.3g} focal lengths from "
                    "its middle; check the signs and sizes of k1, k2, k3, p1, p2 (they go with powers of tan(field))"
                )

    def _slopes(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return dxd/dx, dxd/dy (equal to dyd/dx) and dyd/dy at (x, y)."""
        k1, k2, k3, p1, p2 = self.coefficients
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))  # d radial / d(r²) times two
        return (
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
            radial + y * y * slope + 2.0 * p2 * x + 6.0 * p1 * y,
        )

    def _solve(self, xd: np.ndarray, yd: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve distort(x, y) = (xd, yd) from a first guess; return x and y of the directions.

        Parameters
        ----------
        xd, yd : image points, tangents
        x, y : first guess of the directions, tangents

        Raises
        ------
        ScenarioError
            If no direction is found for an image point.
        """
        if not any(self.coefficients):
            return xd.copy(), yd.copy()
        within = 1e-13 * (1.0 + np.hypot(xd, yd))
        with np.errstate(all="ignore"):  # a guess may diverge, which raises below
            for _ in range(25):
                at_x, at_y = self.distort(x, y)
                miss_x, miss_y = at_x - xd, at_y - yd
                if np.all(np.hypot(miss_x, miss_y) <= within):
                    return x, y
                xx, xy, yy = self._slopes(x, y)
                scale = 1.0 / (xx * yy - xy * xy)
                x = x - scale * (yy * miss_x - xy * miss_y)
                y = y - scale * (xx * miss_y - xy * miss_x)
        raise ScenarioError(
            "distortion: no direction is imaged to some points of the focal plane; check the signs and sizes of "
            "k1, k2, k3, p1, p2 (coefficients of powers of tan(field))"
        )


class BrownConrady(DistortionPart):
    """Radial (k1, k2, k3) and tangential (p1, p2) distortion in powers of the tangent of the field angle.

    A fraction D of distortion at the field angle θ is k1 = D / tan²θ: barrel for k1 < 0, pincushion for k1 > 0. All five
    are pure numbers.

    >>> lens = BrownConrady(k1=5.2)
    >>> xd, yd = lens.distort(np.array([0.0218]), np.array([0.0218]))
    >>> round(100 * float(xd[0] / 0.0218 - 1), 2)
    0.49
    """

    type: Literal["brown_conrady"] = "brown_conrady"
    k1: Number = Field(default=0.0, description="Radial coefficient of r², where r is the tangent of the field angle.")
    k2: Number = Field(default=0.0, description="Radial coefficient of r⁴.")
    k3: Number = Field(default=0.0, description="Radial coefficient of r⁶.")
    p1: Number = Field(default=0.0, description="Tangential coefficient along y.")
    p2: Number = Field(default=0.0, description="Tangential coefficient along x.")

    @property
    def coefficients(self) -> Coefficients:
        """Coefficients k1, k2, k3, p1, p2."""
        return self.k1, self.k2, self.k3, self.p1, self.p2


class ZemaxDistortion(DistortionPart):
    """Distortion of a Zemax Grid Distortion listing, as the Brown-Conrady coefficients that fit it best.

    The listing's x runs to the right and its y up, as its window draws them. For a lens that is symmetric about its
    axis that makes no difference.
    """

    type: Literal["zemax_grid"] = "zemax_grid"
    file: Text = Field(description="Path of a Zemax Grid Distortion listing against F-Tan(theta).")

    @property
    def coefficients(self) -> Coefficients:
        """Coefficients k1, k2, k3, p1, p2 of the fit."""
        return self.fit.coefficients

    def read_bands(self) -> tuple[zemax.FileBand, ...]:
        """Read the wavelength of the listing.

        Returns
        -------
        path of the listing with its wavelength twice [m]; empty if the listing does not state it.
        """
        wavelength_m = zemax.read_grid_distortion(self.file).wavelength_m
        return ((self.file, wavelength_m, wavelength_m),) if wavelength_m else ()

    @property
    def fit(self) -> "Fit":
        """The fit, made once for each state of the file."""
        return _fit(self.file)

    def check(self, half_x: float, half_y: float) -> None:
        """Check that the listing covers the focal plane, and that its fit does not fold within it.

        Parameters
        ----------
        half_x, half_y : half the width and half the height of the focal plane, tangents

        Raises
        ------
        ScenarioError
            If the listing ends inside the corner of the focal plane, or the fit folds.
        """
        corner = math.hypot(half_x, half_y)
        if corner > 1.05 * self.fit.reach_tangent:
            raise ScenarioError(
                f"{self.file}: reaches {self.fit.reach_tangent:.4g} focal lengths from the axis, the focal plane's "
                f"corner {corner:.4g}; list the distortion over a wider field"
            )
        super().check(half_x, half_y)


Distortion = Annotated[BrownConrady | ZemaxDistortion, Field(discriminator="type")]


@dataclass(frozen=True)
class Fit:
    """Brown-Conrady coefficients fitted to a listing, and the quality of the fit.

    `rms_tangent` is the rms distance of real from fitted image points. `reach_tangent` is the distance of the farthest
    real point from the axis. Both are over the paraxial focal length `focal_length_m`.
    """

    coefficients: Coefficients
    rms_tangent: float
    reach_tangent: float
    focal_length_m: float


@cache_by_file(16)
def _fit(path: str) -> Fit:
    """Fit Brown-Conrady coefficients to a Grid Distortion listing.

    Returns
    -------
    coefficients, and how well and how far they fit.

    Raises
    ------
    ScenarioError
        If the listing is not a grid of fields against f tan(field), or if the fit is poor.
    """
    grid = zemax.read_grid_distortion(path)
    x, y = grid.field_tangent.T
    # Predicted = (A B; C D) tan(field) + offset: the paraxial lens, for any names of axes and any origin.
    linear = np.stack([x, y, np.ones_like(x)], axis=1)
    if np.linalg.matrix_rank(linear, tol=1e-9 * max(float(np.abs(linear[:, :2]).max()), 1e-300)) < 3:
        raise ScenarioError(f"{path}: its points are on one line; list a grid of fields in x and y")
    paraxial = np.linalg.lstsq(linear, grid.predicted_m, rcond=None)[0]
    size_m = float(np.ptp(grid.predicted_m, axis=0).max())
    missed_m = float(np.abs(np.einsum("ij,jk->ik", linear, paraxial) - grid.predicted_m).max())
    determinant = float(paraxial[0, 0] * paraxial[1, 1] - paraxial[0, 1] * paraxial[1, 0])
    if missed_m > 1e-3 * size_m or abs(determinant) < 1e-6 * float(np.abs(paraxial[:2]).max()) ** 2:
        raise ScenarioError(
            f"{path}: its predicted points are not f tan(field); list the distortion against F-Tan(theta), not F-Theta"
        )
    inverse = np.linalg.inv(paraxial[:2])
    xd, yd = np.einsum("ij,jk->ik", grid.real_m - paraxial[2], inverse).T
    y, yd = -y, -yd  # down, in lidar axes
    radius = float(np.hypot(x, y).max())
    u, v = x / radius, y / radius
    w = u * u + v * v
    nil, ones = np.zeros_like(u), np.ones_like(u)
    # Beside the five coefficients a shift of the whole image, which is pointing and not distortion.
    in_x = np.stack([u * w, u * w**2, u * w**3, 2 * u * v, w + 2 * u * u, ones, nil], axis=1)
    in_y = np.stack([v * w, v * w**2, v * w**3, w + 2 * v * v, 2 * u * v, nil, ones], axis=1)
    terms, target = np.concatenate([in_x, in_y]), np.concatenate([xd - x, yd - y]) / radius
    solution = np.linalg.lstsq(terms, target, rcond=None)[0]
    left = target - np.einsum("ij,j->i", terms, solution)
    rms = radius * math.sqrt(2.0 * float(np.mean(left**2)))  # of the two axes together
    if rms > WORST_FIT * radius:
        raise ScenarioError(
            f"{path}: Brown-Conrady coefficients fit its grid only to {100 * rms / radius:.2g} % of the field (rms, "
            f"{100 * WORST_FIT:g} % is allowed); list a smaller field, or one lens at a time"
        )
    powers = radius ** -np.array([2.0, 4.0, 6.0, 1.0, 1.0])
    k1, k2, k3, p1, p2 = (float(value) for value in solution[:5] * powers)
    return Fit((k1, k2, k3, p1, p2), rms, float(np.hypot(xd, yd).max()), math.sqrt(abs(determinant)))
