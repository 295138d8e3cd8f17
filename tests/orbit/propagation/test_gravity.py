"""Gravity from files of coefficients: what is read, what is refused, and how it joins the other forces."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Forces, Gravity, gcrs_from_axes, integrate_orbit, itrs_from_gcrs
from rso_lidar.part import dump_part
from rso_lidar.shipped import shipped

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
R, V = (5.0e6, -3.2e6, 3.9e6), (3.1e3, 6.5e3, 1.4e3)
FIELD = shipped("gravity/egm2008_20x20.gfc")


def acceleration(forces, time_s=5000.0, r=R):
    return forces.acceleration(Epochs(START, np.array([time_s])), np.array([r]), np.array([V]))[0]


def test_acceleration_against_brahe():
    # brahe 1.8.0, accel_gravity_spherical_harmonics(R, identity, EGM2008, 20, 20): axes fixed in the Earth
    brahe = np.array([-5.558188671168728, 3.5573509783354478, -4.346682877036711])
    harmonics = Gravity().load_harmonics()
    got = np.array(harmonics.perturb(*R)) - harmonics.gm / math.hypot(*R) ** 3 * np.array(R)
    np.testing.assert_allclose(got, brahe, rtol=1e-14)


def test_the_field_turns_with_the_earth():
    harmonics = Gravity().load_harmonics()
    for time_s in (0.0, 21_000.0):
        (turn,) = itrs_from_gcrs(Epochs(START, np.array([time_s])))
        wanted = turn.T @ np.array(harmonics.perturb(*(turn @ R))) - harmonics.gm / math.hypot(*R) ** 3 * np.array(R)
        np.testing.assert_allclose(acceleration(Forces(gravity=Gravity()), time_s), wanted, rtol=0, atol=1e-12)


def test_zonal_harmonics_alone_are_those_of_the_short_form():
    zonal, field = acceleration(Forces(zonal_degree=6)), acceleration(Forces(gravity=Gravity(degree=6, order=0)))
    # GM differs by 7.5e-10, J2 of EGM96 and EGM2008 by 4.7e-7, the poles by 0.2 arcsecond, 1e-6 of J2
    bare = acceleration(Forces(zonal_degree=0))
    assert np.linalg.norm(zonal - field) < 7.6e-10 * np.linalg.norm(bare) + 3e-6 * np.linalg.norm(zonal - bare)


def test_j22_pushes_a_geostationary_body_as_published():
    """Up to 1.715 m/s in a year about stable longitudes of 75 E and 255 E (Wertz & Larson, SMAD 3rd ed., sec. 6.2.3).

    A push to the east raises the orbit, which then drifts west: about a stable longitude the push is away from it.
    """
    (axes,) = gcrs_from_axes("itrs", Epochs(START, np.array([0.0])))
    pushes = {}
    for longitude in range(0, 360, 5):
        angle = longitude * units.DEG
        r, east = axes @ [math.cos(angle), math.sin(angle), 0.0], axes @ [-math.sin(angle), math.cos(angle), 0.0]
        zonal, full = (
            acceleration(Forces(gravity=Gravity(degree=2, order=order)), 0.0, 42_164.2e3 * r) for order in (0, 2)
        )
        pushes[longitude] = float((full - zonal) @ east)
    assert max(pushes.values()) * 365.25 * units.DAY_S == pytest.approx(1.715, rel=0.04)  # J22 of 1.77e-6 to 1.82e-6
    assert pushes[70] < 0.0 < pushes[80] and pushes[250] < 0.0 < pushes[260]


def test_attraction_of_many_points_is_that_of_each():
    points = np.array([R, (-4.2e6, 3.3e6, 4.6e6), (42e6, 1e6, 2e6)])
    times = np.array([0.0, 3000.0, -9000.0])
    for forces in (Forces(), Forces(zonal_degree=0), Forces(gravity=Gravity())):
        attract = forces.attraction(START)
        wanted = [acceleration(forces, *pair) for pair in zip(times, points, strict=True)]
        # the pole moves by 1e-9 of J2 in an hour
        np.testing.assert_allclose(attract(times, points.T).T, wanted, rtol=0, atol=1e-10)
        np.testing.assert_allclose(attract(3000.0, points[1:2].T).T, wanted[1:2], rtol=0, atol=1e-10)


def test_a_dump_is_read_back_as_the_same_forces():
    for forces in (Forces(gravity=Gravity(degree=8, order=3)), Forces(zonal_degree=4), Forces()):
        assert Forces(**dump_part(forces)) == forces


def test_gravity_takes_the_place_of_the_short_form():
    with pytest.raises(ScenarioError, match=r"gravity: takes the place of zonal_degree; leave zonal_degree out"):
        Forces(zonal_degree=2, gravity=Gravity())


def test_words_of_a_field(tmp_path):
    file = tmp_path / "GGM05S.gfc"
    words = [Gravity().describe(), Gravity(degree=12, order=0, file=str(file)).describe()]
    assert words == ["EGM2008 20 x 20", "GGM05S 12 x 0"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"degree": 21}, "degree: the shipped EGM2008 has 20, not 21; give a file"),
        ({"degree": 1}, "degree"),
        ({"degree": 4, "order": 5}, "order: 5 is above the degree 4; give at most 4"),
        ({"order": -1}, "order"),
        ({"degree": 2.5}, "degree"),
    ],
)
def test_a_degree_or_order_that_does_not_exist_is_refused(fields, message):
    with pytest.raises(ScenarioError, match=message):
        Gravity(**fields)


def test_a_users_file_is_read_to_its_own_degree(tmp_path):
    file = tmp_path / "own.gfc"
    text = FIELD.read_text()
    file.write_text(text.replace("e-04", "d-04") + "gfc 21 0 1e-8 0.0\n")
    ours, theirs = Gravity(), Gravity(file=str(file))
    assert ours.load_harmonics().perturb(*R) == theirs.load_harmonics().perturb(*R)
    with pytest.raises(ScenarioError, match="has no coefficient of degree 21 and order 1; lower the degree"):
        Gravity(degree=21, file=str(file)).load_harmonics()


def test_an_orbit_is_integrated_anew_when_its_field_is_edited(tmp_path):
    """The orbit moves by the changed share of J2 in the fall: about 1.5 J2 g t^2 / 2 of it."""
    file = tmp_path / "own.gfc"
    file.write_text(FIELD.read_text())
    forces = Forces(gravity=Gravity(degree=2, file=str(file)))

    def fly():
        return integrate_orbit(R, V, START, forces)(np.array([600.0]))[0, :3]

    first = fly()
    text = file.read_text()
    assert text.count("-4.841651437908150e-04") == 1
    file.write_text(text.replace("-4.841651437908150e-04", "-4.84e-04"))  # by 3.4e-4 of J2
    moved_m = np.linalg.norm(fly() - first)
    most_m = 3.4e-4 * 1.5 * 1.0826e-3 * 9.0 * 600.0**2 / 2
    assert 0.05 * most_m < moved_m < 2.0 * most_m


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("end_of_head", "head_ends", "has no line end_of_head"),
        ("fully_normalized", "unnormalized", "norm is 'unnormalized'"),
        ("0.3986004415E+15", "0.4902800066E+13", "are not the Earth's"),
        ("0.63781363E+07", "large", "radius: 'large' is not a number"),
        ("radius  ", "Radius  ", "radius: '' is not a number"),
        ("gfc     3    1", "gfct    3    1", r"change with time \('gfct'\)"),
        ("gfc     3    1", "gfc     1    3", "is no coefficient"),
        ("gfc     3    1", "#gfc    3    1", "has no coefficient of degree 3 and order 1"),
        ("2.030462010478640e-06", "nan", "'nan' is not a number"),
        ("2.030462010478640e-06", "2.030462010478640", "is no coefficient"),
        ("gfc     3    1", "gfc 3 0 1e-6 0\ngfc     3    1", "'gfc 3 0 1e-6 0' is given twice"),
        ("-4.841651437908150e-04", "-1.0826e-03", r"degree 2 and order 0: -0\.0010826 is not the Earth's"),
    ],
)
def test_a_file_that_is_no_such_field_is_refused(tmp_path, old, new, message):
    file, text = tmp_path / "bad.gfc", FIELD.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ScenarioError, match=message) as raised:
        Gravity(file=str(file)).load_harmonics()
    assert str(raised.value).startswith(f"gravity: {file}: ")


def test_a_missing_file_is_named():
    with pytest.raises(ScenarioError, match=r"gravity: none\.gfc: no such file; give the path"):
        Forces(gravity=Gravity(file="none.gfc")).field(START)
