"""A lens that changes from frame to frame: its lines of sight are stored once each, and each frame finds its own."""

import h5py
import numpy as np
import pytest
from frames_for_tests import SOURCE, assert_same, datasets, leave_unfinished, line_of_sight, make_frame, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.reader import hdf5_file
from rso_lidar.export.writer.lens_tables import LensTables

RUN = "1a2b3c4d"
ZOOMS = [1.0, 2.0, 1.0, 3.0, 2.0, 2.0]  # of frame k
NUMBERS = [0, 1, 0, 2, 1, 1]


def zoom(k):
    return ZOOMS[k % len(ZOOMS)]


def record(path, frames, **how):
    with export.Recorder(path, SOURCE, run_id=RUN, **how) as recorder:
        for frame in frames:
            recorder.write(frame)
    return path


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return record(tmp_path_factory.mktemp("lens") / "run.h5", make_frames(6, zoom=zoom), changing_lens=True)


def test_each_frame_has_its_own_line_of_sight(saved):
    with export.open(saved) as recording:
        assert recording.changes_lens
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, zoom=zoom))
        np.testing.assert_array_equal(recording[3].line_of_sight, line_of_sight((12, 10), 3.0))
        assert_same(recording[0], make_frame(0))  # and backwards


def test_tables_are_stored_once(saved):
    with export.open(saved) as recording:
        assert recording.lens[:].tolist() == NUMBERS
        assert recording.lens.dtype == np.dtype("i4")
        tables = np.stack([line_of_sight((12, 10), zoom) for zoom in (1.0, 2.0, 3.0)])
        np.testing.assert_array_equal(recording.line_of_sight, tables)
    with h5py.File(saved) as file:
        assert file["line_of_sight"].shape == (3, 12, 10, 3)
        assert file["line_of_sight"].dtype == np.dtype("f8")
        assert [dim[0].name for dim in file["line_of_sight"].dims] == ["/lens_number", "/row", "/col", "/xyz"]
        assert [dim[0].name for dim in file["lens"].dims] == ["/time"]
        assert file["lens_number"][:].tolist() == [0, 1, 2]
        assert file["lens"].attrs["long_name"] and file["lens_number"].attrs["long_name"]


@pytest.mark.parametrize("pixel", [(0, 0, 1), (7, 3, 0), (11, 9, 2)])
def test_tables_that_differ_in_one_pixel_are_two(tmp_path, pixel):
    """A table is known by all of its entries, first row, last row and between, to the last bit of one of them."""
    first = line_of_sight((12, 10), 2.0)
    second = first.copy()
    second[pixel] = np.nextafter(second[pixel], 2.0)
    with h5py.File(tmp_path / "tables.h5", "w") as file:
        file.create_dataset("line_of_sight", (0, 12, 10, 3), "f8", maxshape=(None, 12, 10, 3))
        file.create_dataset("lens_number", (0,), "i4", maxshape=(None,))
        tables = LensTables(file)
        assert [tables.number(table) for table in (first, second, first.copy(), second.copy())] == [0, 1, 0, 1]
        np.testing.assert_array_equal(file["line_of_sight"], [first, second])


def test_one_lens_in_a_file_for_many(tmp_path):
    path = record(tmp_path / "run.h5", make_frames(3), changing_lens=True)
    with export.open(path) as recording:
        assert recording.line_of_sight.shape == (1, 12, 10, 3)
        assert recording.lens[:].tolist() == [0, 0, 0]
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k))


def test_one_lens_has_the_plain_layout(tmp_path):
    with export.open(export.save(tmp_path / "run.h5", make_frames(2))) as recording:
        assert not recording.changes_lens
        assert recording.line_of_sight.shape == (12, 10, 3)
        with pytest.raises(RecordingError, match="there is no dataset lens in it"):
            _ = recording.lens


def test_save_finds_out(tmp_path, saved):
    path = export.save(tmp_path / "run.h5", make_frames(6, zoom=zoom))
    assert datasets(path) == datasets(saved)
    again = export.save(tmp_path / "again.h5", export.open(path))
    with export.open(again) as recording:
        assert recording.lens[:].tolist() == NUMBERS
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, zoom=zoom))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again.h5", "run.h5"]


def test_save_finds_out_late_and_with_all_that_is_kept(tmp_path):
    how = {"shape": (6, 5), "returns": True, "keep": ("waveforms", "photons"), "zoom": lambda k: 1.0 + (k > 6)}
    path = export.save(tmp_path / "run.h5", make_frames(9, **how))
    with export.open(path) as recording:
        assert recording.lens[:].tolist() == [0] * 7 + [1] * 2
        for k in (0, 6, 7, 8):
            assert_same(recording[k], make_frame(k, **how))


def test_without_being_told_a_recorder_refuses(tmp_path):
    message = r"frame 3: its line of sight differs from the first's; record .*, or all of them with changing_lens=True"
    with pytest.raises(RecordingError, match=message) as caught:
        record(tmp_path / "run.h5", make_frames(2, zoom=zoom))
    assert "\n" not in str(caught.value)
    assert_same(export.open(tmp_path / f"run.h5.tmp-{RUN}")[0], make_frame(0))


@pytest.mark.parametrize("changing", [True, None])
def test_other_pixels_are_refused_all_the_same(tmp_path, changing):
    with pytest.raises(
        RecordingError, match=r"frame 3: its line of sight differs from the first's; record it to another"
    ):
        record(tmp_path / "run.h5", [make_frame(0), make_frame(1, shape=(5, 5))], changing_lens=changing)


# ------------------------------------------------------------------------------------------- unfinished and resumed


def test_a_reader_follows_the_writer(tmp_path):
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, changing_lens=True) as recorder:
        for k, frame in enumerate(make_frames(6, zoom=zoom)):
            recorder.write(frame)
            with export.open(recorder.temporary) as recording:
                assert len(recording) == k + 1
                assert len(recording.line_of_sight) == max(NUMBERS[: k + 1]) + 1
                assert_same(recording[k], make_frame(k, zoom=zoom))


@pytest.mark.parametrize(("count", "changing"), [(1, None), (3, True), (3, None), (5, True)])
def test_resume_goes_on(tmp_path, saved, count, changing):
    output = tmp_path / "run.h5"
    leave_unfinished(output, make_frames(count, zoom=zoom), RUN, changing_lens=changing)
    with export.Recorder(output, SOURCE, run_id=RUN, resume=True, changing_lens=changing) as recorder:
        assert recorder.written == count
        for k in range(count, 6):
            recorder.write(make_frame(k, zoom=zoom))
    assert datasets(output) == datasets(saved)


def test_a_table_whose_frame_was_lost_is_left_behind(tmp_path, monkeypatch):
    output = tmp_path / "run.h5"

    def full(*_):
        raise OSError(28, "No space left on device")

    with (
        pytest.raises(RunError, match="after 1 frames"),
        export.Recorder(output, SOURCE, run_id=RUN, changing_lens=True) as recorder,
    ):
        recorder.write(make_frame(0))
        with monkeypatch.context() as patch:
            patch.setattr("rso_lidar.export.writer.chunks.ChunkWriter.append", full)
            recorder._file.flush()
            recorder._lenses.number(line_of_sight((12, 10), 9.0))
            recorder._file.flush()
            recorder._superblock = hdf5_file.read_superblock(recorder._file)
            recorder.write(make_frame(1, zoom=2.0))
    with export.open(recorder.temporary) as recording:
        assert recording.dataset("time").shape == (1,)
        assert recording.line_of_sight.shape == (1, 12, 10, 3)
    with export.Recorder(output, SOURCE, run_id=RUN, resume=True, changing_lens=True) as recorder:
        recorder.write(make_frame(1, zoom=2.0))
    with export.open(output) as recording:
        assert recording._file["line_of_sight"].shape == (2, 12, 10, 3)
        assert_same(recording[1], make_frame(1, zoom=2.0))


# ------------------------------------------------------------------------------------------------------ other readers


def test_xarray_opens_it_unchanged(saved):
    import xarray

    with xarray.open_dataset(saved, engine="h5netcdf") as root:
        assert root["line_of_sight"].dims == ("lens_number", "row", "col", "xyz")
        assert root["lens"].dims == ("time",)
        points = root["range"] * root["line_of_sight"].sel(lens_number=root["lens"])
        for k in range(6):
            np.testing.assert_allclose(
                points.isel(time=k).transpose("row", "col", "xyz"), make_frame(k, zoom=zoom).points_m, rtol=1e-6
            )


def test_damage_is_said_in_one_line(tmp_path, saved):
    for path in ("lens", "line_of_sight"):
        (tmp_path / "run.h5").write_bytes(saved.read_bytes())
        with h5py.File(tmp_path / "run.h5", "a") as file:
            del file[path]
        with pytest.raises(RecordingError, match=rf"the dataset {path} is missing"):
            export.open(tmp_path / "run.h5")
    for number in (-1, 3):
        (tmp_path / "run.h5").write_bytes(saved.read_bytes())
        with h5py.File(tmp_path / "run.h5", "a") as file:
            file["lens"][2] = number
        with export.open(tmp_path / "run.h5") as recording:
            assert_same(recording[1], make_frame(1, zoom=zoom))
            with pytest.raises(RecordingError, match=rf"is damaged \(no line of sight {number} among 3\)"):
                recording[2]
