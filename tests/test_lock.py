"""Locks: one at a time, waited for or not, and never on a file that nobody else sees."""

import threading
import time

import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.lock import Lock, held

fcntl = pytest.importorskip("fcntl", reason="locks are POSIX's")


def test_a_second_is_refused_waits_or_is_let_in(tmp_path):
    path = tmp_path / ".run.h5.lock"
    with Lock(path):
        assert held(path)
        with pytest.raises(RecordingError, match=r"^run\.h5: another run is writing it"):
            Lock(path)
        with pytest.raises(RecordingError, match=r"^busy$"):
            Lock(path, wait_s=0.05, busy="busy")
    assert not path.exists() and not held(path)
    first = Lock(path)
    threading.Timer(0.1, first.release).start()
    before = time.monotonic()
    with Lock(path, wait_s=30.0):
        assert time.monotonic() - before >= 0.05, "it was waited for"


def test_a_lock_on_a_file_that_its_last_holder_took_away_is_taken_anew(tmp_path, monkeypatch):
    path, real, calls = tmp_path / ".index.lock", fcntl.flock, []

    def flock(descriptor, what):
        real(descriptor, what)
        if not calls:
            path.unlink()  # as the last holder does, between another's opening and locking
        calls.append(what)

    monkeypatch.setattr(fcntl, "flock", flock)
    with Lock(path):
        assert len(calls) == 2 and path.exists(), "whoever comes next sees this lock"


def test_no_lock_where_nothing_may_be_written(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("rso_lidar.lock.os.open", refuse)
    with pytest.raises(RecordingError, match=r"may not be written \(Permission denied\); choose another folder"):
        Lock(tmp_path / ".index.lock")
