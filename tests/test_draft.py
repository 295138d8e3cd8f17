"""Files written whole or not at all; locks: one holder at a time, waited for or not, and none outlives its process."""

import os
import subprocess
import sys
import threading

import pytest

from rso_lidar.draft import beside, hold_lock, is_locked
from rso_lidar.errors import RecordingError, RunError


def test_what_stops_half_way_leaves_the_old_picture(tmp_path):
    place = tmp_path / "a.png"
    place.write_text("old")

    def stop(error):
        with beside(place) as draft:
            draft.write_text("half")
            raise error

    with pytest.raises(KeyboardInterrupt):
        stop(KeyboardInterrupt())
    with pytest.raises(RunError, match="could not be written: No space left"):
        stop(OSError(28, "No space left on device"))
    with pytest.raises(RecordingError, match="may not be written"):
        stop(PermissionError(13, "Permission denied"))
    assert place.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_draft_is_nobody_elses_file(tmp_path):
    place = tmp_path / "a.png"
    own = [tmp_path / "a.part.png", tmp_path / "a.part1.png"]
    for path in own:
        path.write_text("mine")
    with beside(place) as draft:
        assert draft.suffix == ".png"
        assert draft not in own
        with beside(place) as another:  # at the same time
            assert another not in (draft, *own)
            another.write_text("second")
        draft.write_text("first")
    assert place.read_text() == "first"
    assert [path.read_text() for path in own] == ["mine", "mine"]
    with pytest.raises(RecordingError, match="there is no folder"), beside(tmp_path / "none" / "a.png"):
        raise AssertionError("begun")
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_may_not_be_written_is_told(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refused)
    with pytest.raises(RecordingError, match="may not be written"), beside(tmp_path / "a.png"):
        raise AssertionError("begun")


def test_a_second_is_refused_waits_or_is_let_in(tmp_path):
    path = tmp_path / ".run.h5.lock"
    assert is_locked(path) is False
    with hold_lock(path):
        assert is_locked(path) is True
        with pytest.raises(RecordingError, match=r"^run\.h5: another run is writing it"), hold_lock(path):
            pass
        with pytest.raises(RecordingError, match=r"^busy$"), hold_lock(path, wait_s=0.05, busy="busy"):
            pass
        assert is_locked(path) is True, "whoever was refused took nothing away"
    assert not list(tmp_path.iterdir())
    order, first = [], hold_lock(path)
    first.__enter__()
    threading.Timer(0.1, lambda: (order.append("first is done"), first.__exit__(None, None, None))).start()
    with hold_lock(path, wait_s=300.0):
        order.append("second")
    assert order == ["first is done", "second"]


def test_a_lock_whose_file_was_deleted_by_its_last_holder_is_taken_anew(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl", reason="Windows deletes no file that is open")
    path, real, calls = tmp_path / ".index.lock", fcntl.flock, []

    def flock(descriptor, what):
        real(descriptor, what)
        if not calls:
            path.unlink()  # as the last holder does, between another's opening and locking
        calls.append(what)

    monkeypatch.setattr(fcntl, "flock", flock)
    with hold_lock(path):
        assert len(calls) == 2 and path.exists(), "whoever comes next sees this lock"


def test_a_killed_process_holds_no_lock(tmp_path):
    path = tmp_path / ".run.h5.lock"
    code = "import sys, time; from pathlib import Path; from rso_lidar.draft import hold_lock\n"
    code += "with hold_lock(Path(sys.argv[1])): print('held', flush=True); time.sleep(600)"
    with subprocess.Popen([sys.executable, "-c", code, path], stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == b"held\n"
        assert is_locked(path) is True
        with pytest.raises(RecordingError, match="another run is writing it"), hold_lock(path):
            pass
        holder.kill()
        holder.wait()
    assert path.exists() and is_locked(path) is False
    with hold_lock(path):
        assert is_locked(path) is True


def test_no_lock_where_nothing_may_be_written(tmp_path, monkeypatch):
    with pytest.raises(RunError, match=r"none/\.index\.lock: cannot be written \(No such file or directory\)"):
        hold_lock(tmp_path / "none" / ".index.lock").__enter__()
    assert not (tmp_path / "none").exists(), "a lock makes no folder"

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(RecordingError, match=r"may not be written \(Permission denied\); choose another folder"):
        hold_lock(tmp_path / ".index.lock").__enter__()
    assert is_locked(tmp_path / ".index.lock") is None, "what may not be looked at is not known to be free"
