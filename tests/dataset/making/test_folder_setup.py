"""Optional labels in shards: keypoints by the arrays beside them, and normals of a plate and of a sphere."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.dataset.training.augmentation import turn_frame
from tests.dataset.bench_for_tests import CAMERA, make_spec


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Return the dataset, and all frames of its training split."""
    folder = tmp_path_factory.mktemp("labels")
    wanted = {"keypoints": True, "normals": True, "prediction": False}
    near = {"range_m": {"type": "uniform", "low": 60, "high": 120}}
    spec = make_spec(folder, set=(CAMERA,), draws=1, labels=wanted, view=near)
    dataset = rl.dataset.make(spec, folder / "made", workers=1)
    split = dataset.split("train")
    return dataset, [split[k] for k in range(len(split))]


def of_lidar(frame):
    """Return what the shard holds of the lidar, which alone is turned."""
    return {name: array for name, array in frame.items() if not name.startswith("camera.")}


@pytest.mark.parametrize("sensor", ["", "camera.nav."], ids=["lidar", "camera"])
def test_keypoints_of_a_shard_are_those_of_its_pose_and_its_pinhole(frames, sensor):
    dataset, split = frames
    rows, cols = split[0][f"{sensor}target"].shape
    counts = [len(names) for names in dataset.keypoints]
    assert dict(zip(dataset.models, counts, strict=True)) == {"plate": 8, "sphere": 0, "capsule": 8}
    seen = 0
    for frame in split:
        model = int(frame["model_id"])
        if model < 0 or not counts[model]:
            assert np.isnan(frame[f"{sensor}keypoint_px"]).all() and not frame[f"{sensor}keypoint_visibility"].any()
            continue
        entry = rl.scene.model(dataset.models[model])
        assert dataset.keypoints[model] == tuple(point.name for point in entry.keypoints)
        body = np.array([point.position_m for point in entry.keypoints]) - entry.center_of_mass_m
        x, y, z = (Rotation.from_quat(frame[f"{sensor}quaternion_xyzw"]).apply(body) + frame[f"{sensor}position_m"]).T
        fx, fy, cx, cy = frame[f"{sensor}intrinsics_px"]
        expected = np.stack([fy * y / z + cy, fx * x / z + cx], axis=1)
        inside = frame[f"{sensor}keypoint_visibility"] > 0
        assert np.array_equal(inside, ((expected > -0.5) & (expected < [rows - 0.5, cols - 0.5])).all(axis=1))
        assert frame[f"{sensor}keypoint_px"][inside] == pytest.approx(expected[inside], abs=1e-5)  # float32
        seen += int(inside.sum())
    assert seen >= 10


def test_normals_of_a_sphere_are_its_radii_and_turn_with_the_image(frames):
    """A pixel may show 0.3 m of a sphere of 1 m, so its label is one facet of many; the mean direction is that to it."""
    dataset, split = frames
    name = dataset.models.index("sphere")
    for frame in split:
        on = (frame["target"] == 0) & np.isfinite(frame["true_range_m"])
        for sensor in ("", "camera.nav."):
            has_normal = np.isfinite(frame[f"{sensor}normal"]).all(axis=-1)
            assert np.array_equal(has_normal, frame[f"{sensor}target"] >= 0)
        if int(frame["model_id"]) == name and on.sum() > 8:
            toward = -frame["position_m"] / np.linalg.norm(frame["position_m"])
            mean = frame["normal"][on].astype(float).mean(axis=0)
            assert mean @ toward / np.linalg.norm(mean) > 0.95
            of_camera = frame["camera.nav.normal"][frame["camera.nav.target"] == 0].astype(float).mean(axis=0)
            toward = -frame["camera.nav.position_m"] / np.linalg.norm(frame["camera.nav.position_m"])
            assert of_camera @ toward / np.linalg.norm(of_camera) > 0.95
            turned = turn_frame(of_lidar(frame), 1)
            back = turned["normal"][np.rot90(on)].astype(float).mean(axis=0)
            assert back == pytest.approx([mean[1], -mean[0], mean[2]], abs=1e-6)
            break
    else:
        pytest.fail("no frame of the sphere")


def test_keypoints_turn_with_the_image(frames):
    _, split = frames
    frame = next(frame for frame in split if (frame["keypoint_visibility"] == 2).any())
    marked = np.zeros((16, 16))
    row, col = frame["keypoint_px"][frame["keypoint_visibility"] == 2][0]
    marked[round(float(row)), round(float(col))] = 1.0
    turned = turn_frame(of_lidar(frame), 3)["keypoint_px"][frame["keypoint_visibility"] == 2][0]
    assert np.rot90(marked, 3)[round(float(turned[0])), round(float(turned[1]))] == 1.0
