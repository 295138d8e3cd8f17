"""Mean elements of J2: the map both ways, secular rates, and an integration to compare with."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import (
    J2,
    Epochs,
    Forces,
    Kepler,
    Numerical,
    State,
    mean_from_osculating,
    osculating_from_mean,
    propagate_j2_secular,
    quasi_nonsingular_from_state,
    state_from_quasi_nonsingular,
)
from rso_lidar.orbit.propagation.j2 import secular_rates

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CRITICAL = math.acos(math.sqrt(0.2))
# semi-major axis, eccentricity, inclination, and by how much a day of J2 alone may differ [m]: J2^2 a is 8 m at 7000 km
ORBITS = [
    (7000e3, 0.001, 0.9, 60.0),
    (7000e3, 0.0, 1.7, 60.0),
    (7000e3, 0.01, 0.0, 60.0),
    (7078e3, 0.01, CRITICAL, 60.0),
    (7000e3, 0.001, math.pi, 60.0),
    (8000e3, 0.1, 1.0, 60.0),
    (26600e3, 0.7, 1.1, 60.0),
    (42164e3, 1e-4, 1e-3, 1.0),
]


def rows(a, e, i, perigee=0.7, latitude=1.0, raan=2.0):
    return np.array([a, latitude, e * math.cos(perigee), e * math.sin(perigee), i, raan])


@pytest.mark.parametrize(("a", "e", "i", "allowed"), ORBITS)
def test_the_map_has_an_inverse(a, e, i, allowed):
    start = propagate_j2_secular(rows(a, e, i), np.linspace(0.0, 30_000.0, 50))
    position, velocity = osculating_from_mean(start)
    back = mean_from_osculating(position, velocity)
    bare, speed = state_from_quasi_nonsingular(start)
    again, speed_again = state_from_quasi_nonsingular(
        back
    )  # compared as states: on the equator the node is a convention
    np.testing.assert_allclose(again, bare, rtol=0, atol=1e-6)
    np.testing.assert_allclose(speed_again, speed, rtol=0, atol=1e-9)
    moved = np.linalg.norm(position - bare, axis=1).max()
    assert 0.2 * units.EARTH_J2 * (units.EARTH_RADIUS_M / a) ** 2 * a < moved < 30 * units.EARTH_J2 * a


@pytest.mark.parametrize(("a", "e", "i", "allowed"), ORBITS)
def test_against_an_integration_of_j2(a, e, i, allowed):
    degrees = [x / units.DEG for x in (i, 2.0, 0.7, 0.3)]
    keys = dict(
        zip(("inclination_deg", "raan_deg", "argument_of_perigee_deg", "mean_anomaly_deg"), degrees, strict=True)
    )
    keys |= {"epoch_utc": START, "semi_major_axis_km": a / 1e3, "eccentricity": e}
    epochs = Epochs(START, np.linspace(0.0, 86_400.0, 145))
    mean = J2(**keys, elements="osculating").states(epochs)
    full = Numerical(initial=Kepler(**keys), forces=Forces(zonal_degree=2)).states(epochs)
    off = np.linalg.norm(mean.position_m - full.position_m, axis=1)
    assert off[0] < 1e-5 and off.max() < allowed
    two_body = Kepler(**keys).states(epochs)
    assert np.linalg.norm(two_body.position_m - full.position_m, axis=1).max() > 200 * off.max()


def test_mean_elements_of_an_integrated_orbit_drift_as_they_should():
    start = State(epoch_utc=START, position_m=(6.9e6, 1e5, 2e5), velocity_m_s=(-2e2, 5.0e3, 5.8e3))
    epochs = Epochs(START, np.linspace(0.0, 86_400.0, 289))
    from rso_lidar.orbit import equator_axes
    from rso_lidar.pose import rotate_vectors

    state = Numerical(initial=start).states(epochs)
    turn = equator_axes(Epochs(START, np.zeros(1)))[0]
    mean = mean_from_osculating(rotate_vectors(turn, state.position_m), rotate_vectors(turn, state.velocity_m_s))
    assert np.ptp(mean[:, 0]) < 0.1  # the osculating axis swings by 10 km or so
    assert np.ptp(quasi_nonsingular_from_state(state.position_m, state.velocity_m_s)[:, 0]) > 5e3
    anomaly, perigee, node = secular_rates(mean[0])
    slope = np.polyfit(epochs.time_s, np.unwrap(mean[:, 5]), 1)[0]
    assert slope == pytest.approx(node, rel=2e-5)  # third order of J2, and what is left of the long period
    slope = np.polyfit(epochs.time_s, np.unwrap(mean[:, 1]), 1)[0]
    assert slope == pytest.approx(anomaly + perigee, rel=1e-7)


def test_secular_rates_of_the_textbook():
    # Vallado 4th ed. eq. 9-41 with a sun-synchronous orbit: 800 km and 98.6 deg turn 360 degrees in a tropical year
    a = units.EARTH_RADIUS_M + 800e3
    _, perigee, node = secular_rates(rows(a, 0.0, 98.603 * units.DEG))
    assert node / units.DEG * units.DAY_S == pytest.approx(360 / 365.2422, rel=2e-3)
    first = -1.5 * units.EARTH_J2 * (units.EARTH_ZONAL_RADIUS_M / a) ** 2 * math.sqrt(GM / a**3)
    assert node == pytest.approx(first * math.cos(98.603 * units.DEG), rel=5e-3)
    at_critical = secular_rates(rows(a, 0.0, CRITICAL))[1]
    assert abs(at_critical) < 5 * units.EARTH_J2 * abs(perigee)


def test_second_order_rates_are_those_of_sgp4():
    """Brouwer's in J2 squared; SGP4 (Spacetrack Report 3) has them for a circle: 13 - 78 t^2 + 137 t^4 and so on."""
    from rso_lidar.orbit.propagation.j2 import _K2, _rates

    a, i = 7000e3, 0.8
    t2 = math.cos(i) ** 2
    n, k = math.sqrt(GM / a**3), _K2 / a**2
    _, (anomaly, perigee, node) = _rates(rows(a, 0.0, i))
    assert anomaly == pytest.approx(3 * k**2 * (13 - 78 * t2 + 137 * t2**2) / 16 * n, rel=1e-12)
    assert perigee == pytest.approx(3 * k**2 * (7 - 114 * t2 + 395 * t2**2) / 16 * n, rel=1e-12)
    assert node == pytest.approx(k**2 * (4 - 19 * t2) * 1.5 * math.cos(i) * n, rel=1e-12)


def test_states_have_the_same_bits_in_any_company():
    orbit = J2(
        epoch_utc=START,
        semi_major_axis_km=7000.0,
        eccentricity=0.01,
        inclination_deg=51.6,
        raan_deg=20.0,
        argument_of_perigee_deg=30.0,
        mean_anomaly_deg=40.0,
    )
    epochs = Epochs(START, np.linspace(-5e4, 5e4, 203))
    together = orbit.states(epochs)
    for k in (0, 1, 77, 202):
        np.testing.assert_array_equal(orbit.states(epochs.at(k)).position_m[0], together.position_m[k])
    assert orbit.validity(epochs) == []
    (sentence,) = orbit.validity(epochs.shift(5 * units.DAY_S))
    assert "numerical" in sentence and "\n" not in sentence
    assert "drag" in orbit.replace(semi_major_axis_km=6700.0).validity(epochs)[0]


def test_open_orbits_are_refused():
    with pytest.raises(ScenarioError, match="type 'numerical'"):
        J2(
            epoch_utc=START,
            semi_major_axis_km=-20000.0,
            eccentricity=1.5,
            inclination_deg=0.0,
            raan_deg=0.0,
            argument_of_perigee_deg=0.0,
            true_anomaly_deg=0.0,
        )
    with pytest.raises(PropagationError, match="this state has none"):
        mean_from_osculating(np.array([7e6, 0.0, 0.0]), np.array([0.0, 12e3, 0.0]))
