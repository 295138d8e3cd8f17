"""Least squares with a gate: a straight line, its covariance, a prior, outliers, and what is refused."""

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.track.least_squares.gated_solution import solve_gated, whiten_each

X = np.linspace(0.0, 1.0, 40)
SLOPES = np.stack([np.ones_like(X), X], axis=1)[:, None, :]  # (measurement, row, parameter)
SIGMA = 0.1
SPREAD = np.full((len(X), 1, 1), SIGMA**2)


def line(measured):
    return lambda values: (measured[:, None] - SLOPES @ values, SLOPES)


@pytest.fixture
def measured():
    return 2.0 - 3.0 * X + SIGMA * np.random.default_rng(2).normal(size=len(X))


def test_a_straight_line_is_that_of_the_normal_equations(measured):
    found = solve_gated(line(measured), np.zeros(2), SPREAD)
    matrix = SLOPES[:, 0]
    information = matrix.T @ matrix / SIGMA**2
    expected = np.linalg.solve(information, matrix.T @ measured / SIGMA**2)
    assert np.allclose(found.values, expected, rtol=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(information), rtol=1e-9)
    assert found.used.all() and found.degrees_of_freedom == len(X) - 2
    assert found.chi2 == pytest.approx(np.sum((measured - matrix @ expected) ** 2) / SIGMA**2)
    assert found.square.sum() == pytest.approx(found.chi2)


def test_outliers_are_rejected_and_do_not_matter(measured):
    wrong = measured.copy()
    bad = np.array([3, 17, 18, 30, 39])
    wrong[bad] += [5.0, 40.0, -3.0, 8.0, 1e4]
    found = solve_gated(line(wrong), np.zeros(2), SPREAD)
    assert np.flatnonzero(~found.used).tolist() == bad.tolist()
    kept = np.setdiff1d(np.arange(len(X)), bad)
    alone = np.linalg.lstsq(SLOPES[kept, 0], measured[kept], rcond=None)[0]
    assert np.allclose(found.values, alone, atol=1e-9)
    assert found.degrees_of_freedom == len(kept) - 2


def test_a_prior_is_a_measurement_of_a_parameter(measured):
    found = solve_gated(line(measured), np.array([1.0, -2.0]), SPREAD, prior_sigma=np.array([np.inf, 0.2]))
    matrix = np.concatenate([SLOPES[:, 0] / SIGMA, [[0.0, 5.0]]])
    expected = np.linalg.lstsq(matrix, np.concatenate([measured / SIGMA, [-10.0]]), rcond=None)[0]
    assert np.allclose(found.values, expected, rtol=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-9)
    assert found.degrees_of_freedom == len(X) - 1


def test_correlated_errors_are_weighted_by_their_covariance(measured):
    whole = SIGMA**2 * (0.5 * np.eye(len(X)) + 0.5 * np.exp(-10.0 * np.abs(np.subtract.outer(X, X))))

    def whiten(values, used):
        return np.linalg.solve(np.linalg.cholesky(whole[np.ix_(used, used)]), values[used, 0])

    found = solve_gated(line(measured), np.zeros(2), SPREAD, whitening=whiten)
    weight, matrix = np.linalg.inv(whole), SLOPES[:, 0]
    information = matrix.T @ weight @ matrix
    assert np.allclose(found.values, np.linalg.solve(information, matrix.T @ weight @ measured), rtol=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(information), rtol=1e-9)


def test_a_quantity_that_is_not_estimated_shifts_the_solution(measured):
    found = solve_gated(line(measured), np.zeros(2), SPREAD)
    shifted = solve_gated(line(measured - 0.5 * X**2), np.zeros(2), SPREAD)  # predictions that grow by 0.5 X^2
    mapped = found.map_errors((X**2)[:, None, None])
    assert np.allclose(shifted.values - found.values, 0.5 * mapped[:, 0], atol=1e-9)


def test_rows_of_a_measurement_are_whitened_together():
    spread = np.array([[[4.0, 1.0], [1.0, 3.0]]])
    white = whiten_each(np.linalg.cholesky(spread), np.linalg.cholesky(spread))
    assert np.allclose(white, np.eye(2))


def test_what_cannot_be_solved_is_refused(measured):
    with pytest.raises(ScenarioError, match="gate 1 is not a probability"):
        solve_gated(line(measured), np.zeros(2), SPREAD, gate=1.0)
    with pytest.raises(ScenarioError, match="fit: the measurements do not determine a state; give more frames"):
        solve_gated(lambda values: (measured[:, None], np.ones((len(X), 1, 2))), np.zeros(2), SPREAD)
    scattered = 1e3 * np.random.default_rng(1).normal(size=len(X))
    with pytest.raises(ScenarioError, match="of 40 measurements agree with one orbit"):
        solve_gated(line(scattered), np.zeros(2), SPREAD * 1e-6, gate=0.5)
