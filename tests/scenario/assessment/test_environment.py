"""What surrounds the lidar of a scenario: the table, the lines for a person, and the advice that nobody asked for."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.scenario import preview_mission
from rso_lidar.scenario.assessment.environment import (
    _describe_passage,
    advise_on_environment,
    describe_environment,
)
from rso_lidar.scenario.preview.sky import compute_sky_geometry, tabulate_environment

MOON_KM = (-220_497.1, 291_971.7, 164_731.8)  # by astropy 8.0.2 (ERFA's moon98), 2024-03-20 03:06 UTC, in GCRS

# At the March equinox of 2024 the Sun stands on +x of GCRS, but for 0.3 degree of precession; GEO, seen toward +y.
ORBIT = """
version = 1
name    = "a plate in orbit"

[time]
start_utc     = 2024-03-20T03:06:00Z
duration_s    = {duration_s}
frame_rate_hz = {rate_hz}

[[target]]
name     = "plate"
model    = "plate"
material = {{ type = "lambertian", reflectance = 0.30 }}
motion   = {{ type = "state", epoch_utc = 2024-03-20T03:06:00Z, position_m = {position}, velocity_m_s = {velocity} }}

[follower]
motion   = {{ type = "hill", relative_to = "plate", position_m = {place}, velocity_m_s = [0, 0, 0] }}
attitude = {{ type = "look_at", at = "plate" }}

[lidar.receiver]
fov_deg  = {fov_deg}
f_number = 2.8
n_rows   = 32
n_cols   = 32
"""


def flown(*settings, height_m=35_786e3, angle_deg=0.0, place=(0, -500, 0), duration_s=100, rate_hz=0.1, fov_deg=2.5):
    """Return a scenario on a circular equatorial orbit that begins at an angle from +x, and its preview."""
    radius, angle = units.EARTH_RADIUS_M + height_m, angle_deg * units.DEG
    speed = math.sqrt(units.EARTH_GM_M3_S2 / radius)
    text = ORBIT.format(
        position=[radius * math.cos(angle), radius * math.sin(angle), 0.0],
        velocity=[-speed * math.sin(angle), speed * math.cos(angle), 0.0],
        place=list(map(float, place)),
        duration_s=duration_s,
        rate_hz=rate_hz,
        fov_deg=fov_deg,
    )
    scenario = rl.Scenario.loads(text, settings=settings)
    return scenario, preview_mission(scenario)


def advice(*args, **kwargs):
    return advise_on_environment(*flown(*args, **kwargs))


def only(lines, *words):
    assert len(lines) == 1, lines
    assert "\n" not in lines[0]
    for word in words:
        assert word in lines[0], (word, lines[0])


class TestTable:
    def test_over_the_day_side_along_the_orbit(self):
        scenario, seen = flown()
        table = tabulate_environment(scenario, seen)
        assert all(column.shape == seen.time_s.shape for column in table.values())
        assert all(name.endswith(("_s", "_m", "_rad", "_fraction")) for name in table)
        first = {name: values[0] / (units.DEG if name.endswith("_rad") else 1.0) for name, values in table.items()}
        # the boresight is along +y, the Sun on +x 0.31 degree of precession aside (24.2 years of 46.1 arcsec in right
        # ascension), the Earth below
        assert first["sun_angle_rad"] == pytest.approx(90.0, abs=0.35)
        assert first["earth_limb_angle_rad"] == pytest.approx(90.0 - 8.70, abs=0.01)
        assert first["earth_radius_rad"] == pytest.approx(8.70, abs=0.01)
        assert first["plate_phase_angle_rad"] == pytest.approx(90.0, abs=0.35)
        assert first["sun_angle_rad"] + first["plate_phase_angle_rad"] == pytest.approx(180.0, abs=0.001)  # GEO: 0.016
        assert abs(first["plate_beta_rad"]) < 0.15  # declination in axes of J2000: 24.2 years of 20.0 arcsec
        assert first["plate_range_m"] == pytest.approx(500.0)
        assert first["plate_line_height_m"] == pytest.approx(35_786e3, abs=10.0)
        assert first["plate_sunlit_fraction"] == first["follower_sunlit_fraction"] == 1.0

    def test_the_moon_is_seen_from_the_follower_and_not_from_the_earths_centre(self):
        """In GEO its parallax is up to 6.3 degrees."""
        scenario, seen = flown()
        moon_km, place = np.array(MOON_KM), seen.states["follower"].position_m[0]
        line = 1e3 * moon_km - place
        expected = math.acos(line[1] / np.linalg.norm(line)) / units.DEG  # the boresight is +y to 0.001 degree
        got = tabulate_environment(scenario, seen)["moon_angle_rad"][0] / units.DEG
        assert got == pytest.approx(expected, abs=0.3)
        assert abs(math.acos(moon_km[1] / np.linalg.norm(moon_km)) / units.DEG - expected) > 0.5

    def test_a_local_world_has_what_makes_sense_there(self, text):
        bare = rl.Scenario.loads(text)
        assert sorted(tabulate_environment(bare, preview_mission(bare))) == ["plate_range_m", "time_s"]
        lit = rl.Scenario.loads(text, settings=('world={axes="local", sun_direction=[-1, 0, 1]}',))
        table = tabulate_environment(lit, preview_mission(lit))
        np.testing.assert_allclose(table["sun_angle_rad"] / units.DEG, 135.0, atol=1e-9)
        np.testing.assert_allclose(table["plate_phase_angle_rad"] / units.DEG, 45.0, atol=1e-6)
        assert not {"moon_angle_rad", "earth_limb_angle_rad", "plate_sunlit_fraction"} & set(table)


class TestLines:
    def test_a_day_in_geo_at_the_equinox(self):
        scenario, seen = flown(duration_s=86_400, rate_hz=0.001)
        lines = describe_environment(scenario, seen)
        assert [line[:11].strip() for line in lines] == ["sun", "earth", "moon", "phase", "eclipse"]
        eclipse = lines[-1]
        assert "1 eclipse: umbra from " in eclipse
        assert "beta" in eclipse
        # half a revolution, 43,082 s; the Sun starts 0.31 degree of right ascension behind and goes on 0.45 meanwhile
        words = eclipse.split("umbra from ")[1].split()
        middle = 0.5 * (float(words[0]) + float(words[3]))
        assert middle == pytest.approx(43_082 + 0.14 * 239.3, abs=5)

    def test_many_eclipses_are_counted(self):
        scenario, seen = flown(height_m=500e3, duration_s=86_400, rate_hz=0.01)
        (line,) = [line for line in describe_environment(scenario, seen) if "eclipse" in line]
        assert "15 eclipses: " in line
        assert "... 13 more ..." in line

    def test_sunlight_that_the_shadow_takes_is_told_where_it_counts(self):
        for settings, told in (((), False), (("lidar.receiver.filter_width_nm=2",), True)):
            scenario, seen = flown(*settings, height_m=500e3, angle_deg=180.0)
            (line,) = [line for line in describe_environment(scenario, seen) if "eclipse" in line]
            assert "umbra all the time" in line
            assert ("no sunlight on it" in line) == told

    def test_a_passage_that_a_run_does_not_hold_whole_says_which_end_is_outside(self):
        assert _describe_passage("umbra", 3.25, 70.5) == "umbra from 3.250 s to 70.500 s"
        assert _describe_passage("umbra", 3.25, math.inf) == "umbra from 3.250 s to after the last"
        assert _describe_passage("umbra", -math.inf, 70.5) == "umbra from before the first frame to 70.500 s"
        assert _describe_passage("umbra", -math.inf, math.inf) == "umbra all the time"

    def test_no_eclipse(self):
        scenario, seen = flown()
        assert "no eclipse" in describe_environment(scenario, seen)[-1]

    def test_a_bench_says_nothing_of_earth(self, text):
        bare = rl.Scenario.loads(text)
        assert describe_environment(bare, preview_mission(bare)) == []

    def test_they_stand_in_a_description(self):
        scenario, seen = flown()
        assert "\n".join(describe_environment(scenario, seen)) in scenario.describe()


class TestAdvice:
    def test_a_clear_sky(self):
        assert advice() == []
        assert advice("lidar.receiver.filter_width_nm=2") == []

    def test_the_sun_in_the_field(self):
        """Toward +y from +x the Sun is 90 degrees off; a quarter of a revolution before, the orbit runs into it."""
        lines = advice(angle_deg=-90.0)
        only(lines, "the Sun is in the field of view 100% of the time, first at 0 s", "blinds")

    def test_the_sun_beside_the_field(self):
        only(advice(angle_deg=-86.0), "the Sun comes within ", "sun_exclusion_deg")
        assert advice(angle_deg=-80.0) == []

    def test_the_sun_behind_the_earth_blinds_nothing(self):
        """In the umbra, straight down at the Earth, with the Sun behind it."""
        scenario, seen = flown(height_m=500e3, angle_deg=180.0, place=(500, 0, 0), fov_deg=150.0)
        assert not compute_sky_geometry(scenario, seen).sun_seen.any()
        assert advise_on_environment(scenario, seen) == []

    def test_the_earth_in_the_field_where_sunlight_counts(self):
        down = {"place": (500, 0, 0)}  # from above: the boresight meets the Earth
        assert advice(**down) == []
        filtered = "lidar.receiver.filter_width_nm=2"
        only(advice(filtered, **down), "Earth's disk is in the field of view 100% of the time", "(its day side)")
        only(advice(filtered, height_m=500e3, angle_deg=180.0, **down), "(its night side)")
        only(advice(filtered, fov_deg=170.0), "Earth's disk")

    def test_the_earth_between(self, tmp_path):
        """The follower half a revolution away from a target in its own orbit."""
        state = "{type='state', epoch_utc=2024-03-20T03:06:00Z, position_m=[-42164137, 0, 0], velocity_m_s=[0, -3074.66, 0]}"
        lines = advice(f"follower.motion={state}", fov_deg=1.0)
        assert [line for line in lines if "stands between" in line] == [
            "target plate: the Earth stands between it and the lidar 100% of the time, first at 0 s, and frames show it all "
            "the same; start when it is in sight"
        ]

    def test_a_bench_at_the_earths_centre_is_let_be(self, text):
        """A bench in inertial axes lies where the Earth is: that is no matter of line of sight."""
        scenario = rl.Scenario.loads(text, settings=('world={axes="inertial"}', "lidar.receiver.filter_width_nm=2"))
        assert advise_on_environment(scenario, preview_mission(scenario)) == []

    def test_a_sun_on_the_bench(self, text):
        for direction, told in (
            ([1, 0, 0], "in the field of view"),
            ([1, 0, 0.09], "comes within"),
            ([-1, 0, 0], None),
        ):
            scenario = rl.Scenario.loads(text, settings=(f'world={{axes="local", sun_direction={direction}}}',))
            lines = advise_on_environment(scenario, preview_mission(scenario))
            assert [told in line for line in lines] == [True] * (told is not None)
