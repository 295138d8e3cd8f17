"""Trajectories and the truth's table: every number back, of recordings and of frames alike, and errors that say why."""

import csv
import dataclasses
import datetime

import numpy as np
import pytest
from frames_for_tests import SOURCE, make_frame, make_frames
from scipy.spatial.transform import Rotation

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export import read_truth, to_stamp_ns
from rso_lidar.export.formats.trajectory import write_csv, write_kitti, write_tum
from rso_lidar.export.formats.truth_batches import read_truth_batches

COUNT = 9
FAR_M = 8e-7  # the tree's axes lie 4e7 m apart, and a recorded rotation is good to 2e-15, up to ten times in each pose
ONE = dataclasses.replace(SOURCE, targets=SOURCE.targets[:1])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("recorded") / "run.h5", make_frames(COUNT, source=ONE))


def poses(a, b, frames=range(COUNT)):
    made = [make_frame(k).truth.pose(a, b) for k in frames]
    return np.array([pose.translation for pose in made]), np.array([pose.rotation.as_matrix() for pose in made])


@pytest.mark.parametrize("inverse", [False, True])
def test_tum(recorded, tmp_path, inverse):
    with export.open(recorded) as frames:
        path = write_tum(tmp_path / "run.tum", frames, target="tdrs", lidar_in_target=inverse)
    rows = np.loadtxt(path)  # skips the comments, as evaluators do
    where, turn = poses("tdrs", "lidar") if inverse else poses("lidar", "tdrs")
    np.testing.assert_array_equal(rows[:, 0], [round(0.1 * k, 9) for k in range(COUNT)])
    np.testing.assert_allclose(rows[:, 1:4], where, atol=FAR_M)
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 4:]).as_matrix(), turn, atol=1e-14)  # fifteen decimals
    assert (rows[:, 7] >= 0.0).all()
    head = path.read_text().splitlines()[:3]
    assert head[0] == f"# {'lidar in tdrs' if inverse else 'tdrs in lidar'} axes [m], " + (
        "tdrs_from_lidar as x, y, z, w" if inverse else "lidar_from_tdrs as x, y, z, w"
    )
    assert "1726574400 s since 1970" in head[1]


@pytest.mark.parametrize("inverse", [False, True])
def test_kitti(recorded, tmp_path, inverse):
    with export.open(recorded) as frames:
        path = write_kitti(tmp_path / "run.kitti", frames, target="tdrs", lidar_in_target=inverse)
    matrices = np.loadtxt(path).reshape(-1, 3, 4)
    where, turn = poses("tdrs", "lidar") if inverse else poses("lidar", "tdrs")
    np.testing.assert_allclose(matrices[:, :, 3], where, atol=FAR_M)
    np.testing.assert_allclose(matrices[:, :, :3], turn, atol=1e-14)


def test_frames_that_come_one_by_one_are_written_like_a_recording(recorded, tmp_path):
    for write, options in ((write_tum, {"target": "tdrs"}), (write_kitti, {"target": "tdrs"}), (write_csv, {})):
        with export.open(recorded) as frames:
            stored = write(tmp_path / "stored", frames, **options, overwrite=True).read_text()
            some = write(tmp_path / "some", frames[2:8:3], **options, overwrite=True).read_text()
            one_by_one = write(tmp_path / "one", (frame for frame in frames), **options, overwrite=True).read_text()
        # A matrix read in a batch, or alone, may differ in its last digit.
        how = {"delimiter": ","} if write is write_csv else {}
        a, b = (np.genfromtxt(text.splitlines(), **how) for text in (stored, one_by_one))
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=FAR_M)
        lines = stored.splitlines()
        head = {write_tum: 3, write_kitti: 0, write_csv: 1}[write]
        assert some.splitlines() == [*lines[:head], lines[head + 2], lines[head + 5]]


def test_courses_of_many_batches_join(recorded, monkeypatch):
    monkeypatch.setattr("rso_lidar.export.formats.truth_batches._READ", 4)
    with export.open(recorded) as frames:
        assert [truth.time_s.size for truth, _ in read_truth_batches(frames)] == [4, 4, 1]
        truth = read_truth(frames[::-1])
        angles = [angle for _, batch in read_truth_batches(frames[::-1]) for angle in batch]
        assert read_truth(frames, lambda n: np.array([0, n - 1])).time_s.tolist() == truth.time_s[[8, 0]].tolist()
        for k, frame in enumerate(reversed(list(frames))):
            at = truth.at(k)
            assert at.time_s == frame.time_s and at.sunlit == frame.truth.sunlit
            np.testing.assert_allclose(at.poses["ptu"].matrix, frame.truth.poses["ptu"].matrix, atol=1e-15)
            np.testing.assert_array_equal(at.states["tdrs"].velocity_m_s, frame.truth.states["tdrs"].velocity_m_s)
            np.testing.assert_array_equal(angles[k].rate_rad_s, frame.truth.pointing.rate_rad_s)


def test_stamps_are_whole_nanoseconds():
    assert to_stamp_ns("2024-09-17T12:00:00Z", 0.0) == 1726574400 * 10**9
    assert to_stamp_ns("2024-09-17T14:00:00.000001+02:00", 1e-9) == 1726574400 * 10**9 + 1001
    # 20 Hz over 1e6 frames: no stamp is off by a nanosecond, and none comes twice.
    stamps = [to_stamp_ns("2024-09-17T12:00:00Z", k / 20.0) for k in range(0, 1_000_000, 997)]
    assert stamps == [1726574400 * 10**9 + 50_000_000 * k for k in range(0, 1_000_000, 997)]
    with pytest.raises(RecordingError, match="has no offset"):
        to_stamp_ns("2024-09-17T12:00:00", 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"there are 2 \(tdrs, rock\); name one with --target"),
        ({"target": "tdsr"}, "--target tdsr: nothing in the recording has that name; did you mean 'tdrs'"),
        ({"target": "rock"}, "--target rock: nothing in the recording has that name.*known: tdrs, tdrs.rtn"),
    ],
)
@pytest.mark.parametrize("write", [write_tum, write_kitti])
def test_a_target_that_is_not_there(tmp_path, write, options, message):
    with pytest.raises(RecordingError, match=message):
        write(tmp_path / "x.txt", make_frames(2), **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [write_tum, write_kitti, write_csv])
def test_outputs_that_cannot_be(tmp_path, write):
    (tmp_path / "there").write_text("older")
    with pytest.raises(RecordingError, match="exists already; give --overwrite"):
        write(tmp_path / "there", make_frames(2))
    with pytest.raises(RecordingError, match="is a folder"):
        write(tmp_path, make_frames(2))
    with pytest.raises(RecordingError, match="there is no folder"):
        write(tmp_path / "no" / "where", make_frames(2))
    with pytest.raises(RecordingError, match="no frames to write"):
        write(tmp_path / "none", [])
    assert [file.name for file in tmp_path.iterdir()] == ["there"]
    assert (tmp_path / "there").read_text() == "older"


def test_an_export_that_fails_half_way_leaves_the_older_file(tmp_path):
    def broken():
        yield from make_frames(200)
        raise ZeroDivisionError

    (tmp_path / "run.tum").write_text("older")
    with pytest.raises(ZeroDivisionError):
        write_tum(tmp_path / "run.tum", broken(), target="tdrs", overwrite=True)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["older"]


def test_a_table_has_its_instants_as_text(tmp_path):
    source = dataclasses.replace(ONE, start_utc="2024-09-17T13:59:59.95+02:00")
    path = write_csv(tmp_path / "run.csv", make_frames(3, source=source))
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["utc"] for row in rows] == [
        "2024-09-17T11:59:59.950000Z", "2024-09-17T12:00:00.050000Z", "2024-09-17T12:00:00.150000Z"
    ]  # fmt: skip
    frame = make_frame(2)
    assert float(rows[2]["follower_velocity_y_m_s"]) == frame.truth.states["follower"].velocity_m_s[1]
    assert float(rows[2]["pan_actual_rad"]) == frame.truth.pointing.actual_rad[0]
    assert float(rows[2]["lidar_from_tdrs_z_m"]) == pytest.approx(
        frame.truth.pose("lidar", "tdrs").translation[2], abs=FAR_M
    )
    assert datetime.datetime.fromisoformat(rows[0]["utc"]).tzinfo is not None
