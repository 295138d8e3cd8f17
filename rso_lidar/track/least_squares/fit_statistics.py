"""How well measurements agree with a fit: residuals, outliers and chi-square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.track.least_squares.gated_solution import SHARE, GatedSolution


@dataclass(frozen=True, eq=False)
class FitStatistics:
    """Residuals of a fit and their sum of squares.

    Parameters
    ----------
    time_s : (measurement) instants since start_utc [s]
    residual : (measurement, row) measured minus predicted, in SI units
    square : (measurement) squared norm of each residual in units of its covariance
    used : (measurement) bool, false for outliers
    chi2 : sum of squares of the used measurements and of the priors, in units of their covariance
    degrees_of_freedom : expectation of `chi2` if noise and motion are as assumed
    """

    time_s: np.ndarray
    residual: np.ndarray
    square: np.ndarray
    used: np.ndarray
    chi2: float
    degrees_of_freedom: int

    @classmethod
    def from_solution(cls, time_s: np.ndarray, solution: GatedSolution) -> FitStatistics:
        """Return the statistics of a solution.

        Parameters
        ----------
        time_s : (measurement) instants of its measurements [s]
        solution : with residuals and chi-square
        """
        return cls(
            time_s, solution.residual, solution.square, solution.used, solution.chi2, solution.degrees_of_freedom
        )

    @property
    def n_used(self) -> int:
        """Number of measurements in the fit."""
        return int(self.used.sum())

    @property
    def n_rejected(self) -> int:
        """Number of outliers."""
        return int(len(self.used) - self.used.sum())

    @property
    def chi2_bounds(self) -> tuple[float, float]:
        """Two-sided 95 % bounds of `chi2`."""
        return chi_square_bounds(self.degrees_of_freedom)

    @property
    def is_consistent(self) -> bool:
        """Whether `chi2` is within its bounds."""
        low, high = self.chi2_bounds
        return low <= self.chi2 <= high

    def describe(self) -> str:
        """Describe chi-square with its bounds, and what to change outside of them."""
        if not self.degrees_of_freedom:
            return "chi-square: no measurement more than parameters, so nothing checks the fit"
        low, high = self.chi2_bounds
        text = f"chi-square {self.chi2:.1f}, {self.degrees_of_freedom} expected (95 % bounds {low:.1f} to {high:.1f})"
        if self.chi2 < low:
            return f"{text}: below, the measurements scatter less than their covariance"
        if self.chi2 > high:
            return (
                f"{text}: above, the measurements scatter more than their covariance; state more noise, or another motion "
                "or other forces"
            )
        return f"{text}: consistent"


def chi_square_bounds(degrees_of_freedom: int, share: float = SHARE) -> tuple[float, float]:
    """Return the two-sided bounds of a chi-square distributed number.

    Examples
    --------
    >>> [round(bound, 3) for bound in chi_square_bounds(6)]
    [1.237, 14.449]
    """
    from scipy.special import chdtri

    if degrees_of_freedom < 1:
        return 0.0, 0.0
    tail = 0.5 * (1.0 - share)
    return float(chdtri(degrees_of_freedom, 1.0 - tail)), float(chdtri(degrees_of_freedom, tail))


def normalize_error(error: np.ndarray, covariance: np.ndarray) -> float:
    """Return the normalised estimation error squared (NEES) of an error (n) with a covariance (n, n)."""
    return float(error @ np.linalg.solve(covariance, error))
