"""The reference controller in a loop of its own: a disc of returns that drifts, false triggers, a real drive."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FixedPoint, Mount, PointingErrors, Ptu, SecondOrder, sense, start, step
from rso_lidar.motion.gimbal.demand import find_pan_tilt
from rso_lidar.records import Command, Observation, Reading
from rso_lidar.track import Pointing, find_cluster
from rso_lidar.units import DEG

N = 64
FOV = 2.5 * DEG
PTU_FROM_OPTICAL = np.array(
    [[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]
)  # z ahead, x right, y down in x forward, y left, z up
_TAN = (np.arange(N) + 0.5 - N / 2) * 2 * np.tan(FOV / 2) / N
_RAYS = np.stack([*np.meshgrid(_TAN, _TAN), np.ones((N, N))], axis=-1)  # columns go right, rows down
LINE_OF_SIGHT = _RAYS / np.linalg.norm(_RAYS, axis=-1, keepdims=True)


def seen(direction, rng, *, range_m=1500.0, radius=0.1 * DEG, false=0.005):
    """Return a reading of a disc toward `direction` (3,) in lidar axes, with false triggers uniform to 5 km."""
    on = LINE_OF_SIGHT @ direction > np.cos(radius)
    ranges = np.where(rng.random((N, N)) < false, rng.uniform(0, 5000, (N, N)), np.nan)
    hit = on & (rng.random((N, N)) < 0.9)
    ranges = np.where(hit, range_m + rng.normal(0, 2.0, (N, N)), ranges)
    return Reading(ranges, np.isfinite(ranges) * 100, np.zeros((N, N)))


def observe(time_s, reading, pan_tilt_rad):
    return Observation(time_s, reading, {}, LINE_OF_SIGHT, np.asarray(pan_tilt_rad, dtype=float))


def turned(pan, tilt):
    return Rotation.from_euler("ZY", [pan, -tilt])


def fly(controller, target, *, seconds, rate_hz=10.0, ptu=None, seed=1, mount=None, blind=(), command_rate_hz=None):
    """Return the angle [rad] between boresight and target at each flash; `target(time_s)` gives pan and tilt [rad]."""
    ptu = ptu or Ptu(response=SecondOrder(natural_hz=4, damping=0.7, max_rate_deg_s=30))
    demand = FixedPoint().demand
    ptu_from_lidar = (mount or Mount()).rotation * Rotation.from_matrix(PTU_FROM_OPTICAL)
    rng, head, command, off = np.random.default_rng(seed), start(ptu, demand), None, []
    for k in range(int(seconds * rate_hz)):
        time_s = k / rate_hz
        head = step(ptu, head, demand, time_s, command)
        pointing = sense(ptu, head, rng)
        toward = turned(*target(time_s)).apply([1.0, 0.0, 0.0])
        direction = (turned(*pointing.actual_rad) * ptu_from_lidar).inv().apply(toward)
        off.append(np.arccos(min(direction[2], 1.0)))
        hidden = any(low <= time_s < high for low, high in blind)
        reading = seen(np.array([0.0, 0.0, -1.0]) if hidden else direction, rng)
        command = controller(observe(time_s, reading, pointing.measured_rad)) if controller else None
        for j in range(1, round((command_rate_hz or 0) / rate_hz)):
            between_s = time_s + j / command_rate_hz
            head = step(ptu, head, demand, between_s, command)
            command = controller.command_at(between_s, {})
    return np.array(off)


def drift(time_s):
    return 0.3 * DEG * time_s, 0.3 * DEG * np.sin(0.2 * time_s)


@pytest.mark.parametrize("alpha", [0.8, 0.3])
def test_a_step_of_the_target_moves_angle_and_rate_by_benedict_and_bordner(alpha):
    """After 60 flashes at rest beta is alpha² / (2 − alpha): of a step the next demand has alpha + beta, at one interval."""
    on = LINE_OF_SIGHT @ [0.0, 0.0, 1.0] > np.cos(0.1 * DEG)
    disc = Reading(np.where(on, 1500.0, np.nan), on * 100, np.zeros((N, N)))
    controller = Pointing(alpha=alpha)
    for k in range(60):
        controller(observe(0.2 * k, disc, (0.0, 0.0)))
    command = controller(observe(0.2 * 60, disc, (0.01, -0.02)))
    share = alpha + alpha**2 / (2.0 - alpha)
    assert [command.pan_rad, command.tilt_rad] == pytest.approx([share * 0.01, share * -0.02], rel=1e-9)


def test_without_it_a_drifting_target_is_lost_and_with_it_held():
    assert fly(None, drift, seconds=10)[-1] > FOV / 2  # 3 deg away: out of the field
    off = fly(Pointing(), drift, seconds=300, rate_hz=5)
    assert off[5:].max() < 0.2 * FOV


def test_commands_between_the_flashes_take_the_stairs_out_of_the_demand():
    """A second-order drive lags a ramp by 2 damping / omega; with one command for each flash it is at rest, and leads."""
    ptu = Ptu(response=SecondOrder(natural_hz=2.0, damping=0.7))
    lead_s = 2.0 * 0.7 / (2.0 * np.pi * 2.0)
    stairs, ramp = (
        fly(
            Pointing(lead_s=lead_s),
            lambda time_s: (0.3 * DEG * time_s, 0.0),
            seconds=60,
            rate_hz=1.0,
            ptu=ptu,
            command_rate_hz=rate_hz,
        )[30:].mean()
        for rate_hz in (None, 100.0)
    )
    assert stairs == pytest.approx(0.3 * DEG * lead_s, rel=0.1)
    assert ramp < 0.25 * stairs  # the noise of the filtered angles


def test_misalignment_jitter_and_encoder_noise_are_lived_with():
    errors = PointingErrors(
        misalignment_deg=(0.3, -0.2),
        jitter_deg=0.01,
        encoder_noise_deg=0.01,
        encoder_resolution_deg=0.005,
        command_latency_s=0.02,
    )
    ptu = Ptu(response=SecondOrder(natural_hz=4, damping=0.7, max_rate_deg_s=30), errors=errors)
    off = fly(Pointing(), drift, seconds=60, ptu=ptu)
    assert off[20:].max() < 0.2 * FOV


@pytest.mark.parametrize("euler_zyx_deg", [(0, 0, 90), (3, -4, 10), (-40, 30, 180), (170, -8, 0)])
def test_it_knows_how_the_lidar_is_mounted(euler_zyx_deg):
    mount = Mount(euler_zyx_deg=euler_zyx_deg)
    pan, tilt = find_pan_tilt(mount.rotation.apply([1.0, 0.0, 0.0]))  # where the boresight is at zero
    off = fly(Pointing(mount=mount), lambda t: (pan + 0.3 * DEG * t, tilt + 0.2 * DEG * t), seconds=20, mount=mount)
    assert off[10:].max() < 0.05 * FOV
    with pytest.raises(ScenarioError, match="tilt axis"):
        Pointing(mount=Mount(euler_zyx_deg=(90, 0, 0)))


def test_a_lost_target_is_followed_at_its_last_rate_then_given_up():
    off = fly(Pointing(coast_s=3.0), lambda t: (0.3 * DEG * t, 0.0), seconds=20, blind=[(10.0, 12.0)])
    assert off[100:].max() < 0.2 * FOV  # 0.6 deg of drift bridged, found again

    controller, rng = Pointing(coast_s=1.0), np.random.default_rng(3)
    ahead, away = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    for k in range(10):
        command = controller(observe(0.1 * k, seen(ahead, rng), (0.01 * k, 0.0)))
    assert command.pan_rad == pytest.approx(0.1, abs=2e-3)  # at 0.9 s 0.09, and 0.1 at the next flash
    later = [controller(observe(0.1 * k, seen(away, rng), (0.0, 0.0))) for k in range(10, 25)]
    assert later[4].pan_rad == pytest.approx(0.15, abs=4e-3)
    assert later[-1] == Command()
    again = controller(observe(2.6, seen(ahead, rng), (1.0, 0.2)))  # nothing is left of the old track
    assert (again.pan_rad, again.tilt_rad) == pytest.approx((1.0, 0.2), abs=2e-3)


def test_false_triggers_alone_are_never_followed():
    controller, rng = Pointing(), np.random.default_rng(4)
    nothing = np.array([0.0, 0.0, -1.0])
    for k in range(300):
        assert controller(observe(0.1 * k, seen(nothing, rng, false=0.01), (0.0, 0.0))) == Command()


def test_right_and_down_in_the_frame_are_right_and_down_of_the_ptu():
    rng = np.random.default_rng(5)
    right = np.array([np.sin(0.5 * DEG), 0.0, np.cos(0.5 * DEG)])
    down = np.array([0.0, np.sin(0.5 * DEG), np.cos(0.5 * DEG)])
    centroid = 0.1 * DEG  # a disc of few pixels, some dark: its mean lies well within its radius
    command = Pointing()(observe(0.0, seen(right, rng), (0.0, 0.0)))
    assert (command.pan_rad, command.tilt_rad) == pytest.approx((-0.5 * DEG, 0.0), abs=centroid)
    command = Pointing()(observe(0.0, seen(down, rng), (0.2, 0.0)))
    assert (command.pan_rad, command.tilt_rad) == pytest.approx((0.2, -0.5 * DEG), abs=centroid)


def test_pan_runs_on_past_a_turn():
    controller, rng = Pointing(), np.random.default_rng(6)
    ahead = np.array([0.0, 0.0, 1.0])
    for k in range(200):
        command = controller(observe(0.1 * k, seen(ahead, rng), (0.05 * k, 0.0)))
        assert command.pan_rad == pytest.approx(0.05 * (k + 1), abs=0.06 if k < 1 else 5e-3)


def test_the_fullest_window_of_neighbours_is_the_cluster():
    ranges = np.full((8, 8), np.nan)
    ranges[1, 1:4] = 500.0, 505.0, 509.0  # three together
    ranges[5:7, 5:7] = 900.0  # four together
    ranges[3, 7] = 899.0  # alone at that range: a false trigger
    ranges[5, 4] = 100.0  # beside the target, at another range
    reading = Reading(ranges, np.zeros((8, 8)), np.zeros((8, 8)))
    found = find_cluster(reading, 10.0, 3)
    assert found.sum() == 4
    assert found[5:7, 5:7].all()
    assert not find_cluster(reading, 10.0, 5).any()
    empty = Reading(np.full((8, 8), np.nan), np.zeros((8, 8)), np.zeros((8, 8)))
    assert not find_cluster(empty, 10.0, 1).any()


def test_it_refuses_what_it_cannot_do():
    with pytest.raises(ScenarioError, match="gate_m > 0"):
        Pointing(gate_m=0.0)
    blind = Observation(0.0, seen(np.array([0, 0, 1.0]), np.random.default_rng(7)), {}, LINE_OF_SIGHT, None)
    with pytest.raises(ScenarioError, match=r"\[ptu\]"):
        Pointing()(blind)
