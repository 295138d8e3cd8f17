"""Constraints: what is broken is told with place, amount, first instant and cure; what is kept is not."""

import re

import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import Constraints, Corridor, preview_mission
from rso_lidar.scenario.assessment.compliance import list_violations

APPROACH = "examples/tdrs_approach.toml"  # from 3000 m behind along -y of rtn to 300 m; boresight along the velocity
BEHIND = {"target": "tdrs", "axes": "rtn", "axis": (0, -1, 0), "half_angle_deg": 30}


@pytest.fixture(scope="module")
def approach():
    """Return a function that gives what an approach breaks."""
    scenario = rl.Scenario.load(APPROACH)
    seen = preview_mission(scenario)

    def lines(**fields):
        constraints = Constraints(**fields)
        constraints.check(scenario.target, local=False, sun=True)
        found = list_violations(constraints, scenario, seen)
        assert not any("\n" in line for line in found)
        return found

    return lines


def only(lines, *words):
    assert len(lines) == 1, lines
    for word in words:
        assert word in lines[0], (word, lines[0])


def test_nothing_asked_is_nothing_broken(approach):
    assert approach() == []


class TestExclusion:
    """Of the approach: the Sun 50.74 degrees off at the start, 61.77 at the end, the limb 81.29 and more, the Moon 109."""

    def test_sun(self, approach):
        assert approach(sun_exclusion_deg=50.7) == []
        (line,) = approach(sun_exclusion_deg=55)
        told = "constraints.sun_exclusion_deg: the Sun comes within 50.74° of the boresight at 0 s, and 55° is required"
        assert told in line
        assert re.search(r"\d+% of the time, first at 0 s; turn the boresight away", line)

    def test_moon(self, approach):
        assert approach(moon_exclusion_deg=105) == []
        only(approach(moon_exclusion_deg=130), "constraints.moon_exclusion_deg", "the Moon comes within 1")

    def test_earth(self, approach):
        assert approach(earth_exclusion_deg=81.2) == []
        only(
            approach(earth_exclusion_deg=81.3),
            "constraints.earth_exclusion_deg",
            "the Earth's limb comes within 81.29°",
        )

    def test_a_boresight_that_meets_the_earth(self):
        scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
        lines = list_violations(Constraints(earth_exclusion_deg=20), scenario, preview_mission(scenario))
        only(lines, "the boresight meets the Earth, 66.", "° inside its limb, at 43", "first at ")

    def test_the_sun_behind_the_earth_is_no_matter(self):
        """The flyby lies in the umbra throughout, with the Sun 57.9 degrees off the boresight at last."""
        scenario = rl.Scenario.load("examples/tle_flyby.toml")
        assert list_violations(Constraints(sun_exclusion_deg=90), scenario, preview_mission(scenario)) == []

    @pytest.mark.parametrize("angle", [0, -1, 180, float("nan")])
    def test_angles_that_mean_nothing(self, angle):
        with pytest.raises(ScenarioError, match="sun_exclusion_deg"):
            Constraints(sun_exclusion_deg=angle)


class TestKeepOut:
    def test_one_for_all_or_one_by_name(self, approach):
        for asked in (400, {"tdrs": 400.0}):
            only(
                approach(keep_out_m=asked),
                "constraints.keep_out_m: the follower comes within 305 m of tdrs at 2695.000 s, ",
            )
        assert approach(keep_out_m=300) == approach(keep_out_m={}) == []

    def test_the_first_entry_is_where_the_range_is_the_radius(self, approach):
        (line,) = approach(keep_out_m=1000)
        first_s = float(re.search(r"first at ([\d.]+) s", line)[1])
        scenario = rl.Scenario.load(APPROACH)
        at = rl.orbit.Epochs(scenario.time.start_utc, [first_s - 0.01, first_s + 0.01])
        place = rl.motion.truth(scenario.bodies, at).poses.pose("tdrs", "follower").translation
        before, after = (place**2).sum(axis=-1) ** 0.5
        assert before > 1000.0 > after
        assert before - after < 0.1  # at 1 m/s, 20 ms are 2 cm

    @pytest.mark.parametrize(("radius_m", "first_s"), [(10.0, 54.556), (2.001, 55.096)])
    def test_a_pass_between_frames(self, text, tmp_path, radius_m, first_s):
        """Frames at 0 and 100 s; it passes at 2 m and 18 m/s at 55.1 s: the entry is sqrt(R^2 - 4) / 18 s before."""
        (tmp_path / "pass.csv").write_text("time_s,x_m,y_m,z_m\n0,998,-991.8,0\n100,998,808.2,0\n")
        table = f"follower.motion={{type='table', file='{tmp_path / 'pass.csv'}'}}"
        settings = (table, "time.duration_s=200", "time.frame_rate_hz=0.01", f"constraints.keep_out_m={radius_m}")
        scenario = rl.Scenario.loads(text, settings=settings)
        seen = preview_mission(scenario)
        assert len(seen.time_s) == 2
        words = f"comes within 2 m of plate at 55.100 s, and {radius_m:g} m is required, first at {first_s:.3f} s"
        only(list_violations(scenario.constraints, scenario, seen), words)

    def test_from_the_first_frame_on(self, text):
        scenario = rl.Scenario.loads(text)
        only(
            list_violations(Constraints(keep_out_m=1500), scenario, preview_mission(scenario)),
            "1000 m",
            "from the first frame on",
        )

    def test_a_corridor_is_the_way_in(self, approach):
        assert approach(keep_out_m=400, corridor=[BEHIND]) == []
        short = {**BEHIND, "to_m": 350.0}  # it begins inside the sphere: the shell from 350 to 400 m is closed
        only(approach(keep_out_m=400, corridor=[short]), "outside of its corridor at ", "400 m is required")

    @pytest.mark.parametrize(
        ("asked", "told"),
        [
            ("wide", "keep_out_m: the radius is 'wide'; give metres"),
            (True, "keep_out_m: the radius is True"),
            (0, "keep_out_m: the radius is 0;"),
            (float("inf"), "keep_out_m: the radius is inf"),
            ({"tdrs": -5}, "keep_out_m: the radius of 'tdrs' is -5;"),
            ({"tdrs": [1]}, r"keep_out_m: the radius of 'tdrs' is \[1\];"),
        ],
    )
    def test_radii_that_are_none(self, asked, told):
        with pytest.raises(ScenarioError, match=told):
            Constraints(keep_out_m=asked)


class TestCorridor:
    def test_kept(self, approach):
        assert approach(corridor=[BEHIND]) == []

    def test_broken(self, approach):
        (line,) = approach(corridor=[{**BEHIND, "half_angle_deg": 5}])
        assert line.startswith("constraints.corridor[0]: the follower is ")
        assert " m from tdrs, and 5° is required; " in line
        assert "of the time, first at" in line

    def test_only_over_its_length(self, approach):
        aside = {**BEHIND, "axis": (0, 1, 0)}
        only(approach(corridor=[{**aside, "to_m": 500.0}]), "the follower is 1", "first at 2")
        assert approach(corridor=[{**aside, "from_m": 5000.0}]) == []

    def test_axes_of_the_target_and_of_its_port(self, text):
        """The plate at 1000 m on +x does not turn here; its port looks back along -x, 1 m ahead of it."""
        still = "target=[{name='plate', model='plate', motion={type='fixed', position_m=[1000, 0, 0]}, axes=[{name='port', position_m=[-1, 0, 0], euler_zyx_deg=[180, 0, 0]}]}]"  # fmt: skip  # noqa: E501
        scenario = rl.Scenario.loads(text, settings=(still,))
        seen = preview_mission(scenario)
        for axes, axis, kept in (
            (None, (-1, 0, 0), True),
            ("plate", (1, 0, 0), False),
            ("port", (1, 0, 0), True),
            ("port", (-1, 0, 0), False),
        ):
            asked = Constraints(corridor=[{"target": "plate", "axes": axes, "axis": axis, "half_angle_deg": 1}])
            asked.check(scenario.target, local=True, sun=False)
            lines = list_violations(asked, scenario, seen)
            assert (lines == []) == kept
            if not kept:
                only(
                    lines,
                    "the follower is 180.00° off the axis",
                    "999 m from plate's port" if axes == "port" else "1000 m",
                )

    def test_ends_in_the_wrong_order(self):
        with pytest.raises(ScenarioError, match="to_m 100 is not beyond from_m 200"):
            Corridor(target="tdrs", axis=(1, 0, 0), half_angle_deg=5, from_m=200, to_m=100)


class TestNames:
    """A scenario whose constraints speak of what it has not is refused, with the place and the cure."""

    @pytest.mark.parametrize(
        ("setting", "told"),
        [
            ("keep_out_m={plat=10}", "constraints.keep_out_m: no target 'plat'; did you mean 'plate'?"),
            (
                "corridor=[{target='disk', axis=[1,0,0], half_angle_deg=5}]",
                "constraints.corridor[0].target: no target 'disk' (targets: plate)",
            ),
            (
                "corridor=[{target='plate', axes='prt', axis=[1,0,0], half_angle_deg=5}]",
                "constraints.corridor[0].axes: 'plate' has no axes 'prt'",
            ),
            (
                "corridor=[{target='plate', axes='rtn', axis=[1,0,0], half_angle_deg=5}]",
                "constraints.corridor[0].axes: 'plate' has no axes 'rtn'",
            ),
            (
                "sun_exclusion_deg=30",
                "constraints.sun_exclusion_deg: this local world has no Sun; set world.sun_direction",
            ),
            ("moon_exclusion_deg=30", "constraints.moon_exclusion_deg: this local world has no Moon; leave it out"),
            ("earth_exclusion_deg=30", "constraints.earth_exclusion_deg: this local world has no Earth; leave it out"),
            ("sun_excl_deg=30", "constraints: unknown key 'sun_excl_deg'; did you mean 'sun_exclusion_deg'?"),
        ],
    )
    def test_refused(self, text, setting, told):
        with pytest.raises(ScenarioError, match=re.escape(told)) as error:
            rl.Scenario.loads(text, settings=(f"constraints.{setting}",))
        assert "\n" not in str(error.value)

    def test_a_bench_with_a_sun(self, text):
        sun = 'world={axes="local", sun_direction=[0, 0, 1]}'
        scenario = rl.Scenario.loads(text, settings=(sun, "constraints.sun_exclusion_deg=91"))
        only(
            scenario.advice(),
            "the Sun comes within 90.00° of the boresight at 0 s, and 91° is required; 100% of the time",
        )
