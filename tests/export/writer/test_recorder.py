import dataclasses
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from frames_for_tests import (
    SOURCE,
    assert_same,
    datasets,
    folder_of_somebody,
    leave_unfinished,
    make_frame,
    make_frames,
)

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.pose import PoseTree

RUN = "1a2b3c4d"


def test_save_takes_a_generator_and_holds_one_frame_at_a_time(tmp_path):
    output = tmp_path / "run.h5"
    seen = []

    def flying():
        for k, frame in enumerate(make_frames(5)):
            unfinished = [p for p in tmp_path.iterdir() if re.fullmatch(r"run\.h5\.tmp-[0-9a-f]{8}", p.name)]
            if unfinished:  # another reader, while the writer goes on
                with export.open(unfinished[0]) as recording:
                    assert not recording.complete
                    assert len(recording) == k
                    assert_same(recording[k - 1], make_frame(k - 1))
                    seen.append(k)
            assert not output.exists()
            yield frame

    assert export.save(output, flying()) == output
    assert seen == [1, 2, 3, 4]
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


@pytest.mark.parametrize("name", ["run.hdf5", "run.H5"])
def test_suffix_picks_the_writer(tmp_path, name):
    export.save(tmp_path / name, make_frames(1))
    assert len(export.open(tmp_path / name)) == 1


def never():
    raise AssertionError("a frame was made")
    yield


def test_output_that_cannot_be_is_refused_before_any_frame(tmp_path):
    (tmp_path / "there.h5").write_text("precious")
    (tmp_path / "folder.h5").mkdir()
    os.mkfifo(tmp_path / "pipe.h5")
    cases = {
        "there.h5": r"there\.h5: exists already; give --overwrite",
        "folder.h5": r"folder\.h5: is a folder",
        "pipe.h5": r"pipe\.h5: is not a regular file",
        "none/run.h5": r"run\.h5: there is no folder .*none; create it first",
        "there.h5/run.h5": r"run\.h5: (there is no folder|cannot be written here \(Not a directory\))",
        "run.h6": r"unknown suffix '\.h6'; did you mean '\.h5'\? \(known: \.h5, \.hdf5",
        "run": r"the name has no suffix \(known: \.h5, \.hdf5",
        "x" * 250 + ".h5": r"cannot be written here \(File name too long\)",
    }
    for name, message in cases.items():
        with pytest.raises(RecordingError, match=message) as caught:
            export.save(tmp_path / name, never())
        assert "\n" not in str(caught.value)
        with pytest.raises(RecordingError, match=message):
            export.Recorder(tmp_path / name, SOURCE, run_id=RUN)
    assert (tmp_path / "there.h5").read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.h5", "pipe.h5", "there.h5"]


@pytest.mark.skipif(os.name != "posix", reason="folders have no such rights elsewhere")
def test_folder_without_rights_is_refused():
    with folder_of_somebody() as folder:
        folder.chmod(0o500)
        with pytest.raises(RecordingError, match="the folder may not be written to; choose another"):
            export.save(folder / "run.h5", never())
        assert not list(folder.iterdir())


def test_overwrite_keeps_the_old_file_until_the_new_one_is_complete(tmp_path):
    output = export.save(tmp_path / "run.h5", make_frames(2))

    def breaking():
        yield make_frame(0, seed=2)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        export.save(output, breaking(), overwrite=True)
    assert_same(export.open(output)[0], make_frame(0))
    export.save(output, make_frames(3, seed=2), overwrite=True)
    assert_same(export.open(output)[2], make_frame(2, seed=2))
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_no_frames_is_said(tmp_path):
    with pytest.raises(RecordingError, match="no frames to write"):
        export.save(tmp_path / "run.h5", [])
    with (
        pytest.raises(RecordingError, match="no frames to record"),
        export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_frame_is_said(tmp_path):
    for found, kind in ((3, "int"), (None, "NoneType"), ({"range_m": 1}, "str"), ("x.h5", "str"), ([[]], "list")):
        with pytest.raises(RecordingError, match=rf"run\.h5: got a {kind}, not (a frame|frames); give what simulate"):
            export.save(tmp_path / "run.h5", found)
    assert list(tmp_path.iterdir()) == []


def test_an_exception_after_some_frames_says_where_they_are(tmp_path):
    def breaking(frame):
        yield from make_frames(2)
        if frame is not None:
            yield frame
        raise ZeroDivisionError

    for frame, error in ((None, ZeroDivisionError), (3, RecordingError)):
        with pytest.raises(error) as told:
            export.save(tmp_path / "run.h5", breaking(frame), overwrite=True)
        (left,) = tmp_path.iterdir()
        assert told.value.__notes__ == [
            f"{left}: holds the 2 frames before; open() reads it, and overwrite=True replaces it"
        ]
        with export.open(left) as recording:
            assert len(recording) == 2
    export.save(tmp_path / "run.h5", make_frames(1), overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]


def test_exception_keeps_the_temporary_file_and_resume_goes_on(tmp_path):
    whole = export.save(tmp_path / "whole.h5", make_frames(12, shape=(6, 5)))
    output = tmp_path / "run.h5"
    leave_unfinished(output, make_frames(9, shape=(6, 5)), RUN)
    assert not output.exists()
    left = tmp_path / f"run.h5.tmp-{RUN}"
    with export.open(left) as recording:
        assert len(recording) == 9
        assert not recording.complete
    with h5py.File(left) as plain:  # closed properly: no need of swmr
        assert plain["time"].shape == (9,)

    (tmp_path / "run.h5.tmp-00000000").write_text("another run's")
    with export.Recorder(output, SOURCE, run_id=RUN, resume=True) as recorder:
        assert recorder.written == 9
        for k in range(recorder.written, 12):
            recorder.write(make_frame(k, shape=(6, 5)))
    assert datasets(output) == datasets(whole)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.h5", "run.h5.tmp-00000000", "whole.h5"]


@pytest.mark.slow
def test_resume_goes_on_past_4096_frames(tmp_path):
    """4099 frames, more than any block of them that a copy may take at a time: each row of truth a number of its own."""
    output, count = tmp_path / "run.h5", 4099
    leave_unfinished(output, [_slim(make_frame(0, shape=(1, 1), ptu=False))], RUN)
    unfinished, rng, rows = tmp_path / f"run.h5.tmp-{RUN}", np.random.default_rng(4), {}
    told = ("time", "frame_index", "range", "truth/lidar/position", "truth/lidar/angular_velocity", "settings/energy_j")

    def lengthen(name, item):
        if not (isinstance(item, h5py.Dataset) and item.maxshape and item.maxshape[0] is None):
            return
        item.resize(count, axis=0)
        if name in told:
            values = rng.permutation(item.size).reshape(item.shape).astype(item.dtype)
            rows[name] = item[:] = np.sort(values) if name == "time" else values
        else:
            zeros = (0,) * (item.ndim - 1)
            mask, chunk = item.id.read_direct_chunk((0, *zeros))
            for k in range(1, count):
                item.id.write_direct_chunk((k, *zeros), chunk, mask)

    with h5py.File(unfinished, "r+", libver=("v110", "v110")) as file:
        file.visititems(lengthen)
    assert sorted(rows) == sorted(told)
    with export.Recorder(output, SOURCE, run_id=RUN, resume=True) as recorder:
        assert recorder.written == count
        recorder.write(_slim(make_frame(count, shape=(1, 1), ptu=False)))
    with h5py.File(output) as file:
        assert len(file["time"]) == count + 1 and file["time"][count] == 0.1 * count
        for name, values in rows.items():
            np.testing.assert_array_equal(file[name][:count], values, err_msg=name)

        def same_in_all(name, item):
            if isinstance(item, h5py.Dataset) and item.maxshape and item.maxshape[0] is None and name not in told:
                values = item[:count]
                np.testing.assert_array_equal(values, np.broadcast_to(values[0], values.shape), err_msg=name)

        file.visititems(same_in_all)


def _slim(frame):
    """Return a frame with axes of the lidar alone, and no bodies: few datasets, of which a test makes many frames."""
    truth = frame.truth
    poses = PoseTree({"lidar": "inertial"}, {"lidar": truth.poses["lidar"]})
    return dataclasses.replace(frame, truth=dataclasses.replace(truth, poses=poses, states={}, sunlit={}))


def test_resume_with_nothing_to_resume_starts_at_the_beginning(tmp_path):
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True) as recorder:
        assert recorder.written == 0
        recorder.write(make_frame(0))
    assert len(export.open(tmp_path / "run.h5")) == 1
    with pytest.raises(RecordingError, match="exists already"):
        export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True)
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True, overwrite=True) as recorder:
        assert recorder.written == 0
        recorder.write(make_frame(0))
        recorder.write(make_frame(1))
    assert len(export.open(tmp_path / "run.h5")) == 2


def test_resume_of_all_frames_only_gives_the_name(tmp_path):
    leave_unfinished(tmp_path / "run.h5", make_frames(1), RUN)
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True) as recorder:
        assert recorder.written == 1
    assert_same(export.open(tmp_path / "run.h5")[0], make_frame(0))


def test_stale_temporary_file_is_replaced_without_resume(tmp_path):
    (tmp_path / f"run.h5.tmp-{RUN}").write_text("stale")
    with (
        pytest.raises(RecordingError, match="not an HDF5 file"),
        export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, resume=True),
    ):
        pass
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN) as recorder:
        assert recorder.written == 0
        recorder.write(make_frame(0))
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_a_run_that_was_cut_off_is_not_thrown_away_in_silence(tmp_path):
    leave_unfinished(tmp_path / "run.h5", make_frames(3), RUN)
    with (
        pytest.raises(RecordingError, match=r"holds 3 frames .*--resume"),
        export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN),
    ):
        pass
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, overwrite=True) as recorder:
        assert recorder.written == 0
        recorder.write(make_frame(0))
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_two_runs_do_not_write_one_recording(tmp_path):
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN) as recorder:
        recorder.write(make_frame(0))
        for settings in ({}, {"resume": True}, {"overwrite": True}):
            with (
                pytest.raises(RecordingError, match="another run is writing it"),
                export.Recorder(tmp_path / "run.h5", SOURCE, run_id=RUN, **settings),
            ):
                pass
        recorder.write(make_frame(1))
    assert len(export.open(tmp_path / "run.h5")) == 2
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_output_that_appears_meanwhile_is_not_overwritten(tmp_path):
    def flying():
        yield make_frame(0)
        (tmp_path / "run.h5").write_text("precious")

    with pytest.raises(RecordingError, match="appeared while this ran"):
        export.save(tmp_path / "run.h5", flying())
    assert (tmp_path / "run.h5").read_text() == "precious"
    (left,) = tmp_path.glob("run.h5.tmp-*")
    assert len(export.open(left)) == 1


def test_frames_that_do_not_fit_the_first_are_refused_and_the_others_kept(tmp_path):
    odd = {
        "its line of sight differs": make_frame(1, shape=(5, 5)),
        "its tree of axes differs": make_frame(1, ptu=False),
        r"settings/gain: not in every frame": make_frame(
            1, settings={"focal_length_m": 0.2, "energy_j": 0.05, "gain": 1.0}
        ),
    }
    for place, (message, frame) in enumerate(odd.items()):
        output = tmp_path / f"run{place}.h5"
        with pytest.raises(RecordingError, match=rf"frame 3: {message}"):
            export.save(output, [make_frame(0), frame])
        assert not output.exists()
        (left,) = tmp_path.glob(f"{output.name}.tmp-*")
        assert_same(export.open(left)[0], make_frame(0))


def test_run_id_names_scenario_seed_frames_and_version():
    import dataclasses

    first = export.run_id(SOURCE, "0:10", "0.1.0")
    assert re.fullmatch("[0-9a-f]{8}", first)
    assert first == export.run_id(dataclasses.replace(SOURCE, title="other"), "0:10", "0.1.0")
    others = {
        export.run_id(dataclasses.replace(SOURCE, scenario="x"), "0:10", "0.1.0"),
        export.run_id(dataclasses.replace(SOURCE, seed=1), "0:10", "0.1.0"),
        export.run_id(SOURCE, "0:11", "0.1.0"),
        export.run_id(SOURCE, "0:10", "0.1.1"),
    }
    assert len(others - {first}) == 4


# The child fills its file-size limit, catches the error, and must then end in peace: after a failed write HDF5 alone
# crashes the interpreter at its end.
FULL = """
import resource, signal, sys
sys.path.insert(0, sys.argv[1])
from frames_for_tests import SOURCE, make_frames
from rso_lidar import export
from rso_lidar.errors import RunError
import h5py
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for limit in sys.argv[3:]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), resource.RLIM_INFINITY))
    try:
        with export.Recorder(f"{sys.argv[2]}/{limit}/run.h5", SOURCE, run_id="1a2b3c4d") as recorder:
            for frame in make_frames(60, shape=(40, 40), lit=1.0):
                recorder.write(frame)
    except RunError as error:
        assert isinstance(error.__cause__, OSError | RuntimeError)
        print(limit, recorder.written, error)
"""
LIMITS = (20_000, 300_000, 550_000, 1_000_003)


@pytest.fixture(scope="module")
def full_disks(tmp_path_factory):
    """Record onto disks that are full after so many bytes, in one process; return the folder, and by limit what it said."""
    folder = tmp_path_factory.mktemp("full")
    for limit in LIMITS:
        (folder / str(limit)).mkdir()
    here = Path(__file__).parents[1]
    command = [sys.executable, "-c", FULL, here, folder, *(str(limit) for limit in LIMITS)]
    child = subprocess.run(command, capture_output=True, text=True)
    assert (child.returncode, child.stderr) == (0, "")
    said = dict(line.split(maxsplit=1) for line in child.stdout.splitlines())
    return folder, {int(limit): line for limit, line in said.items()}


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory):
    """Return the datasets of the run on a disk that is large enough."""
    frames = make_frames(60, shape=(40, 40), lit=1.0)
    return datasets(export.save(tmp_path_factory.mktemp("whole") / "whole.h5", frames))


@pytest.mark.skipif(sys.platform == "win32", reason="file-size limits are POSIX")
@pytest.mark.parametrize("limit", LIMITS)
def test_a_full_disk_keeps_whole_frames_and_says_so(full_disks, limit, whole_run):
    folder, said = full_disks[0] / str(limit), full_disks[1]
    output, line = folder / "run.h5", said[limit]
    assert not output.exists()
    written = int(line.split()[0])
    assert f"run.h5: cannot be written after {written} frames (File too large); " in line
    if limit < 100_000:  # not even room for the first frame
        assert line.endswith("make room and run again")
        assert list(folder.iterdir()) == []
        return
    assert line.endswith(f"run.h5.tmp-{RUN} is kept: make room and continue with --resume")
    with export.open(folder / f"run.h5.tmp-{RUN}") as recording:
        assert len(recording) == written > 0
        for k, frame in enumerate(recording):
            assert_same(frame, make_frame(k, shape=(40, 40), lit=1.0))
    with export.Recorder(output, SOURCE, run_id=RUN, resume=True) as recorder:
        assert recorder.written == written
        for k in range(written, 60):
            recorder.write(make_frame(k, shape=(40, 40), lit=1.0))
    assert datasets(output) == whole_run


def test_a_failed_write_in_this_process_is_a_run_error(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    def flying():
        yield make_frame(0)
        monkeypatch.setattr("rso_lidar.export.writer.chunks.ChunkWriter.append", full)
        yield make_frame(1)

    with pytest.raises(RunError, match=r"after 1 frames \(No space left on device\); run.h5.tmp-\w+ is kept") as caught:
        export.save(tmp_path / "run.h5", flying())
    assert isinstance(caught.value.__cause__, OSError)
    (left,) = tmp_path.glob("run.h5.tmp-*")
    assert len(export.open(left)) == 1
