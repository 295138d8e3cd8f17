"""Dispersed missions: repeatable, resumable, equal on workers, against Foster's probability, and refused in one line."""

import datetime
import json
import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import rpo, units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Catalog, ElementSet
from rso_lidar.orbit.collision.foster import disc_probability
from rso_lidar.scenario import preview_mission
from rso_lidar.study.dispersions import dispersed_mission
from rso_lidar.study.dispersions.dispersed_mission import nees_bounds
from rso_lidar.study.dispersions.kept_runs import identify_runs
from rso_lidar.study.dispersions.start_errors import resolve_start_errors
from tests.test_processes import Elsewhere

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CHIEF = rl.Kepler(
    epoch_utc=START, semi_major_axis_km=6928.137, eccentricity=0.0, inclination_deg=97.6, raan_deg=35.0,
    argument_of_perigee_deg=0.0, true_anomaly_deg=0.0,
)  # fmt: skip


def make_scenario(motion=None, dispersion=None, **time):
    return rl.Scenario(
        version=1,
        name="dispersed",
        seed=4,
        time=rl.Time(start_utc=START, **({"duration_s": 3000, "frame_rate_hz": 0.01} | time)),
        target=[rl.Target(name="plate", model="plate", motion=CHIEF, attitude=rl.Rtn())],
        follower=rl.Follower(
            motion=motion
            or rpo.Hop(relative_to="plate", from_m=(0, -1000, 0), to_m=(0, -200, 0), duration_s=2500, keep_out_m=50),
            attitude=rl.LookAt(at="plate"),
        ),
        lidar=rl.Lidar(preset="gsfl_1064", detector=rl.Empirical()),  # its link budget costs nothing
        dispersion=dispersion
        or rl.Dispersion(
            position_sigma_m=(5, 10, 5), velocity_sigma_m_s=(0.01, 0.005, 0.005),
            thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.02), energy_sigma_fraction=0.05, pointing_sigma_deg=0.2,
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def mission():
    return rl.study.disperse(make_scenario(), 500)


def test_runs_are_the_same_however_many_there_are(mission):
    few = rl.study.disperse(make_scenario(), 300)
    for name, column in few.table.items():
        assert column.tobytes() == mission.table[name][:300].tobytes(), name
    assert len(np.unique(mission.table["nearest_m"])) == 500


@pytest.mark.slow
def test_an_interrupted_study_goes_on(mission, tmp_path, monkeypatch):
    flown = []

    def stop(fly, begins, count, executor):
        for begin in begins:
            flown.append(begin)
            yield fly(begin)
            if len(flown) == 1:
                raise KeyboardInterrupt

    monkeypatch.setattr(dispersed_mission, "map_unordered", stop)
    with pytest.raises(KeyboardInterrupt):
        rl.study.disperse(make_scenario(), 500, working=tmp_path / "kept")
    assert len(list(tmp_path.iterdir())) == 1
    again = rl.study.disperse(make_scenario(), 500, working=tmp_path / "kept")
    assert flown == [0, 250]
    for name, column in again.table.items():
        assert column.tobytes() == mission.table[name].tobytes(), name
    rl.study.disperse(make_scenario().replace(seed=5), 250, working=tmp_path / "kept")
    assert len(list(tmp_path.iterdir())) == 2  # another scenario has a file of its own
    next(tmp_path.iterdir()).write_bytes(b"not runs")


def test_spreads_of_runs_are_those_of_the_linear_covariance(mission):
    """500 runs: the standard deviation has a relative standard error of 3.2 %; 5 of them."""
    for axis in ("radial", "along", "cross"):
        ratio = mission.tubes[f"{axis}_sigma_m"] / mission.tubes[f"{axis}_linear_sigma_m"]
        assert np.abs(ratio - 1.0).max() < 0.16
        shares = [mission.tubes[f"{axis}_{name}_share"] for name in ("start", "burns", "navigation")]
        np.testing.assert_allclose(np.sum(shares, axis=0), 1.0, rtol=1e-6)
    assert (np.diff(mission.tubes["detected_probability"]) >= 0.0).all()


@pytest.mark.slow
def test_collisions_are_as_likely_as_foster_says():
    """A fly-past at 1 m/s, 30 m off, with 20 m of error across: linear for minutes, which Foster (1992) assumes."""
    passing = rpo.Hill(relative_to="plate", position_m=(30.0, -60.0, 0.0), velocity_m_s=(0.0, 1.0, 0.0))
    dispersion = rl.Dispersion(position_sigma_m=(20.0, 5.0, 15.0), hard_body_radius_m=15.0)
    scenario = make_scenario(passing, dispersion, duration_s=120.0, frame_rate_hz=0.5)
    made = rl.study.disperse(scenario, 5000)
    share, low, high = made.probability("collision")
    path = np.stack([made.tubes[f"{axis}_m"] for axis in ("radial", "along", "cross")], axis=1)
    miss_m = path[np.argmin(np.linalg.norm(path, axis=1))]
    expected = disc_probability(miss_m[[0, 2]], np.diag([400.0, 225.0]), 15.0)  # the plane across the velocity
    assert expected == pytest.approx(share, abs=5.0 * (high - low) / 4.0)
    assert 0.05 < expected < 0.3


@pytest.mark.slow
def test_spreads_are_those_of_flights_that_are_integrated_one_by_one():
    """20 flights of `flown`, whose guidance shoots by integration: the error of a standard deviation is 16 %.

    3.5 of them: one in 360 that one of six standard deviations exceeds that by chance.

    150 flights of examples/dispersed_hop.toml agreed within 11 % in each axis at five instants.
    """
    motion = rpo.Flown(
        plan=rpo.Hop(relative_to="plate", from_m=(0, -1000, 0), to_m=(0, -200, 0), duration_s=2500),
        thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0),
        guidance=rpo.TwoImpulseGuidance(at_s=(800.0, 1900.0)),
        navigation=rpo.NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.002),
    )
    made = rl.study.disperse(make_scenario(motion, rl.Dispersion()), 2)
    place = [int(np.argmin(np.abs(made.tubes["time_s"] - at_s))) for at_s in (1500.0, 2900.0)]
    time_s = made.tubes["time_s"][place]
    nominal = motion.without_random_errors().fly(START, CHIEF).relative(time_s)[0]
    flown = np.array([motion.with_seed(seed).fly(START, CHIEF).relative(time_s)[0] - nominal for seed in range(20)])
    linear = np.stack([made.tubes[f"{axis}_linear_sigma_m"][place] for axis in ("radial", "along", "cross")], axis=1)
    assert np.abs(flown.std(axis=0, ddof=1) / linear - 1.0).max() < 3.5 / np.sqrt(2.0 * 19.0)


FILTER = rpo.RelativeFilter(
    every_s=100,
    sensors=(rpo.NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.2),),
    position_sigma_m=(10, 20, 10),
    velocity_sigma_m_s=(0.02, 0.02, 0.02),
    acceleration_m_s2_sqrt_hz=0.0,
)


def make_filtered(navigation=FILTER):
    """Return a hop of 2500 s with two corrections on what a filter knows."""
    motion = rpo.Flown(
        plan=rpo.Hop(relative_to="plate", from_m=(0, -1000, 0), to_m=(0, -200, 0), duration_s=2500),
        thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0),
        guidance=rpo.TwoImpulseGuidance(at_s=(800.0, 1900.0)),
        navigation=navigation,
    )
    return make_scenario(motion, rl.Dispersion(position_sigma_m=(10, 20, 10), velocity_sigma_m_s=(0.02, 0.01, 0.01)))


@pytest.fixture(scope="module")
def kept_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("dispersed") / "kept"


@pytest.fixture(scope="module")
def filtered(kept_folder):
    """Return 300 runs in two blocks."""
    return rl.study.disperse(make_filtered(), 300, working=kept_folder)


def test_workers_change_no_bit(filtered):
    with Elsewhere() as executor:
        again = rl.study.disperse(make_filtered(), 300, executor=executor)
    assert filtered.tubes["nees"].tobytes() == again.tubes["nees"].tobytes()
    assert filtered.table["delta_v_m_s"].tobytes() == again.table["delta_v_m_s"].tobytes()


def test_a_filter_is_dispersed_with_its_knowledge(filtered, kept_folder, tmp_path):
    """A standard deviation of 300 runs has a relative standard error of 4.1 %; 5 of them."""
    made = filtered
    for axis in ("radial", "along", "cross"):
        for word in ("linear_knowledge_sigma", "filter_sigma"):
            ratio = made.tubes[f"{axis}_knowledge_sigma_m"] / made.tubes[f"{axis}_{word}_m"]
            assert np.abs(ratio - 1.0).max() < 5.0 / np.sqrt(600.0)
        ratio = made.tubes[f"{axis}_sigma_m"] / made.tubes[f"{axis}_linear_sigma_m"]
        assert np.abs(ratio - 1.0).max() < 5.0 / np.sqrt(600.0)
    low, high = nees_bounds(300, 0.9999)
    assert low < made.tubes["nees"].min() < made.tubes["nees"].max() < high
    text = made.describe()
    assert "error of the filter" in text
    assert "mean NEES" in text
    assert made.save(tmp_path / "a.png").stat().st_size > 20_000
    kept = rl.study.disperse(make_filtered(), 300, working=kept_folder)
    assert kept.tubes["nees"].tobytes() == made.tubes["nees"].tobytes()


@pytest.mark.slow
def test_filtered_spreads_are_those_of_flights_that_are_integrated_one_by_one():
    """20 flights of `flown` with filters of their own: the error of a standard deviation is 16 %; 3.5 of them, as above."""
    scenario = make_filtered(FILTER).replace(dispersion=rl.Dispersion())
    motion = scenario.follower.motion
    made = rl.study.disperse(scenario, 2)
    place = [int(np.argmin(np.abs(made.tubes["time_s"] - at_s))) for at_s in (1500.0, 2900.0)]
    time_s = made.tubes["time_s"][place]
    nominal = motion.without_random_errors().fly(START, CHIEF).relative(time_s)[0]
    flown = np.array([motion.with_seed(seed).fly(START, CHIEF).relative(time_s)[0] - nominal for seed in range(20)])
    linear = np.stack([made.tubes[f"{axis}_linear_sigma_m"][place] for axis in ("radial", "along", "cross")], axis=1)
    assert np.abs(flown.std(axis=0, ddof=1) / linear - 1.0).max() < 3.5 / np.sqrt(2.0 * 19.0)


def test_a_dispersion_may_have_another_navigation():
    stated = rl.study.disperse(make_filtered(rpo.NavigationErrors(position_sigma_m=5.0)), 50)
    assert "nees" not in stated.tubes
    scenario = make_filtered(rpo.NavigationErrors(position_sigma_m=5.0))
    filtered = rl.study.disperse(scenario.replace(dispersion=scenario.dispersion.replace(navigation=FILTER)), 50)
    assert "nees" in filtered.tubes
    assert filtered.tubes["along_sigma_m"][-1] < stated.tubes["along_sigma_m"][-1]


def test_pointing_at_the_plan_loses_what_strays():
    dispersion = rl.Dispersion(position_sigma_m=(0, 0, 50), pointing="plan")
    lost = rl.study.disperse(make_scenario(dispersion=dispersion), 250)
    kept = rl.study.disperse(make_scenario(dispersion=dispersion.replace(pointing="target")), 250)
    assert lost.probability("held_always")[0] < 0.5 < kept.probability("held_always")[0] == 1.0
    # at the start, 1 km away, half the field is 21.8 m: 34 % of a normal distribution of 50 m lie within
    assert lost.table["held_fraction"].min() < 1.0


def hold(y_m, dispersion, **target):
    """Return a mission that waits on the V-bar, before a plate that faces it unless other fields of the target are given."""
    target = {"attitude": rl.Rtn(euler_zyx_deg=(90.0, 0.0, 0.0))} | target
    part = rpo.StationKeeping(relative_to="plate", position_m=(0.0, y_m, 0.0), duration_s=3000.0)
    scenario = make_scenario(part, dispersion)
    return scenario.replace(target=[scenario.target[0].replace(**target)])


def test_without_errors_the_whole_body_is_in_the_field_where_check_says_so():
    """A stage turns end over end in a field narrower than its length. The lidar is mounted beside the centre."""
    spin = rl.Spin(axis=(0, 0, 1), rate_deg_s=0.13, axes="rtn")
    scenario = hold(-300.0, rl.Dispersion(), attitude=spin, model="rocket_body")
    scenario = scenario.replace(lidar=scenario.lidar.replace(mount=rl.Mount(position_m=(0.0, 1.5, 0.7))))
    (seen,) = preview_mission(scenario).targets
    assert 0.2 < np.mean(seen.all_in_field) < 0.8 and seen.in_field.all()
    made = rl.study.disperse(scenario, 2)
    assert made.table["held_fraction"].tolist() == [1.0, 1.0]
    assert made.table["whole_held_fraction"] == pytest.approx([np.mean(seen.all_in_field)] * 2, rel=1e-12)


def test_pointing_by_navigation_loses_the_origin_as_often_as_its_errors_say():
    """A square field of half angle h at range R holds an error in each axis: erf(R tan h / (sigma sqrt 2))^2."""
    wild = rpo.NavigationErrors(position_sigma_m=2.0)
    made = rl.study.disperse(hold(-100.0, rl.Dispersion(navigation=wild)), 250)
    half_m = 100.0 * math.tan(math.radians(1.25))
    share = math.erf(half_m / 2.0 / math.sqrt(2.0)) ** 2
    samples = 250 * 30
    found = float(np.mean(made.table["held_fraction"]))
    assert found == pytest.approx(share, abs=4.0 * math.sqrt(share * (1.0 - share) / samples))
    assert np.all(made.table["whole_held_fraction"] <= made.table["held_fraction"])
    text = made.describe()
    assert "P(origin held in the field) 0 " in text and "P(whole body held) 0 " in text
    assert "pointed where navigation takes the target to be" in text
    ideal = rl.study.disperse(hold(-100.0, rl.Dispersion(navigation=wild, pointing="target")), 2)
    assert ideal.table["held_fraction"].tolist() == [1.0, 1.0] and "pointed ideally, at the target" in ideal.describe()


def test_a_constant_error_of_the_boresight_is_about_both_axes_of_the_field():
    """The edge of the field is at 1.25 degrees in both axes: erf(1.25 / (sigma sqrt 2))^2 of the runs hold the origin."""
    made = rl.study.disperse(hold(-100.0, rl.Dispersion(pointing_sigma_deg=1.0)), 1000)
    share = math.erf(1.25 / math.sqrt(2.0)) ** 2
    assert made.probability("held_always")[0] == pytest.approx(share, abs=4.0 * math.sqrt(share * (1.0 - share) / 1000))
    assert set(np.unique(made.table["held_fraction"])) == {0.0, 1.0}


def test_what_is_drawn_and_told(mission, tmp_path):
    text = mission.describe()
    assert "P(collision) " in text
    assert "nearest approach" in text
    place = mission.save(tmp_path / "a.png")
    assert place.stat().st_size > 20_000
    assert mission.save_tubes(tmp_path / "tubes.csv").read_text(encoding="utf-8").startswith("time_s,radial_m,")
    assert (tmp_path / "tubes.csv").read_text(encoding="utf-8").count("\n") == 31


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"position_sigma_m": (1, -1, 0)}, "position_sigma_m: a standard deviation is negative"),
        ({"position_sigma_m": (1, 1)}, "position_sigma_m"),
        ({"covariance": np.eye(6).tolist(), "position_sigma_m": (1, 0, 0)}, "stands in place of position_sigma_m"),
        ({"covariance": (np.eye(6) + np.eye(6, k=1)).tolist()}, "is not symmetric"),
        ({"covariance": (np.eye(6) - 2.0 * np.ones((6, 6))).tolist()}, "is not positive semidefinite"),
        ({"covariance": np.eye(3).tolist()}, "covariance"),
        ({"energy_sigma_fraction": 0.5}, "energy_sigma_fraction"),
        ({"hard_body_radius_m": 0.0}, "hard_body_radius_m"),
        ({"pointing": "sun"}, "pointing: unknown value 'sun'"),
        ({"sigma": 1.0}, "unknown key 'sigma'"),
    ],
)
def test_what_is_no_dispersion_is_refused_in_one_line(fields, problem):
    with pytest.raises(ScenarioError, match=problem) as error:
        rl.Dispersion(**fields)
    assert "\n" not in str(error.value)


def test_what_cannot_be_dispersed_is_refused_in_one_line():
    scenario = make_scenario()
    with pytest.raises(ScenarioError, match=r"no table dispersion; add \[dispersion\]"):
        rl.study.disperse(scenario.replace(dispersion=None))
    alone = scenario.replace(target=(), follower=rl.Follower(motion=CHIEF, attitude=rl.Rtn()))
    with pytest.raises(ScenarioError, match=r"target: no target '' \(known: none\)"):
        rl.study.disperse(alone)
    with pytest.raises(ScenarioError, match=r"target: no target 'moon' \(known: plate\)"):
        rl.study.disperse(scenario, target="moon")
    for runs in (1, 0, True, 2.5):
        with pytest.raises(ScenarioError, match="runs: needs a whole number from 2"):
            rl.study.disperse(scenario, runs)
    local = rl.Scenario.load("examples/bench_plate.toml").replace(dispersion=rl.Dispersion())
    with pytest.raises(ScenarioError, match="orbits about the Earth"):
        rl.study.disperse(local)
    with pytest.raises(ScenarioError, match="disperse: needs a Scenario"):
        rl.study.disperse("a.toml")


BESIDE = {"position_sigma_m": (6, 20, 8), "velocity_sigma_m_s": (0.01, 0.005, 0.01)}


@pytest.mark.slow
def test_errors_of_the_target_add_to_those_of_the_follower_and_leave_its_numbers_alone():
    alone = make_scenario(dispersion=rl.Dispersion(position_sigma_m=(5, 10, 5)))
    both = alone.replace(dispersion=alone.dispersion.replace(target=BESIDE))
    first, second = rl.study.disperse(alone, 500), rl.study.disperse(both, 500)
    assert first.sources == ("start", "burns", "navigation") and second.sources[-1] == "target"
    assert "errors of the target's own orbit and attitude" in first.describe()
    assert "errors of the target's own attitude, and" in second.describe()
    for axis in ("radial", "along", "cross"):
        grown = second.tubes[f"{axis}_linear_sigma_m"] ** 2 - first.tubes[f"{axis}_linear_sigma_m"] ** 2
        share = second.tubes[f"{axis}_target_share"] * second.tubes[f"{axis}_linear_sigma_m"] ** 2
        np.testing.assert_allclose(share, grown, rtol=1e-6, atol=1e-9)
        spread = second.tubes[f"{axis}_sigma_m"] / second.tubes[f"{axis}_linear_sigma_m"]
        assert np.abs(spread - 1.0).max() < 5.0 / math.sqrt(2.0 * 500.0)
    # the noise of runs is that of before: with errors of a micrometre the runs are the same
    tiny = alone.replace(dispersion=alone.dispersion.replace(target={"position_sigma_m": (1e-6, 0, 0)}))
    np.testing.assert_allclose(
        rl.study.disperse(tiny, 300).table["nearest_m"], first.table["nearest_m"][:300], atol=1e-3
    )


def test_errors_of_attitude_turn_the_path_in_the_axes_of_the_target():
    """A constant error about body y moves what is at z by z sigma along x; a drift lets it grow with time."""
    still = make_scenario(
        rpo.StationKeeping(relative_to="plate", position_m=(0.0, 0.0, 200.0)),
        rl.Dispersion(target={"attitude_sigma_deg": (0, 2.0, 0), "rate_sigma_deg_s": (0, 1e-3, 0)}),
    )
    tilted = still.target[0].replace(attitude=rl.Rtn(euler_zyx_deg=(0, 20, 0)))  # about y: a plate is not seen edge-on
    found = rl.study.disperse(still.replace(target=(tilted,)), 750)
    time_s = found.tubes["time_s"]
    expected = 200.0 * math.cos(math.radians(20.0)) * np.radians(np.hypot(2.0, 1e-3 * time_s))
    np.testing.assert_allclose(found.tubes["body_x_linear_sigma_m"], expected, rtol=1e-6)
    np.testing.assert_allclose(found.tubes["body_x_sigma_m"], expected, rtol=5.0 / math.sqrt(2.0 * 750.0))
    np.testing.assert_allclose(np.hypot(found.tubes["body_x_m"], found.tubes["body_z_m"]), 200.0, atol=1e-6)
    assert found.tubes["body_y_linear_sigma_m"].max() < 1e-3
    assert "in the target's axes" in found.describe() and "own orbit, and" in found.describe()
    assert found.table["body_x_m"].std() == pytest.approx(found.tubes["body_x_sigma_m"][-1], rel=2e-3)
    assert found.tubes["along_sigma_m"].max() < 1e-9


@pytest.fixture
def sets(tmp_path):
    """Write a file of element sets of one object whose mean anomaly has errors of 0.01 degree: 1.2 km along the track."""
    rng, lines = np.random.default_rng(2), []
    for k in range(40):
        elements = ElementSet(
            name="KNOWN", norad_id=7, epoch_utc=START - datetime.timedelta(days=0.4 * k), mean_motion_rev_day=15.0,
            eccentricity=1e-6, inclination_deg=90.0, raan_deg=40.0, bstar_per_earth_radius=0.0, argument_of_perigee_deg=0.0,
            mean_anomaly_deg=float((-0.4 * k * 15.0 * 360.0 + 0.01 * rng.normal()) % 360.0),
        )  # fmt: skip
        lines.append(elements)
    place = tmp_path / "known.json"
    place.write_text(write_json(lines), encoding="utf-8")
    return place


def write_json(sets):
    place = {}
    for number, one in enumerate(sets):
        place[number] = {
            "OBJECT_NAME": one.name, "OBJECT_ID": "2026-001A", "NORAD_CAT_ID": one.norad_id,
            "EPOCH": one.epoch_utc.strftime("%Y-%m-%dT%H:%M:%S.%f"), "MEAN_MOTION": one.mean_motion_rev_day,
            "ECCENTRICITY": one.eccentricity, "INCLINATION": one.inclination_deg, "RA_OF_ASC_NODE": one.raan_deg,
            "ARG_OF_PERICENTER": one.argument_of_perigee_deg, "MEAN_ANOMALY": one.mean_anomaly_deg, "EPHEMERIS_TYPE": 0,
            "CLASSIFICATION_TYPE": "U", "ELEMENT_SET_NO": 999, "REV_AT_EPOCH": 1, "BSTAR": 0.0, "MEAN_MOTION_DOT": 0.0,
            "MEAN_MOTION_DDOT": 0.0,
        }  # fmt: skip
    return json.dumps(list(place.values()))


def test_element_sets_state_a_covariance_by_name(sets):
    errors = {"type": "element_sets", "file": str(sets), "age_days": 1.0}
    scenario = make_scenario(dispersion=rl.Dispersion(target={"start": errors}))
    found = rl.study.disperse(scenario, 2)
    expected = rl.study.estimate_set_errors(list(Catalog.from_file(sets))).covariance_at(1.0)
    for k, axis in enumerate(("radial", "along", "cross")):
        assert found.tubes[f"{axis}_linear_sigma_m"][0] == pytest.approx(math.sqrt(expected[k, k]), rel=1e-9, abs=1e-6)
    # velocities are those of the sets less omega x r, so that the inertial ones are what the sets say
    resolved = resolve_start_errors(scenario, "plate").target
    n = math.sqrt(units.EARTH_GM_M3_S2 / 6928.137e3**3)
    turn = np.eye(6)
    turn[3:, :3] = [[0.0, -n, 0.0], [n, 0.0, 0.0], [0.0, 0.0, 0.0]]
    sigma = np.maximum(np.sqrt(np.diag(expected)), [1e-4] * 3 + [1e-7] * 3)  # less is rounding of 1.2 km
    scale = np.outer(sigma, sigma)
    off = (turn @ resolved.start_covariance @ turn.T - expected) / scale
    assert np.abs(off).max() < 1e-6
    own = make_scenario(dispersion=rl.Dispersion(start=errors))
    along_m = rl.study.disperse(own, 2).tubes["along_linear_sigma_m"][0]  # along its own track, a little aside
    assert along_m == pytest.approx(found.tubes["along_linear_sigma_m"][0], rel=1e-4)


def test_a_message_states_the_covariance_of_the_target_or_of_the_relative_state(tmp_path):
    state = CHIEF.states(rl.orbit.Epochs(START, np.zeros(1)))
    orbit = rl.orbit.State(
        epoch_utc=START, position_m=tuple(state.position_m[0]), velocity_m_s=tuple(state.velocity_m_s[0])
    )
    given = np.diag(np.square([3.0, 40.0, 5.0, 0.05, 0.004, 0.006]))
    turn = rl.orbit.orbit_state_matrix("rtn", state.position_m, state.velocity_m_s)[0]
    path = rl.orbit.write_opm(
        tmp_path / "plate.opm", "PLATE", "2020-001A", orbit, covariance=turn @ given @ turn.T, covariance_axes="rtn"
    )
    named = {"type": "covariance", "file": str(path), "object": "PLATE"}
    rates = rl.orbit.orbit_state_matrix("rtn", state.position_m, state.velocity_m_s, rotating=True)[0]
    back = rl.orbit.invert_state_matrix(rates) @ turn
    expected = back @ given @ back.T
    own = {"target": {"start": named}, "position_sigma_m": (1, 2, 3)}
    resolved = resolve_start_errors(make_scenario(dispersion=rl.Dispersion(**own)), "plate")
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((resolved.target.start_covariance - expected) / scale).max() < 1e-6
    rows = rl.Dispersion(target={"start": {"type": "covariance", "matrix": given.tolist()}})
    inline = resolve_start_errors(make_scenario(dispersion=rows), "plate").target
    assert np.abs((inline.start_covariance - expected) / scale).max() < 1e-6
    apart = rl.study.disperse(make_scenario(dispersion=rl.Dispersion(**own)), 100)
    shared = rl.study.disperse(make_scenario(dispersion=rl.Dispersion(**own, relative_to_target=True)), 100)
    for k, axis in enumerate(("radial", "along", "cross")):
        sigma_m = k + 1.0
        assert shared.tubes[f"{axis}_linear_sigma_m"][0] == pytest.approx(sigma_m, rel=1e-6)
        both = math.hypot(sigma_m, math.sqrt(given[k, k]))
        assert apart.tubes[f"{axis}_linear_sigma_m"][0] == pytest.approx(both, rel=1e-6)
        assert shared.tubes[f"{axis}_sigma_m"][0] == pytest.approx(sigma_m, rel=5.0 / math.sqrt(200.0))


@pytest.mark.parametrize(
    ("start", "problem"),
    [
        ({"file": "none.opm"}, r"dispersion\.start: .*none\.opm"),
        ({"file": "tle/flyby.cdm"}, r"dispersion\.start: .*has two objects"),
    ],
)
def test_a_message_that_states_no_covariance_is_refused_in_one_line(start, problem):
    errors = rl.Dispersion(start={"type": "covariance"} | start)
    with pytest.raises(rl.RsoLidarError, match=problem) as error:
        resolve_start_errors(make_scenario(dispersion=errors), "plate")
    assert "\n" not in str(error.value)


def test_a_covariance_of_another_instant_names_the_key_that_propagates_it():
    errors = rl.Dispersion(start={"type": "covariance", "file": "tle/flyby.cdm", "object": "OBJECT2"})
    scenario = make_scenario(dispersion=errors)
    later = scenario.replace(time=scenario.time.replace(start_utc=START + datetime.timedelta(minutes=1)))
    with pytest.raises(
        rl.RsoLidarError, match=r"does not cover .*; give one at the start, or set propagate = true"
    ) as error:
        resolve_start_errors(later, "plate")
    assert "beyond" not in str(error.value)


def test_a_covariance_of_another_object_is_warned_of():
    errors = rl.Dispersion(start={"type": "covariance", "file": "tle/flyby.cdm", "object": "OBJECT2"})
    with pytest.warns(rl.RsoLidarWarning, match="km from the body whose errors it states"):
        resolve_start_errors(make_scenario(dispersion=errors), "plate")


def test_kept_runs_are_not_those_of_other_element_sets(sets):
    scenario = make_scenario(dispersion=rl.Dispersion(start={"type": "element_sets", "file": str(sets)}))
    first = identify_runs(scenario, "plate")
    records = json.loads(sets.read_text(encoding="utf-8"))
    sets.write_text(json.dumps(records[:20]), encoding="utf-8")
    assert identify_runs(scenario, "plate") != first


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"start": {"type": "element_sets"}}, "file"),
        ({"start": {"type": "tle", "file": "a.tle"}}, "type"),
        ({"start": {"type": "element_sets", "file": "a.tle", "age": 1}}, "unknown key 'age'"),
        ({"start": {"type": "element_sets", "file": "a.tle", "age_days": -1}}, "age_days"),
        ({"start": {"type": "element_sets", "file": "a.tle", "name": "A", "norad_id": 5}}, "both choose the object"),
        ({"start": {"type": "element_sets", "file": "a.tle"}, "position_sigma_m": (1, 0, 0)}, "place of position_sigma_m"),
        ({"start": {"type": "element_sets", "file": "a.tle"}, "covariance": np.eye(6).tolist()}, "in place of covariance"),
        ({"start": {"type": "covariance"}}, "needs exactly one of file and matrix"),
        ({"start": {"type": "covariance", "file": "a.opm", "axes": "tnw"}}, "a file states its own"),
        ({"start": {"type": "covariance", "matrix": np.eye(6).tolist(), "object": "A"}}, "object: goes with file"),
        ({"start": {"type": "covariance", "matrix": (-np.eye(6)).tolist()}}, "matrix: is not positive semidefinite"),
        ({"cross_covariance": np.eye(6).tolist()}, "is with errors of the target, which has none"),
        ({"cross_covariance": np.eye(6).tolist(), "target": {}, "relative_to_target": True}, "give one of them"),
        ({"cross_covariance": np.eye(6).tolist(), "target": {}}, "more than the errors of follower and target allow"),
        ({"target": {"position_sigma_m": (-1, 0, 0)}}, "target.*a standard deviation is negative"),
        ({"target": {"attitude_sigma_deg": (-1, 0, 0)}}, "attitude_sigma_deg: a standard deviation is negative"),
        ({"target": {"attitude_sigma_deg": (0, 0, 90)}}, "attitude_sigma_deg: 90 is over 30"),
        ({"target": {"attitude_deg": (0, 0, 9)}}, "unknown key 'attitude_deg'"),
        ({"target": {"thrusters": {}}}, "unknown key 'thrusters'"),
    ],
)  # fmt: skip
def test_what_are_no_errors_of_a_target_is_refused_in_one_line(fields, problem):
    with pytest.raises(ScenarioError, match=problem) as error:
        rl.Dispersion(**fields)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"file": "none.tle"}, r"dispersion\.target\.start: no file 'none\.tle'"),
        ({"norad_id": 8}, r"dispersion\.target\.start: .*no object with norad_id 8"),
        ({"name": "OTHER"}, r"dispersion\.target\.start: .*OTHER"),
        ({"age_days": 30.0}, r"dispersion\.target\.start: .*age_days: 30 is beyond the known ages"),
    ],
)
def test_element_sets_that_state_nothing_are_refused_in_one_line(sets, changes, problem):
    errors = {"type": "element_sets", "file": str(sets)} | changes
    with pytest.raises(rl.RsoLidarError, match=problem) as error:
        rl.study.disperse(make_scenario(dispersion=rl.Dispersion(target={"start": errors})), 2)
    assert "\n" not in str(error.value)


def check_equal(first, second):
    for name, column in first.table.items():
        assert column.tobytes() == second.table[name].tobytes(), name
    for name, column in first.tubes.items():
        assert column.tobytes() == second.tubes[name].tobytes(), name


def test_an_executor_changes_no_bit(mission):
    with Elsewhere() as executor:
        check_equal(mission, rl.study.disperse(make_scenario(), 500, executor=executor))
        assert executor.submitted == 2
        with pytest.raises(ScenarioError, match=r"executor: needs an Executor of .* and no workers"):
            rl.study.disperse(make_scenario(), 500, executor=executor, workers=2)
    with pytest.raises(ScenarioError, match="executor: needs an Executor"):
        rl.study.disperse(make_scenario(), 500, executor=4)


def test_corrections_that_arrive_after_the_last_frame_are_made():
    """A run that ends before its plan has, up to there, the dispersions of a longer one."""
    scenario = make_filtered(rpo.NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.002))
    short, long = (
        rl.study.disperse(scenario.replace(time=scenario.time.replace(duration_s=duration_s)), 40)
        for duration_s in (1500, 3000)
    )
    ends = int(np.searchsorted(long.tubes["time_s"], short.tubes["time_s"][-1]))
    assert short.tubes["time_s"][-1] == long.tubes["time_s"][ends] < 1900.0
    assert np.ptp(short.table["delta_v_m_s"]) > 0.1
    for axis in ("radial", "along", "cross"):
        name = f"{axis}_linear_sigma_m"
        assert short.tubes[name][-1] == pytest.approx(long.tubes[name][ends], rel=1e-6)
