import itertools

import numpy as np
import pytest
from scipy.stats import chi2

import rso_lidar as rl
from rso_lidar.rpo import CentroidWander, SensorBias, clohessy_wiltshire
from rso_lidar.track import filter_positions, locate_centroid, nis_bounds
from rso_lidar.track.kalman import _discretize

N_RAD_S = 1.0948e-3  # 550 km up


def wandering(rng, count, step_s, density, noise_m):
    """Return positions measured of a target that moves as the filter believes."""
    forward, noise = _discretize(None, density, step_s)
    root = np.linalg.cholesky(noise)
    state, places = np.array([100.0, -50.0, 300.0, 0.5, -0.2, 1.0]), []
    for _ in range(count):
        places.append(state[:3] + rng.normal(0.0, noise_m, 3))
        state = forward @ state + root @ rng.standard_normal(6)
    return np.arange(count) * step_s, np.array(places)


def test_nis_is_chi_square_where_the_noises_are_known():
    count, noise_m = 1500, 0.1
    time_s, places = wandering(np.random.default_rng(5), count, 0.5, 0.02, noise_m)
    spread = np.broadcast_to(np.eye(3) * noise_m**2, (count, 3, 3))
    made = filter_positions(time_s, places, spread, acceleration_m_s2_sqrt_hz=0.02)
    known = np.isfinite(made.nis)
    assert known.sum() == count - 1
    assert not known[0]
    assert made.nis_share == pytest.approx(0.95, abs=3.0 * np.sqrt(0.95 * 0.05 / count))  # binomial, 3 sigma
    low, high = nis_bounds(count - 1, 0.9973)
    assert low <= made.nis_mean <= high
    sure = filter_positions(
        time_s, places, spread / 9.0, acceleration_m_s2_sqrt_hz=0.02
    )  # believes a third of the noise
    assert sure.nis_mean > 2.0 * made.nis_mean
    assert sure.nis_share < 0.7


WANDER = CentroidWander(along_sigma_m=0.5, across_sigma_m=0.3, correlation_time_s=40.0)
BIAS = SensorBias(range_sigma_m=0.4)


def measure_with_slow_errors(rng, count=50, step_s=5.0, density=0.003, noise_m=0.05, speed_m_s=0.2):
    """Return instants, measured positions, the true state at the end (6), and the true centroid (3) along and across."""
    forward, noise = _discretize(None, density, step_s)
    root, decay = np.linalg.cholesky(noise), np.exp(-step_s / 40.0)
    state, places = np.array([40.0, -200.0, 250.0, *(speed_m_s * rng.standard_normal(3))]), []
    bias_m, sigma_m = 0.4 * rng.standard_normal(), np.array([0.5, 0.3, 0.3])
    wander_m = sigma_m * rng.standard_normal(3)
    for k in range(count):
        if k:
            state = forward @ state + root @ rng.standard_normal(6)
            wander_m = decay * wander_m + np.sqrt(1.0 - decay**2) * sigma_m * rng.standard_normal(3)
        along = state[:3] / np.linalg.norm(state[:3])
        in_plane = np.cross([0.0, 0.0, 1.0], along)
        in_plane /= np.linalg.norm(in_plane)
        shift = (bias_m + wander_m[0]) * along + wander_m[1] * in_plane + wander_m[2] * np.cross(along, in_plane)
        places.append(state[:3] + shift + rng.normal(0.0, noise_m, 3))
    return np.arange(count) * step_s, np.array(places), state, np.array([bias_m, *wander_m])


def test_a_filter_that_estimates_slow_errors_is_consistent_and_one_that_does_not_is_overconfident():
    """Fifty runs: the sum of NEES of position and velocity is chi-square, 99.9 %, and so are the errors' own."""
    rng, count = np.random.default_rng(12), 50
    totals, own = {True: 0.0, False: 0.0}, np.zeros(4)
    spread = np.broadcast_to(np.eye(3) * 0.05**2, (50, 3, 3))
    for _ in range(count):
        time_s, places, state, slow = measure_with_slow_errors(rng)
        for knows in totals:
            errors = {"bias": BIAS, "centroid": WANDER} if knows else {}
            made = filter_positions(
                time_s, places, spread, acceleration_m_s2_sqrt_hz=0.003, speed_m_s=0.2, **errors
            )  # fmt: skip
            miss = np.concatenate([made.position_m[-1], made.velocity_m_s[-1]]) - state
            totals[knows] += miss @ np.linalg.solve(made.covariance[-1], miss)
            if knows:
                sigmas = np.array([values[-1] for values in made.slow_sigma.values()])
                own += ((np.array([values[-1] for values in made.slow.values()]) - slow) / sigmas) ** 2
    assert list(made.slow) == []
    low, high = chi2.ppf([0.0005, 0.9995], 6 * count)
    assert low < totals[True] < high
    assert totals[False] > 3.0 * high
    low, high = chi2.ppf([0.0005 / 4, 1.0 - 0.0005 / 4], count)
    assert (low < own).all()
    assert (own < high).all()


def test_slow_errors_of_one_position_share_its_covariance():
    """After the first position nothing tells them apart: the covariance is that of noise and errors, and they stay."""
    made = filter_positions(
        np.zeros(1), np.array([[0.0, -100.0, 0.0]]), np.eye(3)[None] * 0.01, bias=BIAS, centroid=WANDER
    )
    np.testing.assert_allclose(np.diag(made.covariance[0])[:3], [0.01 + 0.3**2, 0.01 + 0.4**2 + 0.5**2, 0.01 + 0.3**2])
    assert {name: values[0] for name, values in made.slow_sigma.items()} == pytest.approx(
        {"bias_range_m": 0.4, "centroid_along_m": 0.5, "centroid_in_plane_m": 0.3, "centroid_out_of_plane_m": 0.3}
    )


def test_nis_of_a_flat_target_with_known_noise():
    """A plate of some 100 pixels recedes at constant velocity; its centroid's covariance is what the filter believes."""
    rng, count, pixel_rad, noise_m = np.random.default_rng(6), 400, 1e-3, 0.05
    places, spreads = np.empty((count, 3)), np.empty((count, 3, 3))
    for k in range(count):
        middle = np.array([0.01 * k, 0.0, 300.0 + 0.05 * k])
        grid = (np.arange(50) - 25.0 + rng.random()) * pixel_rad
        x, y = np.meshgrid(grid, grid + rng.random() * pixel_rad)
        at = np.stack([x, y, np.ones_like(x)], axis=-1) * middle[2]
        right, down = at[..., 0] - middle[0], at[..., 1] - middle[1]
        on = np.hypot(right, down) < 1.7
        seen = at[on] * (1.0 + rng.normal(0.0, noise_m, on.sum()) / middle[2])[:, None]
        fix = locate_centroid(seen, pixel_rad=pixel_rad, range_noise_m=noise_m)
        places[k], spreads[k] = fix.position_m, fix.covariance_m2
    made = filter_positions(np.arange(count) * 1.0, places, spreads, acceleration_m_s2_sqrt_hz=0.0)
    # Along the line of sight the noise is known, across it for a disc 0.3 to 0.9 of what is believed: the mean of NIS, 3 for
    # equality, lies between 1 + 2 * 0.3 and 1 + 2 * 0.9, give or take its spread of sqrt(6 / 400), 3 sigma.
    assert 1.6 - 0.37 < made.nis_mean < 2.8 + 0.37
    along = made.innovation_m[10:, 2]
    assert along.std() == pytest.approx(noise_m / np.sqrt(100), rel=0.2)  # some 100 pixels
    assert np.abs(made.velocity_m_s[-1] - [0.01, 0.0, 0.05]).max() < 1e-3


def test_clohessy_wiltshire_foresees_a_hop_and_constant_velocity_does_not():
    time_s = np.arange(0.0, 1500.0, 20.0)
    drift = clohessy_wiltshire(np.array([0.0, -3000.0, 0.0]), np.array([-0.195, 0.987, 0.02]), time_s, N_RAD_S)[0]
    noise_m = 0.3
    measured = drift + np.random.default_rng(7).normal(0.0, noise_m, drift.shape)
    spread = np.broadcast_to(np.eye(3) * noise_m**2, (time_s.size, 3, 3))
    hill, straight = (
        filter_positions(time_s, measured, spread, mean_motion_rad_s=n, acceleration_m_s2_sqrt_hz=1e-5)
        for n in (N_RAD_S, None)
    )
    assert hill.nis_mean == pytest.approx(3.0, abs=3.0 * np.sqrt(6.0 / time_s.size))  # 3 sigma of chi-square
    assert straight.nis_mean > 30.0
    # Without measurements for the last ten minutes, both coast.
    blind = measured.copy()
    blind[-30:] = np.nan
    hill, straight = (
        filter_positions(time_s, blind, spread, mean_motion_rad_s=n, acceleration_m_s2_sqrt_hz=1e-5)
        for n in (N_RAD_S, None)
    )
    off = [np.linalg.norm(made.position_m[-1] - drift[-1]) for made in (hill, straight)]
    assert off[0] < 5.0
    assert off[1] > 20.0 * off[0]
    deviation = np.sqrt(np.trace(hill.covariance[-1, :3, :3]))
    assert off[0] < 3.5 * deviation  # and knows how little it knows
    assert np.isnan(hill.nis[-30:]).all()


def test_the_models_are_those_of_the_books():
    step_s, density = 7.0, 0.3
    forward, noise = _discretize(None, density, step_s)
    state = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(forward @ state, [1.7, 3.4, 5.1, 0.1, 0.2, 0.3], rtol=1e-12)
    np.testing.assert_allclose(noise[0, [0, 3]], density**2 * np.array([step_s**3 / 3.0, step_s**2 / 2.0]), rtol=1e-12)
    np.testing.assert_allclose(noise[3, 3], density**2 * step_s, rtol=1e-12)
    forward, _ = _discretize(N_RAD_S, density, 300.0)
    start = np.array([100.0, -2000.0, 30.0]), np.array([0.1, -0.2, 0.3])
    place, speed = clohessy_wiltshire(*start, np.array([300.0]), N_RAD_S)
    np.testing.assert_allclose(forward @ np.concatenate(start), np.concatenate([place[0], speed[0]]), rtol=1e-9)


def test_before_the_first_position_there_is_nothing():
    places = np.full((5, 3), np.nan)
    places[2:] = [1.0, 2.0, 3.0]
    made = filter_positions(np.arange(5.0), places, np.broadcast_to(np.eye(3), (5, 3, 3)))
    assert np.isnan(made.position_m[:2]).all()
    np.testing.assert_array_equal(made.position_m[2], [1.0, 2.0, 3.0])
    none = filter_positions(np.arange(5.0), np.full((5, 3), np.nan), np.broadcast_to(np.eye(3), (5, 3, 3)))
    assert np.isnan([none.nis_mean, none.nis_share]).all()


@pytest.mark.parametrize(
    ("time_s", "places", "given"),
    [([0.0, 0.0], (2, 3), {}), ([0.0, 1.0], (2, 2), {}), ([0.0, 1.0], (2, 3), {"speed_m_s": 0.0})],
)
def test_refused(time_s, places, given):
    with pytest.raises(rl.ScenarioError, match="kalman"):
        filter_positions(np.array(time_s), np.zeros(places), np.zeros((2, 3, 3)), **given)


@pytest.mark.parametrize("mean_motion", [None, N_RAD_S])
def test_a_known_kick_moves_the_estimate_and_not_the_innovation(mean_motion):
    """Without noise: a kick between two instants, and one on an instant, which is in the velocity there already."""
    time_s, kick = np.arange(40.0), np.array([0.3, -0.2, 0.1])
    start, velocity = np.array([10.0, -500.0, 5.0]), np.array([0.05, 0.4, -0.02])
    kicks = [(20.4, kick), (30.0, -kick)]
    places, speeds = np.empty((40, 3)), np.empty((40, 3))
    edges = [0.0, *[at for at, _ in kicks], np.inf]
    for (begin, end), given in zip(itertools.pairwise(edges), [np.zeros(3), kick, -kick], strict=True):
        velocity = velocity + given
        of = (time_s >= begin) & (time_s < end)
        n = mean_motion or 1e-12
        places[of], speeds[of] = clohessy_wiltshire(start, velocity, time_s[of] - begin, n)
        if np.isfinite(end):
            (start,), (velocity,) = clohessy_wiltshire(start, velocity, np.array([end - begin]), n)
    spread = np.broadcast_to(np.eye(3) * 1e-6, (40, 3, 3))
    made = filter_positions(
        time_s, places, spread, mean_motion_rad_s=mean_motion, acceleration_m_s2_sqrt_hz=0.0, kicks=kicks
    )
    assert np.abs(made.innovation_m[2:]).max() < 1e-6  # metres; a kick that is not told of gives 0.3
    np.testing.assert_allclose(made.velocity_m_s[-1], speeds[-1], atol=1e-6)
    np.testing.assert_allclose(made.velocity_m_s[30], speeds[30], atol=1e-6)  # with the kick of that instant
    assert np.abs(filter_positions(time_s, places, spread, mean_motion_rad_s=mean_motion).innovation_m[21:]).max() > 0.1
