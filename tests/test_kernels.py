"""Kernels: compiled at their first call, kept on disk, and made anew when what they depend on changes."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import kernels

STAGE = """
from rso_lidar.kernels import kernel
from room_of_kernels.constants import LIGHT, halved


@kernel
def scale(x):
    return halved(x) * LIGHT
"""
CONSTANTS = """
from rso_lidar.kernels import kernel

LIGHT = {light}


@kernel
def halved(x):
    return x * {half}
"""
ASKED = "from room_of_kernels.stage import scale; print(scale(1.0), sum(scale.dispatcher.stats.cache_hits.values()))"


@kernels.kernel
def add_up(values):
    total = 0.0
    for value in values:
        total += value
    return total


@pytest.fixture
def room(tmp_path, monkeypatch):
    """Return a function that writes a room with kernels, and one that calls it in a new process."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "room_of_kernels"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "stage.py").write_text(STAGE)

    def write(light=4.0, half=0.5):
        (folder / "constants.py").write_text(CONSTANTS.format(light=light, half=half))

    def ask(code=ASKED, **others):
        return subprocess.Popen(
            [sys.executable, "-W", "always", "-c", code],
            cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **others,
        )  # fmt: skip

    write()
    return write, ask, tmp_path / "cache"


def answer(process):
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out.split(), err


def test_a_kernel_does_what_its_function_does():
    values = np.linspace(0.1, 0.9, 101)
    assert add_up(values) == add_up.function(values)  # in the order written, to the bit


def test_a_kernel_is_pickled_by_name():
    assert pickle.loads(pickle.dumps(add_up)) is add_up


def test_a_wrong_loop_is_an_error_and_machine_code_stays(room, monkeypatch):
    @kernels.kernel
    def wrong(x):
        return x + "text"

    answer(room[1]())
    before = sorted(room[2].rglob("*.nbc"))
    assert before
    with pytest.raises(Exception, match="No implementation of function"):
        wrong(1.0)
    assert sorted(room[2].rglob("*.nbc")) == before


@pytest.mark.slow
def test_machine_code_is_made_anew_when_an_imported_constant_or_kernel_changes(room):
    write, ask, _ = room
    assert answer(ask())[0] == ["2.0", "0"]
    assert answer(ask())[0] == ["2.0", "1"]  # read from disk
    write(light=30.0)
    assert answer(ask())[0] == ["15.0", "0"]
    write(half=3.0)
    assert answer(ask())[0] == ["12.0", "0"]


@pytest.mark.slow
def test_damaged_machine_code_is_made_anew_and_then_kept(room):
    _, ask, cache = room
    answer(ask())
    for suffix in (".nbi", ".nbc"):
        files = sorted(cache.rglob(f"*{suffix}"))
        assert files
        for file in files:
            file.write_bytes(file.read_bytes()[:20])
        found, said = answer(ask())
        assert found == ["2.0", "0"], suffix
        assert "cannot be read or kept" in said, suffix
        found, said = answer(ask())
        assert found == ["2.0", "1"], suffix
        assert not said, suffix


def test_without_a_place_to_keep_machine_code_each_process_compiles(room):
    _, ask, cache = room
    cache.write_text("a file where a folder is needed")
    found, said = answer(ask())
    assert found == ["2.0", "0"]
    assert "cannot be read or kept" in said


@pytest.mark.slow
def test_of_two_that_start_together_one_compiles(room):
    _, ask, _ = room
    both = [ask(), ask()]
    assert sorted(answer(process)[0][1] for process in both) == ["0", "1"]


def test_without_compiling_kernels_run_as_python(room, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    _, ask, cache = room
    assert answer(ask("from room_of_kernels.stage import scale; print(scale(1.0))"))[0] == ["2.0"]
    assert not cache.exists()


WATCHED = """
from room_of_kernels.stage import scale
import rso_lidar as rl
from rso_lidar import kernels

told = []
with kernels.watch_compiling(told.append):
    scale(1.0), scale(1.0)
scale(1)
print(*told)
"""


@pytest.mark.slow
def test_compiling_is_told_while_someone_listens(room):
    _, ask, _ = room
    assert answer(ask(WATCHED))[0] == ["1", "2"]
    assert answer(ask(WATCHED))[0] == []  # read from disk


def test_packed_arrays_are_of_one_kind():
    strided = np.arange(10.0)[::2]
    whole = kernels.packed(strided, np.float32)
    assert whole.flags.c_contiguous and not whole.flags.writeable and whole.dtype == np.float32
    assert strided.flags.writeable


def test_the_compiler_is_named():
    assert kernels.compiler_version().startswith("numba ")


def test_a_recording_names_the_compiler_and_the_packets(text):
    """A run is resumed only by what began it: the version of numba is part of that."""
    arithmetic = rl.Scenario.loads(text).source.versions["arithmetic"]
    assert arithmetic.startswith(kernels.compiler_version())
    assert "with" in arithmetic
