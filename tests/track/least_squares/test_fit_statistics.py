"""Chi-square of a fit: bounds, and what a description says inside and outside of them."""

import numpy as np
import pytest

from rso_lidar.track import FitStatistics
from rso_lidar.track.least_squares.fit_statistics import chi_square_bounds, normalize_error


def make(chi2, freedom=30):
    return FitStatistics(
        np.arange(4.0), np.zeros((4, 3)), np.zeros(4), np.array([True, True, False, True]), chi2, freedom
    )


def test_bounds_are_those_of_tables():
    assert chi_square_bounds(1) == pytest.approx(
        (0.00098207, 5.0239), rel=1e-4
    )  # Bar-Shalom and others 2001, table 1.5.4-1
    assert chi_square_bounds(100) == pytest.approx((74.222, 129.56), rel=1e-4)
    assert chi_square_bounds(0) == (0.0, 0.0)


def test_numbers_of_measurements():
    assert (make(30.0).n_used, make(30.0).n_rejected) == (3, 1)


@pytest.mark.parametrize(
    ("chi2", "words", "inside"), [(30.0, "consistent", True), (3.0, "scatter less", False), (90.0, "more noise", False)]
)
def test_a_description_says_what_chi_square_shows(chi2, words, inside):
    assert words in make(chi2).describe() and make(chi2).is_consistent is inside


def test_a_fit_without_redundancy_is_not_judged():
    assert "nothing checks the fit" in make(0.0, 0).describe()


def test_a_normalised_error():
    assert normalize_error(np.array([2.0, 3.0]), np.diag([4.0, 1.0])) == pytest.approx(10.0)
