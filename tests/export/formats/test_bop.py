import dataclasses
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rso_lidar import export
from rso_lidar.errors import RecordingError, RsoLidarWarning
from rso_lidar.export import choose_depth_scale, quantize_depth
from rso_lidar.export.formats.bop import fit_pinhole
from tests.export.frames_for_tests import make_frame, make_frames

ROOT = Path(__file__).resolve().parents[3]


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def image(path):
    return np.asarray(Image.open(path))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("bop") / "scene.bop", make_frames(3))


def test_points_come_back_to_a_step_of_16_bits(folder):
    """Depth, camera and depth_scale give the points, to half a step of depth."""
    scene = folder / "000000"
    cameras = read(scene / "scene_camera.json")
    assert list(cameras) == ["0", "3", "6"]
    frame, camera = make_frame(2), cameras["6"]
    counts = image(scene / "depth/000006.png")
    assert counts.dtype == np.uint16
    np.testing.assert_array_equal(counts > 0, frame.valid)
    depth_m = counts * camera["depth_scale"] / 1000
    fx, skew, cx, _, fy, cy, *last = camera["cam_K"]
    assert (skew, last) == (0, [0, 0, 1])
    row, col = np.indices(counts.shape)
    points_m = np.stack([(col - cx) / fx * depth_m, (row - cy) / fy * depth_m, depth_m], axis=-1)
    half_step_m = camera["depth_scale"] / 2000
    assert half_step_m < 0.003
    valid = frame.valid
    np.testing.assert_allclose(points_m[valid], frame.points_m[valid], rtol=0, atol=half_step_m * 1.001)
    np.testing.assert_array_equal(image(scene / "gray/000006.png"), frame.intensity_counts)


def test_poses_are_model_to_camera_in_mm(folder):
    poses = read(folder / "000000/scene_gt.json")["3"]
    assert [pose["obj_id"] for pose in poses] == [1]  # rock has no axes in these frames
    pose = make_frame(1).truth.pose("lidar", "tdrs")
    there_mm = np.array(poses[0]["cam_R_m2c"]).reshape(3, 3) @ [1000.0, 2000.0, 3000.0] + poses[0]["cam_t_m2c"]
    np.testing.assert_allclose(there_mm, 1000 * pose.apply([1.0, 2.0, 3.0]), rtol=1e-12)
    assert read(folder / "source.json")["targets"][0]["name"] == "tdrs"


def test_masks_and_boxes_are_of_the_labels(folder):
    scene, frame = folder / "000000", make_frame(1)
    mask = frame.labels.target == 0
    for name in ("mask", "mask_visib"):
        np.testing.assert_array_equal(image(scene / name / "000003_000000.png"), np.where(mask, 255, 0))
    [info] = read(scene / "scene_gt_info.json")["3"]
    left, top, width, height = info["bbox_visib"]
    assert mask[top : top + height, left : left + width].sum() == mask.sum() == info["px_count_visib"] > 0
    assert mask[top].any() and mask[top + height - 1].any()
    assert mask[:, left].any() and mask[:, left + width - 1].any()
    assert info["px_count_valid"] == (mask & frame.valid).sum()


def changed(frame, **how):
    """Return a frame with other labels, or with another reading."""
    labels = {name: value for name, value in how.items() if name == "target"}
    reading = {name: value for name, value in how.items() if name == "range_m"}
    observation = dataclasses.replace(
        frame.observation, reading=dataclasses.replace(frame.observation.reading, **reading)
    )
    return dataclasses.replace(frame, labels=dataclasses.replace(frame.labels, **labels), observation=observation)


def test_a_target_that_is_not_seen_has_a_pose_and_no_box(tmp_path):
    frame = make_frame()
    frame = changed(frame, target=np.full(frame.range_m.shape, -1))
    scene = export.save(tmp_path / "scene.bop", [frame]) / "000000"
    [info] = read(scene / "scene_gt_info.json")["0"]
    assert info["bbox_obj"] == info["bbox_visib"] == [-1, -1, -1, -1]
    assert (info["px_count_all"], info["visib_fract"]) == (0, 0.0)
    assert len(read(scene / "scene_gt.json")["0"]) == 1


def test_a_false_trigger_far_behind_costs_itself_and_no_precision(tmp_path):
    frame = make_frame()
    range_m = np.array(frame.range_m)
    range_m[-1, -1] = 9000.0
    scene = export.save(tmp_path / "scene.bop", [changed(frame, range_m=range_m)]) / "000000"
    assert read(scene / "scene_camera.json")["0"]["depth_scale"] == 5.0
    np.testing.assert_array_equal(image(scene / "depth/000000.png") > 0, frame.valid)


def test_steps_of_depth_reach_and_are_the_finest_that_do():
    for farthest_m in (0.0, 300.0, 3.0e3, 3234.405, 3234.407, 3.3e3, 1e6):
        step, greatest_mm = choose_depth_scale(farthest_m), (1.01 * farthest_m + 10.0) * 1e3
        assert step * 65535 >= greatest_mm
        assert step == 0.1 or step / 2.5 * 65535 < greatest_mm
    assert (choose_depth_scale(0.0), choose_depth_scale(3234.405), choose_depth_scale(3234.407)) == (0.2, 50.0, 100.0)


def test_counts_of_depth_are_rounded_and_zero_where_there_is_none():
    depth_m = np.array([[np.nan, 0.01, 12.34], [6553.5, 6553.56, 9000.0]])
    np.testing.assert_array_equal(quantize_depth(depth_m, 0.1), np.array([[0, 1, 123], [65535, 0, 0]], np.uint16))


def test_camera_matrix_is_the_lens(tmp_path):
    focal_pixels = 20.0 * 12
    camera, off_pixels = fit_pinhole(tmp_path, make_frame().line_of_sight)
    np.testing.assert_allclose(camera, [[focal_pixels, 0, 4.5], [0, focal_pixels, 5.5], [0, 0, 1]], atol=1e-10)
    assert off_pixels < 1e-10


def test_camera_matrix_of_a_lens_that_looks_aside(tmp_path):
    """Focal lengths and the image of the axis come back where neither is in the middle nor alike across and down."""
    col, row = np.meshgrid(np.arange(10.0), np.arange(12.0))
    sight = np.stack([(col - 3.2) / 240.0, (row - 7.9) / 250.0, np.ones((12, 10))], axis=-1)
    camera, off_pixels = fit_pinhole(tmp_path, sight / np.linalg.norm(sight, axis=-1, keepdims=True))
    np.testing.assert_allclose(camera, [[240.0, 0, 3.2], [0, 250.0, 7.9], [0, 0, 1]], atol=1e-9)
    assert off_pixels < 1e-9


def test_a_lens_that_bends_is_told_of_once(tmp_path):
    def bent(k):
        frame = make_frame(k)
        tangent = frame.line_of_sight[..., :2] / frame.line_of_sight[..., 2:]
        tangent = tangent * (1 + 200 * (tangent**2).sum(axis=-1, keepdims=True))
        sight = np.concatenate([tangent, np.ones((*tangent.shape[:2], 1))], axis=-1)
        sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
        return dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, line_of_sight=sight))

    with pytest.warns(RsoLidarWarning, match=r"the lens bends rays by up to 0\.\d+ pixels from the pinhole") as told:
        export.save(tmp_path / "scene.bop", map(bent, range(3)))
    assert len(told) == 1


def test_a_lens_that_looks_back_is_refused(tmp_path):
    frame = make_frame()
    back = dataclasses.replace(frame.observation, line_of_sight=-frame.line_of_sight)
    with pytest.raises(RecordingError, match="a pixel looks sideways or back"):
        export.save(tmp_path / "scene.bop", [dataclasses.replace(frame, observation=back)])
    assert list(tmp_path.iterdir()) == []


def test_the_model_lies_on_the_mask_by_the_files_alone(tmp_path):
    """A real frame: the catalogue's mesh, shifted to its centre of mass, put through pose and camera as BOP tools do."""
    import trimesh
    from scipy import ndimage

    import rso_lidar as rl

    scenario = rl.Scenario.load(ROOT / "examples/tdrs_approach.toml")
    folder = rl.save(tmp_path / "scene.bop", rl.simulate(scenario, frames=[500]))
    scene = folder / "000000"
    camera, [pose] = read(scene / "scene_camera.json")["500"], read(scene / "scene_gt.json")["500"]
    mesh = trimesh.load(ROOT / "models/tdrs.glb", force="mesh")
    index = tomllib.loads((ROOT / "models/index.toml").read_text(encoding="utf-8"))["model"]
    [about] = [entry for entry in index if entry["name"] == "tdrs"]
    points, _ = trimesh.sample.sample_surface(mesh, 100_000, seed=1)
    model_mm = 1000 * (points - about["center_of_mass_m"])
    rotation, matrix = (np.array(flat).reshape(3, 3) for flat in (pose["cam_R_m2c"], camera["cam_K"]))
    seen_mm = np.einsum("ij,nj->ni", rotation, model_mm) + pose["cam_t_m2c"]
    col, row = np.rint(np.einsum("ij,nj->in", matrix, seen_mm)[:2] / seen_mm[:, 2]).astype(int)
    silhouette = np.zeros((128, 128), bool)
    inside = (row >= 0) & (row < 128) & (col >= 0) & (col < 128)
    silhouette[row[inside], col[inside]] = True
    mask = image(scene / "mask_visib/000500_000000.png") > 0
    assert mask.sum() > 2000
    # A pixel at an edge may be on either side of it; beside that, a few are crossed by rods that no ray need meet.
    assert not (mask & ~ndimage.binary_dilation(silhouette)).any()
    assert (ndimage.binary_erosion(silhouette) & ~mask).sum() <= 5
    depth_mm = image(scene / "depth/000500.png")[mask] * camera["depth_scale"]
    depth_mm = depth_mm[depth_mm > 0]
    noise_mm = 1000  # ranging is good to about 0.1 m, a pixel in thousands is off by more
    low, high = np.percentile(depth_mm, [1, 99])
    assert seen_mm[:, 2].min() - noise_mm < low < high < seen_mm[:, 2].max() + noise_mm
