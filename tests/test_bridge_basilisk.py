"""The bridge to Basilisk: its states are ours, and its wheels point the lidar. Needs `pip install bsk`, which is 270 MB."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl

kinematics = pytest.importorskip(
    "Basilisk.utilities.RigidBodyKinematics", reason="Basilisk is not installed: pip install bsk"
)

FILE = Path(__file__).resolve().parents[1] / "examples" / "bridges" / "basilisk" / "bridge.py"
DURATION_S = 20.0


@pytest.fixture(scope="module")
def example():
    return SimpleNamespace(**runpy.run_path(str(FILE), run_name="example"))


@pytest.fixture(scope="module")
def flown(example):
    """The scenario, the frames, and the recorded states of stage, servicer and wheels."""
    scenario = example.make_scenario(DURATION_S)
    return scenario, *example.fly(scenario, DURATION_S)


def message(sigma, omega=(0.0, 0.0, 0.0)):
    return SimpleNamespace(r_CN_N=[1.0, 2.0, 3.0], v_CN_N=[4.0, 5.0, 6.0], sigma_BN=list(sigma), omega_BN_B=list(omega))


def test_attitudes_are_those_of_basilisks_own_kinematics(example):
    random = np.random.default_rng(2)
    for _ in range(100):
        sigma, omega = random.normal(size=3), random.normal(size=3)  # beyond the unit sphere too: the shadow set
        state = example.HandedState()
        state.take(message(sigma, omega), 10.0)
        matrix = state.rotation.as_matrix()  # inertial_from_body
        np.testing.assert_allclose(matrix, kinematics.MRP2C(sigma).T, atol=1e-14)
        scalar_first = kinematics.MRP2EP(sigma)
        xyzw = state.rotation.as_quat()
        np.testing.assert_allclose(
            xyzw * np.sign(xyzw[3]), np.roll(scalar_first, -1) * np.sign(scalar_first[0]), atol=1e-14
        )
        # the rate: its own kinematic equation gives the attitude a moment later, and so does the bridge
        step_s = 1e-5
        later = sigma + kinematics.dMRP(sigma, omega) * step_s
        turned = state.orient(SimpleNamespace(epochs=SimpleNamespace(time_s=np.array([10.0 + step_s])))).rotation[0]
        error = (Rotation.from_mrp(later).inv() * turned).magnitude()
        assert error < 20.0 * (np.linalg.norm(omega) * (1.0 + np.linalg.norm(sigma)) * step_s) ** 2


def test_frames_are_those_of_a_scenario_that_flies_basilisks_table(flown, tmp_path):
    scenario, frames, (stage, servicer, _) = flown
    places = {}
    for name, states in (("stage", stage), ("servicer", servicer)):
        time_s = states.times() * 1e-9
        assert len(time_s) == len(frames) == scenario.time.n_frames == 40
        quaternion = np.array([np.roll(kinematics.MRP2EP(sigma), -1) for sigma in states.sigma_BN])
        quaternion[1:] *= np.cumprod(np.sign(np.sum(quaternion[1:] * quaternion[:-1], axis=1)))[:, None]
        rows = np.column_stack([time_s, states.r_CN_N, quaternion]).tolist()
        text = ["time_s,x_m,y_m,z_m,qx,qy,qz,qw", *(",".join(map(repr, row)) for row in rows)]
        places[name] = tmp_path / f"{name}.csv"
        places[name].write_text("\n".join(text) + "\n")
    target = scenario.target[0].replace(motion=rl.motion.Table(file=str(places["stage"])), attitude=None)
    follower = scenario.follower.replace(motion=rl.motion.Table(file=str(places["servicer"])), attitude=None)
    for ours, theirs in zip(frames, rl.simulate(scenario.replace(target=(target,), follower=follower)), strict=True):
        a, b = (frame.truth.pose("lidar", "stage") for frame in (ours, theirs))
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-7)  # 7e6 m in float64
        np.testing.assert_allclose(a.rotation.as_matrix(), b.rotation.as_matrix(), atol=1e-12)
        # The same noise on the same light; a ray may meet an edge on its other side
        same = ours.intensity_counts == theirs.intensity_counts
        assert same.mean() > 0.999 and ours.valid.sum() > 100
        np.testing.assert_allclose(ours.range_m[same], theirs.range_m[same], atol=1e-4)


def test_the_stage_is_where_basilisk_says(flown):
    _, frames, (stage, servicer, _) = flown
    for k, frame in enumerate(frames):
        to_body = kinematics.MRP2C(servicer.sigma_BN[k])
        ahead, left, up = to_body @ (stage.r_CN_N[k] - servicer.r_CN_N[k])
        np.testing.assert_allclose(frame.truth.pose("lidar", "stage").translation, [-left, -up, ahead], atol=1e-7)
        rate = frame.truth.rates("inertial", "stage")[1]
        np.testing.assert_allclose(np.linalg.norm(rate), np.linalg.norm(stage.omega_BN_B[k]), rtol=1e-9)


def test_wheels_turn_the_lidar_to_the_stage_by_its_readings(example, flown):
    _, frames, (_, _, wheels) = flown
    off_deg = []
    for frame in frames:
        centre = np.median(frame.points_m[frame.valid], axis=0)
        off_deg.append(np.arctan2(np.hypot(*centre[:2]), centre[2]) / rl.units.DEG)
    assert off_deg[0] > 2.0
    assert max(off_deg[-6:]) < 0.5
    assert np.abs(np.array(wheels.wheelSpeeds)[-1, :3]).max() > 0.1  # rad/s


def test_the_example_prints_what_it_flew(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["bridge.py", "5.5"])
    runpy.run_path(str(FILE), run_name="__main__")
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["0.0", "5.0"]
