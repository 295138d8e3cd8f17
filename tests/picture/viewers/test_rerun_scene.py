"""Scenes for Rerun: where axes hang, and what stands in the file when Rerun's own reader opens it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

import rso_lidar as rl
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export import list_cameras
from rso_lidar.picture import Shape, Stretch, rerun_scene
from rso_lidar.picture.viewers.rerun_scene import (
    import_rerun,
    open_rerun,
    paths_of,
    silence_analytics,
    viewer_command,
    world_of,
    write_rerun,
)
from rso_lidar.pose import Link, PoseTree
from tests.settings_for_tests import limit_pixels

PLATE = Shape(
    "tdrs", np.array([[[-3, -3, 0], [3, -3, 0], [3, 3, 0]], [[-3, -3, 0], [3, 3, 0], [-3, 3, 0]]], dtype=float)
)


@pytest.fixture
def rerun():
    """The library; without it what it writes cannot be tested."""
    return pytest.importorskip("rerun", reason="needs the extra view: pip install 'rso-lidar[view]'")


# ------------------------------------------------------------------------------------------------- without the library


def tree(parents):
    return PoseTree(parents, dict.fromkeys(parents, Link.still()))


def test_axes_hang_as_in_the_truth_and_on_the_world_where_that_is_inertial():
    poses = tree(
        {
            "tdrs.rtn": "inertial",
            "tdrs": "tdrs.rtn",
            "tdrs.array": "tdrs",
            "other.rtn": "inertial",
            "other": "other.rtn",
            "follower.rtn": "tdrs.rtn",
            "follower": "follower.rtn",
            "lidar": "follower",
        }
    )
    paths = {name: "/".join(path) for name, path in paths_of(poses, "tdrs.rtn").items()}
    assert paths == {
        "tdrs.rtn": "tdrs.rtn",
        "tdrs": "tdrs.rtn/tdrs",
        "tdrs.array": "tdrs.rtn/tdrs/tdrs.array",
        "other.rtn": "tdrs.rtn/other.rtn",
        "other": "tdrs.rtn/other.rtn/other",
        "follower.rtn": "tdrs.rtn/follower.rtn",
        "follower": "tdrs.rtn/follower.rtn/follower",
        "lidar": "tdrs.rtn/follower.rtn/follower/lidar",
    }


def test_the_world_is_where_the_target_is_and_does_not_turn_with_it(coming):
    assert world_of(coming[0]) == "tdrs.rtn"


def test_without_the_extra_it_is_named(coming, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(RecordingError, match=r"view: Rerun is an extra: pip install rso-lidar\[view\]"):
        import_rerun("view")
    with pytest.raises(RecordingError, match=r"a\.rrd: Rerun is an extra"):
        write_rerun(coming, tmp_path / "a.rrd")
    assert not list(tmp_path.iterdir())


def test_the_viewer_listens_here_alone_and_is_asked_to_be_quiet(tmp_path, monkeypatch):
    calls = []

    def run(command, env, check):
        config = json.loads(Path(env["XDG_CONFIG_HOME"], "rerun", "analytics.json").read_text(encoding="utf-8"))
        calls.append((command, config["analytics_enabled"], env["HTTPS_PROXY"]))
        return subprocess.CompletedProcess(command, 0 if len(calls) == 1 else 3)

    monkeypatch.setattr(rerun_scene, "import_rerun", lambda what: None)
    monkeypatch.setattr(subprocess, "run", run)
    open_rerun(tmp_path / "a.rrd")
    (command, wanted, way_out), *_ = calls
    assert command[-1] == f"{tmp_path / 'a.rrd'}"
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert wanted is False
    assert way_out.endswith("//127.0.0.1:9")
    with pytest.raises(RunError, match=r"viewer left with status 3"):
        open_rerun(tmp_path / "a.rrd")


# ---------------------------------------------------------------------------------------------------- with the library


def read(path):
    """Return, by entity and frame, what Rerun's own reader finds: component, and its rows; None is the frame of statics."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        frames = batch.column(names.index("frame")).to_pylist() if "frame" in names else [None] * chunk.num_rows
        for name in names:
            for k, frame in enumerate(frames):
                value = batch.column(names.index(name))[k].as_py()
                if value is not None:
                    found.setdefault(chunk.entity_path, {}).setdefault(frame, {})[name] = value
    return found


@pytest.fixture
def scene(rerun, coming, tmp_path):
    return read(write_rerun(coming, tmp_path / "a.rrd", [PLATE]))


def test_points_are_those_of_the_frames(scene, coming):
    clouds = scene["/tdrs.rtn/lidar/cloud"]
    assert sorted(clouds) == [frame.index for frame in coming]
    for frame in coming:
        found, valid = clouds[frame.index], frame.valid
        points = np.array(found["Points3D:positions"]).reshape(-1, 3)
        assert points.shape == (valid.sum(), 3)
        step_m = np.spacing(np.float32(np.abs(frame.points_m[valid]).max()))  # rounded to float32
        assert np.abs(points - frame.points_m[valid]).max() <= 0.5 * step_m
        assert found["range_m"] == frame.range_m[valid].tolist()
        assert found["intensity_counts"] == frame.intensity_counts[valid].tolist()
        assert found["pixel"] == np.flatnonzero(valid).tolist()


def test_axes_put_together_are_the_truth(scene, coming):
    for frame in coming:
        world_from = {}
        for name in ("tdrs", "lidar"):
            found = scene[f"/tdrs.rtn/{name}"][frame.index]
            turn = Rotation.from_quat(found["Transform3D:quaternion"][0])
            world_from[name] = RigidTransform.from_components(found["Transform3D:translation"][0], turn)
            assert found["time"].total_seconds() == pytest.approx(frame.time_s, abs=1e-9)
        off = (world_from["lidar"].inv() * world_from["tdrs"]).inv() * frame.truth.pose("lidar", "tdrs")
        far_m = np.linalg.norm(frame.truth.pose("lidar", "tdrs").translation)
        assert np.linalg.norm(off.translation) < 4e-7 * far_m  # places and quaternions in float32, 6e-8 each
        assert off.rotation.magnitude() < 1e-6


def test_images_say_metres_and_counts_and_cover_what_is_none(scene, coming):
    for frame in coming:
        shape = frame.range_m.shape
        found = scene["/images/range"][frame.index]
        range_m = np.array(found["DepthImage:buffer"][0], dtype=np.uint8).view(np.float32).reshape(shape)
        assert np.array_equal(range_m, frame.range_m, equal_nan=True)
        cover = np.array(scene["/images/range/no_return"][frame.index]["SegmentationImage:buffer"][0]).reshape(shape)
        assert np.array_equal(cover == 0, frame.valid)
        counts = np.array(scene["/images/intensity"][frame.index]["Image:buffer"][0], dtype=np.uint8)
        assert np.array_equal(counts.view(np.uint16).reshape(shape), frame.intensity_counts)


def test_the_mesh_hangs_on_its_axes(scene):
    mesh = scene["/tdrs.rtn/tdrs/mesh"][None]
    assert np.array_equal(np.array(mesh["Mesh3D:vertex_positions"]).reshape(-1, 3, 3), PLATE.corners_m)
    normals = np.array(mesh["Mesh3D:vertex_normals"])
    assert np.array_equal(np.abs(normals), np.tile([0.0, 0.0, 1.0], (6, 1)))


def test_images_of_cameras_are_stretched_and_their_fields_hang_on_their_axes(rerun, tmp_path):
    lens = {"fov_deg": 90, "f_number": 4, "n_rows": 6, "n_cols": 8}
    near = "target[0].motion.position_m=[30, 0, 0]"
    bench = rl.Scenario.load("examples/bench_plate.toml", settings=(*limit_pixels(8, 1), near))
    frames = list(rl.simulate(bench.replace(camera=[{"name": "wide", "bands": "rgb", "lens": lens}]), frames=[0, 1]))
    (camera,) = list_cameras(tmp_path, frames[0].source.scenario)
    scene = read(write_rerun(frames, tmp_path / "a.rrd", cameras={"wide": camera.pinhole.matrix}))
    (field,) = (scene[path][None] for path in scene if path.endswith("/wide/field"))
    # Half of 8 columns see half of 90 degrees; Rerun counts from the corner of the image. Columns come first.
    np.testing.assert_allclose(field["Pinhole:image_from_camera"][0], [4, 0, 0, 0, 4, 0, 4, 3, 1], atol=1e-6)
    assert field["Pinhole:resolution"][0] == [8.0, 6.0]
    for frame in frames:
        image = scene["/images/camera/wide"][frame.index]
        shown = np.array(image["Image:buffer"][0], dtype=np.uint8).reshape(6, 8, 3)
        np.testing.assert_array_equal(shown, Stretch.of("wide", frame).paint(frame.camera["wide"].intensity_counts))
        assert image["exposure_s"] == [float(frame.camera["wide"].exposure_s)]


def test_the_field_is_as_wide_as_the_lidars(scene, coming):
    field = scene["/tdrs.rtn/lidar/field"]
    assert list(field) == [0]  # once: the lens does not change
    focal = field[0]["Pinhole:image_from_camera"][0][0]
    n = coming[0].valid.shape[1]
    assert 2 * np.degrees(np.arctan(0.5 * n / focal)) == pytest.approx(2.5, rel=1e-6)


def test_colours_mean_what_was_asked(rerun, coming, tmp_path):
    several = {
        colour: read(write_rerun(coming, tmp_path / f"{colour}.rrd", colour=colour))
        for colour in ("range", "intensity")
    }
    packed = {
        name: np.array(scene["/tdrs.rtn/lidar/cloud"][11]["Points3D:colors"], dtype=np.uint32)
        for name, scene in several.items()
    }
    rgb = {name: np.stack([(word >> shift) & 255 for shift in (24, 16, 8)], axis=-1) for name, word in packed.items()}
    assert np.ptp(rgb["intensity"], axis=1).max() == 0
    assert np.ptp(rgb["range"], axis=1).min() > 0
    counts = coming[11].intensity_counts[coming[11].valid]
    order = np.argsort(counts, kind="stable")
    assert (np.diff(rgb["intensity"][order, 0].astype(int)) >= 0).all()


def test_what_fails_leaves_nothing(rerun, coming, tmp_path):
    class Broken(list):
        def __getitem__(self, k):
            return super().__getitem__(k)

        def __iter__(self):
            yield self[0]
            raise OSError(28, "No space left on device")

    with pytest.raises(RunError, match="No space left"):
        write_rerun(Broken(coming), tmp_path / "a.rrd")
    assert not list(tmp_path.iterdir())


def test_a_file_cut_short_is_seen(rerun, coming, tmp_path):
    place = write_rerun(coming[:3], tmp_path / "a.rrd")
    place.write_bytes(place.read_bytes()[:-500])
    with pytest.raises(RunError, match="could not be written"):
        rerun_scene._readable(place, place)


def test_a_frame_without_returns_is_empty(rerun, handmade, tmp_path):
    frames = [handmade.make_frame(range_m=60_000.0, n=32, false_returns=0, index=k) for k in range(2)]
    scene = read(write_rerun(frames, tmp_path / "a.rrd"))
    assert scene["/tdrs.rtn/lidar/cloud"][1].get("Points3D:positions", []) == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only there does an environment say it")
def test_the_viewer_collects_nothing(rerun):
    with silence_analytics() as environment:
        command = [*viewer_command("x")[:3], "analytics", "config"]
        said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        assert json.loads(said)["analytics_enabled"] is False
        assert json.loads(said)["config_file_path"].startswith(environment["XDG_CONFIG_HOME"])
    assert not Path(environment["XDG_CONFIG_HOME"]).exists()
