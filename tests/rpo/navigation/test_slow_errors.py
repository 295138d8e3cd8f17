"""Biases and wandering centroids in the filters: closed forms, batch least squares, consistency, and observability."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.stats import chi2

from rso_lidar.errors import ScenarioError
from rso_lidar.rpo import (
    CentroidWander,
    FilterBank,
    NavigationCamera,
    NavigationLidar,
    RelativeFilter,
    SensorBias,
    clohessy_wiltshire,
)
from rso_lidar.rpo.navigation.filter_bank import find_axes_across
from rso_lidar.study.dispersions.dispersed_paths import find_nees

STEP_S = 60.0
FORWARD = np.kron([[1.0, STEP_S], [0.0, 1.0]], np.eye(3))  # free motion
BIAS = SensorBias(range_sigma_m=1.0, bearing_sigma_deg=0.05)
WANDER = CentroidWander(along_sigma_m=1.0, across_sigma_m=0.7, correlation_time_s=300.0)
LIDAR = NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.1)
AXES = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]  # any rtn axes
FAR_M, NEAR_M = np.array([[50.0], [-2000.0], [30.0]]), np.array([[20.0], [-60.0], [15.0]])


def make_filter(treatment="estimated", position_m=(3, 6, 3), velocity_m_s=(0.005, 0.005, 0.005), density=0.0, **errors):
    return RelativeFilter(
        every_s=STEP_S, sensors=(LIDAR.replace(**errors),), position_sigma_m=position_m, velocity_sigma_m_s=velocity_m_s,
        acceleration_m_s2_sqrt_hz=density, slow_errors=treatment,
    )  # fmt: skip


def make_bank(part, estimate):
    return FilterBank(
        estimate, np.diag(part.start_sigma**2), has_thrust=False, slow=part.sensor_errors, treatment=part.slow_errors
    )


def fly(part, reference_m, steps=15, n_runs=400, seed=1):
    """Return the filters and true deviations of runs with process noise, after some steps."""
    rng = np.random.default_rng(seed)
    true, noise = np.zeros((6, n_runs)), part.find_noise(STEP_S)
    root = np.linalg.cholesky(noise + 1e-30 * np.eye(6))
    bank = make_bank(part, part.start_sigma[:, None] * rng.standard_normal((6, n_runs)))
    for k in range(steps):
        true = FORWARD @ true + root @ rng.standard_normal((6, n_runs))
        bank.predict(FORWARD @ bank.orbit, FORWARD, noise, step_s=STEP_S)
        bank.draw_slow(rng.standard_normal((len(part.sensor_errors), n_runs)), STEP_S if k else None)
        numbers = rng.standard_normal((3, n_runs))
        bank.observe(part.sensors[0], reference_m, reference_m + true[:3], numbers, axes=AXES)
    return bank, true


@pytest.mark.parametrize("reference_m", [FAR_M, NEAR_M], ids=["2 km", "65 m"])
@pytest.mark.parametrize("errors", [{"bias": BIAS}, {"bias": BIAS, "centroid": WANDER}], ids=["bias", "both"])
@pytest.mark.parametrize("treatment", ["estimated", "considered", "ignored"])
def test_errors_are_as_large_as_filters_say_that_know_the_slow_ones(treatment, errors, reference_m):
    """The sum of 400 NEES is chi-square, within 99.9 %, where slow errors are estimated or considered, and above it else."""
    bank, true = fly(make_filter(treatment, (10, 20, 10), (0.02, 0.02, 0.02), 1e-4, **errors), reference_m)
    nees = find_nees(bank.orbit - true, bank.covariance[:6, :6].transpose(2, 0, 1)).sum()
    low, high = chi2.ppf([0.0005, 0.9995], 6 * 400)
    if treatment == "ignored":
        assert nees > 2.0 * high
    else:
        assert low < nees < high


def test_estimates_of_slow_errors_are_as_wrong_as_filters_say():
    """Each over its standard deviation: the mean square of 400 runs is 1, within 99.9 %."""
    bank, _ = fly(make_filter("estimated", density=1e-4, bias=BIAS, centroid=WANDER), FAR_M)
    slow, sigma = bank.find_slow()
    low, high = chi2.ppf([0.0005 / 6, 1.0 - 0.0005 / 6], 400)
    square = np.sum(((slow - bank.true_slow) / sigma) ** 2, axis=1)
    assert (low < square).all()
    assert (square < high).all()
    assert (bank.find_slow()[1][:, 0] < bank._slow.sigma).all()


def find_steady_sigma(forward, noise, seen, variance):
    """Return the standard deviations after a measurement in the steady state, by the algebraic Riccati equation."""
    before = solve_discrete_are(forward.T, seen[:, None], noise, np.array([[variance]]))
    gain = before @ seen / (seen @ before @ seen + variance)
    return np.sqrt(np.diag(before - np.outer(gain, seen @ before)))


@pytest.mark.parametrize("density", [0.0, 1e-4])
def test_a_gauss_markov_range_bias_reaches_the_steady_state_of_riccatis_equation(density):
    """A scalar Gauss-Markov process in white noise, and the same beside a position with white acceleration."""
    tau_s, sigma_m = 300.0, 1.0
    bias = SensorBias(range_sigma_m=sigma_m, correlation_time_s=tau_s)
    start = ((1e-6,) * 3, (1e-9,) * 3) if density == 0.0 else ((10.0,) * 3, (0.1,) * 3)
    part, still = make_filter("estimated", *start, density=density, bias=bias), np.zeros((6, 1))
    bank, reference_m = make_bank(part, still), np.array([[0.0], [-1000.0], [0.0]])
    for _ in range(400):
        bank.predict(FORWARD @ bank.orbit, FORWARD, part.find_noise(STEP_S), step_s=STEP_S)
        bank.observe(part.sensors[0], reference_m, reference_m, np.zeros((3, 1)), axes=np.eye(3))
    decay = np.exp(-STEP_S / tau_s)
    new = np.array([[sigma_m**2 * (1.0 - decay**2)]])
    if density == 0.0:
        (wanted,) = find_steady_sigma(np.array([[decay]]), new, np.array([1.0]), 0.1**2)
    else:
        forward, noise = np.zeros((3, 3)), np.zeros((3, 3))
        forward[:2, :2], forward[2, 2] = [[1.0, STEP_S], [0.0, 1.0]], decay
        noise[:2, :2], noise[2:, 2:] = part.find_noise(STEP_S)[1::3, 1::3], new
        along_m, _, wanted = find_steady_sigma(forward, noise, np.array([1.0, 0.0, 1.0]), 0.1**2)
        assert np.sqrt(bank.covariance[1, 1, 0]) == pytest.approx(along_m, rel=1e-6)
    assert bank.find_slow()[1].item() == pytest.approx(wanted, rel=1e-6)


def find_triad(place_m):
    """Return the axes along the line of sight, across it in the orbital plane, and out of it."""
    along = -place_m / np.linalg.norm(place_m)
    in_plane = np.cross(AXES[:, 2], along)
    in_plane /= np.linalg.norm(in_plane)
    return np.stack([along, in_plane, np.cross(along, in_plane)])


def test_a_filter_agrees_with_batch_least_squares():
    """All measurements at once, slow errors as correlated noise of the data: the estimate of Gauss and Markov.

    Data are linearised about the truth; the filter is not, so that both differ by the share of errors in the range, squared.
    """
    bias = BIAS.replace(correlation_time_s=900.0, range_sigma_m=0.5)
    part, n = make_filter("estimated", bias=bias, centroid=WANDER), 12
    rng = np.random.default_rng(8)
    error = part.start_sigma * rng.standard_normal(6)
    bank = make_bank(part, error[:, None])
    triad, size = find_triad(FAR_M[:, 0]), np.linalg.norm(FAR_M)
    data, rows, onward, still = [], [], np.eye(6), np.zeros((6, 1))
    for k in range(n):
        bank.predict(FORWARD @ bank.orbit, FORWARD, np.zeros((6, 6)), step_s=STEP_S)
        bank.draw_slow(rng.standard_normal((6, 1)), STEP_S if k else None)
        numbers = rng.standard_normal((3, 1))
        bank.observe(part.sensors[0], FAR_M, FAR_M + still[:3], numbers, axes=AXES)
        slow = bank.true_slow[:, 0]
        shifted = triad.T @ (slow[:3] * [1.0, size, size] + slow[3:])
        first, second = (axis[:, 0] for axis in find_axes_across((FAR_M - shifted[:, None]) / size))
        angle = np.deg2rad(0.02) * size
        moved = -shifted + angle * (numbers[0] * first + numbers[1] * second) - 0.1 * numbers[2] * triad[0]
        data.append(-triad @ moved)
        onward = FORWARD @ onward
        rows.append(-triad @ onward[:3])
    time_s = STEP_S * np.arange(n)
    apart_s = np.abs(time_s[:, None] - time_s)
    slow_m = [np.array([0.5, size * np.deg2rad(0.05), size * np.deg2rad(0.05)]), np.array([1.0, 0.7, 0.7])]
    spread = np.kron(np.eye(n), np.diag([0.1, angle, angle]) ** 2)
    for sigma, tau_s in zip(slow_m, (900.0, 300.0), strict=True):
        spread += np.kron(np.exp(-apart_s / tau_s), np.diag(sigma**2))
    slopes, weight = np.concatenate(rows), np.linalg.inv(spread)
    prior = np.diag(1.0 / part.start_sigma**2)
    covariance = np.linalg.inv(prior + slopes.T @ weight @ slopes)
    start = covariance @ (prior @ error + slopes.T @ weight @ np.concatenate(data))
    wanted = onward @ covariance @ onward.T
    sigma = np.sqrt(np.diag(wanted))
    assert np.abs((bank.covariance[:6, :6, 0] - wanted) / np.outer(sigma, sigma)).max() < 0.01
    assert np.abs((bank.orbit[:, 0] - onward @ start) / sigma).max() < 0.02


def find_range_bias_sigma_m(hold, burn_m_s=(0.0, 0.0, 0.0), circles=False):
    """Return the standard deviation of a constant range bias of 2 m after one revolution of relative motion."""
    n_rad_s, count = 1.1e-3, 96
    step_s = 2.0 * np.pi / n_rad_s / count
    part = make_filter("estimated", (100, 200, 100), (0.2, 0.2, 0.2), bias=SensorBias(range_sigma_m=2.0))
    state = np.array([50.0, 0.0, 0.0, 0.0, -100.0 * n_rad_s, 0.0]) if circles else np.array([0.0, -hold, 0, 0, 0, 0])
    unit = np.eye(6)
    forward = np.hstack(clohessy_wiltshire(unit[:, :3], unit[:, 3:], step_s, n_rad_s)).T
    bank = make_bank(part, np.zeros((6, 1)))
    for k in range(count):
        if k == count // 4:
            state[3:] += burn_m_s
        state = forward @ state
        bank.predict(np.zeros((6, 1)), forward, np.zeros((6, 6)), step_s=step_s)
        bank.observe(part.sensors[0], state[:3, None], state[:3, None], np.zeros((3, 1)), axes=np.eye(3))
    return bank.find_slow()[1].item()


def test_a_range_bias_is_seen_in_a_manoeuvre_but_not_in_a_hold_on_the_v_bar():
    """On the V-bar every place is at rest, so that a bias cannot be told from an offset along the track.

    What is known of it is the prior of both: 2 m of bias against 200 m of offset. It is so for the range of a camera, too,
    which needs a manoeuvre (Woffinden and Geller, J. Guid. Control Dyn. 32 (2009) 1194).
    """
    assert find_range_bias_sigma_m(100.0) == pytest.approx(2.0 * 200.0 / np.hypot(200.0, 2.0), rel=1e-5)
    assert find_range_bias_sigma_m(100.0, burn_m_s=(0.05, 0.0, 0.0)) < 0.1 * 2.0
    assert find_range_bias_sigma_m(100.0, circles=True) < 0.1 * 2.0


def test_drawn_errors_are_stationary_and_lose_their_correlation_as_stated():
    part, rng = make_filter(bias=BIAS, centroid=WANDER), np.random.default_rng(4)
    bank, history = make_bank(part, np.zeros((6, 20_000))), []
    for k in range(6):
        bank.draw_slow(rng.standard_normal((6, 20_000)), STEP_S if k else None)
        history.append(bank.true_slow)
    sigma = part.sensor_errors.sigma
    np.testing.assert_allclose(history[-1].std(axis=1), sigma, rtol=5.0 / np.sqrt(2.0 * 20_000))
    kept = np.mean(history[0] * history[-1], axis=1) / sigma**2  # after 300 s: a constant, and a time of correlation
    np.testing.assert_allclose(kept, [1.0] * 3 + [np.exp(-1.0)] * 3, atol=5.0 / np.sqrt(20_000))


def test_a_run_with_slow_errors_has_the_same_bits_alone_and_among_others():
    part, rng = make_filter(bias=BIAS, centroid=WANDER), np.random.default_rng(2)
    first, numbers = part.start_sigma[:, None] * rng.standard_normal((6, 50)), rng.standard_normal((9, 50))
    made = []
    for chosen in (slice(None), slice(17, 18)):
        bank = make_bank(part, first[:, chosen])
        bank.predict(bank.orbit, FORWARD, part.find_noise(STEP_S), step_s=STEP_S)
        bank.draw_slow(numbers[3:, chosen], None)
        bank.observe(part.sensors[0], NEAR_M, NEAR_M + first[:3, chosen], numbers[:3, chosen], axes=AXES)
        made.append((bank.state, bank.covariance))
    assert made[0][0][:, 17].tobytes() == made[1][0][:, 0].tobytes()
    assert made[0][1][:, :, 17].tobytes() == made[1][1][:, :, 0].tobytes()


def test_each_slow_error_has_a_name_with_its_unit_and_a_camera_has_none_of_range():
    names = [error.name for error in make_filter(bias=BIAS, centroid=WANDER).sensor_errors.errors]
    ends = ["in_plane", "out_of_plane"]
    assert names == [
        "bias_range_m", *(f"bias_{end}_rad" for end in ends), "centroid_along_m", *(f"centroid_{end}_m" for end in ends)
    ]  # fmt: skip
    camera = NavigationCamera(bearing_sigma_deg=0.01, centroid=WANDER.replace(along_sigma_m=0.0))
    part = make_filter().replace(sensors=(camera,))
    assert [error.name for error in part.sensor_errors.errors] == [f"centroid_{end}_m" for end in ends]


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"bias": {}}, "bias: .*both 0"),
        ({"centroid": {"correlation_time_s": 10.0}}, "centroid: .*both 0"),
        ({"bias": {"range_sigma_m": -1.0}}, "bias.range_sigma_m"),
        ({"bias": {"range_sigma_m": 1.0, "correlation_time_s": 0.0}}, "bias.correlation_time_s"),
        ({"bias": {"sigma_m": 1.0}}, "bias.*unknown key 'sigma_m'"),
        ({"bias": {"bearing_sigma_deg": 20.0}}, "bias.bearing_sigma_deg"),
        ({"centroid": {"along_sigma_m": float("nan")}}, "centroid.along_sigma_m"),
        ({"centroid": 1.0}, "centroid"),
        ({"type": "camera", "bias": {"range_sigma_m": 1.0}}, "bias.range_sigma_m: a camera measures no range"),
        ({"type": "camera", "centroid": {"along_sigma_m": 1.0}}, "centroid.along_sigma_m: a camera measures no range"),
    ],
)
def test_what_is_no_slow_error_is_refused_in_one_line(fields, problem):
    sensor = {"type": "lidar", "bearing_sigma_deg": 1.0} | fields
    with pytest.raises(ScenarioError, match=problem) as error:
        RelativeFilter(**make_filter().model_dump() | {"sensors": (sensor,)})
    assert "\n" not in str(error.value)


def test_a_treatment_that_is_unknown_is_refused():
    with pytest.raises(ScenarioError, match=r"slow_errors.*white"):
        make_filter("white")
