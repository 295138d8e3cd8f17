"""Files written whole or not at all; locks: one holder at a time, waited for or not, and none outlives its process."""

import os
import subprocess
import sys
import threading

import pytest

from rso_lidar.draft import beside, free, hold_lock, is_locked, write_text
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


def test_a_free_path_comes_back_with_the_home_folder_in_full(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert free("~/x.csv", (".csv",)) == tmp_path / "x.csv"
    assert free(str(tmp_path / "X.CSV"), (".csv",)) == tmp_path / "X.CSV"
    assert free(tmp_path / "any.thing") == tmp_path / "any.thing"
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_free_only_to_overwrite(tmp_path):
    (tmp_path / "x.csv").write_text("precious")
    with pytest.raises(
        RecordingError, match=r"x\.csv: exists already; give --overwrite \(overwrite=True\) or another name"
    ):
        free(tmp_path / "x.csv")
    assert free(tmp_path / "x.csv", overwrite=True) == tmp_path / "x.csv"
    assert (tmp_path / "x.csv").read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("x.cvs", "unknown suffix '.cvs'; did you mean '.csv'? (known: .csv, .png)"),
        ("x.foo", "unknown suffix '.foo'; (known: .csv, .png)"),
        ("x", "the name has no suffix; (known: .csv, .png)"),
        ("", "the name has no suffix"),
        ("folder.csv", "is a folder; name a file in it"),
        ("none/x.csv", "there is no folder"),
        ("fifo.csv", "is not a regular file"),
        ("x" * 300 + ".csv", "cannot be written here (File name too long)"),
        ("x\0.csv", "cannot be written here"),
        ("~nobody_of_that_name/x.csv", "cannot be written here"),
    ],
)
def test_what_is_not_free(tmp_path, monkeypatch, name, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "fifo.csv")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RecordingError) as told:
        free(name, (".csv", ".png"), overwrite=True)
    assert said in str(told.value)
    assert "\n" not in str(told.value)
    assert sorted(tmp_path.iterdir()) == before


def test_a_read_only_folder_is_told_before_work_begins(tmp_path, monkeypatch):
    monkeypatch.setattr("rso_lidar.draft.os.access", lambda *_: False)  # root may write everywhere
    with pytest.raises(RecordingError, match="the folder may not be written to"):
        free(tmp_path / "x.csv")


def test_a_text_is_written_whole_and_an_older_one_kept(tmp_path):
    path = tmp_path / "a.oem"
    assert write_text(path, "one\n").read_bytes() == b"one\n"
    with pytest.raises(RecordingError, match="exists already"):
        write_text(path, "two")
    assert write_text(path, "three", overwrite=True).read_text() == "three"
    assert [file.name for file in tmp_path.iterdir()] == ["a.oem"]
