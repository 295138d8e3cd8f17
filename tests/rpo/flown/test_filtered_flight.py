"""The filter of one flight: what it is told, what it knows, and that it repeats."""

import datetime
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.stats import chi2

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Forces, Kepler
from rso_lidar.rpo import (
    AfterTime,
    CentroidWander,
    Flown,
    HoldLeg,
    Hop,
    HopLeg,
    NavigationCamera,
    NavigationErrors,
    NavigationLidar,
    RangeNoise,
    RelativeFilter,
    SensorBias,
    Sequence,
    Thrusters,
    TwoImpulseGuidance,
    VBarLeg,
)
from rso_lidar.rpo.flown import flown_plan

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CHIEF = Kepler(
    epoch_utc=START, semi_major_axis_km=6878.137, eccentricity=0.0005, inclination_deg=51.6, raan_deg=40.0,
    argument_of_perigee_deg=15.0, true_anomaly_deg=30.0,
)  # fmt: skip
LIDAR = NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.1)
BLIND = LIDAR.replace(most_range_m=1.0)
FILTER = RelativeFilter(
    every_s=100, sensors=(LIDAR,), position_sigma_m=(10, 30, 10), velocity_sigma_m_s=(0.03, 0.03, 0.03),
    acceleration_m_s2_sqrt_hz=0.0,
)  # fmt: skip
SURE = FILTER.replace(sensors=(BLIND,), position_sigma_m=(1e-6,) * 3, velocity_sigma_m_s=(1e-9,) * 3)
HOP = Hop(relative_to="station", from_m=(0.0, -2000.0, 0.0), to_m=(0.0, -300.0, 0.0), duration_s=2500.0)
HELD = Sequence(
    relative_to="station",
    legs=[
        HopLeg(from_m=(0, -1500, 0), to_m=(0, -500, 0), duration_s=1500.0),
        VBarLeg(to_m=-200, speed_m_s=0.5),
        HoldLeg(until=AfterTime(duration_s=400.0)),
    ],
)


def fly(plan=HOP, navigation=FILTER, seed=0, **changed):
    """Return a flight with corrections each 500 s."""
    fields = {"guidance": TwoImpulseGuidance(every_s=500.0, horizon_s=1500.0), "forces": Forces()} | changed
    return Flown(plan=plan, navigation=navigation, seed=seed, **fields).fly(START, CHIEF)


def find_misses(flight, until_s):
    """Return estimates less true positions (time, 3) [m], and the covariances (time, 3, 3) of the filter."""
    made = flight.list_estimates(until_s)
    true, _ = flight.relative(np.array([one.time_s for one in made]))
    return np.array([one.position_m for one in made]) - true, np.array([one.covariance[:3, :3] for one in made])


@pytest.mark.parametrize(
    "thrusters",
    [Thrusters(), Thrusters(acceleration_m_s2=0.01, rise_s=1.0, fall_s=2.0, magnitude_error_fraction=0.03,
               misalignment_deg=(0.5, -0.3, 0.8))],
)  # fmt: skip
def test_what_the_filter_knows_it_keeps(thrusters):
    """With a sure start, no measurement and burns whose errors are constant, the estimate follows the path.

    Thrust of finite length is an impulse to the filter: its push of 0.3 m/s over 30 s has a second order of below 1 cm.
    """
    miss, _ = find_misses(fly(HELD, SURE, thrusters=thrusters), 2400.0)
    assert np.abs(miss).max() < (2e-4 if thrusters == Thrusters() else 0.03)


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_says():
    """Five flights by five seeds, of burns and held thrust with errors; positions at two instants, 99.9 %."""
    thrusters = Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0)
    total = np.zeros(2)
    for seed in range(5):
        miss, covariance = find_misses(fly(HELD, seed=seed, thrusters=thrusters), 2400.0)
        nees = np.einsum("ti,tij,tj->t", miss, np.linalg.inv(covariance), miss)
        total += nees[[8, 18]]
    low, high = chi2.ppf([0.0005, 0.9995], 15)
    assert (low < total).all()
    assert (total < high).all()


@pytest.mark.slow
def test_held_thrust_with_errors_is_followed_by_its_covariance():
    """Thrust is 20 % off, and only the start is known: the miss is that of the thrust, and the filter says so."""
    thrusters = Thrusters(magnitude_sigma_fraction=0.2)
    misses = []
    for seed in range(6):
        flight = fly(HELD, SURE, seed=seed, thrusters=thrusters, guidance=TwoImpulseGuidance(at_s=(2390.0,)))
        miss, covariance = find_misses(flight, 2400.0)
        misses.append(miss[-1] / np.sqrt(np.diagonal(covariance[-1])))
    assert np.abs(misses).max() < 5.0
    assert np.sqrt(np.mean(np.square(misses))) == pytest.approx(1.0, abs=0.6)


def test_a_flight_whose_filter_estimates_slow_errors_knows_its_position_and_one_that_ignores_them_does_not():
    """Four flights by four seeds: positions after half of the hop, 99.9 %, and what is known of each error in the end."""
    sensor = LIDAR.replace(
        bias=SensorBias(range_sigma_m=1.0, bearing_sigma_deg=0.05, correlation_time_s=1e4),
        centroid=CentroidWander(along_sigma_m=1.0, across_sigma_m=1.0, correlation_time_s=300.0),
    )
    sums = {}
    for treatment in ("estimated", "ignored"):
        total = 0.0
        for seed in range(4):
            flight = fly(navigation=FILTER.replace(sensors=(sensor,), slow_errors=treatment), seed=seed)
            miss, covariance = find_misses(flight, 1300.0)
            total += miss[-1] @ np.linalg.solve(covariance[-1], miss[-1])
        sums[treatment] = total
        last = flight.list_estimates(1300.0)[-1]
        assert last.slow.shape == last.slow_sigma.shape == ((6,) if treatment == "estimated" else (0,))
    low, high = chi2.ppf([0.0005, 0.9995], 12)
    assert low < sums["estimated"] < high
    assert sums["ignored"] > 10.0 * high


def test_a_flight_repeats_to_the_bit_whatever_is_asked_first():
    one = fly(seed=7)
    flown_plan._make_flight.cache_clear()
    other = fly(seed=7)
    assert other is not one
    other.relative(np.array([100.0]))
    other.list_estimates(700.0)
    made, again = one.list_estimates(2400.0), other.list_estimates(2400.0)
    assert [a.position_m.tobytes() for a in made] == [b.position_m.tobytes() for b in again]
    assert made[-1].covariance.tobytes() == again[-1].covariance.tobytes()
    assert fly(seed=8).list_estimates(2400.0)[-1].position_m.tobytes() != made[-1].position_m.tobytes()


def test_sensors_with_little_noise_bring_the_flight_to_its_plan():
    exact = NavigationLidar(bearing_sigma_deg=1e-6, range_sigma_m=1e-4)
    flight = fly(navigation=FILTER.replace(sensors=(exact,), every_s=50.0))
    assert (
        np.linalg.norm(
            flight.relative(np.array([2490.0]))[0][0] - HOP.plan(START, CHIEF).relative(np.array([2490.0]))[0][0]
        )
        < 0.05
    )
    far = fly(navigation=NavigationErrors(position_sigma_m=20.0))
    assert np.linalg.norm(far.find_miss_m()) > 1.0


@dataclass(frozen=True)
class Listener:
    """Guidance that does nothing but listen."""

    heard: list = field(default_factory=list, compare=False)

    def next_s(self, after_s):
        return 1000.0 if after_s < 1000.0 else np.inf

    def replan(self, update):
        self.heard.append(update)
        return update.impulses


def test_guidance_is_given_the_estimate():
    listener = Listener()
    flight = fly(guidance=listener, seed=41)
    estimate = flight.list_estimates(1000.0)[-1]
    (update,) = listener.heard
    assert estimate.time_s == update.time_s == 1000.0
    np.testing.assert_array_equal(update.position_m, estimate.position_m)
    np.testing.assert_array_equal(update.velocity_m_s, estimate.velocity_m_s)
    assert estimate.sensors == (0,)
    assert "10 instants of measurement, 0 without a sensor; sigma of the position at 1000 s:" in flight.describe()


def test_sensors_measure_within_their_range_only():
    camera = NavigationCamera(bearing_sigma_deg=0.01, least_range_m=1000.0, needs_sunlight=False)
    flight = fly(navigation=FILTER.replace(sensors=(camera, LIDAR.replace(most_range_m=1500.0))))
    for one in flight.list_estimates(2400.0):
        size = float(np.linalg.norm(flight.relative(np.array([one.time_s]))[0][0]))
        assert one.sensors == tuple(k for k, sees in enumerate((size >= 1000.0, size <= 1500.0)) if sees)


def test_range_noise_is_interpolated_in_logarithms():
    noisy = LIDAR.replace(range_noise=RangeNoise(range_m=(100.0, 10_000.0), sigma_m=(0.1, 10.0)), origin_sigma_m=0.2)
    found = noisy.find_range_sigma_m(np.array([10.0, 1000.0, 1e5]))
    np.testing.assert_allclose(found, np.sqrt(0.1**2 + 0.2**2 + np.array([0.1, 1.0, 10.0]) ** 2))


def test_in_the_earths_shadow_a_camera_sees_nothing():
    """The body is behind the Earth for half an hour in each revolution of 94 minutes, less the season."""
    camera = NavigationCamera(bearing_sigma_deg=0.01)
    flight = fly(
        Hop(relative_to="station", from_m=(0, -2000, 0), to_m=(0, -500, 0), duration_s=5600.0),
        navigation=FILTER.replace(sensors=(camera,)),
    )
    seen = [bool(one.sensors) for one in flight.list_estimates(5600.0)]
    assert 0.25 < 1.0 - np.mean(seen) < 0.45


def sensor(type_="lidar", **fields):
    """Return the table of one sensor."""
    return {"sensors": ({"type": type_, "bearing_sigma_deg": 1.0} | fields,)}


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"every_s": 0.5}, "every_s"),
        ({"every_s": -1.0}, "every_s"),
        ({"sensors": ()}, "sensors"),
        (sensor("radar"), "sensors.*radar"),
        ({"sensors": ({"bearing_sigma_deg": 1.0},)}, "sensors.*type"),
        (sensor("camera", bearing_sigma_deg=0.0), "bearing_sigma_deg"),
        (sensor("camera", range_sigma_m=1.0), "unknown key 'range_sigma_m'"),
        (sensor(range_sigma_m=0.0), "range_sigma_m"),
        (sensor(least_range_m=9, most_range_m=5), "never measure"),
        (sensor(fov_deg=200), "fov_deg"),
        ({"position_sigma_m": (1, 0, 1)}, "position_sigma_m: the first estimate needs an uncertainty"),
        ({"velocity_sigma_m_s": (1, -1, 1)}, "velocity_sigma_m_s: the first estimate needs an uncertainty"),
        ({"position_sigma_m": (1, 1)}, "position_sigma_m"),
        ({"acceleration_m_s2_sqrt_hz": -1.0}, "acceleration_m_s2_sqrt_hz"),
        ({"acceleration": 1.0}, "unknown key 'acceleration'"),
    ],
)  # fmt: skip
def test_what_is_no_filter_is_refused_in_one_line(fields, problem):
    with pytest.raises(ScenarioError, match=problem) as error:
        RelativeFilter(**FILTER.model_dump() | fields)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("navigation", "problem"),
    [
        ({"type": "kalman"}, "navigation.*kalman"),
        ({"every_s": 5.0}, "navigation.*unknown key 'every_s'"),
        ({"type": "errors", "every_s": 5.0}, "navigation.*unknown key 'every_s'"),
        ({"type": "filter"}, "navigation"),
        (3.0, "navigation"),
    ],
)
def test_what_is_no_navigation_is_refused_in_one_line(navigation, problem):
    with pytest.raises(ScenarioError, match=problem) as error:
        Flown(plan=HOP, navigation=navigation)
    assert "\n" not in str(error.value)


def test_stated_errors_need_no_type():
    assert Flown(plan=HOP, navigation={"position_sigma_m": 2.0}).navigation == NavigationErrors(position_sigma_m=2.0)


def test_tables_of_noise_are_checked():
    for fields, problem in (
        ({"range_m": (1.0, 2.0), "sigma_m": (1.0, 2.0, 3.0)}, "one for each range_m"),
        ({"range_m": (2.0, 1.0), "sigma_m": (1.0, 2.0)}, "do not ascend"),
        ({"range_m": (2.0,), "sigma_m": (1.0,)}, "range_m"),
    ):
        with pytest.raises(ScenarioError, match=problem):
            RangeNoise(**fields)


def test_too_many_measurements_are_refused():
    with pytest.raises(ScenarioError, match="leave more time between them"):
        FILTER.replace(every_s=1.0).list_instants_s(0.0, 1e6)


def test_a_filter_without_guidance_is_said():
    motion = Flown(plan=HOP, navigation=FILTER, forces=Forces())
    lines = motion.validity(Epochs(START, np.linspace(0.0, 100.0, 3)), CHIEF)
    assert any("without guidance the navigation filter has no effect" in line for line in lines)
