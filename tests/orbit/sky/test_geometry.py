"""Angles about a body in orbit, the Earth in a field of view, and when a smooth function is below zero."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import (
    Eclipse,
    Epochs,
    State,
    angle_rad,
    beta_angle_rad,
    earth_angular_radius_rad,
    earth_limb_angle_rad,
    find_eclipses,
    find_minimum,
    find_spans_below,
    line_altitude_m,
    phase_angle_rad,
    shadow_margins_rad,
    sun_position_m,
    sunlit_fraction,
)
from rso_lidar.records import BodyState

START = datetime.datetime(2024, 3, 20, 3, 6, tzinfo=datetime.UTC)  # March equinox
EARTH, AU = units.EARTH_RADIUS_M, units.ASTRONOMICAL_UNIT_M
SUN = np.array([[AU, 0.0, 0.0]])


def row(*numbers):
    return np.array([numbers], dtype=float)


def test_angles_keep_their_digits_at_both_ends():
    tiny = 1e-9
    assert angle_rad(row(1, 0, 0), row(3, 3 * tiny, 0))[0] == pytest.approx(tiny, rel=1e-12)
    assert angle_rad(row(1, 0, 0), row(-2, 0, 2 * tiny))[0] == pytest.approx(math.pi - tiny, rel=1e-15)


@pytest.mark.parametrize(("inclination_deg", "beta_deg"), [(0, 0), (30, 30), (90, 90), (150, 30), (-40, -40)])
def test_beta_is_the_suns_height_on_the_side_of_the_orbit_normal(inclination_deg, beta_deg):
    tilt = inclination_deg * units.DEG
    velocity = row(0.0, 0.0, 7500.0) if inclination_deg == 90 else row(0.0, 7500.0, 0.0)
    # an orbit through +y whose normal is the z axis, tilted about y toward the Sun on +x
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    position = row(0.0, 7e6, 0.0)
    velocity = 7500.0 * np.cross(normal, position / 7e6)
    beta = beta_angle_rad(BodyState(position, velocity), SUN)
    assert beta[0] / units.DEG == pytest.approx(beta_deg, abs=1e-12)


def test_phase_is_nought_with_the_sun_behind_the_observer():
    target, sun = row(7e6, 0, 0), row(0, AU, 0)
    assert phase_angle_rad(target, row(7e6, 1e3, 0), sun)[0] == pytest.approx(7e6 / AU, rel=1e-6)  # the Sun's parallax
    assert phase_angle_rad(target, row(7e6 + 1e3, 0, 0), sun)[0] == pytest.approx(math.pi / 2 + 7e6 / AU, abs=1e-9)
    assert phase_angle_rad(target, row(7e6, -1e3, 0), sun)[0] == pytest.approx(math.pi - 7e6 / AU, rel=1e-6)


class TestEarth:
    position = row(EARTH + 400e3, 0, 0)
    radius = math.asin(EARTH / (EARTH + 400e3))

    @pytest.mark.parametrize("turn_deg", [0, 20, 70, 71, 90, 180])
    def test_limb(self, turn_deg):
        turn = turn_deg * units.DEG
        boresight = row(-math.cos(turn), math.sin(turn), 0)
        assert earth_limb_angle_rad(boresight, self.position)[0] == pytest.approx(turn - self.radius, abs=1e-14)

    def test_below_the_surface_there_is_no_disk(self):
        assert np.isnan(earth_angular_radius_rad(row(1000, 0, 0))).all()
        assert np.isnan(earth_angular_radius_rad(row(0, 0, 0))).all()
        assert earth_angular_radius_rad(row(EARTH, 0, 0))[0] == pytest.approx(math.pi / 2)

    def test_a_line_that_it_blocks(self):
        a = row(EARTH + 400e3, 0, 0)
        assert line_altitude_m(a, a)[0] == pytest.approx(400e3)
        assert line_altitude_m(a, -a)[0] == pytest.approx(-EARTH)
        assert line_altitude_m(a, row(2 * EARTH, 0, 0))[0] == pytest.approx(
            400e3
        )  # away from it: the near end is lowest
        quarter = row(0, EARTH + 400e3, 0)
        assert line_altitude_m(a, quarter)[0] == pytest.approx((EARTH + 400e3) / math.sqrt(2) - EARTH)


class TestSpans:
    def test_of_a_wave(self):
        spans = find_spans_below(lambda t: np.cos(2 * np.pi * t / 5400), 0.0, 12_000.0)
        np.testing.assert_allclose(spans, [(1350, 4050), (6750, 9450)], atol=1e-3)

    def test_that_reach_beyond_the_ends(self):
        wave = lambda t: np.cos(2 * np.pi * t / 5400)  # noqa: E731
        assert find_spans_below(wave, 2000, 3000) == [(-math.inf, math.inf)]
        (first,) = find_spans_below(wave, 2000, 6000)
        assert first == (-math.inf, pytest.approx(4050, abs=1e-3))
        (last,) = find_spans_below(wave, 0, 2000)
        assert last == (pytest.approx(1350, abs=1e-3), math.inf)

    @pytest.mark.parametrize("middle", [31.0, 59.99, 330.0, 3599.0, 3575.0, 2.0])
    def test_a_dip_of_a_second_between_instants_a_minute_apart(self, middle):
        (span,) = find_spans_below(lambda t: ((t - middle) / 0.5) ** 2 - 1, 0.0, 3600.0)
        assert span == (pytest.approx(middle - 0.5, abs=1e-3), pytest.approx(middle + 0.5, abs=1e-3))

    def test_a_dip_that_does_not_reach(self):
        assert find_spans_below(lambda t: (t - 330.0) ** 2 + 1e-6, 0.0, 3600.0) == []

    def test_one_instant(self):
        assert find_spans_below(lambda t: t - 1.0, 0.0, 0.0) == [(-math.inf, math.inf)]
        assert find_spans_below(lambda t: t + 1.0, 0.0, 0.0) == []

    def test_least(self):
        when, value = find_minimum(lambda t: np.cos(2 * np.pi * t / 5400), 0.0, 5000.0)
        assert when == pytest.approx(2700, abs=1e-3)
        assert value == pytest.approx(-1.0)
        assert find_minimum(lambda t: t, 3.0, 3.0) == (3.0, 3.0)

    def test_least_of_the_dips_of_a_month_of_orbits(self):
        deepest_s = 100.5 * 5400.0
        when, value = find_minimum(
            lambda t: np.cos(2 * np.pi * t / 5400) + ((t - deepest_s) / 1e6) ** 2, 0.0, 30 * units.DAY_S
        )
        assert when == pytest.approx(deepest_s, abs=1e-3)
        assert value == pytest.approx(-1.0)


def circular(height_m, angle_deg=0.0):
    """Return an equatorial circular orbit that at the start stands at an angle from the Sun's direction."""
    sun = sun_position_m(Epochs(START, np.zeros(1)))[0]
    angle = math.atan2(sun[1], sun[0]) + angle_deg * units.DEG
    radius = EARTH + height_m
    speed = math.sqrt(units.EARTH_GM_M3_S2 / radius)
    return State(
        epoch_utc=START,
        position_m=(radius * math.cos(angle), radius * math.sin(angle), 0.0),
        velocity_m_s=(-speed * math.sin(angle), speed * math.cos(angle), 0.0),
    )


class TestEclipses:
    def test_one_for_each_revolution_whatever_epochs_are_between(self):
        orbit = circular(500e3)
        found = find_eclipses(orbit, Epochs(START, np.array([0.0, 40_000.0])))
        assert len(found) == 7
        assert found == find_eclipses(orbit, Epochs(START, np.linspace(0.0, 40_000.0, 77)))
        for one in found:
            assert one.is_total
            assert one.penumbra_from_s < one.umbra_from_s < one.umbra_to_s < one.penumbra_to_s

    def test_edges_are_where_the_light_changes_to_the_millisecond(self):
        orbit = circular(500e3)
        one = find_eclipses(orbit, Epochs(START, np.array([0.0, 5000.0])))[0]

        def lit(time_s):
            at = Epochs(START, np.array([time_s]))
            return float(sunlit_fraction(orbit.states(at).position_m, sun_position_m(at))[0])

        # Near either edge the light changes with the power 3/2 of time: a millisecond in 8 s is (1.2e-4)^1.5 = 1.3e-6
        assert lit(one.penumbra_from_s - 1e-3) == 1.0 > lit(one.penumbra_from_s + 1e-3)
        assert lit(one.umbra_from_s - 1e-3) > 0.0 == lit(one.umbra_from_s + 1e-3)
        assert lit(one.umbra_to_s - 1e-3) == 0.0 < lit(one.umbra_to_s + 1e-3)
        assert lit(one.penumbra_to_s - 1e-3) < 1.0 == lit(one.penumbra_to_s + 1e-3)

    def test_that_holds_at_the_ends(self):
        orbit = circular(500e3, 180.0)
        (one,) = find_eclipses(orbit, Epochs(START, np.array([-100.0, 100.0])))
        assert one == Eclipse(-math.inf, -math.inf, math.inf, math.inf)

    def test_none_in_daylight(self):
        assert find_eclipses(circular(500e3), Epochs(START, np.array([-600.0, 600.0]))) == []

    def test_a_penumbra_alone(self):
        """Beyond the umbra's tip, 1.38 million km behind the Earth, the Sun is covered in part only."""
        far = circular(1.5e9, 179.7)
        (one,) = find_eclipses(far, Epochs(START, np.array([0.0, 3e5])))
        assert not one.is_total
        assert math.isnan(one.umbra_to_s)


def test_margins_agree_with_the_light():
    generator = np.random.default_rng(3)
    places = generator.normal(size=(20_000, 3)) * [3e7, 7e6, 7e6] - [3e7, 0, 0]
    sun = np.broadcast_to(SUN, places.shape)
    touched, covered = shadow_margins_rad(places, sun)
    light = sunlit_fraction(places, sun)
    assert 100 < np.sum((light > 0) & (light < 1))
    np.testing.assert_array_equal(covered < 0.0, light == 0.0)
    # near the penumbra's edge the hidden part vanishes in rounding: margins of 1e-6 rad and less are left out
    clear = np.abs(touched) > 1e-6
    np.testing.assert_array_equal((touched < 0.0)[clear], (light < 1.0)[clear])
