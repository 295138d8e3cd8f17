"""Images of cameras beside the lidar as PNG, MCAP and BOP, read by Pillow, zlib and rosbags."""

import dataclasses
import json
import zlib
from pathlib import Path

import numpy as np
import pytest
from frames_for_tests import make_frame, make_frames
from PIL import Image
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar import Scenario, export, simulate
from rso_lidar.errors import RecordingError, RsoLidarWarning
from rso_lidar.export.formats.bop import write_bop
from rso_lidar.export.formats.mcap import TOPICS, write_mcap
from rso_lidar.export.formats.png import write_png

SCENARIO = """
version = 1
name    = "Bench, plate at 30 m"
[world]
axes = "local"
sun_direction = [-1, 0.2, 0.5]
[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 1
frame_rate_hz = 10
[[target]]
name     = "plate"
model    = "plate"
motion   = { type = "fixed", position_m = [30, 0, 0] }
attitude = { type = "look_at", at = "follower" }
[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }
[lidar.laser]
wavelength_nm  = 1064
energy_mj      = 1
pulse_fwhm_ns  = 8
divergence_deg = 20
[lidar.receiver]
fov_deg        = 20
f_number       = 2.8
n_rows         = 4
n_cols         = 4
rays_per_pixel = 1
[lidar.detector]
type = "empirical"
[[camera]]
name        = "nav"
bands       = "rgb"
exposure_ms = 0.2
mount       = { position_m = [0, 0.5, 0] }
[camera.lens]
fov_deg    = 20
f_number   = 4
n_rows     = 12
n_cols     = 16
distortion = { type = "brown_conrady", k1 = -0.9, p1 = 0.02 }
[[camera]]
name          = "far-eye"
auto_exposure = {}
lens          = { focal_length_mm = 0.4, f_number = 4, n_rows = 16, n_cols = 16 }
sensor        = { electrons_per_count = 7.5 }
[[camera]]
name        = "pair"
bands       = [{ name = "a", wavelength_nm = 600, width_nm = 50 }, { name = "b", wavelength_nm = 800, width_nm = 50 }]
exposure_ms = 0.2
lens        = { fov_deg = 20, f_number = 4, n_rows = 4, n_cols = 4 }
"""


@pytest.fixture(scope="module")
def flown():
    """Return the scenario and two frames of it."""
    scenario = Scenario.loads(SCENARIO)
    return scenario, list(simulate(scenario, frames=[0, 3]))


def project(points, described):
    """Return columns and rows of points in camera axes, by OpenCV's formula with the numbers of camera.json."""
    x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
    k1, k2, p1, p2, k3 = (described["distortion"][term] for term in ("k1", "k2", "p1", "p2", "k3"))
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    col = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    row = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return described["fx"] * col + described["cx"], described["fy"] * row + described["cy"]


def read_image(path):
    """Read an image as Pillow does: grey with its 16 bits, RGB with the upper 8."""
    with Image.open(path) as image:
        assert image.mode in ("I;16", "RGB", "L")
        return np.asarray(image)


def read_rgb16(path):
    """Read the samples of an RGB image whose rows are not filtered."""
    content = path.read_bytes()
    header = content.index(b"IHDR") + 4
    cols, rows = np.frombuffer(content[header : header + 8], ">u4")
    assert content[header + 8 : header + 13] == bytes([16, 2, 0, 0, 0])
    start = content.index(b"IDAT")
    size = int.from_bytes(content[start - 4 : start], "big")
    lines = np.frombuffer(zlib.decompress(content[start + 4 : start + 4 + size]), np.uint8).reshape(rows, -1)
    assert not lines[:, 0].any()
    return lines[:, 1:].copy().view(">u2").reshape(rows, cols, 3)


def test_png_holds_the_counts_and_what_turns_them_into_light_and_directions(flown, tmp_path):
    scenario, frames = flown
    folder = write_png(tmp_path / "images.png", frames)
    assert sorted(entry.name for entry in folder.iterdir()) == ["far-eye", "nav", "pair", "source.json"]
    for frame in frames:
        name = f"{frame.index:06d}"
        counts = frame.camera["nav"].intensity_counts
        assert counts.max() > 1000 and (counts[0, 0] != counts.max()).all()  # the plate is lit, and the sky is not
        np.testing.assert_array_equal(read_rgb16(folder / f"nav/{name}.png"), counts)
        np.testing.assert_array_equal(read_image(folder / f"nav/{name}.png"), counts >> 8)
        np.testing.assert_array_equal(
            read_image(folder / f"far-eye/{name}.png"), frame.camera["far-eye"].intensity_counts[..., 0]
        )
        for k, band in enumerate("ab"):
            image = read_image(folder / f"pair/{name}_{band}.png")
            np.testing.assert_array_equal(image, frame.camera["pair"].intensity_counts[..., k])
    for camera in scenario.camera:
        described = json.loads((folder / camera.name / "camera.json").read_text())
        col, row = project(camera.lens.line_of_sight, described)  # of the centre of each pixel
        # The lens is inverted to 1e-12 of the tangent, times 50 to 100 pixels.
        np.testing.assert_allclose(col, np.broadcast_to(np.arange(camera.lens.n_cols), col.shape), atol=1e-9)
        np.testing.assert_allclose(row, np.broadcast_to(np.arange(camera.lens.n_rows)[:, None], row.shape), atol=1e-9)
        assert described["electrons_per_count"] == camera.sensor.gain_electrons
        assert (described["black_level_counts"], described["bits"]) == (64, 12)
        lines = [json.loads(line) for line in (folder / camera.name / "frames.jsonl").read_text().splitlines()]
        assert [line["index"] for line in lines] == [0, 3]
        for line, frame in zip(lines, frames, strict=True):
            assert line["exposure_s"] == frame.camera[camera.name].exposure_s
            pose, truth = line["camera_from"]["plate"], frame.truth.pose(camera.name, "plate")
            np.testing.assert_allclose(pose["position_m"], truth.translation, atol=1e-12)
            turned = Rotation.from_quat(pose["quaternion_xyzw"]) * truth.rotation.inv()
            assert turned.magnitude() < 1e-12


def test_png_needs_a_camera_and_replaces_only_its_own(flown, tmp_path):
    with pytest.raises(RecordingError, match=r"no images of a camera; add \[\[camera\]\] to the scenario"):
        export.save(tmp_path / "images.png", make_frames(2))
    assert not list(tmp_path.iterdir())
    frames = flown[1]
    folder = export.save(tmp_path / "images.png", frames)
    with pytest.raises(RecordingError, match="overwrite"):
        export.save(folder, frames[:1])
    export.save(folder, frames[:1], overwrite=True)
    assert not (folder / "nav/000003.png").exists()
    (folder / "own").mkdir()
    with pytest.raises(RecordingError, match="holds own, which is not an export"):
        export.save(folder, frames, overwrite=True)
    with pytest.raises(RecordingError, match="frame 0 is given twice"):
        export.save(tmp_path / "twice.png", [frames[0], frames[0]])
    with pytest.raises(RecordingError, match=r"frame 3: its cameras or their images differ from the first frame's"):
        export.save(tmp_path / "other.png", [frames[0], make_frame(1)])


def test_ros_messages_hold_images_intrinsics_and_axes_of_each_camera(flown, tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
    scenario, frames = flown
    write_mcap(tmp_path / "run.mcap", frames)
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    read = {}
    with rosbags.AnyReader([tmp_path / "run.mcap"], default_typestore=store) as reader:
        for connection, _, raw in reader.messages():
            read.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    words = {"nav": "rgb16", "far_eye": "mono16", "pair": "16UC2"}
    own = {f"/{word}/{topic}" for word in words for topic in ("image_raw", "camera_info")}
    assert read.keys() == TOPICS.keys() | own
    for camera in scenario.camera:
        word = camera.name.replace("-", "_")
        for k, frame in enumerate(frames):
            image, info, tf = read[f"/{word}/image_raw"][k], read[f"/{word}/camera_info"][k], read["/tf"][k]
            assert image.header == info.header and image.header.stamp == read["/lidar/points"][k].header.stamp
            assert (image.header.frame_id, image.encoding, image.is_bigendian) == (camera.name, words[word], 0)
            assert (image.height, image.width, image.step) == (
                *camera.lens.shape,
                2 * camera.lens.n_cols * camera.shape[2],
            )
            counts = np.frombuffer(image.data.tobytes(), "<u2").reshape(camera.shape)
            np.testing.assert_array_equal(counts, frame.camera[camera.name].intensity_counts)
            focal = camera.lens.focal_length_m / camera.lens.pixel_pitch_m
            centre = 0.5 * (camera.lens.n_cols - 1), 0.5 * (camera.lens.n_rows - 1)
            np.testing.assert_allclose(info.k, [focal, 0, centre[0], 0, focal, centre[1], 0, 0, 1], rtol=1e-14)
            assert info.d.tolist() == ([-0.9, 0, 0.02, 0, 0] if word == "nav" else [0.0] * 5)
            links = {link.child_frame_id: link for link in tf.transforms}
            link = links[camera.name]
            assert link.header.frame_id == "follower"
            move, turn = link.transform.translation, link.transform.rotation
            pose = RigidTransform.from_components(
                [move.x, move.y, move.z], Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
            )
            truth = frame.truth.pose("follower", camera.name)
            np.testing.assert_allclose(pose.as_matrix(), truth.as_matrix(), atol=1e-14)


def test_bop_has_images_masks_and_poses_of_each_camera(flown, tmp_path):
    scenario, frames = flown
    with pytest.warns(RsoLidarWarning) as warned:
        scene = write_bop(tmp_path / "set.bop", frames) / "000000"
    texts = [str(warning.message) for warning in warned]
    assert len(texts) == 2 and "'nav': the lens moves points by up to" in texts[0] and "'pair': BOP knows" in texts[1]
    table = {
        (name, camera.name): json.loads((scene / f"{name}_{camera.name}.json").read_text())
        for name in ("scene_camera", "scene_gt", "scene_gt_info")
        for camera in scenario.camera
    }
    np.testing.assert_array_equal(read_rgb16(scene / "rgb_nav/000003.png"), frames[1].camera["nav"].intensity_counts)
    grey = read_image(scene / "gray_far-eye/000003.png")
    np.testing.assert_array_equal(grey, frames[1].camera["far-eye"].intensity_counts[..., 0])
    mask = read_image(scene / "mask_visib_far-eye/000003_000000.png")
    np.testing.assert_array_equal(mask == 255, frames[1].camera_labels["far-eye"].target == 0)
    # The centre of the plate, which faces the camera, is projected to the middle of its mask by matrix and pose alone.
    matrix = np.reshape(table["scene_camera", "far-eye"]["3"]["cam_K"], (3, 3))
    col, row, depth = matrix @ table["scene_gt", "far-eye"]["3"][0]["cam_t_m2c"]
    left, top, width, height = table["scene_gt_info", "far-eye"]["3"][0]["bbox_visib"]
    assert depth == pytest.approx(30e3, rel=1e-12)
    assert (col / depth, row / depth) == pytest.approx((left + (width - 1) / 2, top + (height - 1) / 2), abs=0.5)
    assert table["scene_gt_info", "far-eye"]["3"][0]["px_count_visib"] == (mask == 255).sum() > 50
    for key in ("0", "3"):
        pose = table["scene_gt", "nav"][key][0]
        truth = frames[0].truth.pose("nav", "plate")
        np.testing.assert_allclose(pose["cam_t_m2c"], 1e3 * truth.translation, atol=1e-9)
        np.testing.assert_allclose(np.reshape(pose["cam_R_m2c"], (3, 3)), truth.rotation.as_matrix(), atol=1e-12)
    assert (scene / "gray/000003.png").exists() and (scene / "scene_camera.json").exists()


def test_frames_whose_scenario_does_not_describe_their_camera_are_refused(flown, tmp_path):
    frame = flown[1][0]
    bare = dataclasses.replace(frame, source=dataclasses.replace(frame.source, scenario='name = "none"'))
    for write, name in ((write_png, "images.png"), (write_mcap, "run.mcap"), (write_bop, "set.bop")):
        with pytest.raises(RecordingError, match="camera 'nav': the recording's scenario does not describe it"):
            write(Path(tmp_path / name), [bare])
    assert not list(tmp_path.iterdir())
