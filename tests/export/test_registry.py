"""The table of formats, and what every writer refuses or leaves behind."""

import dataclasses
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from frames_for_tests import make_frame, make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export import FORMATS, format_for, writer_for
from rso_lidar.export.registry import FORMAT_SUFFIXES

FOLDERS = ("pcd", "ply", "bop")
OURS = ("npz", *FOLDERS, *["zarr"] * bool(find_spec("zarr")))


@pytest.fixture(params=OURS)
def name(request):
    return request.param


def everything(folder):
    """Return every file below a folder with what is in it."""
    return {file.relative_to(folder): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_every_suffix_has_one_format_that_says_what_it_loses():
    assert len(FORMAT_SUFFIXES) == sum(len(made.suffixes) for made in FORMATS.values())
    for made in FORMATS.values():
        assert made.loses
        assert not made.loses.endswith(".")
        assert all(
            format_for(word) is made for word in (made.name, *made.suffixes, f"out/a.b{made.suffixes[0].upper()}")
        )


@pytest.mark.parametrize("made", ["hdf5", *OURS])
def test_writers_are_where_the_table_says(made):
    assert writer_for(made).__module__ == f"rso_lidar.export.{FORMATS[made].writer.split(':')[0]}"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("out.pdc", r"out.pdc: unknown suffix '.pdc'; did you mean '.pcd'\?"),
        ("out", "out: unknown format .known: hdf5, netcdf, zarr, npz"),
        ("pdc", r"pdc: unknown format; did you mean 'pcd'\?"),
        ("some/folder", "some/folder: the name has no suffix .known: .h5"),
        ("run.mat", "run.mat: '.mat' cannot be written; MATLAB reads .h5 with h5read"),
        (".las", "'.las' cannot be written; use .pcd, which keeps rows and columns"),
        ("", "unknown format"),
        ("oem", "oem: oem needs the recording's scenario; use rso_lidar.save"),
    ],
)
def test_an_unknown_word_is_told_what_is_known(word, message):
    with pytest.raises(RecordingError, match=message):
        writer_for(word)


def test_import_of_the_table_brings_no_writer_along():
    code = "import rso_lidar, sys; rso_lidar.export.FORMATS; print([n for n in sys.modules if 'lidar.export.' in n])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "rso_lidar.export.registry" in loaded
    assert not re.search(r"export\.(pcd|ply|npz|bop|zarr_store)'", loaded)


def write(tmp_path, name, frames, **how):
    return export.save(tmp_path / f"out.{name}", frames, **how)


def test_no_frames_leave_nothing(tmp_path, name):
    with pytest.raises(RecordingError, match=rf"out.{name}: no frames to write; check the selection"):
        write(tmp_path, name, [])
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_frame_is_refused(tmp_path, name):
    with pytest.raises(RecordingError, match=rf"out.{name}: got a dict, not a frame"):
        write(tmp_path, name, [make_frame(), {}])
    assert list(tmp_path.iterdir()) == []


def test_an_error_on_the_way_leaves_nothing_and_the_older_one_whole(tmp_path, name):
    def breaking():
        yield make_frame(0)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write(tmp_path, name, breaking())
    assert list(tmp_path.iterdir()) == []
    write(tmp_path, name, make_frames(2))
    before = everything(tmp_path)
    with pytest.raises(ZeroDivisionError):
        write(tmp_path, name, breaking(), overwrite=True)
    assert everything(tmp_path) == before


def test_an_older_export_is_replaced_only_when_asked(tmp_path, name):
    write(tmp_path, name, make_frames(3))
    before = everything(tmp_path)
    with pytest.raises(RecordingError, match=rf"out.{name}: exists already; give --overwrite"):
        write(tmp_path, name, make_frames(1))
    assert everything(tmp_path) == before
    write(tmp_path, name, make_frames(1), overwrite=True)
    assert [entry.name for entry in tmp_path.iterdir()] == [f"out.{name}"]
    assert everything(tmp_path) != before
    assert not any(file.name in ("000003.pcd", "000006.ply") for file in everything(tmp_path))


def test_a_folder_that_is_not_there_is_named(tmp_path, name):
    with pytest.raises(RecordingError, match=rf"out.{name}: there is no folder .*nowhere; create it first"):
        write(tmp_path / "nowhere", name, make_frames(1))


def test_a_name_that_no_disk_takes_is_one_line(tmp_path, name):
    with pytest.raises(RecordingError, match=r"cannot be written here \(File name too long\)"):
        export.save(tmp_path / f"{'x' * 254}.{name}", make_frames(1))
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RecordingError, match=r"there is no folder .*file; create it first|Not a directory"):
        write(tmp_path / "file", name, make_frames(1))


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_file_where_a_folder_should_be_is_kept(tmp_path, kind):
    (tmp_path / f"out.{kind}").write_text("mine")
    with pytest.raises(RecordingError, match="is a file, and this format needs a folder"):
        write(tmp_path, kind, make_frames(1), overwrite=True)
    assert (tmp_path / f"out.{kind}").read_text() == "mine"


def test_a_folder_where_a_file_should_be_is_kept(tmp_path):
    (tmp_path / "out.npz").mkdir()
    with pytest.raises(RecordingError, match="is a folder; name a file in it"):
        write(tmp_path, "npz", make_frames(1), overwrite=True)


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_folder_of_somebody_else_is_never_removed(tmp_path, kind):
    (tmp_path / f"out.{kind}").mkdir()
    (tmp_path / f"out.{kind}" / "thesis.tex").write_text("years of work")
    with pytest.raises(
        RecordingError, match=r"holds thesis\.tex, which is not an export of rso_lidar; name another folder"
    ):
        write(tmp_path, kind, make_frames(1), overwrite=True)
    assert (tmp_path / f"out.{kind}" / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("name", [name for name in OURS if name != "npz"])  # which is one file
def test_what_somebody_put_into_our_folder_is_never_removed(tmp_path, name):
    notes = write(tmp_path, name, make_frames(1)) / "notes"
    notes.mkdir()
    before = everything(tmp_path)
    with pytest.raises(RecordingError, match="holds notes, which is not an export of rso_lidar"):
        write(tmp_path, name, make_frames(2), overwrite=True)
    assert everything(tmp_path) == before
    notes.rmdir()
    write(tmp_path, name, make_frames(2), overwrite=True)


@pytest.mark.parametrize("path", [".", "..", "/"])
def test_no_folder_one_stands_in_is_replaced(path):
    with pytest.raises(RecordingError, match="cannot be replaced; name a folder in it"):
        writer_for("pcd")(path, make_frames(1), overwrite=True)


def test_an_empty_folder_is_as_good_as_none(tmp_path):
    (tmp_path / "clouds").mkdir()
    assert len(list(writer_for("pcd")(tmp_path / "clouds", make_frames(2)).glob("*.pcd"))) == 2


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_frame_that_comes_twice_is_refused(tmp_path, kind):
    with pytest.raises(RecordingError, match=rf"out.{kind}: frame 3 is given twice; give each frame once"):
        write(tmp_path, kind, [make_frame(1), make_frame(2), make_frame(1)])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_negative_number_of_a_frame_is_refused(tmp_path, kind):
    with pytest.raises(RecordingError, match="frame -1: has a negative number"):
        write(tmp_path, kind, [dataclasses.replace(make_frame(), index=-1)])


SHAPE = ({"shape": (10, 12)}, "frame 3: has other rows or columns than the first")
TREE = ({"ptu": False}, "frame 3: its tree of axes differs from the first frame's")
SETTINGS = ({"settings": {"gain": 1.0}}, "frame 3: settings/energy_j, settings/focal_length_m, settings/gain: not in")
RETURNS = ({"returns": True}, "frame 3: labels/return_photons, .*: not in every frame")


@pytest.mark.parametrize(
    ("kind", "odd", "message"),
    [*(("npz", *odd) for odd in (SHAPE, TREE, SETTINGS, RETURNS)), *[("zarr", *TREE)] * ("zarr" in OURS)],
)
def test_frames_that_differ_do_not_share_arrays(tmp_path, kind, odd, message):
    with pytest.raises(RecordingError, match=message):
        write(tmp_path, kind, [make_frame(0), make_frame(1, **odd)])
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_said_in_one_line_and_leaves_nothing(tmp_path, name, monkeypatch):
    def full(*_, **__):
        raise OSError(28, os.strerror(28))

    writes = {"npz": "numpy.savez_compressed", "zarr": "rso_lidar.export.writer.zarr_store.ZarrWriter.add"}
    writes |= {"bop": "rso_lidar.export.formats.bop.write_new_file"}
    monkeypatch.setattr(writes.get(name, "rso_lidar.export.writer.frame_files.write_new_file"), full)
    with pytest.raises(RunError, match=rf"out.{name}: could not be written: No space left on device"):
        write(tmp_path, name, make_frames(2))
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []


def test_what_appears_while_frames_come_is_not_removed(tmp_path):
    def slow():
        yield make_frame(0)
        (tmp_path / "out.ply").mkdir()
        (tmp_path / "out.ply" / "notes").write_text("mine")

    with pytest.raises(RecordingError, match="exists already"):
        write(tmp_path, "ply", slow())
    assert everything(tmp_path) == {Path("out.ply/notes"): b"mine"}


def test_a_folder_of_any_name_and_options_of_the_writer(tmp_path):
    folder = export.save(tmp_path / "clouds", make_frames(2), format="pcd", labels=False)
    assert b"FIELDS x y z intensity\n" in (folder / "000003.pcd").read_bytes()
    with pytest.raises(RecordingError, match="clouds: the name has no suffix"):
        export.save(tmp_path / "clouds", make_frames(2))
