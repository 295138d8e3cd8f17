import json
import struct

import numpy as np
import pytest
from frames_for_tests import SOURCE, make_frame, make_frames
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.formats.pcd import encode_pcd, write_pcd


def parsed(data):
    """Return header and points of a PCD file, read by its specification and nothing of ours."""
    head, found = {}, 0
    while "DATA" not in head:
        line, _, _ = data[found:].partition(b"\n")
        found += len(line) + 1
        key, _, value = line.decode("ascii").partition(" ")
        if not key.startswith("#"):
            head[key] = value.split()
    kinds = {"F": {4: "f"}, "I": {2: "h"}}
    codes = [kinds[kind][int(size)] for kind, size in zip(head["TYPE"], head["SIZE"], strict=True)]
    layout = struct.Struct("<" + "".join(codes))
    rows = [layout.unpack_from(data, found + k * layout.size) for k in range(int(head["POINTS"][0]))]
    assert found + layout.size * len(rows) == len(data)
    return head, np.array(rows, dtype=float)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("pcd") / "clouds.pcd", make_frames(3))


def test_a_cloud_keeps_rows_columns_and_nan(folder):
    frame = make_frame(2)
    head, values = parsed((folder / "000006.pcd").read_bytes())
    assert (head["VERSION"], head["WIDTH"], head["HEIGHT"]) == (["0.7"], ["10"], ["12"])
    assert head["FIELDS"] == ["x", "y", "z", "intensity", "target", "part"]
    cloud = values.reshape(12, 10, 6)
    np.testing.assert_array_equal(cloud[..., :3], frame.points_m.astype("f4"))  # NaN where NaN
    np.testing.assert_array_equal(np.isfinite(cloud[..., 0]), frame.valid)
    np.testing.assert_array_equal(cloud[..., 3], frame.intensity_counts)  # u2 is exact in f4
    np.testing.assert_array_equal(cloud[..., 4], frame.labels.target)
    np.testing.assert_array_equal(cloud[..., 5], frame.labels.part)
    # float32 steps by 2^-15 m at 300 m, and rounds to half of it
    assert np.nanmax(np.abs(cloud[..., :3] - frame.points_m)) <= 2.0**-16


def test_another_library_reads_it_organised(folder):
    pypcd4 = pytest.importorskip(
        "pypcd4", reason="pypcd4 is not installed; the parser of this test reads it all the same"
    )
    cloud = pypcd4.PointCloud.from_path(folder / "000003.pcd")
    frame = make_frame(1)
    assert (cloud.metadata.width, cloud.metadata.height, cloud.points) == (10, 12, 120)
    xyz = cloud.numpy(("x", "y", "z")).reshape(12, 10, 3)
    np.testing.assert_array_equal(xyz, frame.points_m.astype("f4"))
    np.testing.assert_array_equal(cloud.numpy(("intensity",)).reshape(12, 10), frame.intensity_counts)
    np.testing.assert_array_equal(cloud.numpy(("target",)).reshape(12, 10), frame.labels.target)


def test_labels_may_be_left_out():
    head, values = parsed(encode_pcd(make_frame(), labels=False))
    assert head["FIELDS"] == ["x", "y", "z", "intensity"]
    assert values.shape == (120, 4)


def test_viewpoint_is_the_lidar_as_the_target_sees_it():
    frame = make_frame(1)
    assert parsed(encode_pcd(frame))[0]["VIEWPOINT"] == ["0", "0", "0", "1", "0", "0", "0"]
    x, y, z, qw, qx, qy, qz = map(float, parsed(encode_pcd(frame, "tdrs"))[0]["VIEWPOINT"])
    there = RigidTransform.from_components([x, y, z], Rotation.from_quat([qx, qy, qz, qw]))
    expected = frame.truth.pose("tdrs", "lidar")
    np.testing.assert_allclose(there.as_matrix(), expected.as_matrix(), rtol=1e-14, atol=1e-14)


def test_times_poses_and_the_scenario_stand_beside_the_clouds(folder):
    lines = [json.loads(line) for line in (folder / "frames.jsonl").read_text().splitlines()]
    assert [line["file"] for line in lines] == ["000000.pcd", "000003.pcd", "000006.pcd"]
    assert all((folder / line["file"]).is_file() for line in lines)
    truth = make_frame(2).truth
    told = lines[2]["lidar_from"]
    assert set(told) == set(truth.poses)
    for name, pose in told.items():
        expected = truth.pose("lidar", name)
        np.testing.assert_allclose(pose["position_m"], expected.translation, rtol=1e-13, atol=1e-7)  # 4.2e7 m arms
        np.testing.assert_allclose(pose["quaternion_xyzw"], expected.rotation.as_quat(canonical=True), atol=1e-14)
    source = json.loads((folder / "source.json").read_text(encoding="utf-8"))
    assert source["scenario"] == SOURCE.scenario
    assert [target["name"] for target in source["targets"]] == ["tdrs", "rock"]


def test_axes_that_are_not_there_are_refused_and_nothing_is_left(tmp_path):
    with pytest.raises(RecordingError, match=r"viewpoint: no axes named 'tdsr'; did you mean 'tdrs'\?"):
        write_pcd(tmp_path / "clouds", make_frames(2), viewpoint="tdsr")
    assert list(tmp_path.iterdir()) == []
