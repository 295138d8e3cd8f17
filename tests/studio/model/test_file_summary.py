"""Uploads: files that their reader takes, in the folder and over no other file."""

import io
import zipfile

import pytest

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.shipped import shipped
from rso_lidar.studio.model import file_summary as module
from rso_lidar.studio.model.file_summary import KINDS, MOST_UPLOAD_BYTES, keep_upload
from rso_lidar.studio.model.root_folder import Folder

OBJECT = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "work").mkdir()
    return Folder(tmp_path / "work")


def list_names(folder):
    return sorted(path.name for path in folder.path.rglob("*"))


def test_a_mesh_is_kept_to_the_byte_and_said(folder):
    assert keep_upload(folder, "box.obj", OBJECT) == "box.obj: 4 facets, 1 part, 1 × 1 × 1 m as it stands"
    assert (folder.path / "box.obj").read_bytes() == OBJECT
    assert list_names(folder) == ["box.obj"]


def test_element_sets_are_counted(folder):
    content = shipped("tle/tdrs.tle").read_bytes()
    assert keep_upload(folder, "own.tle", content) == "own.tle: 1 element sets"
    assert (folder.path / "own.tle").read_bytes() == content


@pytest.mark.parametrize("name", ["table.csv", "scenario.toml", "words.txt"])
def test_other_texts_are_kept_as_they_are(folder, name):
    assert keep_upload(folder, name, b"a,b\r\n1,2\r\n") == f"{name}: 10 bytes"
    assert (folder.path / name).read_bytes() == b"a,b\r\n1,2\r\n"


def zipped():
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a", b"0" * 10_000_000)
    return made.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.json", b"{"),
        ("a.csv", b"\xff\xfe"),
        ("a.oem", b"CCSDS_OEM_VERS = 2.0\n"),
        ("a.obj", b""),
        ("a.obj", b"f 1 2 3\n"),
        ("a.stl", b"no mesh"),
        ("a.stl", b"\0" * 80 + b"\xff\xff\xff\xff"),  # 4 billion facets
        ("a.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff"),
        ("a.glb", zipped()),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\nend_header\n"),
        ("a.off", b"OFF\n1000000000 1 0\n"),
        ("a.tle", b"no set"),
        ("a.tle", b"\xff\xfe"),
        ("a.omm", b"<?xml version='1.0'?><!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>"),
        ("a.toml", b"\xff\xfe"),
    ],
)
def test_what_no_reader_takes_is_refused_and_leaves_nothing(folder, name, content):
    with pytest.raises(RsoLidarError) as caught:
        keep_upload(folder, name, content)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)
    assert list_names(folder) == []


@pytest.mark.parametrize(
    "name", ["../a.obj", "/a.obj", ".a.obj", "a.py", "a.exe", "a.obj.py", "", "a.h5", "a\n.obj", "a.html", "con:a.obj"]
)
def test_names_outside_the_folder_and_of_other_kinds_are_refused(folder, name):
    with pytest.raises(ScenarioError):
        keep_upload(folder, name, OBJECT)
    assert list_names(folder) == []
    assert not (folder.path.parent / "a.obj").exists()


def test_no_file_is_written_over(folder):
    keep_upload(folder, "a.txt", b"first")
    with pytest.raises(ScenarioError, match="in the folder already"):
        keep_upload(folder, "a.txt", b"second")
    assert (folder.path / "a.txt").read_bytes() == b"first"


def test_large_files_are_refused(folder):
    with pytest.raises(ScenarioError, match="64 MB"):
        keep_upload(folder, "a.txt", bytes(MOST_UPLOAD_BYTES + 1))
    assert list_names(folder) == []


def test_a_mesh_cannot_name_files_beside_it(folder):
    (folder.path / "own.mtl").write_text("newmtl a\nKd 1 0 0\n", encoding="utf-8")
    said = keep_upload(folder, "a.obj", b"mtllib own.mtl\nmtllib ../../secret.mtl\nusemtl a\n" + OBJECT)
    assert said.startswith("a.obj: 4 facets")


def test_a_full_disk_leaves_nothing(folder, monkeypatch):
    def fail(place):
        raise OSError(28, "the disk is full", str(place))

    monkeypatch.setattr(module, "write_atomically", fail)
    with pytest.raises(OSError, match="full"):
        keep_upload(folder, "a.txt", b"words")
    assert list_names(folder) == []


def test_no_kind_of_file_that_runs_is_taken():
    assert not {".py", ".so", ".dll", ".fmu", ".html", ".js", ".exe", ".sh", ".h5"} & set(KINDS)
