"""Sensors beside the lidar against their datasheets, IEEE Std 952, and rigid-body motion."""

import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from rso_lidar import motion, sensors, units
from rso_lidar.sensors.sensor_part import gauss_markov_allan_variance
from tests.sensors.motion_for_tests import make_motion

HOURS, RATE_HZ, SEEDS = 10.0, 5.0, 5
AVERAGING_S = np.array([1.0, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 4000, 8000, 12000])
CORRELATION_S = (10.0, 100.0, 1000.0, 10_000.0)
GYRO = sensors.Gyro(
    name="gyro", rate_hz=RATE_HZ, angle_random_walk_deg_sqrt_h=0.01, bias_instability_deg_h=0.2,
    rate_random_walk_deg_h_sqrt_h=0.5, turn_on_bias_deg_h=10.0,
)  # fmt: skip
ACCELEROMETER = sensors.Accelerometer(
    name="accelerometer", rate_hz=RATE_HZ, velocity_random_walk_m_s_sqrt_h=0.002, bias_instability_ug=10.0,
    acceleration_random_walk_ug_sqrt_h=50.0, turn_on_bias_ug=100.0,
)  # fmt: skip
SOURCE = "datasheet numbers of the part; overlapping Allan deviation of allantools"


@functools.cache
def rest():
    return make_motion(np.arange(round(HOURS * 3600.0 * RATE_HZ)) / RATE_HZ)


@functools.cache
def allan_variances(part):
    """Return the overlapping Allan variances (run, averaging time) of each axis at rest [deg/h]² or [µg]²."""
    allantools = pytest.importorskip("allantools", reason="allantools is in the test group: install it")
    read, unit = ("angular_velocity_rad_s", units.DEG_H) if part is GYRO else ("specific_force_m_s2", units.UG)
    found = []
    for seed in range(SEEDS):
        samples, _ = part.measure(rest(), sensors.make_key(seed, part.name), 0)
        for axis in (getattr(samples, read) / unit).T:
            times, deviations, *_ = allantools.oadev(axis, rate=RATE_HZ, data_type="freq", taus=AVERAGING_S)
            np.testing.assert_allclose(times, AVERAGING_S)
            found.append(deviations**2)
    return np.array(found)


def sampled_allan_variance(count, correlation_s):
    """Return the Allan variance of means of `count` samples of a Gauss-Markov process of variance 1, by its sums."""
    r = np.exp(-1.0 / RATE_HZ / correlation_s)
    within = count + 2.0 * (count * r * (1.0 - r) - r * (1.0 - r**count)) / (1.0 - r) ** 2
    across = r * ((1.0 - r**count) / (1.0 - r)) ** 2
    return (within - across) / count**2


def terms():
    """Return the Allan variances (averaging time, 3) of IEEE Std 952, annex C, for coefficients of 1.

    The slow processes are sampled at instants: the sums over samples stand in place of integrals. For the walk that is a
    factor 1 + 1 / (2 n^2) for means of n samples.
    """
    fine = np.geomspace(1.0, 1e6, 20_000)
    greatest = sum(gauss_markov_allan_variance(fine, 1.0, time_s) for time_s in CORRELATION_S).max()
    count = AVERAGING_S * RATE_HZ
    flat = sum(sampled_allan_variance(count, time_s) for time_s in CORRELATION_S) / greatest
    return np.stack([1.0 / AVERAGING_S, flat, AVERAGING_S / 3.0 * (1.0 + 0.5 / count**2)], axis=1)


def test_means_of_samples_tend_to_the_integral_of_ieee_std_952():
    long = AVERAGING_S[AVERAGING_S >= 100.0]
    for time_s in CORRELATION_S[1:]:
        sampled = sampled_allan_variance(long * RATE_HZ, time_s)
        np.testing.assert_allclose(sampled, gauss_markov_allan_variance(long, 1.0, time_s), rtol=1e-3)


CASES = {  # coefficients in units of the Allan deviation and √s, and those of the datasheet
    "gyro at rest for 10 h": (
        GYRO, [(0.01, 60.0, "deg/√h"), (0.2, 1.0, "deg/h"), (0.5, 1.0 / 60.0, "deg/h/√h")],
    ),
    "accelerometer at rest for 10 h": (
        ACCELEROMETER,
        [(0.002, units.M_S_SQRT_H / units.UG, "m/s/√h"), (10.0, 1.0, "µg"), (50.0, 1.0 / 60.0, "µg/√h")],
    ),
}  # fmt: skip
WHAT = ("random walk of the angle or velocity", "flat of the Allan deviation", "random walk of the bias")


@pytest.mark.parametrize("case", CASES)
def test_ten_hours_at_rest_meet_the_three_numbers_of_a_datasheet(case, validation):
    part, numbers = CASES[case]
    variances = allan_variances(part)
    expected = terms() @ np.array([(stated * factor) ** 2 for stated, factor, _ in numbers])
    weights = np.sqrt(HOURS * 3600.0 / AVERAGING_S) / expected
    squares, *_ = np.linalg.lstsq(weights[:, None] * terms(), (weights * variances).T, rcond=None)
    for k, (stated, factor, unit) in enumerate(numbers):
        mean = squares[k].mean() / factor**2
        error = squares[k].std(ddof=1) / np.sqrt(len(variances)) / factor**2 / (2.0 * stated)  # of the root
        assert error < 0.06 * stated
        validation(
            case=f"{case}: {WHAT[k]}",
            source=SOURCE,
            expected=stated,
            got=np.sqrt(mean),
            tolerance=4.0 * error,
            unit=unit,
        )


@pytest.mark.parametrize("case", CASES)
def test_the_whole_curve_is_that_of_ieee_std_952(case):
    """Each point is chi-square with the degrees of freedom of Greenhall and Riley, summed over fifteen axes."""
    part, numbers = CASES[case]
    variances = allan_variances(part)
    import allantools

    expected = terms() @ np.array([(stated * factor) ** 2 for stated, factor, _ in numbers])
    for k, averaging_s in enumerate(AVERAGING_S):
        alpha = 0 if averaging_s < 5.0 else -1 if averaging_s < 500.0 else -2
        count = round(averaging_s * RATE_HZ)
        each = allantools.edf_greenhall(alpha, 2, count, rest().time_s.size, overlapping=True, modified=False)
        low, high = chi2.ppf([1e-4, 1.0 - 1e-4], each * len(variances)) / (each * len(variances))
        assert low < variances[:, k].mean() / expected[k] < high, averaging_s


@pytest.mark.parametrize(
    ("name", "white", "floor", "at_1_s", "lowest", "unit"),
    [
        ("stim300_gyro", "angle_random_walk_deg_sqrt_h", "bias_instability_deg_h", 0.15 * 60.0, 0.5, "deg/h"),
        (
            "stim300_accelerometer", "velocity_random_walk_m_s_sqrt_h", "bias_instability_ug",
            0.06 * units.M_S_SQRT_H / units.UG, 50.0, "µg",
        ),
    ],
)  # fmt: skip
def test_presets_read_as_their_maker_reads_the_curve(name, white, floor, at_1_s, lowest, unit, validation):
    """Sensonor reads the random walk at 1 s and the bias instability at the lowest point, here within one hour."""
    table = sensors.load_sensor_presets()[name]
    factor = 60.0 if unit == "deg/h" else units.M_S_SQRT_H / units.UG
    curve = np.sqrt(terms()[:, :2] @ np.array([(table[white] * factor) ** 2, table[floor] ** 2]))
    source = "STIM300 datasheet TS1524 rev. 9"
    validation(
        case=f"{name}: Allan deviation at 1 s",
        source=source,
        expected=at_1_s,
        got=curve[0],
        tolerance=0.02 * at_1_s,
        unit=unit,
    )
    got = curve[AVERAGING_S <= 4000.0].min()
    validation(
        case=f"{name}: lowest point within an hour",
        source=source,
        expected=lowest,
        got=got,
        tolerance=0.02 * lowest,
        unit=unit,
    )


# ---------------------------------------------------------------------------------------- GNSS and star trackers


def of_seeds(part, motion_of, read, count=500):
    """Return measured arrays (seed, sample, ...) of the same motion."""
    return np.array(
        [getattr(part.measure(motion_of, sensors.make_key(k, part.name), 0)[0], read) for k in range(count)]
    )


def check_variance(values, sigma):
    """Check that independent values have the mean 0 and this standard deviation, by chi-square at 1e-5 on each side."""
    total = np.sum((values / sigma) ** 2)
    low, high = chi2.ppf([1e-5, 1.0 - 1e-5], values.size)
    assert low < total < high, (total / values.size, sigma)


def test_errors_of_gnss_are_chi_square_and_correlated_as_stated(validation):
    part = sensors.Gnss(
        name="gnss", rate_hz=0.1, position_noise_m=1.0, slow_position_m=2.0, velocity_noise_m_s=0.03, slow_velocity_m_s=0.04,
        correlation_s=50.0, vertical_ratio=1.5,
    )  # fmt: skip
    motion_of = make_motion(10.0 * np.arange(6))
    for read, sigma in (("position_m", np.sqrt(5.0)), ("velocity_m_s", 0.05)):
        errors = (of_seeds(part, motion_of, read) - getattr(motion_of, read)) / [1.5, 1.0, 1.0]
        for sample in (0, 5):  # stationary from the first sample on
            check_variance(errors[:, sample], sigma)
        lag = np.mean(errors[:, 0] * errors[:, 5]) / sigma**2
        share = {"position_m": 0.8, "velocity_m_s": 0.64}[read]
        validation(
            case=f"GNSS, {read}: correlation after one correlation time", source="exp(-1) of the slow share of the variance",
            expected=share * np.exp(-1.0), got=lag, tolerance=4.0 / np.sqrt(1500.0), unit="1",
        )  # fmt: skip


def test_errors_of_relative_gnss_are_chi_square():
    from rso_lidar.records import BodyState

    part = sensors.RelativeGnss(
        name="gnss", rate_hz=1.0, target="tdrs", axes="inertial", position_noise_m=0.3, slow_position_m=0.4,
        velocity_noise_m_s=0.01,
    )  # fmt: skip
    motion_of = make_motion([0.0], targets={"tdrs": BodyState(np.full((1, 3), 50.0), np.zeros((1, 3)))})
    check_variance(of_seeds(part, motion_of, "relative_position_m") + 50.0, 0.5)
    check_variance(of_seeds(part, motion_of, "relative_velocity_m_s"), 0.01)


def test_errors_of_a_star_tracker_are_chi_square(validation):
    part = sensors.StarTracker(
        name="tracker", rate_hz=0.1, mount={"euler_zyx_deg": (20.0, 50.0, 70.0)}, cross_boresight_arcsec=6.0,
        boresight_arcsec=40.0, slow_cross_boresight_arcsec=8.0, slow_boresight_arcsec=30.0, correlation_s=50.0,
    )  # fmt: skip
    motion_of = make_motion(10.0 * np.arange(6), np.random.default_rng(1), earth_direction=None)
    measured = of_seeds(part, motion_of, "quaternion_xyzw")
    true = Rotation.from_quat(np.tile(motion_of.quaternion_xyzw, (len(measured), 1)))
    error = (true.inv() * Rotation.from_quat(measured.reshape(-1, 4))).as_rotvec()
    error = part.mount.rotation.inv().apply(error).reshape(measured.shape[0], -1, 3) / units.ARCSEC
    for sample in (0, 5):
        check_variance(error[:, sample, :2], 10.0)
        check_variance(error[:, sample, 2], 50.0)
    for axes, share, what in ((slice(0, 2), 0.64, "across"), (slice(2, 3), 0.36, "about")):
        lag = np.mean(error[:, 0, axes] * error[:, 5, axes]) / np.mean(error[..., axes] ** 2)
        validation(
            case=f"star tracker, {what} the boresight: correlation after one correlation time",
            source="exp(-1) of the slow share of the variance", expected=share * np.exp(-1.0), got=lag,
            tolerance=4.0 / np.sqrt(500.0), unit="1",
        )  # fmt: skip


def test_white_errors_of_successive_samples_and_of_two_sensors_are_independent():
    quiet = {"cross_boresight_arcsec": 10.0, "boresight_arcsec": 10.0, "rate_hz": 1.0}
    motion_of = make_motion(np.arange(20_000.0))
    first, second = (
        part.measure(motion_of, sensors.make_key(3, part.name), 0)[0].quaternion_xyzw[:, :3]
        for part in (sensors.StarTracker(name=name, **quiet) for name in ("one", "two"))
    )
    check_variance(2.0 * first / units.ARCSEC, 10.0)
    together = np.concatenate([first[1:], first[:-1], second[1:]], axis=1)
    correlation = np.corrcoef(together.T) - np.eye(9)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(len(together))


# ---------------------------------------------------------------------------------------- a tumbling body


def test_sensors_of_a_tumbling_body_agree_with_its_attitude(validation):
    """The rate integrates to the attitude; the second difference of a place is the specific force there, without gravity."""
    step_s, place = 1e-3, np.array([0.4, -0.3, 0.5])
    time_s = step_s * np.arange(20_001)
    tumble = motion.Tumble(inertia_kg_m2=(10.0, 20.0, 25.0), body_rate_deg_s=(10.0, 20.0, 5.0))
    turned, rate = tumble.orientation(time_s)
    moments = np.array([10.0, 20.0, 25.0])
    change = -np.cross(rate, moments * rate) / moments  # Euler's equations without torque
    motion_of = make_motion(
        time_s, quaternion_xyzw=turned.as_quat(), angular_velocity_rad_s=rate, angular_acceleration_rad_s2=change
    )
    mount = {"position_m": tuple(place), "euler_zyx_deg": (40.0, -30.0, 20.0)}
    gyro = sensors.Gyro(name="gyro", rate_hz=1000.0, mount=mount)
    samples, _ = gyro.measure(motion_of, sensors.make_key(1, "gyro"), 0)
    measured = gyro.mount.rotation.apply(np.array(samples.angular_velocity_rad_s))
    steps = Rotation.from_rotvec(step_s * 0.5 * (measured[1:] + measured[:-1]))  # trapezoidal rule
    while len(steps) > 1:  # product of all, in pairs
        steps = Rotation.concatenate(
            [steps[0::2][: len(steps) // 2] * steps[1::2], steps[len(steps) - len(steps) % 2 :]]
        )
    found = turned[0] * steps[0]
    validation(
        case="gyro on a tumbling body: attitude after 20 s of integrated rates",
        source="torque-free rotation in closed form", expected=0.0,
        got=(turned[-1].inv() * found).magnitude() / units.ARCSEC, tolerance=0.5, unit="arcsec",
    )  # fmt: skip
    accelerometer = sensors.Accelerometer(name="accelerometer", rate_hz=1000.0, mount=mount)
    samples, _ = accelerometer.measure(motion_of, sensors.make_key(1, "accelerometer"), 0)
    path = turned.apply(place)
    inertial = np.diff(path, 2, axis=0) / step_s**2
    felt = turned[1:-1].inv().apply(inertial)
    difference = accelerometer.mount.rotation.apply(np.array(samples.specific_force_m_s2)[1:-1]) - felt
    validation(
        case="accelerometer on a tumbling body: greatest difference", source="second difference of its place",
        expected=0.0, got=np.abs(difference).max(), tolerance=1e-6, unit="m/s²",
    )  # fmt: skip
