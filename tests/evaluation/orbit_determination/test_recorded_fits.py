"""Orbits from a recording: with the sensors that it has, against its truth, and what is refused."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

import rso_lidar as rl
from rso_lidar.errors import RecordingError
from rso_lidar.study import find_true_relative_state, fit_own_orbit, fit_relative_orbit
from rso_lidar.track.least_squares.fit_statistics import normalize_error
from tests.evaluation.orbit_determination.scenario_for_tests import EXAMPLES, load_small

LIMIT = chi2.ppf(0.999, 6)  # of the NEES of one fit


@pytest.fixture(scope="module")
def made(flown):
    return fit_relative_orbit(flown, forces=None, range_noise_m=0.05)


def test_the_relative_orbit_of_a_recording_has_its_covariance(made, flown):
    true = find_true_relative_state(flown, "stage", made.fit.epoch_s)
    assert np.allclose(true[0], [0.0, -60.0, 4.0]) and np.allclose(true[1], [0.02, -0.05, 0.0])
    assert made.fit.normalize_error(*true) < LIMIT
    assert np.linalg.norm(made.fit.position_m - true[0]) < 2.0 and np.linalg.norm(made.fit.sigma[:3]) < 2.0
    assert made.fit.offset_m[0] == pytest.approx(-1.3, abs=0.5)  # the near side of a stage of 3.9 m
    # The first flash has no samples of the star tracker before it, and the last none after it.
    assert made.n_frames == 20 and 18 <= made.fit.statistics.n_used <= 20


def test_its_own_orbit_has_its_covariance(made, flown):
    truth = flown[0].truth.states["follower"]
    true = np.concatenate([truth.position_m, truth.velocity_m_s])
    own = made.own.orbit
    assert own.epoch_s == made.fit.epoch_s == 0.0
    assert normalize_error(own.vector - true, own.covariance) < LIMIT
    alone = fit_own_orbit(flown, forces=None, epoch_s=0.0, sensor="gnss")
    assert np.allclose(alone.orbit.vector, own.vector, rtol=0, atol=1e-9)
    assert np.linalg.norm(own.position_m - true[:3]) < 5.0


def test_a_description_names_what_the_fit_rests_on(made):
    text = made.describe()
    for words in ("star tracker 'star_tracker'", "frames measure stage", "solutions of GNSS", "noise of the shape"):
        assert words in text


def test_the_truth_of_the_target_is_not_used(made, flown):
    def hide(frame):
        states = {"follower": frame.truth.states["follower"]}
        return dataclasses.replace(frame, truth=dataclasses.replace(frame.truth, states=states), labels=None)

    again = fit_relative_orbit([hide(frame) for frame in flown], forces=None, range_noise_m=0.05)
    assert np.array_equal(again.fit.position_m, made.fit.position_m)


def test_own_orbit_and_attitude_can_be_taken_as_known(made, flown):
    known = fit_relative_orbit(
        flown, "stage", forces=None, range_noise_m=0.05, known_orbit=True, known_attitude=True, shape=False,
        motion="hill", epoch_s=10.0,
    )  # fmt: skip
    assert known.own is None and known.attitude == "taken as known"
    assert "own orbit: taken as known" in known.describe() and "noise of the shape" not in known.describe()
    # Without the shape, the state is that of the visible middle, nearer to the follower by 1.3 m.
    true = find_true_relative_state(flown, "stage", 10.0)
    assert np.linalg.norm(true[0]) - np.linalg.norm(known.fit.position_m) == pytest.approx(1.3, abs=0.5)
    given = fit_relative_orbit(flown, forces=None, range_noise_m=0.05, own=made.own.orbit)
    assert np.allclose(given.fit.position_m, made.fit.position_m, atol=1e-9) and given.own is None
    assert find_true_relative_state(flown, "stage", 10.5) is None


def test_what_a_recording_lacks_is_said(flown):
    with pytest.raises(RecordingError, match="fit: the recording has no frames; record some"):
        fit_own_orbit([])
    with pytest.raises(RecordingError, match="no target named 'stag'; did you mean 'stage'"):
        fit_relative_orbit(flown, "stag")
    with pytest.raises(RecordingError, match="no gnss sensor 'gns'; did you mean 'gnss'"):
        fit_own_orbit(flown, sensor="gns")
    bare = list(rl.simulate(load_small().replace(sensor=()), frames=range(3)))
    with pytest.raises(RecordingError, match=r"no star tracker; record it .*known-attitude"):
        fit_relative_orbit(bare)
    with pytest.raises(RecordingError, match=r"no GNSS; record it .*known-orbit"):
        fit_relative_orbit(bare, known_attitude=True)
    with pytest.raises(RecordingError, match="no GNSS; record it with"):
        fit_own_orbit(bare)
    blind = [
        dataclasses.replace(
            frame,
            observation=dataclasses.replace(
                frame.observation,
                reading=dataclasses.replace(frame.observation.reading, range_m=np.full_like(frame.range_m, np.nan)),
            ),
        )
        for frame in bare
    ]
    with pytest.raises(RecordingError, match="no frame measures 'stage'"):
        fit_relative_orbit(blind, known_orbit=True, known_attitude=True, range_noise_m=0.05)


def test_burns_among_the_frames_are_refused():
    hops = {
        "type": "waypoints", "relative_to": "stage", "positions_m": [[0, -60, 0], [-5, -50, 0], [0, -40, 0]],
        "times_s": [0.0, 20.0, 39.0],
    }  # fmt: skip
    scenario = load_small().replace(sensor=())
    scenario = scenario.replace(follower=scenario.follower.replace(motion=rl.rpo.Waypoints(**hops)))
    frames = list(rl.simulate(scenario, frames=[8, 12]))
    with pytest.raises(
        RecordingError, match="the follower burns at 20 s, between the frames; give frames of one coast"
    ):
        fit_own_orbit(frames)


def test_a_local_world_has_no_orbits():
    scenario = rl.Scenario.load(EXAMPLES / "bench_plate.toml", ("lidar.receiver.n_rows=4", "lidar.receiver.n_cols=4"))
    with pytest.raises(RecordingError, match="local world, without orbits"):
        fit_own_orbit(list(rl.simulate(scenario, frames=[0])))
