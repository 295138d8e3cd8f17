"""The walk as a whole: the same frames however they are asked for, and the one way back that there is."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import truth


@pytest.fixture(scope="module")
def scenario():
    settings = ("lidar.receiver.n_rows=32", "lidar.receiver.n_cols=32", "time.frame_rate_hz=0.01")
    return rl.Scenario.load("examples/tdrs_approach.toml", settings)


def same(a, b):
    for name in ("range_m", "intensity_counts", "saturated"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("range_m", "photons", "facet", "cos_incidence"):
        np.testing.assert_array_equal(getattr(a.labels, name), getattr(b.labels, name))
    np.testing.assert_array_equal(a.truth.pose("lidar", "tdrs").as_matrix(), b.truth.pose("lidar", "tdrs").as_matrix())
    np.testing.assert_array_equal(a.truth.pointing.measured_rad, b.truth.pointing.measured_rad)


def test_a_frame_is_the_same_alone_in_a_slice_and_with_any_threads(scenario):
    whole = list(rl.simulate(scenario, threads=2))
    assert [frame.index for frame in whole] == list(range(27))
    same(next(rl.simulate(scenario, frames=[20], threads=1)), whole[20])
    for frame in rl.simulate(scenario, frames=slice(24, None), threads=5):
        same(frame, whole[frame.index])


def test_a_frame_holds_what_it_says(scenario):
    frame = next(rl.simulate(scenario, frames=[26], keep=("rays", "hits", "photons")))
    assert frame.range_m.shape == frame.intensity_counts.shape == frame.valid.shape == (32, 32)
    assert frame.points_m.shape == (32, 32, 3)
    np.testing.assert_allclose(
        np.linalg.norm(frame.points_m[frame.valid], axis=1), frame.range_m[frame.valid], rtol=1e-6
    )
    assert np.isnan(frame.range_m[~frame.valid]).all()
    assert (frame.intensity_counts[frame.valid] >= 1).all()
    assert (frame.intensity_counts[~frame.valid] == 0).all()
    assert set(frame.kept) == {"rays", "hits", "photons"}
    with pytest.raises(ValueError, match="read-only"):
        frame.range_m[0, 0] = 1.0


def test_a_pose_goes_through_the_tree_in_the_order_of_equation_5(scenario):
    truth = next(rl.simulate(scenario, frames=[9])).truth
    chain = (
        truth.pose("lidar", "ptu")
        * truth.pose("ptu", "follower")
        * truth.pose("follower", "inertial")
        * truth.pose("inertial", "tdrs")
    )
    # Through inertial coordinates float64 is 7 nm coarse at 42,000 km, and a rotation of 1e-16 moves as much: 50 nm.
    np.testing.assert_allclose(truth.pose("lidar", "tdrs").as_matrix(), chain.as_matrix(), atol=5e-8)


def test_rates_are_the_change_of_the_pose(scenario):
    fine = scenario.replace(time=scenario.time.replace(frame_rate_hz=100.0, duration_s=0.1), ptu=None)
    before, now, after = (frame.truth for frame in rl.simulate(fine, frames=[3, 4, 5]))
    velocity, turning = now.rates("lidar", "tdrs")
    moved = after.pose("lidar", "tdrs").translation - before.pose("lidar", "tdrs").translation
    np.testing.assert_allclose(velocity, moved / 0.02, atol=1e-6)  # 20 nm over 20 ms
    turned = (before.pose("lidar", "tdrs").rotation.inv() * after.pose("lidar", "tdrs").rotation).as_rotvec()
    # rtn turns with r x v / r², by convention; the slow turn of a geosynchronous orbit's plane, 1e-9 rad/s, is left out.
    np.testing.assert_allclose(turning, turned / 0.02, atol=3e-9)


class TestController:
    def test_it_sees_no_truth_and_commands_the_next_flash(self, scenario):
        fast = scenario.replace(
            time=scenario.time.replace(frame_rate_hz=10.0, duration_s=0.5),
            ptu=scenario.ptu.replace(response=rl.Ideal()),
        )
        seen = []

        def controller(observation):
            seen.append(observation)
            assert not hasattr(observation, "truth")
            assert not hasattr(observation, "labels")
            return rl.Command(pan_rad=0.01 * len(seen))

        frames = list(rl.simulate(fast, controller=controller))
        assert len(seen) == 5
        pans = [frame.truth.pointing.actual_rad[0] for frame in frames]
        np.testing.assert_allclose(pans[1:], [0.01, 0.02, 0.03, 0.04], atol=1e-12)
        open_loop = list(rl.simulate(fast))
        same(frames[0], open_loop[0])
        # What is not commanded keeps the scenario's demand.
        np.testing.assert_allclose(
            [frame.truth.pointing.actual_rad[1] for frame in frames],
            [frame.truth.pointing.actual_rad[1] for frame in open_loop],
            atol=1e-12,
        )

    def test_with_a_choice_of_frames_it_is_refused(self, scenario):
        with pytest.raises(ScenarioError, match="controller"):
            rl.simulate(scenario, controller=lambda _: None, frames=[3])

    def test_without_a_ptu_there_is_nothing_to_command(self, scenario):
        bare = scenario.replace(ptu=None)
        with pytest.raises(ScenarioError, match=r"\[ptu\]"):
            list(rl.simulate(bare, controller=lambda _: rl.Command(pan_rad=0.0)))
        assert len(list(rl.simulate(bare.replace(time=bare.time.replace(duration_s=200.0)), lambda _: None))) == 2


@pytest.mark.parametrize("frames", [[27], [-1], [3, 3], [5, 4], [], slice(30, 40)])
def test_frames_that_are_not_there(scenario, frames):
    with pytest.raises(ScenarioError, match="0 to 26"):
        rl.simulate(scenario, frames=frames)


def test_unknown_records_to_keep(scenario):
    with pytest.raises(ScenarioError, match=r"known: .*waveforms"):
        rl.simulate(scenario, keep=["wave"])
    fast = scenario.replace(lidar=scenario.lidar.replace(detector=rl.Empirical()))
    with pytest.raises(ScenarioError, match=r"lidar.detector.type = .gsfl."):
        rl.simulate(fast, keep=["waveforms"])


def test_no_target_is_no_error(scenario):
    settings = ("target=[]", 'ptu.point={ type = "fixed" }', 'follower.motion={ type = "tle", file = "tle/tdrs.tle" }')
    empty = rl.Scenario.load("examples/tdrs_approach.toml", (*settings, "time.duration_s=10"))
    (frame,) = list(rl.simulate(empty, frames=[0]))
    assert (frame.labels.target == -1).all()


ORBIT = rl.Kepler(
    epoch_utc=datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC),
    semi_major_axis_km=7000,
    eccentricity=0.01,
    inclination_deg=98,
    raan_deg=10,
    argument_of_perigee_deg=20,
    true_anomaly_deg=30,
)
MOTIONS = {
    "tle": rl.Tle(file="tle/flyby.tle", norad_id=99002),
    "kepler": ORBIT,
    "state": rl.State(
        epoch_utc=datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC),
        position_m=(7e6, 1e5, 2e5),
        velocity_m_s=(10, 7500, 300),
    ),
    "hill": rl.Hill(relative_to="chief", position_m=(10, -100, 20), velocity_m_s=(0.01, 0.1, 0.02)),
    "fixed": rl.Fixed(position_m=(1, 2, 3), relative_to="chief"),
}
ATTITUDES = {
    "none": None,
    "fixed": rl.FixedAttitude(euler_zyx_deg=(10, 20, 30)),
    "rtn": rl.Rtn(euler_zyx_deg=(10, 20, 30)),
    "lvlh_ccsds": rl.LvlhCcsds(euler_zyx_deg=(10, 20, 30)),
    "look_at": rl.LookAt(at="other"),
    "spin": rl.Spin(axis=(1, 2, 3), rate_deg_s=3),
    "tumble": rl.Tumble(inertia_kg_m2=(1, 2, 2.5), body_rate_deg_s=(1, 5, 0.1)),
}


@pytest.mark.parametrize("attitude", ATTITUDES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_an_epoch_has_the_same_bits_alone_and_among_many(motion, attitude):
    """Frame k depends on (scenario, seed, k) only: so must every pose and rate, whatever a library does with batches."""
    if motion == "fixed" and attitude in ("rtn", "lvlh_ccsds"):
        pytest.skip("a body that does not orbit has no rtn axes")
    bodies = [
        rl.Body(name="chief", motion=ORBIT, attitude=rl.Rtn()),
        rl.Body(name="other", motion=rl.Hill(relative_to="chief", position_m=(5, 300, -7), velocity_m_s=(0, 0, 0))),
        rl.Body(name="body", motion=MOTIONS[motion], attitude=ATTITUDES[attitude]),
    ]
    epochs = rl.Epochs(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), np.arange(50) * 7.3)
    course = truth(bodies, epochs)
    for k in (0, 17, 49):
        alone, among = truth(bodies, epochs.at([k])).at(0), course.at(k)
        for name in among.poses:
            one, many = alone.poses.link("chief", name), among.poses.link("chief", name)
            np.testing.assert_array_equal(one.pose.as_matrix(), many.pose.as_matrix(), err_msg=name)
            np.testing.assert_array_equal(one.velocity_m_s, many.velocity_m_s, err_msg=name)
            np.testing.assert_array_equal(one.angular_velocity_rad_s, many.angular_velocity_rad_s, err_msg=name)
        np.testing.assert_array_equal(alone.sun_direction, among.sun_direction)
        np.testing.assert_array_equal(alone.states["body"].velocity_m_s, among.states["body"].velocity_m_s)
