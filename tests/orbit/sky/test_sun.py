"""The analytic Sun against a published example, ERFA, and the seasons; the Earth's shadow against closed forms and rays."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Body, Fixed, truth
from rso_lidar.orbit import Epochs, State, sun_position_m, sunlit_fraction
from rso_lidar.orbit.sky.sun import _mean_of_date_m

WORST_DEG = 0.0105  # of this formula against ERFA's epv00 with aberration, 2000 to 2050

SUN_RADIUS_M = 6.957e8  # IAU 2015 resolution B3


def at(*parts):
    return Epochs(datetime.datetime(*parts, tzinfo=datetime.UTC), np.zeros(1))


def sun_direction(epochs):
    position = sun_position_m(epochs)
    return position / np.linalg.norm(position, axis=1, keepdims=True)


def separation_deg(a, b):
    return 2 * math.asin(np.linalg.norm(np.subtract(a, b)) / 2) / units.DEG


def test_vallado_example_5_1():
    # 2 April 2006, 00:00 UTC, mean of date. Vallado counts centuries from UT1, here 0.3 s from UTC (6e-8 au), and his
    # printed numbers come from a mean longitude of 36000.77 degrees a century, 0.001 less (1.1e-6 au by 2006)
    whole, fraction = at(2006, 4, 2).utc_julian()
    position = _mean_of_date_m((whole - 2451545.0 + fraction) / 36525.0)
    np.testing.assert_allclose(
        position[0] / units.ASTRONOMICAL_UNIT_M, [0.9771945, 0.1924424, 0.0834308], rtol=0, atol=1.3e-6
    )


@pytest.mark.parametrize(
    ("year", "month", "direction", "distance_au"),
    [  # ERFA 2.0.1 (IAU SOFA) epv00, first of the month 00:00 UTC: Sun from the Earth, with annual aberration, BCRS axes
        (2001, 1, (0.1843615, -0.9017549, -0.3909589), 0.983316),
        (2012, 4, (0.979946, 0.1828243, 0.0792532), 0.999276),
        (2024, 7, (-0.1619501, 0.9053916, 0.3924771), 1.016672),
        (2026, 10, (-0.9915294, -0.1191715, -0.0516491), 1.001326),
        (2040, 1, (0.1668177, -0.9046617, -0.3921212), 0.983313),
    ],
)
def test_against_erfa(year, month, direction, distance_au):
    epochs = at(year, month, 1)
    assert separation_deg(sun_direction(epochs)[0], direction) < WORST_DEG
    distance = np.linalg.norm(sun_position_m(epochs)[0]) / units.ASTRONOMICAL_UNIT_M
    assert distance == pytest.approx(distance_au, abs=1e-4)  # perturbations left out: 9e-5 at most


def of_date(epochs):
    """Return right ascension and declination [deg] in the true equator and equinox of date, by skyfield's matrix."""
    x, y, z = np.einsum("ijt,tj->ti", epochs.skyfield_time().M, sun_direction(epochs))[0]
    return math.atan2(y, x) / units.DEG, math.asin(z) / units.DEG


def test_march_equinox_2024():
    # US Naval Observatory, Earth's Seasons: 2024 March 20 03:06 UTC, where apparent longitude is 0.
    # The published minute is half a minute coarse: 0.0004 degree of longitude.
    ascension, declination = of_date(at(2024, 3, 20, 3, 6))
    assert abs(ascension) < WORST_DEG + 0.0004
    assert abs(declination) < (WORST_DEG + 0.0004) * math.sin(23.44 * units.DEG) + 0.0005  # and 1.2" of latitude


def test_june_solstice_2024():
    # US Naval Observatory: 2024 June 20 20:51 UTC, apparent longitude 90 degrees; true obliquity then 23.4385 degrees
    # (mean 23.43610 + nutation 8.7" by IAU 2000A, from skyfield)
    epochs = at(2024, 6, 20, 20, 51)
    ascension, declination = of_date(epochs)
    assert abs(ascension - 90.0) < (WORST_DEG + 0.0004) / math.cos(23.44 * units.DEG)
    time = epochs.skyfield_time()
    obliquity = (time._mean_obliquity_radians + time._nutation_angles_radians[1])[0] / units.DEG
    assert declination == pytest.approx(obliquity, abs=0.0015)  # the formula's obliquity is mean: nutation within 9.2"


def test_precession_is_not_forgotten():
    epochs = at(2026, 4, 2)
    mean = _mean_of_date_m(epochs.tt_centuries())[0]
    # general precession, 50.29" a year for 26.25 years
    assert separation_deg(mean / np.linalg.norm(mean), sun_direction(epochs)[0]) == pytest.approx(
        50.29 * 26.25 / 3600, abs=0.002
    )


def test_directions_are_unit_and_the_same_bits_in_any_company():
    epochs = Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), np.linspace(0.0, 3e7, 101))
    together = sun_direction(epochs)
    np.testing.assert_allclose(np.linalg.norm(together, axis=1), 1.0, rtol=0, atol=4e-16)
    for k in (0, 7, 100):
        np.testing.assert_array_equal(sun_direction(epochs.at(k))[0], together[k])


# ------------------------------------------------------------------------------------------------ the Earth's shadow

AU, EARTH = units.ASTRONOMICAL_UNIT_M, units.EARTH_RADIUS_M
SUN = np.array([AU, 0.0, 0.0])


def lit(position):
    position = np.atleast_2d(position)
    return sunlit_fraction(position, np.broadcast_to(SUN, position.shape))


def around(radius_m, angle):
    """Return positions at angles [rad] from the axis of the shadow."""
    return radius_m * np.stack([-np.cos(angle), np.sin(angle), 0 * np.asarray(angle)], axis=-1)


def apparent_radii(radius_m):
    """Return those of Sun and Earth [rad]; the Sun's is that at 1 au, of which 7000 km change 5e-5."""
    return math.asin(SUN_RADIUS_M / AU), math.asin(EARTH / radius_m)


def test_umbra_ends_where_the_cones_meet():
    # Similar triangles: the cone that touches Sun and Earth ends at R d / (R_sun - R) = 1.384e6 km behind the Earth
    length = EARTH * AU / (SUN_RADIUS_M - EARTH)
    assert length == pytest.approx(1.384e9, rel=5e-4)
    near = lit([[-length * 0.999, 0.0, 0.0], [-length * 1.001, 0.0, 0.0]])
    assert near[0] == 0.0
    # Beyond it a ring of Sun is left: 1 - (b / a)^2
    beyond = length * 1.001
    ring = 1.0 - (math.asin(EARTH / beyond) / math.asin(SUN_RADIUS_M / (AU + beyond))) ** 2
    assert near[1] == pytest.approx(ring, abs=1e-12)
    assert 0.0 < ring < 0.01


def test_eclipse_of_a_low_orbit_lasts_35_minutes():
    # 500 km and beta 0: the umbra holds from -(b - a) to b - a about the shadow's axis, the penumbra to b + a, but for
    # the Sun's parallax, R_orbit / au = 5e-5 rad (0.05 s of flight)
    radius = EARTH + 500e3
    rate = math.sqrt(units.EARTH_GM_M3_S2 / radius**3)
    time_s = np.arange(-2000.0, 2000.0, 0.05)
    share = lit(around(radius, rate * time_s))
    sun, earth = apparent_radii(radius)
    dark_s, touched_s = 0.05 * np.sum(share == 0.0), 0.05 * np.sum(share < 1.0)
    assert dark_s == pytest.approx(2 * (earth - sun) / rate, abs=0.2)
    assert touched_s == pytest.approx(2 * (earth + sun) / rate, abs=0.2)
    assert 35.0 < dark_s / 60 < 36.0
    assert (touched_s - dark_s) / 2 == pytest.approx(8.4, abs=0.1)  # crossing 2 a = 0.533 degree


@pytest.mark.parametrize("height_m", [300e3, 20_000e3, 35_786e3, 1.2e9, 1.5e9])
def test_penumbra_rises_from_dark_to_light(height_m):
    sun, earth = apparent_radii(EARTH + height_m)
    share = lit(around(EARTH + height_m, np.linspace(max(0.0, earth - 1.2 * sun), earth + 1.2 * sun, 500)))
    assert np.all(np.diff(share) >= -1e-9)  # rounding of the lens, a difference of areas some 1e3 times larger
    assert share[-1] == 1.0
    assert (share[0] == 0.0) == (height_m < 1.37e9)


def test_on_the_side_of_the_sun_it_is_light():
    assert (
        lit([[EARTH + 300e3, 0.0, 0.0], [0.0, EARTH + 300e3, 0.0], [4e8, 1e3, 0.0], [-2e10, 1.5e9, 0.0]]).tolist()
        == [1] * 4
    )
    assert lit([[0.0, 0.0, 0.0], [EARTH / 2, 0.0, 0.0]]).tolist() == [0, 0]  # inside the Earth


def free_rays(position, n=300):
    """Return the share of lines to points of the Sun's disc that miss the Earth, in three dimensions."""
    toward = SUN - position
    distance = np.linalg.norm(toward)
    u = toward / distance
    v = np.cross(u, [0.0, 0.0, 1.0])
    v /= np.linalg.norm(v)
    x, y = np.meshgrid(*[(np.arange(n) + 0.5) / n * 2 - 1] * 2)
    x, y = 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y  # so that no row of the grid runs along the Earth's rim
    disc = math.tan(math.asin(SUN_RADIUS_M / distance)) * np.stack([x, y])[:, x**2 + y**2 < 1.0]
    rays = u + disc[0][:, None] * v + disc[1][:, None] * np.cross(u, v)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = -np.sum(rays * position, axis=1)
    miss = np.linalg.norm(position + along[:, None] * rays, axis=1)
    return 1.0 - np.mean((along > 0) & (miss < EARTH))


@pytest.mark.parametrize("radius_m", [EARTH + 300e3, 4.2e7, 4e8, 1.5e9])
def test_share_is_that_of_rays_to_the_disc(radius_m):
    # Discs are taken as flat: the Earth's rim, b from its centre, bends by cot b on the sky and not by 1 / b, which moves
    # a (1 / b - cot b) / (3 pi) = 2.4e-4 of the disc at 300 km; 7e4 rays on a grid miss another 1.5e-4 at most
    sun, earth = apparent_radii(radius_m)
    for part in (-0.9, -0.4, 0.0, 0.5, 0.9):
        position = around(radius_m, earth + part * sun)
        assert lit(position)[0] == pytest.approx(free_rays(position), abs=4e-4)


def test_against_skyfield_where_the_sun_is_a_point():
    # skyfield's is_sunlit, without the ephemeris file it needs: the line to the Sun's centre meets the Earth or not
    from skyfield.geometry import intersect_line_and_sphere

    rng = np.random.default_rng(500)
    position = rng.normal(size=(4000, 3))
    position *= (EARTH + rng.uniform(300e3, 4e7, 4000) * rng.integers(0, 2, 4000) + 200e3)[:, None] / np.linalg.norm(
        position, axis=1, keepdims=True
    )
    with np.errstate(invalid="ignore"):
        _, far = intersect_line_and_sphere((SUN - position).T, -position.T, EARTH)
    sunlit = np.nan_to_num(far) <= 0
    share = lit(position)
    assert 0.1 < np.mean(~sunlit) < 0.9
    np.testing.assert_array_equal(sunlit[(share == 0) | (share == 1)], share[(share == 0) | (share == 1)] == 1)
    np.testing.assert_array_equal(sunlit[np.abs(share - 0.5) > 0.03], (share > 0.5)[np.abs(share - 0.5) > 0.03])


def test_truth_says_who_sees_the_sun():
    start = datetime.datetime(2024, 3, 20, 3, 6, tzinfo=datetime.UTC)
    epochs = Epochs(start, np.arange(0.0, 6000.0, 100.0))
    sun = sun_position_m(epochs)
    radius = EARTH + 500e3
    speed = math.sqrt(units.EARTH_GM_M3_S2 / radius)
    # from below the Sun along the equator, so into the shadow after a quarter of an orbit
    orbit = State(epoch_utc=start, position_m=(radius, 0.0, 0.0), velocity_m_s=(0.0, speed, 0.0))
    far = Fixed(position_m=(4.2e7, 0.0, 0.0))
    course = truth([Body(name="low", motion=orbit), Body(name="far", motion=far)], epochs)
    assert set(course.sunlit) == {"low", "far"}
    np.testing.assert_array_equal(course.sunlit["low"], sunlit_fraction(course.states["low"].position_m, sun))
    np.testing.assert_array_equal(course.sunlit["far"], np.ones(60))
    assert 20 <= np.sum(course.sunlit["low"] == 0) <= 22  # 35.6 minutes
    assert course.at(0).sunlit == {"low": 1.0, "far": 1.0}
    alone = truth([Body(name="low", motion=orbit)], epochs.at(30))
    assert alone.sunlit["low"][0] == course.sunlit["low"][30]
    np.testing.assert_array_equal(course.sun_direction, sun_direction(epochs))


def test_a_local_world_may_name_its_sun():
    epochs = Epochs(datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC), np.arange(3.0))
    bodies = [Body(name="plate", motion=Fixed(position_m=(0.0, 0.0, 5.0)))]
    dark = truth(bodies, epochs, local=True)
    assert np.all(np.isnan(dark.sun_direction))
    assert dark.sunlit == {}
    named = truth(bodies, epochs, local=True, sun_direction=(0.0, 3.0, 4.0))
    np.testing.assert_array_equal(named.sun_direction, np.tile([0.0, 0.6, 0.8], (3, 1)))
    np.testing.assert_array_equal(named.sunlit["plate"], np.ones(3))
    assert named.at(1).sunlit == {"plate": 1.0}
    with pytest.raises(ScenarioError, match=r"sun_direction: needs a vector"):
        truth(bodies, epochs, local=True, sun_direction=(0.0, 0.0, 0.0))
    with pytest.raises(
        ScenarioError,
        match=r"sun_direction: in a world with an Earth, the date determines the Sun's position; leave it out",
    ):
        truth(bodies, epochs, sun_direction=(0.0, 0.0, 1.0))
