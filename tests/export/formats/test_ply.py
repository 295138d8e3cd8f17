import dataclasses

import numpy as np
import pytest
from frames_for_tests import make_frame, make_frames

from rso_lidar import export
from rso_lidar.export.formats.ply import encode_ply


def test_trimesh_reads_points_pixels_and_labels(tmp_path):
    import trimesh

    folder = export.save(tmp_path / "clouds.ply", make_frames(2))
    assert sorted(file.name for file in folder.iterdir()) == ["000000.ply", "000003.ply", "frames.jsonl", "source.json"]
    frame = make_frame(1)
    cloud = trimesh.load(folder / "000003.ply")
    row, col = np.nonzero(frame.valid)
    np.testing.assert_array_equal(cloud.vertices, frame.points_m[frame.valid].astype("f4"))
    raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
    wanted = {"row": row, "col": col, "intensity": frame.intensity_counts[frame.valid]}
    wanted |= {"target": frame.labels.target[frame.valid], "part": frame.labels.part[frame.valid]}
    for name, values in wanted.items():
        np.testing.assert_array_equal(raw[name].reshape(-1), values, err_msg=name)
    again = np.full((*frame.range_m.shape, 3), np.nan)
    again[raw["row"].reshape(-1), raw["col"].reshape(-1)] = cloud.vertices
    np.testing.assert_array_equal(again, frame.points_m.astype("f4"))


@pytest.mark.parametrize("labels", [True, False])
def test_a_frame_without_returns_is_a_whole_file(labels):
    frame = make_frame()
    dark = np.full(frame.range_m.shape, np.nan, "f4")
    reading = dataclasses.replace(frame.observation.reading, range_m=dark)
    frame = dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, reading=reading))
    data = encode_ply(frame, labels=labels)
    assert data.endswith(b"end_header\n")
    assert b"element vertex 0\n" in data
    assert (b"property short target\n" in data) == labels
