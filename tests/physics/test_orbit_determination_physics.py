"""Batch least squares: known orbits recovered without noise, an independent estimate, and NEES over fifty runs."""

import datetime
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from rso_lidar import track, units
from rso_lidar.records import BodyState
from rso_lidar.track.least_squares.fit_statistics import normalize_error
from rso_lidar.track.least_squares.relative_state import find_sight_axes

RUNS = 50
UTC = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
GM = units.EARTH_GM_M3_S2
RADIUS_M = 6_928_137.0
TIME_S = np.arange(0.0, 1800.0, 60.0)
OWN = np.array([RADIUS_M, 0.0, 0.0, 0.0, 0.6 * np.sqrt(GM / RADIUS_M), 0.8 * np.sqrt(GM / RADIUS_M)])
RELATIVE = np.array([20.0, -3000.0, 100.0, -0.19, 0.98, 0.05])  # of the follower, in the target's rtn axes
SIGMA_M, SIGMA_RAD = 0.05, 2e-5
OWN_SIGMA = np.repeat([100.0, 0.05], 3)
OFFSET_SIGMA_M, TURN_SIGMA_RAD = (0.4, 0.2, 0.2), (1e-4, 2e-4, 5e-5)
GNSS_S = np.arange(0.0, 300.0, 10.0)
GNSS = track.GnssErrors(1.0, 0.03, 3.0, 0.01, correlation_s=100.0, vertical_ratio=1.5)


def rtn(state):
    """Return inertial_from_rtn and the angular velocity in inertial axes of a state in two-body motion."""
    r, v = state[:3], state[3:]
    h = np.cross(r, v)
    x, z = r / np.linalg.norm(r), h / np.linalg.norm(h)
    return np.stack([x, np.cross(z, x), z], axis=1), h / (r @ r)


def place(target, relative):
    """Return the inertial state of a follower from a relative state."""
    axes, omega = rtn(target)
    apart = axes @ relative[:3]
    return np.concatenate([target[:3] + apart, target[3:] + axes @ relative[3:] + np.cross(omega, apart)])


def integrate(state, time_s):
    """Integrate two-body motion by scipy, with no code of the package."""

    def rates(_, x):
        return np.concatenate([x[3:], -GM * x[:3] / np.linalg.norm(x[:3]) ** 3])

    made = solve_ivp(rates, (0.0, time_s[-1]), state, "DOP853", t_eval=time_s, rtol=1e-13, atol=1e-9)
    return made.y.T


@functools.cache
def truth():
    """Return the true states (time, 6) of the follower and of the target; the target's state at the start is OWN."""
    return integrate(place(OWN, RELATIVE), TIME_S), integrate(OWN, TIME_S)


def known(own, sigma=None):
    covariance = np.zeros((6, 6)) if sigma is None else np.diag(sigma**2)
    return track.EstimatedOrbit(UTC, 0.0, own[:3], own[3:], covariance, None)


def across(line):
    """Return the matrices (time, 3, 3) of a unit variance across lines of sight, and those along them."""
    toward = line / np.linalg.norm(line, axis=1)[:, None]
    along = np.einsum("ni,nj->nij", toward, toward)
    return np.eye(3) - along, along


def covariance_of(line):
    side, along = across(line)
    return SIGMA_M**2 * along + (SIGMA_RAD * np.linalg.norm(line, axis=1))[:, None, None] ** 2 * side


def mean_bounds(freedom, count):
    """Return the bounds of the mean of chi-square numbers, exceeded once in a thousand."""
    return chi2.ppf([5e-4, 1.0 - 5e-4], freedom * count) / count


def fit_run(seed, *, considered=True):
    """Return the fit of one run: noise, offset of the centroid, misalignment and error of the own orbit are drawn."""
    rng = np.random.default_rng(seed)
    follower, target = truth()
    line = target[:, :3] - follower[:, :3]
    turned = Rotation.from_rotvec(np.outer(TIME_S, [1e-4, 4e-4, 2e-4])).as_matrix()
    noise = np.linalg.cholesky(covariance_of(line)) @ rng.normal(size=(len(line), 3, 1))
    axes = find_sight_axes(line, BodyState(follower[:, :3], follower[:, 3:]))
    offset = np.array(OFFSET_SIGMA_M) * rng.normal(size=3) + [-1.0, 0.0, 0.0]
    turn = np.array(TURN_SIGMA_RAD) * rng.normal(size=3)
    measured = line + noise[..., 0] + np.einsum("nji,j->ni", axes, offset)
    measured += np.cross(turned @ turn, line)
    own = follower[0] + OWN_SIGMA * rng.normal(size=6)
    bias = track.SightBias((-1.0, 0.0, 0.0), OFFSET_SIGMA_M, TURN_SIGMA_RAD)
    return track.fit_relative_state(
        TIME_S, measured, covariance_of(measured), known(own, OWN_SIGMA if considered else None), bias=bias,
        inertial_from_body=turned,
    )  # fmt: skip


def test_relative_orbit_without_noise_is_recovered(validation):
    follower, target = truth()
    line = target[:, :3] - follower[:, :3]
    fit = track.fit_relative_state(TIME_S, line, covariance_of(line), known(follower[0]))
    # 1e-13 of the radius for each of some 30 steps of the integrator
    for name, got, expected, tolerance, unit in (
        ("position", fit.position_m, RELATIVE[:3], 30 * 1e-13 * RADIUS_M, "m"),
        ("velocity", fit.velocity_m_s, RELATIVE[3:], 30 * 1e-13 * RADIUS_M / 600.0, "m/s"),
    ):
        validation(
            case=f"relative orbit of exact measurements: {name}", source="two-body motion by scipy", expected=0.0,
            got=np.abs(got - expected).max(), tolerance=tolerance, unit=unit,
        )  # fmt: skip


def clohessy_wiltshire(time_s, n):
    """Return the transition matrices (time, 3, 6) to positions: Clohessy and Wiltshire 1960."""
    s, c, nt, zero, one = np.sin(n * time_s), np.cos(n * time_s), n * time_s, 0.0 * time_s, 1.0 + 0.0 * time_s
    rows = [
        [4.0 - 3.0 * c, zero, zero, s / n, 2.0 * (1.0 - c) / n, zero],
        [6.0 * (s - nt), one, zero, -2.0 * (1.0 - c) / n, (4.0 * s - 3.0 * nt) / n, zero],
        [zero, zero, c, zero, zero, s / n],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def test_linear_motion_is_fitted_as_linear_least_squares_do(validation):
    """Normal equations of numpy on Clohessy and Wiltshire's matrix, with the same noise."""
    rng = np.random.default_rng(4)
    target = integrate(OWN, TIME_S)
    follower = place(OWN, RELATIVE)
    n = np.sqrt(GM / RADIUS_M**3)
    transition = clohessy_wiltshire(TIME_S, n)
    axes = np.array([rtn(state)[0] for state in target])
    line = -np.einsum("nij,nj->ni", axes, transition @ RELATIVE)
    spread = covariance_of(line)
    measured = line + (np.linalg.cholesky(spread) @ rng.normal(size=(len(line), 3, 1)))[..., 0]
    exact, noisy = (
        track.fit_relative_state(TIME_S, each, spread, known(follower), motion="hill") for each in (line, measured)
    )
    weight = np.linalg.inv(spread)
    slopes = -axes @ transition
    information = np.einsum("nij,nik,nkl->jl", slopes, weight, slopes)
    expected = np.linalg.solve(information, np.einsum("nij,nik,nk->j", slopes, weight, measured))
    # Inertial coordinates are rounded to 1e-9 m, and the target's mean motion follows from them.
    validation(
        case="linear relative orbit of exact measurements: position", source="Clohessy and Wiltshire 1960", expected=0.0,
        got=np.abs(exact.position_m - RELATIVE[:3]).max(), tolerance=1e-8 * (1.0 + noisy.sigma[:3].max() / SIGMA_M),
        unit="m",
    )  # fmt: skip
    got = np.concatenate([noisy.position_m, noisy.velocity_m_s])
    # The axes of the target move with its estimated position, which the matrix leaves out: a share of distance over radius
    # of an error, and errors are below 3 sigma.
    share = np.linalg.norm(RELATIVE[:3]) / RADIUS_M
    validation(
        case="linear relative orbit: greatest difference in sigma", source="normal equations by numpy", expected=0.0,
        got=np.abs((got - expected) / noisy.sigma).max(), tolerance=3.0 * share, unit="1",
    )  # fmt: skip
    validation(
        case="linear relative orbit: greatest relative difference of sigma", source="normal equations by numpy",
        expected=0.0, got=np.abs(noisy.sigma / np.sqrt(np.diag(np.linalg.inv(information))) - 1.0).max(),
        tolerance=share, unit="1",
    )  # fmt: skip


@pytest.mark.slow
def test_relative_orbits_of_fifty_runs_have_their_covariance(validation):
    fits = [fit_run(seed) for seed in range(RUNS)]
    nees = [fit.normalize_error(RELATIVE[:3], RELATIVE[3:]) for fit in fits]
    low, high = mean_bounds(6, RUNS)
    validation(
        case="relative orbit, 50 runs: mean NEES", source="chi-square distribution", expected=6.0, got=np.mean(nees),
        tolerance=max(high - 6.0, 6.0 - low), unit="1",
    )  # fmt: skip
    freedom = fits[0].statistics.degrees_of_freedom
    assert freedom == 3 * len(TIME_S) - 6
    low, high = mean_bounds(freedom, RUNS)
    validation(
        case="relative orbit, 50 runs: mean sum of squares of residuals", source="chi-square distribution",
        expected=freedom, got=np.mean([fit.statistics.chi2 for fit in fits]), tolerance=max(high - freedom, freedom - low),
        unit="1",
    )  # fmt: skip
    inside = [fit.statistics.is_consistent for fit in fits]
    assert np.sum(inside) >= 42  # of 95 % each; fewer have a probability of 0.08 % (binomial law)


def test_a_fit_that_takes_its_own_orbit_as_exact_is_over_confident():
    nees = [fit_run(seed, considered=False).normalize_error(RELATIVE[:3], RELATIVE[3:]) for seed in range(10)]
    assert np.mean(nees) > mean_bounds(6, 10)[1]


def test_own_orbits_of_fifty_runs_have_their_covariance(validation):
    states = integrate(OWN, GNSS_S)
    up = states[:, :3] / np.linalg.norm(states[:, :3], axis=1)[:, None]
    apart = np.exp(-np.abs(np.subtract.outer(GNSS_S, GNSS_S)) / GNSS.correlation_s)
    nees, sums = [], []
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        measured = []
        for white, slow in ((1.0, 3.0), (0.03, 0.01)):
            factor = np.linalg.cholesky(slow**2 * apart + white**2 * np.eye(len(GNSS_S)))
            error = factor @ rng.normal(size=(len(GNSS_S), 3))
            measured.append(error + 0.5 * up * np.einsum("ni,ni->n", up, error)[:, None])
        fit = track.fit_own_state(
            GNSS_S, states[:, :3] + measured[0], states[:, 3:] + measured[1], GNSS, start_utc=UTC, forces=None
        )
        nees.append(normalize_error(fit.orbit.vector - OWN, fit.orbit.covariance))
        sums.append(fit.statistics.chi2)
    low, high = mean_bounds(6, RUNS)
    validation(
        case="own orbit from GNSS, 50 runs: mean NEES", source="chi-square distribution", expected=6.0, got=np.mean(nees),
        tolerance=max(high - 6.0, 6.0 - low), unit="1",
    )  # fmt: skip
    freedom = 6 * len(GNSS_S) - 6
    low, high = mean_bounds(freedom, RUNS)
    validation(
        case="own orbit from GNSS, 50 runs: mean sum of squares of residuals", source="chi-square distribution",
        expected=freedom, got=np.mean(sums), tolerance=max(high - freedom, freedom - low), unit="1",
    )  # fmt: skip
