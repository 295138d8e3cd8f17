"""Dispersed missions: repeatable, resumable, equal on workers, against Foster's probability, and refused in one line."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import rpo
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.collision.foster import disc_probability
from rso_lidar.study.dispersions import dispersed_mission
from rso_lidar.study.dispersions.dispersed_mission import nees_bounds

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
        lidar=rl.Lidar(preset="gsfl_1064"),
        dispersion=dispersion
        or rl.Dispersion(
            position_sigma_m=(5, 10, 5), velocity_sigma_m_s=(0.01, 0.005, 0.005),
            thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.02), energy_sigma_fraction=0.05, pointing_sigma_deg=0.2,
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def mission():
    return rl.study.disperse(make_scenario(), 500)


def test_runs_are_the_same_however_many_there_are_and_on_workers(mission):
    few = rl.study.disperse(make_scenario(), 300, workers=2)
    for name, column in few.table.items():
        assert column.tobytes() == mission.table[name][:300].tobytes(), name
    assert len(np.unique(mission.table["nearest_m"])) == 500


def test_an_interrupted_study_goes_on(mission, tmp_path, monkeypatch):
    flown = []

    def stop(made, begins, workers):
        for begin in begins:
            flown.append(begin)
            yield begin, made.fly(range(begin, begin + 250))
            if len(flown) == 1:
                raise KeyboardInterrupt

    monkeypatch.setattr(dispersed_mission, "_fly_blocks", stop)
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


def test_collisions_are_as_likely_as_foster_says():
    """A fly-past at 1 m/s, 30 m off, with 20 m of error across: linear for minutes, which Foster (1992) assumes."""
    passing = rpo.Hill(relative_to="plate", position_m=(30.0, -60.0, 0.0), velocity_m_s=(0.0, 1.0, 0.0))
    dispersion = rl.Dispersion(position_sigma_m=(20.0, 5.0, 15.0), hard_body_radius_m=15.0)
    scenario = make_scenario(passing, dispersion, duration_s=120.0, frame_rate_hz=1.0)
    made = rl.study.disperse(scenario, 20_000)
    share, low, high = made.probability("collision")
    path = np.stack([made.tubes[f"{axis}_m"] for axis in ("radial", "along", "cross")], axis=1)
    miss_m = path[np.argmin(np.linalg.norm(path, axis=1))]
    expected = disc_probability(miss_m[[0, 2]], np.diag([400.0, 225.0]), 15.0)  # the plane across the velocity
    assert expected == pytest.approx(share, abs=5.0 * (high - low) / 4.0)
    assert 0.05 < expected < 0.3


def test_spreads_are_those_of_flights_that_are_integrated_one_by_one():
    """30 flights of `flown`, whose guidance shoots by integration: the error of a standard deviation is 13 %; 4 of them.

    150 flights of examples/dispersed_hop.toml agreed within 11 % in each axis at five instants.
    """
    motion = rpo.Flown(
        plan=rpo.Hop(relative_to="plate", from_m=(0, -1000, 0), to_m=(0, -200, 0), duration_s=2500),
        thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0),
        guidance=rpo.TwoImpulseGuidance(at_s=(800.0, 1900.0)),
        navigation=rpo.NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.002),
    )
    made = rl.study.disperse(make_scenario(motion, rl.Dispersion()), 250)
    place = [int(np.argmin(np.abs(made.tubes["time_s"] - at_s))) for at_s in (1500.0, 2900.0)]
    time_s = made.tubes["time_s"][place]
    nominal = motion.without_random_errors().fly(START, CHIEF).relative(time_s)[0]
    flown = np.array([motion.with_seed(seed).fly(START, CHIEF).relative(time_s)[0] - nominal for seed in range(30)])
    linear = np.stack([made.tubes[f"{axis}_linear_sigma_m"][place] for axis in ("radial", "along", "cross")], axis=1)
    assert np.abs(flown.std(axis=0, ddof=1) / linear - 1.0).max() < 4.0 / np.sqrt(2.0 * 29.0)


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


def test_a_filter_is_dispersed_with_its_knowledge(tmp_path):
    """300 runs in two blocks; a standard deviation has a relative standard error of 4.1 %; 5 of them."""
    made = rl.study.disperse(make_filtered(), 300, working=tmp_path / "kept")
    again = rl.study.disperse(make_filtered(), 300, workers=2)
    assert made.tubes["nees"].tobytes() == again.tubes["nees"].tobytes()
    assert made.table["delta_v_m_s"].tobytes() == again.table["delta_v_m_s"].tobytes()
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
    kept = rl.study.disperse(make_filtered(), 300, working=tmp_path / "kept")
    assert kept.tubes["nees"].tobytes() == made.tubes["nees"].tobytes()


def test_filtered_spreads_are_those_of_flights_that_are_integrated_one_by_one():
    """30 flights of `flown` with filters of their own: the error of a standard deviation is 13 %; 4 of them."""
    scenario = make_filtered(FILTER).replace(dispersion=rl.Dispersion())
    motion = scenario.follower.motion
    made = rl.study.disperse(scenario, 250)
    place = [int(np.argmin(np.abs(made.tubes["time_s"] - at_s))) for at_s in (1500.0, 2900.0)]
    time_s = made.tubes["time_s"][place]
    nominal = motion.without_random_errors().fly(START, CHIEF).relative(time_s)[0]
    flown = np.array([motion.with_seed(seed).fly(START, CHIEF).relative(time_s)[0] - nominal for seed in range(30)])
    linear = np.stack([made.tubes[f"{axis}_linear_sigma_m"][place] for axis in ("radial", "along", "cross")], axis=1)
    assert np.abs(flown.std(axis=0, ddof=1) / linear - 1.0).max() < 4.0 / np.sqrt(2.0 * 29.0)


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
