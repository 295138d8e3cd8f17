"""Files that are read are regular and bounded: whoever reads one says so in a line, at once."""

import errno
import os
import stat
from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar import files
from rso_lidar.dataset.shards.shard_file import open_shard
from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.mission_analysis.budgets.inputs import _read_brdf_table
from rso_lidar.motion.motions.prescribed_motion import read_table
from rso_lidar.optics import read_pattern
from rso_lidar.optics.tables.zemax import read_huygens_psf
from rso_lidar.orbit import read_attitudes
from rso_lidar.scene import load_mesh

STUDY = {"version": 1, "name": "s", "merits": ["range_rms_m"], "axis": [{"field": "seed", "values": [1]}]}
READERS = {
    "scenario": ("x.toml", rl.Scenario.load),
    "study": ("x.toml", rl.study.Study.load),
    "catalogue": ("x.tle", rl.orbit.Catalog.from_file),
    "ephemeris": ("x.oem", lambda path: rl.orbit.Ephemeris(file=str(path))._arcs()),
    "table of places": ("x.csv", read_table),
    "attitude": ("x.aem", lambda path: read_attitudes(str(path), None, None)),
    "brdf": ("x.csv", _read_brdf_table),
    "listing": ("x.txt", read_huygens_psf),
    "pattern": ("x.png", lambda path: read_pattern(str(path))),
    "mesh": ("x.stl", load_mesh),
    "recording": ("x.h5", rl.open),
    "kernel": ("x.bsp", rl.orbit.JplEphemeris),
    "log of commands": ("x.commands.jsonl", lambda path: list(rl.loop.repeat_flight(None, path))),
    "shard": ("x.h5", lambda path: open_shard(path, None, 1024)),
}


def fifo(path):
    os.mkfifo(path)


def sock(path):
    os.mknod(path, stat.S_IFSOCK | 0o600)


def device(path):
    path.symlink_to("/dev/zero")


def sparse(path):
    with path.open("wb") as file:
        file.truncate(2**40)  # holes only: it takes no disk


KINDS = {"pipe": fifo, "socket": sock, "device": device, "folder": Path.mkdir, "vast": sparse}


@pytest.mark.skipif(os.name != "posix", reason="has no such files")
@pytest.mark.parametrize("reader", READERS)
def test_no_reader_waits_at_a_pipe_or_reads_without_end(reader, tmp_path):
    name, read = READERS[reader]
    for kind, make in KINDS.items():
        folder = tmp_path / kind
        folder.mkdir()
        make(folder / name)
        with pytest.raises(RsoLidarError) as refused:
            read(folder / name)
        line = str(refused.value)
        assert name in line and "\n" not in line and (";" in line or ": " in line), kind


def test_what_is_read_is_regular_and_bounded(tmp_path):
    path = tmp_path / "x.txt"
    path.write_bytes(b"\xef\xbb\xbf12345")
    assert files.read_text(path, 8, ScenarioError) == "12345"
    with pytest.raises(ScenarioError, match="over the 7 bytes that a table may have; give a smaller one"):
        files.read_bytes(path, 7, ScenarioError, "table")
    path.write_bytes(b"\xff")
    with pytest.raises(ScenarioError, match="is not UTF-8 text; save it as UTF-8"):
        files.read_text(path, 8, ScenarioError)
    with pytest.raises(ScenarioError, match="no such file; check the name"):
        files.read_bytes(tmp_path / "none", 8, ScenarioError)


@pytest.mark.skipif(os.name != "posix", reason="links and error numbers are those of POSIX")
def test_what_the_system_refuses_is_told_in_words_with_a_cure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    Path("circle").symlink_to("circle")
    Path("broken").symlink_to("none")
    Path("folder").mkdir()
    os.mkfifo("pipe")
    for name, said in (
        ("none", "no such file; check the name"),
        ("file/x", "a folder in its path is a file; check the path"),
        ("a" * 300, "its name is longer than the file system allows; check the name"),
        ("circle", "its symbolic links lead in a circle; give the file itself"),
        ("broken", "is a link to none, which does not exist; mend the link"),
        ("folder", "is a folder; give a file in it"),
        ("pipe", "is a pipe, a socket or a device; save it as a regular file and give that"),
        ("a\0b", "its name contains a NUL character, which no file can have; check the name"),
    ):
        with pytest.raises(ScenarioError) as caught:
            files.read_bytes(Path(name), 8, ScenarioError)
        assert str(caught.value) == f"{name}: {said}"
    denied = PermissionError(errno.EACCES, "Permission denied")
    assert files.explain_unreadable("a", denied) == (
        "a: may not be read; allow reading it, or copy it to a folder of yours"
    )
    assert files.explain_unreadable("a", OSError(errno.EINVAL, "Invalid argument")) == (
        "a: cannot be read (Invalid argument); check the file and its disk"
    )


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="a file without a size is in /proc")
def test_a_file_that_does_not_know_its_size_is_bounded_too():
    assert Path("/proc/self/environ").stat().st_size == 0
    with pytest.raises(ScenarioError, match="over the 5 bytes"):
        files.read_bytes(Path("/proc/self/environ"), 5, ScenarioError)


def test_a_file_that_would_block_has_no_content(tmp_path, monkeypatch):
    """A read without waiting returns None where a regular file has nothing at present, as /proc/kmsg does."""
    path = tmp_path / "x"
    path.touch()
    reading, writing = os.pipe()
    os.set_blocking(reading, False)
    monkeypatch.setattr(os, "open", lambda *_: reading)
    assert files.read_bytes(path, 8, ScenarioError) == b""
    os.close(writing)


@pytest.mark.parametrize(
    "read",
    [
        lambda path: rl.Tle(file=path).elements(),
        lambda path: rl.study.Study(**STUDY, scenario=path).scenario_file(),
        rl.Scenario.load,
        rl.open,
    ],
    ids=["element sets", "scenario of a study", "scenario", "recording"],
)
def test_a_home_of_nobody_holds_no_file(read):
    with pytest.raises(RsoLidarError, match=r"no (such )?file|there is no folder"):
        read("~no_such_user/x.h5")
