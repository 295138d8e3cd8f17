"""Files written whole or not at all; locks: one holder at a time, waited for or not, and none outlives its process."""

import errno
import os
import shutil
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.files import check_stream, check_writable, hold_lock, is_locked, write_atomically, write_text


def test_what_stops_half_way_leaves_the_old_picture(tmp_path):
    place = tmp_path / "a.png"
    place.write_text("old")

    def stop(error):
        with write_atomically(place) as draft:
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
    with write_atomically(place) as draft:
        assert draft.suffix == ".png"
        assert draft not in own
        with write_atomically(place) as another:  # at the same time
            assert another not in (draft, *own)
            another.write_text("second")
        draft.write_text("first")
    assert place.read_text() == "first"
    assert [path.read_text() for path in own] == ["mine", "mine"]
    with pytest.raises(RecordingError, match="there is no folder"), write_atomically(tmp_path / "none" / "a.png"):
        raise AssertionError("begun")
    assert len(list(tmp_path.iterdir())) == 3


def test_a_folder_that_may_not_be_written_is_told(tmp_path, monkeypatch):
    def refused(path, *_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refused)
    with pytest.raises(RecordingError, match="may not be written"), write_atomically(tmp_path / "a.png"):
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
    code = "import sys, time; from pathlib import Path; from rso_lidar.files import hold_lock\n"
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
    assert check_writable("~/x.csv", (".csv",)) == tmp_path / "x.csv"
    assert check_writable(str(tmp_path / "X.CSV"), (".csv",)) == tmp_path / "X.CSV"
    assert check_writable(tmp_path / "any.thing") == tmp_path / "any.thing"
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_free_only_to_overwrite(tmp_path):
    (tmp_path / "x.csv").write_text("precious")
    with pytest.raises(
        RecordingError, match=r"x\.csv: exists already; give --overwrite \(overwrite=True\) or another name"
    ):
        check_writable(tmp_path / "x.csv")
    assert check_writable(tmp_path / "x.csv", overwrite=True) == tmp_path / "x.csv"
    assert (tmp_path / "x.csv").read_text() == "precious"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("x.cvs", "unknown suffix '.cvs'; did you mean '.csv'? (known: .csv, .png)"),
        ("x.foo", "unknown suffix '.foo' (known: .csv, .png)"),
        ("x", "the name has no suffix (known: .csv, .png)"),
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
        check_writable(name, (".csv", ".png"), overwrite=True)
    assert said in str(told.value)
    assert "\n" not in str(told.value)
    assert sorted(tmp_path.iterdir()) == before


def test_a_read_only_folder_is_told_before_work_begins(tmp_path, monkeypatch):
    monkeypatch.setattr("rso_lidar.files.writing.can_write_in", lambda _: False)  # root may write everywhere
    with pytest.raises(RecordingError, match="the folder may not be written to"):
        check_writable(tmp_path / "x.csv")


def test_a_text_is_written_whole_and_an_older_one_kept(tmp_path):
    path = tmp_path / "a.oem"
    assert write_text(path, "one\n").read_bytes() == b"one\n"
    with pytest.raises(RecordingError, match="exists already"):
        write_text(path, "two")
    assert write_text(path, "three", overwrite=True).read_text() == "three"
    assert [file.name for file in tmp_path.iterdir()] == ["a.oem"]


# ---------------------------------------------------------------------------------------- what other programs do to it


def replace(draft):
    draft.unlink()
    draft.write_text("another's")


def link(draft):
    draft.unlink()
    draft.symlink_to("victim")


@pytest.mark.skipif(os.name != "posix", reason="inodes are POSIX")
@pytest.mark.parametrize(
    ("meddle", "said"),
    [
        (lambda draft: draft.unlink(), "another program removed or renamed its temporary file; run again"),
        (replace, "another program replaced its temporary file; run again"),
        (link, "another program replaced its temporary file; run again"),
        (lambda draft: os.truncate(draft, 0), "another program emptied its temporary file; run again"),
    ],
    ids=["removed", "replaced", "link", "emptied"],
)
def test_a_draft_that_another_program_touched_is_not_published(tmp_path, meddle, said):
    place, victim = tmp_path / "a.png", tmp_path / "victim"
    place.write_text("old")
    victim.write_text("precious")
    with pytest.raises(RunError, match=said), write_atomically(place) as draft:
        draft.write_text("new")
        meddle(draft)
        left = draft.read_text() if draft.exists() else None
    assert place.read_text() == "old"
    assert victim.read_text() == "precious"
    if left == "another's":
        assert draft.read_text() == left  # and is not removed as if it were ours
    else:
        assert draft.is_symlink() or not draft.exists()


def test_a_message_names_the_output_and_not_its_draft(tmp_path):
    place = tmp_path / "a.png"
    with pytest.raises(RecordingError, match=r"/a\.png: is odd; a\.png$") as caught, write_atomically(place) as draft:
        raise RecordingError(f"{draft}: is odd; {draft.name}")
    assert ".part" not in str(caught.value)
    with pytest.raises(RunError, match=r"a\.png: could not be written: unable to open a\.png; check"):
        with write_atomically(place) as draft:
            raise OSError(f"unable to open {draft.name}")


def test_every_name_that_the_file_system_takes_can_be_written(tmp_path):
    place = tmp_path / f"{'ä' * 125}.csv"  # 254 bytes; its draft would have 259
    with write_atomically(place) as draft:
        draft.write_text("x")
    assert [path.name for path in tmp_path.iterdir()] == [place.name]
    with pytest.raises(RunError, match="File name too long; give another name and run again"):
        with write_atomically(tmp_path / f"{'b' * 300}.csv"):
            pass


def test_a_link_to_nothing_is_not_replaced_unasked(tmp_path):
    link = tmp_path / "a.csv"
    link.symlink_to("nowhere")
    with pytest.raises(RecordingError, match="exists already"):
        check_writable(link)
    assert check_writable(link, overwrite=True) == link


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="a folder that takes no files is /proc")  # noqa: PTH112
def test_a_folder_that_takes_no_files_is_not_called_missing():
    with pytest.raises(RecordingError, match=r"^/proc/x\.csv: its folder takes no new files; choose another folder$"):
        with write_atomically(Path("/proc/x.csv")):
            pass


def test_a_draft_is_not_made_through_a_link(tmp_path):
    (tmp_path / "a.part.png").symlink_to("victim")
    with write_atomically(tmp_path / "a.png") as draft:
        draft.write_text("new")
    assert not (tmp_path / "victim").exists()
    assert (tmp_path / "a.png").read_text() == "new"


def test_a_folder_that_is_removed_meanwhile_is_told_without_advice_that_does_not_fit(tmp_path):
    place = tmp_path / "out" / "a.csv"
    place.parent.mkdir()
    said = r"a\.csv: could not be written: its folder was removed or renamed; create it again, then run again$"
    with pytest.raises(RunError, match=said), write_atomically(place) as draft:
        draft.write_text("new")
        shutil.rmtree(place.parent)


@pytest.mark.parametrize(
    ("number", "cure"),
    [
        (errno.ENOSPC, "make room"),
        (errno.EDQUOT, "make room"),
        (errno.EROFS, "allow writing there"),
        (errno.EIO, "check the disk"),
        (errno.ESTALE, "create its folder again"),
    ],
)
def test_advice_fits_the_reason(tmp_path, number, cure):
    with (
        pytest.raises(RunError, match=f"could not be written: .*; {cure} and run again$"),
        write_atomically(tmp_path / "a.png"),
    ):
        raise OSError(number, os.strerror(number))


def test_a_stream_that_is_cut_short_or_replaced_is_told(tmp_path):
    place, draft = tmp_path / "a.mcap", tmp_path / "a.part.mcap"
    with draft.open("wb") as stream:
        stream.write(b"x" * 100)
        check_stream(stream, draft, place)
        os.truncate(draft, 40)
        with pytest.raises(RunError, match="another program truncated its temporary file"):
            check_stream(stream, draft, place)
        os.truncate(draft, 100)
        check_stream(stream, draft, place)
        if os.name == "posix":
            draft.rename(tmp_path / "elsewhere")
            with pytest.raises(RunError, match="another program removed or renamed its temporary file"):
                check_stream(stream, draft, place)


@pytest.mark.skipif(os.name != "posix", reason="symbolic links without rights are POSIX")
def test_a_lock_is_not_made_through_a_link(tmp_path):
    victim, lock = tmp_path / "victim", tmp_path / ".a.h5.lock"
    victim.write_text("precious")
    lock.symlink_to(victim)
    with suppress(RecordingError, RunError), hold_lock(lock):
        pass
    assert victim.read_text() == "precious"


def test_a_draft_may_be_written_by_another_context(tmp_path):
    """As a command does that writes several outputs, and gives them their names once the last is whole."""
    with write_atomically(tmp_path / "a.txt") as draft:
        write_text(draft, "new", overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "new"
