"""A recording seen from beside: while it grows, when its writer is killed, and when it is complete."""

import contextlib
import subprocess
import sys
from pathlib import Path

import pytest
from frames_for_tests import SOURCE, leave_unfinished, make_frame, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export import read_status
from rso_lidar.files import hold_lock

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows renames no open file and has no SIGKILL")

# Writes a frame for each line that it is sent, and says so; ends well at the end of its input.
WRITE = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from frames_for_tests import SOURCE, make_frame
from rso_lidar import export
with export.Recorder(sys.argv[1], SOURCE, run_id="1a2b3c4d", resume=True, overwrite=True) as recorder:
    print(recorder.written, flush=True)
    for k, _ in enumerate(sys.stdin, start=recorder.written):
        recorder.write(make_frame(k))
        print(k, flush=True)
"""


@pytest.fixture
def start(tmp_path):
    """Return a function that starts a writer, and what stops those that still run."""
    children = []

    def begin():
        child = subprocess.Popen(
            [sys.executable, "-c", WRITE, str(tmp_path / "run.h5")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        children.append(child)
        assert child.stdout.readline().strip().isdigit()
        return child

    yield begin
    for child in children:
        child.kill()
        child.communicate()


def one_more(child):
    child.stdin.write("\n")
    child.stdin.flush()
    return int(child.stdout.readline())


def test_a_run_that_does_not_hold_its_lock_yet(monkeypatch, tmp_path):
    lock = tmp_path / ".run.h5.tmp-1a2b3c4d.lock"
    lock.touch()
    with contextlib.ExitStack() as run:
        monkeypatch.setattr("time.sleep", lambda seconds: run.enter_context(hold_lock(lock)))  # while the reader waits
        seen = read_status(tmp_path / "run.h5")
    assert (seen.running, seen.complete, seen.frames, seen.source) == (True, False, 0, None)
    lock.touch()  # as a killed run leaves it
    monkeypatch.undo()
    with pytest.raises(RecordingError, match="there is no such file"):
        read_status(tmp_path / "run.h5")


@pytest.mark.slow
@posix
def test_the_life_of_a_recording(start, tmp_path):
    output, temporary = tmp_path / "run.h5", tmp_path / "run.h5.tmp-1a2b3c4d"
    child = start()
    seen = read_status(output)
    assert (seen.running, seen.complete, seen.frames, seen.source) == (True, False, 0, None)
    for k in range(3):
        assert one_more(child) == k
        for name in (output, temporary):
            seen = read_status(name)
            assert (seen.output, seen.file) == (output, temporary)
            assert (seen.running, seen.complete, seen.frames, seen.time_s) == (True, False, k + 1, 0.1 * k)
            assert seen.source == SOURCE
    child.kill()
    child.wait()
    seen = read_status(output)
    assert (seen.file, seen.running, seen.complete, seen.frames) == (temporary, False, False, 3)
    child = start()  # a resumed run
    assert read_status(output).running
    assert one_more(child) == 3
    child.communicate()  # the end of its input
    seen = read_status(output)
    assert (seen.file, seen.running, seen.complete, seen.frames) == (output, False, True, 4)
    assert read_status(temporary).complete  # by the name that it had


@posix
def test_a_complete_recording_is_read_whole_beside_an_older_look_at_it(start, tmp_path):
    """HDF5 shares what a process knew of a file that grew with whoever opens it later, by its final name too."""
    child = start()
    for _ in range(3):
        one_more(child)
    with export.Recording(tmp_path / "run.h5.tmp-1a2b3c4d") as early:
        assert len(early) == 3
        for _ in range(7):
            one_more(child)
        child.communicate()
        assert read_status(tmp_path / "run.h5").frames == 10
        with export.Recording(tmp_path / "run.h5") as whole:
            assert (len(whole), len(early)) == (10, 3)
            shared = {path: whole.read(path, slice(None)) for path in whole.paths}
        assert early.range_m[2].tobytes() == shared["range"][2].tobytes()
    with export.Recording(tmp_path / "run.h5") as alone:
        assert [path for path in alone.paths if alone.read(path, slice(None)).tobytes() != shared[path].tobytes()] == []


@posix
def test_a_run_under_way_counts_more_than_what_it_replaces(start, tmp_path):
    export.save(tmp_path / "run.h5", make_frames(5))
    assert read_status(tmp_path / "run.h5").complete
    child = start()
    one_more(child)
    seen = read_status(tmp_path / "run.h5")
    assert (seen.running, seen.frames) == (True, 1)


def test_looking_does_not_disturb_a_writer(tmp_path):
    with export.Recorder(tmp_path / "run.h5", SOURCE, run_id="1a2b3c4d") as recorder:
        for k in range(5):
            recorder.write(make_frame(k))
            assert read_status(tmp_path / "run.h5").frames == k + 1
    with export.open(tmp_path / "run.h5") as frames:
        assert len(frames) == 5


def test_the_youngest_of_several_that_were_left(tmp_path):
    output = tmp_path / "run.h5"
    leave_unfinished(output, make_frames(4), "00000001")
    leave_unfinished(output, make_frames(2), "00000000")
    (tmp_path / "run.h5.tmp-00000002.starting").write_bytes(b"half")
    (tmp_path / "run.h5.txt").write_text("another")
    assert read_status(output).frames == 2
    assert read_status(tmp_path / "run.h5.tmp-00000001").frames == 4


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no.h5", "there is no such file; did you mean 'now.h5'"),
        ("deep/no.h5", "there is no folder"),
        ("text.h5", "is not an HDF5 file"),
        ("folder.h5", "is a folder"),
        ("short.h5", "is cut short"),
        ("now.h5.tmp-00000000", "now.h5.tmp-00000000: there is no such file|complete"),
    ],
)
def test_what_cannot_be_looked_at(tmp_path, name, message):
    whole = export.save(tmp_path / "now.h5", make_frames(2)).read_bytes()
    (tmp_path / "text.h5").write_text("no recording")
    (tmp_path / "short.h5").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "folder.h5").mkdir()
    if "tmp" in name:
        assert read_status(tmp_path / name).complete  # the run of that name may have ended well
        return
    with pytest.raises(RecordingError, match=message):
        read_status(tmp_path / name)
