"""`rso-lidar view`: what it writes without a display, what it says, what it refuses."""

import sys
from functools import partial

import pytest
from PIL import Image

from rso_lidar.evaluation.recorded_runs import display as module


@pytest.fixture
def bench(recorded):
    return recorded


@pytest.fixture
def call(rso_lidar, monkeypatch):
    monkeypatch.setattr(module, "has_display", lambda: False)
    return partial(rso_lidar, "view")


def test_without_a_display_it_writes_files_and_says_so(call, bench, tmp_path):
    status, said, errors = call(bench, "--frames", "0:6:2")
    assert (status, errors) == (0, [])
    assert said.startswith("no display: wrote ")
    assert said.endswith("bench_view.gif (3 frames)\n")
    with Image.open(tmp_path / "bench_view.gif") as film:
        assert film.n_frames == 3
    for name in ("bench_view.png", "bench_view_sheet.png"):
        with Image.open(tmp_path / name) as drawn:
            drawn.verify()
    status, _, errors = call(bench)
    assert (status, len(errors)) == (2, 1)
    assert errors[0].startswith("error: no display, so it would write files: ")
    assert call(bench, "--frames", "0:2", "--overwrite")[0] == 0


def test_one_file_by_its_suffix(call, bench, tmp_path):
    status, said, errors = call(bench, "-o", tmp_path / "a.png", "--colour", "intensity", "--with", "files")
    assert (status, said, errors) == (
        0,
        f"wrote {tmp_path / 'a.png'} (frame 0 alone, of 10, for its many returns)\n",
        [],
    )
    with Image.open(tmp_path / "a.png") as drawn:
        assert drawn.size[0] > 1000


def test_a_scene(call, bench, tmp_path):
    pytest.importorskip("rerun", reason="needs the extra view: pip install 'rso-lidar[view]'")
    status, said, errors = call(bench, "--with", "rerun", "--frames", "2:5")
    place = tmp_path / "bench.rrd"
    assert (status, said) == (0, f"no display: wrote {place} (3 frames); open it with: rerun {place}\n")
    assert errors[-1].startswith("frame 3/3")
    assert place.stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--frames", "40:50"], "holds none of them, but 10 from 0 to 9"),
        (["--frames", "a:b"], "is not A:B"),
        (["--with", "rerum"], "did you mean 'rerun'? (known: rerun, window, files)"),
        (["--with", "window"], "no display; choose files"),
        (["--with", "window", "-o", "x.png"], "a window writes no file"),
        (["--with", "files", "-o", "x.rrd"], "unknown suffix '.rrd'"),
        (["-o", "x"], "no suffix"),
        (["-o", "x.jpg"], "unknown suffix '.jpg'"),
        (["-o", "no/such/x.gif"], "there is no folder"),
        (["--colour", "blue"], "is not range or intensity"),
    ],
)
def test_refused_in_one_line(refused, arguments, said):
    refused(arguments, said)


@pytest.mark.parametrize("arguments", [["--with", "rerun"], ["-o", "x.rrd"]])
def test_without_the_extra_it_is_named(call, bench, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "rerun", None)
    before = sorted(tmp_path.iterdir())
    status, _, errors = call(bench, *arguments)
    assert (status, len(errors)) == (2, 1)
    assert "pip install rso-lidar[view]" in errors[0]
    assert sorted(tmp_path.iterdir()) == before


def test_no_such_recording(call, tmp_path):
    status, _, errors = call(tmp_path / "none.h5")
    assert (status, len(errors)) == (2, 1)
