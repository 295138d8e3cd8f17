import re
import shutil

import h5py
import numpy as np
import pytest
from frames_for_tests import PARENTS, SOURCE, assert_same, leave_unfinished, make_frame, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return export.save(tmp_path_factory.mktemp("recording") / "run.h5", make_frames(9))


@pytest.fixture
def recording(saved):
    with export.open(saved) as recording:
        yield recording


def test_every_frame_comes_back_as_it_was(recording):
    assert len(recording) == 9
    assert recording.complete
    assert recording.source == SOURCE
    for k, frame in enumerate(recording):
        assert_same(frame, make_frame(k))
    assert_same(recording[-1], make_frame(8))
    with pytest.raises(IndexError, match="no frame 9; it has 9"):
        recording[9]


def test_any_pose_and_rate_survives(recording):
    """Between all pairs; the composed float64 product of lever arms of 4.2e7 m is good to about 10 nm."""
    before, after = make_frame(4).truth, recording[4].truth
    for a in ["inertial", *PARENTS]:
        for b in ["inertial", *PARENTS]:
            np.testing.assert_allclose(
                after.pose(a, b).as_matrix(), before.pose(a, b).as_matrix(), rtol=1e-13, atol=1e-7
            )
            for rate, other in zip(before.rates(a, b), after.rates(a, b), strict=True):
                np.testing.assert_allclose(other, rate, rtol=1e-12, atol=1e-6)


def test_position_and_quaternion_are_lidar_from_each(recording):
    for name in PARENTS:
        pose = make_frame(4).truth.pose("lidar", name)
        position = recording.dataset(f"truth/{name}/position")[4]
        quaternion = recording.dataset(f"truth/{name}/quaternion")[4]
        np.testing.assert_allclose(position, pose.translation, rtol=1e-13, atol=1e-7)
        np.testing.assert_allclose(quaternion, pose.rotation.as_quat(canonical=True), atol=1e-14)


def test_without_a_ptu_there_is_no_pan_and_tilt(tmp_path):
    with export.open(export.save(tmp_path / "run.h5", make_frames(2, ptu=False))) as recording:
        assert_same(recording[1], make_frame(1, ptu=False))
        with h5py.File(recording.path) as file:
            assert "ptu" not in file


def test_local_world_and_big_seed_survive(tmp_path):
    import dataclasses

    frame = make_frame(0)
    source = dataclasses.replace(SOURCE, seed=2**70, start_utc="2024-09-17T14:00:00.5+02:00", title="", targets=())
    truth = dataclasses.replace(frame.truth, sun_direction=np.full(3, np.nan), states={})
    frame = dataclasses.replace(frame, source=source, truth=truth)
    with export.open(export.save(tmp_path / "run.h5", [frame])) as recording:
        assert_same(recording[0], frame)
        assert recording.dataset("time").attrs["units"] == "seconds since 2024-09-17 12:00:00.500000"


def test_slices_are_lazy_sequences_of_frames(recording):
    some = recording[2:8:2]
    assert [frame.index for frame in some] == [6, 12, 18]
    assert [frame.index for frame in some[::-1]] == [18, 12, 6]
    assert len(recording[20:]) == 0
    assert_same(some[-1], make_frame(6))


def test_arrays_are_indexed_like_numpy_and_read_in_part(recording, monkeypatch):
    range_m = np.stack([frame.range_m for frame in make_frames(9)])
    keys = [
        *[3, -1, np.int64(2), slice(2, 5), slice(None), slice(7, 1, -2), slice(5, 2), ..., None],
        *[[1, 4, 4, 0], np.array([[0, 1], [2, -1]]), np.arange(9) % 2 == 0, [], ()],
        *[(3, 2), (slice(1, 3), 5), (slice(None, None, 3), ..., 4), (..., 1), (4, slice(None), [1, 2])],
        *[([0, 3], [1, 2], [3, 4]), (slice(2, 4), slice(None, None, -1)), (-2, 3, 4), range_m > 300.5, True],
    ]
    for key in keys:
        key = np.array([], int) if isinstance(key, list) and not key else key
        np.testing.assert_array_equal(recording.range_m[key], range_m[key], err_msg=str(key))
        assert recording.range_m[key].dtype == range_m.dtype
    np.testing.assert_array_equal(np.asarray(recording.range_m), range_m)
    with pytest.raises(IndexError, match="no frame 9"):
        recording.range_m[9]
    assert (recording.range_m.shape, recording.range_m.ndim, len(recording.range_m)) == ((9, 12, 10), 3, 9)

    read = []
    real = export.StoredArray._read
    monkeypatch.setattr(export.StoredArray, "_read", lambda view, frames: read.append(frames) or real(view, frames))
    recording.range_m[2:4]
    recording.range_m[5, 3]
    assert read == [slice(2, 4, 1), slice(5, 6)]


def test_all_arrays_are_there(recording):
    frames = list(make_frames(9))
    np.testing.assert_array_equal(recording.time_s[:], [frame.time_s for frame in frames])
    np.testing.assert_array_equal(recording.frame_index[:], [frame.index for frame in frames])
    np.testing.assert_array_equal(
        recording.intensity_counts[2:4], [frames[2].intensity_counts, frames[3].intensity_counts]
    )
    assert recording.saturated[2].dtype == bool
    np.testing.assert_array_equal(recording.saturated[2], frames[2].saturated)
    for name, value in vars(frames[7].labels).items():
        if value is None:
            assert not hasattr(recording.labels, name)
        else:
            np.testing.assert_array_equal(getattr(recording.labels, name)[7], value)


def test_closed_recording_says_so(saved):
    recording = export.open(saved)
    recording.close()
    with pytest.raises(RecordingError, match="is closed; open it again"):
        recording[0]


# ------------------------------------------------------------------------------------------------------ other readers


def test_plain_h5py_reads_the_layout(saved):
    with h5py.File(saved) as file:
        assert file.attrs["Conventions"] == "CF-1.11"
        assert file.attrs["quaternion_order"] == "xyzw"
        assert file["range"].shape == (9, 12, 10)
        assert file["range"].chunks == (1, 12, 10)
        assert (file["range"].compression, file["range"].compression_opts, file["range"].shuffle) == ("gzip", 1, True)
        assert [dim.label or dim[0].name for dim in file["range"].dims] == ["/time", "/row", "/col"]
        assert [dim[0].name for dim in file["truth/tdrs/quaternion"].dims] == ["/time", "/quaternion"]
        assert [dim[0].name for dim in file["line_of_sight"].dims] == ["/row", "/col", "/xyz"]
        assert file["truth/follower"].attrs["parent"] == "tdrs.rtn"
        assert file["labels/facet"].attrs["_FillValue"] == -1
        assert np.isnan(file["range"].attrs["_FillValue"])
        assert file["labels/target"].attrs["flag_meanings"] == "tdrs rock"
        wanted = {"range": "f4", "intensity": "u2", "saturated": "u1", "line_of_sight": "f8", "time": "f8"}
        wanted |= {"labels/range_m": "f8", "labels/first_range_m": "f8", "labels/target": "i2", "labels/part": "i2"}
        wanted |= {"labels/facet": "i4", "labels/cluster_count": "u1", "labels/photons": "f4"}
        wanted |= {"labels/cos_incidence": "f4", "labels/filled_fraction": "f4", "settings/energy_j": "f8"}
        wanted |= {f"ptu/{a}_{b}_rad": "f8" for a in ("pan", "tilt") for b in ("demand", "actual", "measured")}
        wanted |= {"ptu/pan_rate_rad_s": "f8", "truth/tdrs/inertial_velocity": "f8", "truth/sun_direction": "f8"}
        for path, dtype in wanted.items():
            assert file[path].dtype == np.dtype(dtype), path

        def described(name, item):
            if isinstance(item, h5py.Dataset):
                assert item.attrs["long_name"], name
                assert name in ("xyz", "quaternion") or item.attrs["units"], name

        file.visititems(described)


def test_xarray_opens_it_unchanged(saved):
    import xarray

    frames = list(make_frames(9))
    with xarray.open_dataset(saved, engine="h5netcdf") as root:
        assert root["range"].dims == ("time", "row", "col")
        assert root["line_of_sight"].dims == ("row", "col", "xyz")
        assert root["range"].attrs["units"] == "m"
        assert root["time"].values[0] == np.datetime64("2024-09-17T12:00:00")
        np.testing.assert_array_equal(root["range"].isel(time=3), frames[3].range_m)
        points = root["range"] * root["line_of_sight"]
        np.testing.assert_allclose(points.isel(time=3).transpose("row", "col", "xyz"), frames[3].points_m, rtol=1e-6)
    with xarray.open_datatree(saved, engine="h5netcdf") as tree:
        assert tree["labels/target"].dims == ("time", "row", "col")
        sky = np.isnan(frames[3].range_m)
        np.testing.assert_array_equal(np.isnan(tree["labels/target"].isel(time=3)), sky)
        assert tree["truth/tdrs"].attrs["parent"] == "inertial"
        assert tree["truth/tdrs.rtn/quaternion"].dims == ("time", "quaternion")
        assert tree["truth/lidar"].ds["position"].sel(time="2024-09-17T12:00:00").dims[-1] == "xyz"
        assert tree["ptu/pan_actual_rad"].attrs["units"] == "rad"
        assert tree["settings/focal_length_m"].attrs["units"] == "m"


# ------------------------------------------------------------------------------------------------------- bad files


def one_line(path):
    with pytest.raises(RecordingError) as caught:
        export.open(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_what_is_no_recording_is_said_in_one_line(tmp_path, saved):
    (tmp_path / "text.h5").write_text("hello" * 1000)
    assert "is not an HDF5 file" in one_line(tmp_path / "text.h5")
    (tmp_path / "empty.h5").touch()
    assert "is not an HDF5 file, or is cut short" in one_line(tmp_path / "empty.h5")
    assert "is a folder" in one_line(tmp_path)
    (tmp_path / "run.txt").touch()
    assert "unknown suffix '.txt'" in one_line(tmp_path / "run.txt")
    shutil.copy(saved, tmp_path / "approach.h5")
    assert "did you mean 'approach.h5'?" in one_line(tmp_path / "aproach.h5")
    assert "there is no folder" in one_line(tmp_path / "none" / "run.h5")
    shutil.copy(saved, tmp_path / "hop.h5.tmp-1a2b3c4d")
    assert "only the unfinished hop.h5.tmp-1a2b3c4d: open that, or continue with --resume" in one_line(
        tmp_path / "hop.h5"
    )
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file.create_dataset("x", data=np.zeros(3), dtype="f8")
    assert "holds arrays but is not a recording" in one_line(tmp_path / "other.h5")


def test_newer_schema_and_missing_datasets_are_named(tmp_path, saved):
    paths = []
    with h5py.File(saved) as file:
        file.visit(paths.append)
    needed = [
        path
        for path in paths
        if path not in ("row", "col", "xyz", "quaternion")
        and not path.startswith(("settings", "truth/follower/", "truth/ptu/", "truth/tdrs.rtn/"))  # as tdrs and lidar
    ]
    for path in needed:
        shutil.copy(saved, tmp_path / "run.h5")
        with h5py.File(tmp_path / "run.h5", "a") as file:
            del file[path]
        if path == "ptu":
            continue  # a recording without a PTU
        assert re.search(r"the datasets? \S+.* (is|are) missing|is damaged", one_line(tmp_path / "run.h5")), path
    shutil.copy(saved, tmp_path / "new.h5")
    with h5py.File(tmp_path / "new.h5", "a") as file:
        file.attrs["schema_version"] = np.int64(99)
    assert "is of schema 99" in one_line(tmp_path / "new.h5")
    assert "upgrade rso_lidar" in one_line(tmp_path / "new.h5")


def test_a_file_cut_anywhere_is_refused(tmp_path, saved):
    whole = saved.read_bytes()
    cuts = {0, 1, 7, 8, 12, 47, 48, 60, 95, 96, 500, len(whole) - 1, *range(1000, len(whole), len(whole) // 40)}
    for cut in cuts:
        (tmp_path / "run.h5").write_bytes(whole[:cut])
        assert "is cut short" in one_line(tmp_path / "run.h5"), cut


def test_a_temporary_file_cut_anywhere_is_refused(tmp_path):
    """Closed after an exception, and as a kill would leave it: marked as being written."""
    leave_unfinished(tmp_path / "run.h5", make_frames(20, shape=(6, 5)), "00")
    closed = (tmp_path / "run.h5.tmp-00").read_bytes()
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id="01") as recorder:
        for frame in make_frames(20, shape=(6, 5)):
            recorder.write(frame)
        killed = recorder.temporary.read_bytes()
    assert (closed[11], killed[11]) == (0, 5)  # the superblock's flags: open for writing (1), SWMR (4)
    for whole in (closed, killed):
        (tmp_path / "cut.h5.tmp-00").write_bytes(whole)
        with export.open(tmp_path / "cut.h5.tmp-00") as recording:
            assert_same(recording[19], make_frame(19, shape=(6, 5)))
        for cut in range(len(whole) - 1, 0, -len(whole) // 40):
            (tmp_path / "cut.h5.tmp-00").write_bytes(whole[:cut])
            # While a run writes, the superblock lags by the last chunk: a cut there is found by the chunk's checksum.
            with (
                pytest.raises(RecordingError, match=r"is cut short|is damaged"),
                export.open(tmp_path / "cut.h5.tmp-00") as found,
            ):
                assert_same(found[19], make_frame(19, shape=(6, 5)))


def test_flipped_bytes_give_frames_or_one_line(tmp_path):
    """A damaged file may hide its damage, but what it raises is a `RecordingError` of one line."""
    rng = np.random.default_rng(404)
    path = export.save(tmp_path / "whole.h5", make_frames(2, shape=(6, 5)))
    whole = path.read_bytes()
    said: list[tuple[str, str]] = []
    for number in range(75):
        data = bytearray(whole)
        start = int(rng.integers(0, len(data) - 512))
        data[start : start + int(rng.choice([1, 8, 512]))] = rng.bytes(1)
        broken = tmp_path / f"broken{number}.h5"
        broken.write_bytes(bytes(data[: len(whole)]))
        try:
            with export.open(broken) as recording:
                for frame in recording:
                    assert frame.range_m.shape == (6, 5)
        except RecordingError as error:
            said.append((broken.name, str(error)))
    assert len(said) > 5
    assert all(name in line and "\n" not in line for name, line in said)


def test_other_tools_files_and_unknown_suffixes_are_told_apart(tmp_path):
    (tmp_path / "a.mcap").touch()
    (tmp_path / "a.rosbag2").mkdir()
    (tmp_path / "a.mat").touch()
    for name in ("a.mcap", "a.rosbag2"):
        with pytest.raises(RecordingError, match=r"written for other tools and cannot be read back.*\.zarr\)$"):
            export.open(tmp_path / name)
    with pytest.raises(RecordingError, match=r"unknown suffix '.mat' \(known: .h5, .hdf5, .nc, .zarr\)$"):
        export.open(tmp_path / "a.mat")


def test_a_recording_says_what_it_is(tmp_path):
    path = export.save(tmp_path / "a.h5", make_frames(3))
    with export.open(path) as recording:
        span = f"{recording.time_s[0]:g} to {recording.time_s[2]:g} s"
        assert repr(recording) == f"<Recording a.h5: 3 frames, {span}>"
    assert repr(recording).startswith("<Recording a.h5: 3 frames")  # closed
