"""The navigator on a flown scenario: what it estimates, when it starts, latencies, outages, and messages."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import sensors, track
from rso_lidar.errors import ScenarioError

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "tumbling_inspection.toml"
PARTS = {
    "gyro": sensors.Gyro(name="gyro", preset="stim300_gyro", rate_hz=10.0, scale_factor_ppm=0.0, misalignment_mrad=0.0),
    "star_tracker": sensors.StarTracker(
        name="tracker", preset="nst", rate_hz=2.0, mount={"euler_zyx_deg": (0.0, -90.0, 0.0)}, sun_exclusion_deg=0.0,
        moon_exclusion_deg=0.0, earth_exclusion_deg=0.0,
    ),
    "gnss": sensors.Gnss(name="gnss", preset="oem719", outages=[{"from_s": 5.0, "to_s": 8.0}]),
    "relative_gnss": sensors.RelativeGnss(name="relative", preset="carrier_phase", target="stage"),
}  # fmt: skip
QUIET = {
    "oblate": False,
    "own_acceleration_m_s2_sqrt_hz": 1e-5,
    "target_acceleration_m_s2_sqrt_hz": 1e-5,
    "centroid_m": 2.0,
}


@pytest.fixture(scope="module")
def flown():
    base = rl.Scenario.load(EXAMPLE)
    lidar = base.lidar.replace(
        detector=rl.Empirical(armed_to_m=500.0), receiver=base.lidar.receiver.replace(rays_per_pixel=1)
    )
    scenario = base.replace(
        time=base.time.replace(duration_s=14.0, frame_rate_hz=1.0), sensor=tuple(PARTS.values()), lidar=lidar
    )
    return scenario, list(rl.simulate(scenario, threads=1))


def fix_of(scenario, frame):
    return track.locate_centroid(frame.points_m, pixel_rad=scenario.instrument.receiver.ifov_rad, gate_m=14.0)


def errors(frame, estimate):
    """Return the errors of an estimate, in the order of its covariance."""
    own, other = frame.truth.states["follower"], frame.truth.states["stage"]
    turned = frame.truth.poses.link("inertial", "follower").matrix
    return np.concatenate(
        [
            own.position_m - estimate.position_m,
            own.velocity_m_s - estimate.velocity_m_s,
            other.position_m - own.position_m - estimate.relative_position_m,
            other.velocity_m_s - own.velocity_m_s - estimate.relative_velocity_m_s,
            Rotation.from_matrix(estimate.inertial_from_body.T @ turned).as_rotvec(),
        ]
    )


@pytest.mark.parametrize("sees", ["relative GNSS", "the lidar"])
def test_estimates_agree_with_the_truth_within_their_covariance(flown, sees):
    scenario, frames = flown
    parts = (
        PARTS if sees == "relative GNSS" else {name: part for name, part in PARTS.items() if name != "relative_gnss"}
    )
    navigate = track.Navigator(**parts, mount=scenario.lidar.mount, **QUIET)
    estimates = [navigate(frame.observation, fix_of(scenario, frame)) for frame in frames]
    assert estimates[0] is None  # the first attitude arrives later
    for frame, estimate in list(zip(frames, estimates, strict=True))[2:]:
        assert estimate.time_s == frame.time_s
        wrong = errors(frame, estimate)
        assert wrong @ np.linalg.solve(estimate.covariance, wrong) < 45.0  # chi-square of 15: 1e-4 above 45
    sigma = np.sqrt(np.diag(estimates[-1].covariance))
    assert (sigma[:3] < 1.5).all() and (sigma[12:] < 2e-4).all()
    assert (sigma[6:9] < (0.1 if sees == "relative GNSS" else 1.3)).all()
    sources = {update.source for update in navigate.updates}
    assert sources == {part.name for part in parts.values()} - {"gyro"} | {"lidar"}
    used = [update.time_s for update in navigate.updates if update.source == "gnss"]
    assert not [time_s for time_s in used if 5.0 <= time_s < 8.0]  # its outage


def test_measurements_enter_in_the_order_of_their_instants_however_late_they_arrive(flown):
    scenario, frames = flown
    navigate = track.Navigator(**PARTS, mount=scenario.lidar.mount, **QUIET)
    for frame in frames:
        navigate(frame.observation, fix_of(scenario, frame))
    times = [update.time_s for update in navigate.updates]
    assert times == sorted(times)
    late = PARTS["star_tracker"].latency_s
    assert late > 0.0 and times[-1] <= frames[-1].time_s - late  # what is newer is used in the estimate, but not kept


def test_a_pointed_lidar_sees_the_target_where_it_is(flown):
    """A fix through PTU and mount leads to the target in body axes, as the tree of axes says."""
    frame = flown[1][3]
    ptu = rl.Ptu(mount={"position_m": (0.2, 0.1, 0.4), "euler_zyx_deg": (20.0, 0.0, 0.0)})
    mount = rl.Mount(position_m=(0.05, 0.0, 0.02), euler_zyx_deg=(0.0, 10.0, 0.0))
    navigate = track.Navigator(**PARTS, ptu=ptu, mount=mount, **QUIET)
    pan_tilt = np.array([0.3, -0.2])
    poses = rl.motion.add_lidar(frame.truth.poses, ptu, pan_tilt, np.zeros(2), mount)
    seen = poses.pose("lidar", "stage").translation
    fix = track.Fix(seen, np.eye(3) * 1e-4, seen[None], 1.0)
    observation = rl.Observation(
        frame.time_s, frame.observation.reading, frame.observation.settings, frame.observation.line_of_sight, pan_tilt
    )
    position, _, turned, origin = navigate._place(observation, fix)
    body = turned @ position + origin
    np.testing.assert_allclose(body, poses.pose("follower", "stage").translation, atol=1e-9)


def test_an_observation_without_the_sensor_is_an_error(flown):
    scenario, frames = flown
    other = PARTS["gnss"].replace(name="gps")
    with pytest.raises(ScenarioError, match="no sensor 'gps'"):
        track.Navigator(**{**PARTS, "gnss": other})(frames[1].observation)
    with pytest.raises(ScenarioError, match="leave out ptu"):
        track.Navigator(**PARTS, ptu=rl.Ptu())(frames[1].observation, fix_of(scenario, frames[1]))


def test_samples_that_come_late_are_an_error():
    zero = np.zeros(3)
    estimate = track.NavigationEstimate(5.0, np.array([7e6, 0.0, 0.0]), zero, zero, zero, np.eye(3), np.eye(15))
    navigation = track.NavigationFilter(estimate, gyro=PARTS["gyro"])
    navigation.add_rate(5.0, zero)
    with pytest.raises(ScenarioError, match="comes late"):
        navigation.add_rate(5.0, zero)
    with pytest.raises(ScenarioError, match="cannot go back"):
        navigation.predict(4.0)
    with pytest.raises(ScenarioError, match="has no gnss"):
        navigation.update_position(5.0, zero, zero)


def test_the_error_of_an_attitude_turns_with_the_body():
    """It is fixed in inertial axes: after a turn of 30 degrees about z, its axes in the body have turned back by as much."""
    zero, angle = np.zeros(3), np.pi / 6.0
    spread = np.diag([1e-2] * 12 + [4.0, 1.0, 2.0])
    estimate = track.NavigationEstimate(0.0, np.array([7e6, 0.0, 0.0]), zero, zero, zero, np.eye(3), spread)
    gyro = sensors.Gyro(name="gyro", rate_hz=1.0)
    navigation = track.NavigationFilter(estimate, gyro=gyro)
    navigation.add_rate(0.0, np.array([0.0, 0.0, angle]))
    turned = navigation.estimate(1.0)
    rotation = Rotation.from_euler("z", angle).as_matrix()
    np.testing.assert_allclose(turned.inertial_from_body, rotation, atol=1e-12)
    np.testing.assert_allclose(turned.covariance[12:, 12:], rotation.T @ spread[12:, 12:] @ rotation, atol=1e-12)
