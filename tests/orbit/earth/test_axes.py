import datetime

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, convert_states, gcrs_from_axes, rotate_to_inertial
from rso_lidar.orbit.earth.axes import EARTH_AXES, ORBIT_AXES
from rso_lidar.orbit.two_body.orbit_axes import orbit_axes_matrix
from rso_lidar.records import BodyState
from tests.orbit.earth.earth_for_tests import GEO, LOW, START

EPOCHS = Epochs(START, np.linspace(0.0, 86400.0, 25))


def test_axes_of_date_are_skyfields():
    from skyfield import framelib

    for axes, frame in (
        ("mod", framelib.mean_equator_and_equinox_of_date),
        ("tod", framelib.true_equator_and_equinox_of_date),
        ("itrs", framelib.itrs),
    ):
        other = frame.rotation_at(EPOCHS.skyfield_time()).transpose(2, 1, 0)
        np.testing.assert_allclose(gcrs_from_axes(axes, EPOCHS), other, rtol=0, atol=3e-13)


def test_published_axes_of_date():
    # Vallado 4th ed., example 3-15 (IAU-76/FK5): 2004-04-06 07:51:28.386009 UTC. IAU 2006/2000A differs from the theories of
    # 1976 and 1980 by 60 mas in 2004, 3 m here.
    epochs = Epochs(datetime.datetime(2004, 4, 6, 7, 51, 28, 386009, tzinfo=datetime.UTC), np.zeros(1))
    gcrf_m = 1e3 * np.array([5102.5089580, 6123.0114007, 6378.1369282])
    for axes, of_date in (
        ("mod", [5094.0283745, 6127.8708164, 6380.2485164]),
        ("tod", [5094.5162080, 6127.3652784, 6380.3445327]),
        ("teme", [5094.1801621, 6127.6446596, 6380.3445327]),
    ):
        np.testing.assert_allclose(
            gcrs_from_axes(axes, epochs)[0] @ (1e3 * np.array(of_date)), gcrf_m, rtol=0, atol=5.0
        )


def test_velocity_in_earth_fixed_axes_is_the_derivative_of_position():
    step_s = 1.0
    for motion in (LOW, GEO):
        around = [Epochs(START, EPOCHS.time_s + k * step_s) for k in (-2, -1, 1, 2)]
        places = [convert_states(motion.states(at), at, to_axes="itrs").position_m for at in around]
        slope = (places[0] - 8.0 * places[1] + 8.0 * places[2] - places[3]) / (12.0 * step_s)
        fixed = convert_states(motion.states(EPOCHS), EPOCHS, to_axes="itrs")
        np.testing.assert_allclose(fixed.velocity_m_s, slope, rtol=0, atol=3e-6)  # 1 um of rounding in GEO
    assert np.abs(fixed.velocity_m_s).max() < 10.0  # a geostationary satellite hardly moves over the ground


def test_there_and_back():
    states = LOW.states(EPOCHS)
    for axes in EARTH_AXES:
        there = convert_states(states, EPOCHS, to_axes=axes)
        again = convert_states(there, EPOCHS, from_axes=axes)
        np.testing.assert_allclose(again.position_m, states.position_m, rtol=0, atol=1e-7)
        np.testing.assert_allclose(again.velocity_m_s, states.velocity_m_s, rtol=0, atol=1e-9)
    through = convert_states(convert_states(states, EPOCHS, to_axes="teme"), EPOCHS, from_axes="teme", to_axes="itrs")
    np.testing.assert_allclose(
        through.velocity_m_s, convert_states(states, EPOCHS, to_axes="itrs").velocity_m_s, rtol=0, atol=1e-9
    )


def test_axes_of_an_orbit_are_those_of_maneuvers():
    states = LOW.states(EPOCHS)
    for axes in ("rtn", "vnc"):
        matrix = gcrs_from_axes(axes, EPOCHS, states)
        for k in (0, 7, 24):
            turned = rotate_to_inertial(
                (0.3, -0.5, 0.7), axes, states.position_m[k].tolist(), states.velocity_m_s[k].tolist()
            )
            np.testing.assert_allclose(matrix[k] @ [0.3, -0.5, 0.7], turned, rtol=0, atol=1e-14)


def test_axes_of_an_orbit_by_their_definitions():
    r, v = np.array([7000e3, 0.0, 0.0]), np.array([1000.0, 0.0, 7500.0])  # over the equator, northward and outward
    for axes in ORBIT_AXES:
        np.testing.assert_allclose(np.linalg.det(orbit_axes_matrix(axes, r, v)), 1.0, atol=1e-14)
    forward = v / np.linalg.norm(v)
    np.testing.assert_allclose(orbit_axes_matrix("ntw", r, v)[:, 1], forward)
    np.testing.assert_allclose(orbit_axes_matrix("vnc", r, v)[:, 0], forward)
    np.testing.assert_allclose(orbit_axes_matrix("lvlh_ccsds", r, v).T, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)


def test_bad_names_are_told():
    states = LOW.states(EPOCHS)
    for call, message in (
        (lambda: gcrs_from_axes("itsr", EPOCHS), r"axes: 'itsr' are unknown; did you mean 'itrs'\?"),
        (lambda: gcrs_from_axes("lvlh", EPOCHS, states), "means two things"),
        (lambda: gcrs_from_axes("rtn", EPOCHS), "give its states"),
        (lambda: convert_states(states, EPOCHS, to_axes="rtn"), "axes: 'rtn' are unknown"),
        (lambda: convert_states(BodyState(np.zeros((1, 3)), np.zeros((1, 3))), EPOCHS, from_axes=""), "axes: '' are"),
    ):
        with pytest.raises(ScenarioError, match=message):
            call()
