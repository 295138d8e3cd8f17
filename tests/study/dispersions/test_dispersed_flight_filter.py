"""Dispersed runs with a navigation filter: consistency, linear covariance beside them, outages, and bits."""

import datetime
import math

import numpy as np
import pytest
from scipy.stats import chi2

from rso_lidar.orbit import Epochs, Forces, Kepler
from rso_lidar.rpo import (
    CentroidWander,
    NavigationCamera,
    NavigationLidar,
    PlannedImpulse,
    RelativeFilter,
    SensorBias,
    Thrusters,
    rtn_matrix,
)
from rso_lidar.study.dispersions.dispersed_flight import DispersedFlight
from rso_lidar.study.dispersions.dispersed_paths import Disperser
from rso_lidar.study.dispersions.nominal_flight import GuidanceInstant, NominalFlight

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CHIEF = Kepler(
    epoch_utc=START, semi_major_axis_km=6878.137, eccentricity=0.0, inclination_deg=51.6, raan_deg=40.0,
    argument_of_perigee_deg=0.0, true_anomaly_deg=30.0,
)  # fmt: skip
CRAFT = CHIEF.replace(true_anomaly_deg=30.0 - math.degrees(2000.0 / 6878137.0))  # 2 km behind
LIDAR = NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.2)
FILTER = RelativeFilter(
    every_s=60, sensors=(LIDAR,), position_sigma_m=(10, 20, 10), velocity_sigma_m_s=(0.02, 0.02, 0.02),
    acceleration_m_s2_sqrt_hz=0.0,
)  # fmt: skip
SLOW = FILTER.replace(
    sensors=(
        LIDAR.replace(
            bias=SensorBias(range_sigma_m=1.0, bearing_sigma_deg=0.03),
            centroid=CentroidWander(along_sigma_m=1.5, across_sigma_m=1.0, correlation_time_s=600.0),
        ),
    )
)
THRUSTERS = Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0, magnitude_sigma_m_s=0.002)
SIGMAS = np.diag([20.0, 40.0, 20.0, 0.02, 0.02, 0.02]) ** 2
SAMPLE_S = np.linspace(0.0, 4800.0, 17)


def place(body):
    return lambda time_s: body.states(Epochs(START, time_s)).position_m


def axes_of(time_s):
    state = CHIEF.states(Epochs(START, time_s))
    return rtn_matrix(state.position_m, state.velocity_m_s)


def fly(navigation, n_runs=300, target=None, **changed):
    """Return the disperser of a flight with burns, corrections and a held leg, and its runs."""
    flight = NominalFlight(
        START, place(CRAFT), axes_of,
        burns=(PlannedImpulse(1000.0, np.array([0.05, 0.2, 0.1])),),
        updates=(GuidanceInstant(600.0, 1800.0), GuidanceInstant(1800.0, 3000.0)),
        held_s=((3200.0, 4400.0),),
        control_m_s2=lambda time_s: np.outer((time_s >= 3200.0) & (time_s < 4400.0), [2e-3, -1e-3, 3e-3]),
        navigation=navigation, chief_m=place(CHIEF),
        **{"forces": Forces(zonal_degree=0), "thrusters": THRUSTERS} | changed,
    )  # fmt: skip
    disperser = Disperser(DispersedFlight(flight, SAMPLE_S, SIGMAS, target))
    numbers = np.random.default_rng(4).standard_normal((n_runs, disperser.n_numbers))
    return disperser, numbers, disperser.fly(numbers)


@pytest.fixture(
    scope="module",
    params=[(FILTER, None), (FILTER, 0.25 * SIGMAS), (SLOW, None)],
    ids=["", "target with errors", "sensors with slow errors"],
)
def flown(request):
    navigation, target = request.param
    return fly(navigation, target=target)


def test_errors_are_as_large_as_the_filters_say(flown):
    """At each of 17 instants the sum of 300 NEES is chi-square: within 99.9 %, shared by the instants.

    A filter propagates the relative state as if the target were on its own path. Where it is not, gravity differs by a part
    in 3000 of the target's deviation, which the filter does not know: up to 1.5 times the bound.
    """
    nees = flown[2].knowledge.nees
    low, high = chi2.ppf([0.0005 / 17, 1.0 - 0.0005 / 17], 6 * 300)
    assert low < nees.sum(axis=0).min()
    assert nees.sum(axis=0).max() < high * (1.5 if "target" in flown[0].sources else 1.0)


def test_linear_covariance_and_runs_agree(flown):
    """300 runs: the standard deviation has a relative standard error of 4.1 %; 5 of them."""
    disperser, _, paths = flown
    linear = disperser.find_linear()
    within = 5.0 / math.sqrt(2.0 * 300)
    spread = paths.deviation_m.std(axis=0) / np.sqrt(np.diagonal(linear.covariance, axis1=1, axis2=2)[:, :3])
    assert np.abs(spread - 1.0).max() < within
    known = paths.knowledge.error_m.std(axis=0) / np.sqrt(np.diagonal(linear.knowledge, axis1=1, axis2=2)[:, :3])
    assert np.abs(known - 1.0).max() < within
    stated = np.sqrt(np.mean(paths.knowledge.sigma_m**2, axis=0))
    np.testing.assert_allclose(stated, np.sqrt(np.diagonal(linear.knowledge, axis1=1, axis2=2)[:, :3]), rtol=0.1)
    total = sum(linear.shares.values())
    np.testing.assert_allclose(total, np.diagonal(linear.covariance[:, :3, :3], axis1=1, axis2=2), rtol=1e-9)


@pytest.mark.parametrize("treatment", ["considered", "ignored"])
def test_a_filter_that_ignores_slow_errors_is_overconfident_and_one_that_considers_them_is_not(treatment):
    """200 runs; the linear covariance has the errors that the filter makes, whatever it knows of them."""
    disperser, _, paths = fly(SLOW.replace(slow_errors=treatment), 200)
    assert disperser.sources == ("start", "burns", "navigation", "bias", "centroid")
    low, high = chi2.ppf([0.0005 / 17, 1.0 - 0.0005 / 17], 6 * 200)
    nees = paths.knowledge.nees.sum(axis=0)
    if treatment == "considered":
        assert low < nees.min() < nees.max() < high
    else:
        assert nees[1:].min() > 10.0 * high
    linear = disperser.find_linear()
    known = paths.knowledge.error_m.std(axis=0) / np.sqrt(np.diagonal(linear.knowledge, axis1=1, axis2=2)[:, :3])
    assert np.abs(known - 1.0).max() < 5.0 / math.sqrt(2.0 * 200)
    assert all(linear.shares[name][1:].max() > 0.0 for name in ("bias", "centroid"))


def test_one_sigma_of_a_constant_bias_moves_a_run_as_the_linear_covariance_says():
    """Of two runs that differ in the bias alone. A filter that ignores it has the gains of one without it."""
    sensor = LIDAR.replace(bias=SensorBias(range_sigma_m=1.0))
    disperser, numbers, _ = fly(FILTER.replace(sensors=(sensor,), slow_errors="ignored"), 2, thrusters=Thrusters())
    pair = np.zeros((2, numbers.shape[1]))
    # Before it come the start, four of each held leg, the first estimate, and two angles and a range.
    pair[1, 6 + 4 * len(disperser.nodes.legs) + 6 + 3] = 1.0
    still, moved = disperser.fly(pair).deviation_m
    np.testing.assert_allclose((moved - still) ** 2, disperser.find_linear().shares["bias"], rtol=0.02, atol=1e-6)


def test_without_burns_the_filter_changes_nothing(flown):
    disperser, numbers, _ = flown
    drifting = disperser.fly(numbers[:20], without_burns=True)
    assert drifting.knowledge is None
    target = 0.25 * SIGMAS if "target" in disperser.sources else None
    navigation = disperser.flight.navigation
    (sensor,) = navigation.sensors
    blind, _, _ = fly(navigation.replace(sensors=(sensor.replace(most_range_m=1.0),)), 2, target)
    again = blind.fly(numbers[:20], without_burns=True)
    assert drifting.deviation_m.tobytes() == again.deviation_m.tobytes()


def test_in_an_outage_the_covariance_grows_as_the_linear_one_without_measurements():
    """A camera that the Sun's exclusion blinds always: the error is the first one, propagated."""
    camera = NavigationCamera(bearing_sigma_deg=0.01, sun_exclusion_deg=180.0)
    disperser, _, paths = fly(FILTER.replace(sensors=(camera,)), 2)
    at = disperser.nodes
    rows = at.to_inertial(0, np.diag(FILTER.start_sigma))
    for node in range(int(at.sample[2])):  # up to the first burn
        rows = at.transition[node] @ rows
    wanted = np.sqrt(np.sum(at.to_rotating(int(at.sample[2]), rows)[:3] ** 2, axis=1))
    np.testing.assert_allclose(paths.knowledge.sigma_m[0, 2], wanted, rtol=1e-9)
    assert (paths.knowledge.sigma_m[0, -1] > 5.0 * paths.knowledge.sigma_m[0, 0]).all()


def test_process_noise_makes_the_filter_cautious():
    """Flights do not draw it, so that errors are below what the filter says."""
    _, _, paths = fly(FILTER.replace(acceleration_m_s2_sqrt_hz=1e-3), 100)
    assert paths.knowledge.nees[:, 3:].mean() < 4.0


def test_a_run_has_the_same_bits_alone_and_among_others(flown):
    disperser, numbers, together = flown
    alone = disperser.fly(numbers[17:18])
    assert together.deviation_m[17].tobytes() == alone.deviation_m[0].tobytes()
    assert together.knowledge.sigma_m[17].tobytes() == alone.knowledge.sigma_m[0].tobytes()


def test_thrust_without_errors_is_no_state_of_the_filter():
    disperser, _, paths = fly(FILTER, 50, thrusters=Thrusters())
    assert not disperser.nodes.filter_is_held
    low, high = chi2.ppf([0.0005 / 17, 1.0 - 0.0005 / 17], 6 * 50)
    assert low < paths.knowledge.nees.sum(axis=0).min() < paths.knowledge.nees.sum(axis=0).max() < high
