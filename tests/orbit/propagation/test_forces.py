"""Forces one at a time, against brahe, closed forms and the table."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import quad

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Drag, Epochs, Forces, RadiationPressure, sun_position_m
from rso_lidar.orbit.propagation.atmosphere import ExponentialAtmosphere, air_density_kg_m3
from rso_lidar.orbit.propagation.forces import (
    _drag_acceleration,
    _sunlight_acceleration,
    _third_body_acceleration,
    _zonal_acceleration,
)
from rso_lidar.orbit.sky.almanac import Almanac
from rso_lidar.orbit.sky.precession import equator_axes, pole_direction

GM = units.EARTH_GM_M3_S2
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
R, V = (5.0e6, -3.2e6, 3.9e6), (3.1e3, 6.5e3, 1.4e3)
RADIUS = math.hypot(*R)
NORTH = (0.0, 0.0, 1.0)


def test_zonals_against_brahe():
    # brahe 1.8.0, accel_gravity_spherical_harmonics(R, identity, JGM3, 6, 0), with JGM3's own GM and coefficients
    brahe = np.array([-5.558083046705689, 3.557173149891641, -4.346664757943989])
    normalised = [-0.000484169548456, 9.57170590888e-07, 5.39777068357e-07, 6.86589879865e-08, -1.49671561786e-07]
    zonals = tuple(-c * math.sqrt(2 * n + 1) for n, c in enumerate(normalised, start=2))
    ours = np.array(_zonal_acceleration(zonals, R, RADIUS, NORTH)) - GM / RADIUS**3 * np.array(R)
    np.testing.assert_allclose(ours * (398600.4415e9 / GM), brahe, rtol=1e-14)


@pytest.mark.parametrize("degree", [2, 3, 4, 5, 6])
def test_each_zonal_is_the_gradient_of_its_potential(degree):
    from scipy.special import eval_legendre

    zonals = (0.0,) * (degree - 2) + (1e-3,)

    def potential(r):
        radius = np.linalg.norm(r)
        return (
            -GM / radius * 1e-3 * (units.EARTH_ZONAL_RADIUS_M / radius) ** degree * eval_legendre(degree, r[2] / radius)
        )

    step = 10.0
    slope = [(potential(np.add(R, e)) - potential(np.subtract(R, e))) / (2 * step) for e in np.eye(3) * step]
    got = _zonal_acceleration(zonals, R, RADIUS, NORTH)
    # differences: (step / r)^2 of the value, and EPS V / step
    np.testing.assert_allclose(got, slope, rtol=1e-8, atol=1e-8)


def test_drag_and_light_against_brahe():
    # brahe 1.8.0: accel_drag at 1e-12 kg/m3, axes as given; its rotation rate is 7.292115146706979e-5, ours to 2e-8 of that
    brahe = np.array([-8.722398547011429e-07, -1.8668240142634664e-06, -4.2597973603628864e-07])
    push = np.array(_drag_acceleration(Drag(area_m2=4.0, mass_kg=100.0), 1e-12, R, V, NORTH))
    np.testing.assert_allclose(push, brahe, rtol=1e-8)
    # brahe 1.8.0: accel_solar_radiation_pressure at -R with p0 = 1361 / c, in full light
    sun = (-1.4e11, 3e10, 1.3e10)
    brahe = np.array([2.4892693833228605e-07, -5.333770194482603e-08, -2.3122404467153933e-08])
    light = _sunlight_acceleration(RadiationPressure(area_m2=4.0, mass_kg=100.0), tuple(-x for x in R), RADIUS, sun)
    np.testing.assert_allclose(light, brahe, rtol=1e-13)


def test_light_is_off_in_the_shadow_and_never_elsewhere():
    pressure = RadiationPressure(area_m2=1.0, mass_kg=1.0)
    sun = (units.ASTRONOMICAL_UNIT_M, 0.0, 0.0)
    full = units.SOLAR_PRESSURE_N_M2 * 1.3
    behind, aside = (-7e6, 0.0, 0.0), (-7e6, 6.5e6, 0.0)
    assert math.hypot(*_sunlight_acceleration(pressure, behind, 7e6, sun)) == 0.0
    assert math.hypot(*_sunlight_acceleration(pressure, aside, math.hypot(*aside), sun)) == pytest.approx(
        full, rel=1e-4
    )
    half = (-7e6, 6.378e6, 0.0)
    assert 0.0 < math.hypot(*_sunlight_acceleration(pressure, half, math.hypot(*half), sun)) < 0.9 * full
    assert math.hypot(*_sunlight_acceleration(pressure, (7e6, 0.0, 0.0), 7e6, sun)) == pytest.approx(full, rel=2e-4)


def test_third_body_is_a_tide():
    # along the line to the body 2 GM r / d^3, across it minus half of that, to r / d of it
    d = 3.844e8
    along, across = (
        _third_body_acceleration(units.MOON_GM_M3_S2, r, (d, 0.0, 0.0)) for r in ((1e5, 0.0, 0.0), (0.0, 1e5, 0.0))
    )
    tide = units.MOON_GM_M3_S2 * 1e5 / d**3
    assert along[0] == pytest.approx(2 * tide, rel=1e-3) and across[1] == pytest.approx(-tide, rel=1e-3)


def test_the_air_of_the_table_joins():
    # each row of Vallado's table 8-4 ends near where the next begins, to the table's own 5 %: a mistyped digit shows
    for edge in (
        25,
        30,
        40,
        50,
        60,
        70,
        80,
        90,
        100,
        110,
        120,
        130,
        140,
        150,
        180,
        200,
        250,
        300,
        350,
        400,
        450,
        500,
        600,
        700,
    ):
        below, above = air_density_kg_m3(edge * 1e3 - 1e-3), air_density_kg_m3(edge * 1e3)
        assert below == pytest.approx(above, rel=0.05), edge
    # Vallado 4th ed. example 8-4: 747.2119 km gives 2.1219854e-14 kg/m3
    assert air_density_kg_m3(747_211.9) == pytest.approx(2.1219854e-14, rel=1e-4)
    assert air_density_kg_m3(0.0) == 1.225 and air_density_kg_m3(3e6) == 0.0


def test_the_altitude_of_the_table_is_above_the_ellipsoid():
    epochs = Epochs(START, np.array([5000.0]))
    (pole,) = pole_direction(epochs)
    (over,) = equator_axes(epochs)[:, 0]
    density = ExponentialAtmosphere().density_along(Almanac(START, sun=False, moon=False))
    for up, radius_m in ((pole, 6_356_752.314), (over, 6_378_137.0)):  # WGS84
        got = density(5000.0, tuple((radius_m + 400e3) * up))
        assert got == pytest.approx(3.725e-12, rel=1e-3)  # 50 m of a scale height of 58 km


def test_acceleration_is_the_sum():
    epochs = Epochs(START, np.array([0.0, 5000.0]))
    r, v = np.array([R, R]), np.array([V, V])
    drag, light = Drag(area_m2=4.0, mass_kg=100.0), RadiationPressure(area_m2=4.0, mass_kg=100.0)
    bare = Forces(zonal_degree=0).acceleration(epochs, r, v)
    np.testing.assert_allclose(bare, -GM / RADIUS**3 * r, rtol=1e-15)
    parts = [
        Forces(zonal_degree=6),
        Forces(zonal_degree=0, drag=drag),
        Forces(zonal_degree=0, radiation_pressure=light),
        Forces(zonal_degree=0, sun=True),
        Forces(zonal_degree=0, moon=True),
    ]
    total = Forces(zonal_degree=6, drag=drag, radiation_pressure=light, sun=True, moon=True).acceleration(epochs, r, v)
    np.testing.assert_allclose(
        total, bare + sum(p.acceleration(epochs, r, v) - bare for p in parts), rtol=0, atol=1e-14
    )
    pole, sun = pole_direction(epochs), sun_position_m(epochs)
    expected = [_zonal_acceleration((units.EARTH_J2,), R, RADIUS, tuple(k)) for k in pole.tolist()]
    np.testing.assert_allclose(Forces().acceleration(epochs, r, v) - bare, expected, rtol=0, atol=1e-14)
    expected = [_third_body_acceleration(units.SUN_GM_M3_S2, R, tuple(s)) for s in sun.tolist()]
    np.testing.assert_allclose(parts[3].acceleration(epochs, r, v) - bare, expected, rtol=0, atol=1e-14)


def test_zonals_average_over_the_sphere_to_nothing():
    """The flux of each harmonic through a sphere is none: its mass is in the central pull."""
    for n in range(2, 7):
        zonals = (0.0,) * (n - 2) + (1.0,)

        def outward(s, zonals=zonals):
            r = (7e6 * math.sqrt(1 - s * s), 0.0, 7e6 * s)
            pull = _zonal_acceleration(zonals, r, 7e6, NORTH)
            return (pull[0] * r[0] + pull[2] * r[2]) / 7e6

        assert abs(quad(outward, -1, 1)[0]) < 1e-10


def test_degree_one_is_refused():
    for degree in (1, 7, -1):
        with pytest.raises(ScenarioError, match="zonal_degree"):
            Forces(zonal_degree=degree)
