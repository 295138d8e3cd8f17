"""The command that brings real data to where tests look: what it recognises, makes, places and refuses."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests import real_data

ROOT = Path(__file__).resolve().parents[2]


def stl(corners):
    """Return a binary STL file of facets, without normals."""
    facets = np.zeros(len(corners), real_data.STL)
    facets["corners"] = corners
    return b"made for a test".ljust(80) + len(facets).to_bytes(4, "little") + facets.tobytes()


CUBE = np.random.default_rng(1).uniform(-3.0, 3.0, (12, 3, 3))  # stands for the helper cube: any twelve facets
PLATE = np.array(
    [[[0, 0, 0], [12, 0, 0], [0, 6, 0]], [[1, 1, 1], [2, 2, 2], [3, 3, 3]], [[0, 0, 0], [0, 0, 6], [0, 6, 0]]]
)
ORIGINAL = stl(np.concatenate([CUBE, PLATE]))
LINES = b"ISS\n1 25544U\n2 25544\n"


@pytest.fixture
def downloads(tmp_path, monkeypatch):
    """Return a folder of downloads; the known files are a mesh in print units and a catalogue."""
    source = real_data.Source("Plate_1.stl", len(ORIGINAL), real_data.sha256_of(ORIGINAL), 6, 12)
    made = real_data.in_metres(ORIGINAL, source)
    known = (
        real_data.DataFile("meshes/plate.stl", len(made), real_data.sha256_of(made), "nasa", source),
        real_data.DataFile("tle/iss.tle", len(LINES), real_data.sha256_of(LINES), "celestrak"),
    )
    monkeypatch.setattr(real_data, "list_files", lambda: known)
    for cached in (real_data._sizes, real_data._names, real_data._text_suffixes):
        cached.cache_clear()
    monkeypatch.setattr(real_data, "_sgp4_folder", lambda: None)
    folder = tmp_path / "downloads" / "3D Printing" / "Plate"
    folder.mkdir(parents=True)
    (folder / "Plate_1.stl").write_bytes(ORIGINAL)
    (folder.parent / "iss.txt").write_bytes(LINES)
    (folder / "Plate.png").write_bytes(b"picture")
    yield tmp_path / "downloads"
    for cached in (real_data._sizes, real_data._names, real_data._text_suffixes):
        cached.cache_clear()


def bring(capsys, *words):
    status = real_data.main([str(word) for word in words])
    out, err = capsys.readouterr()
    return status, out.splitlines(), err


def test_known_files_are_placed_whatever_their_name(downloads, tmp_path, capsys):
    (downloads / "iss.tle").write_bytes(LINES.replace(b"\n", b"\r\n"))  # as a browser on Windows may save it
    (downloads / "3D Printing" / "iss.txt").unlink()
    status, lines, err = bring(capsys, downloads, "--to", tmp_path / "data")
    assert (status, err) == (0, "")
    assert [line.split()[:2] for line in lines] == [
        ["placed", "meshes/plate.stl"],
        ["placed", "tle/iss.tle"],
        ["unknown", str(downloads / "3D")],
        ["recording", "pixset/*_ftrr.zip:"],
        ["2", "of"],
    ]
    assert (tmp_path / "data" / "tle" / "iss.tle").read_bytes() == LINES
    made = (tmp_path / "data" / "meshes" / "plate.stl").read_bytes()
    facets = np.frombuffer(made, real_data.STL, offset=84)
    np.testing.assert_allclose(facets["corners"], PLATE[[0, 2]] / 6.0, rtol=1e-7)  # no cube, no facet without area
    np.testing.assert_allclose(facets["normal"], [[0, 0, 1], [-1, 0, 0]])
    again = bring(capsys, downloads, "--to", tmp_path / "data")
    assert [line.split()[0] for line in again[1][:2]] == ["there", "there"]
    assert bring(capsys, "--to", tmp_path / "data")[1][-1] == f"2 of 2 files are in {tmp_path / 'data'}"


def test_what_is_missing_is_named_with_its_place(downloads, tmp_path, capsys):
    (downloads / "3D Printing" / "iss.txt").unlink()
    status, lines, _ = bring(capsys, downloads, "--to", tmp_path / "data")
    assert status == 0
    assert f"missing   tle/iss.tle  ({real_data.WHERE['celestrak']})" in lines
    status, lines, _ = bring(capsys, "--to", tmp_path / "none")  # no folder: what is there
    assert (status, lines[-1]) == (0, f"0 of 2 files are in {tmp_path / 'none'}")
    assert not (tmp_path / "none").exists()


def test_a_recording_of_waveforms_is_found_and_stays_where_it_is(downloads, tmp_path, capsys):
    place = tmp_path / "data"
    _, lines, _ = bring(capsys, downloads, "--to", place)
    assert "recording pixset/*_ftrr.zip: missing (Leddar PixSet, by a form; tests/real_data.md says which)" in lines
    recording = downloads / "20200610_downtown05" / "pixell_bfc_ftrr.zip"
    recording.parent.mkdir()
    recording.write_bytes(b"")
    _, lines, _ = bring(capsys, downloads, "--to", place)
    assert f"recording {recording}: is not copied; move or link it into {place / 'pixset'}" in lines
    (place / "pixset").mkdir()
    recording.rename(place / "pixset" / recording.name)
    _, lines, _ = bring(capsys, "--to", place)
    assert f"recording {place / 'pixset'}: is compared as it is" in lines


def truncate(folder):
    (folder / "Plate_1.stl").write_bytes(ORIGINAL[:-7])


def flip(folder):
    (folder / "Plate_1.stl").write_bytes(ORIGINAL[:200] + bytes([ORIGINAL[200] ^ 1]) + ORIGINAL[201:])


def empty(folder):
    (folder / "Plate_1.stl").write_bytes(b"")


def page(folder):
    (folder / "Plate_1.stl").write_text("<html>404: not found</html>")


@pytest.mark.parametrize("harm", [truncate, flip, empty, page])
def test_a_damaged_file_is_named_and_the_others_are_placed(harm, downloads, tmp_path, capsys):
    harm(downloads / "3D Printing" / "Plate")
    status, lines, _ = bring(capsys, downloads, "--to", tmp_path / "data")
    assert status == 2
    path = downloads / "3D Printing" / "Plate" / "Plate_1.stl"
    told = f"{path}: {path.stat().st_size:,} bytes, not the file of this name that tests know; download it again"
    assert [line for line in lines if line.startswith("damaged")] == [f"damaged   {told}"]
    assert sorted(path.name for path in (tmp_path / "data").rglob("*") if path.is_file()) == ["iss.tle"]


def test_a_damaged_file_in_place_is_told_and_replaced(downloads, tmp_path, capsys):
    bring(capsys, downloads, "--to", tmp_path / "data")
    (tmp_path / "data" / "tle" / "iss.tle").write_bytes(LINES[:-1])
    status, lines, _ = bring(capsys, "--to", tmp_path / "data")
    assert status == 2
    assert any(line.startswith(f"damaged   {tmp_path}/data/tle/iss.tle: ") for line in lines)
    status, lines, _ = bring(capsys, downloads, "--to", tmp_path / "data")
    assert (status, lines[1]) == (0, "placed    tle/iss.tle  (from iss.txt)")


def test_a_wrong_twin_beside_the_right_file_does_no_harm(downloads, tmp_path, capsys):
    (downloads / "Plate_1.stl").write_bytes(b"another version")
    status, lines, _ = bring(capsys, downloads, "--to", tmp_path / "data")
    assert status == 0
    assert f"unknown   {downloads}/Plate_1.stl" in lines


def test_many_unknown_files_are_counted(downloads, tmp_path, capsys):
    for number in range(50):
        (downloads / f"{number}.jpg").write_bytes(b"")
    _, lines, _ = bring(capsys, downloads, "--to", tmp_path / "data")
    unknown = [line for line in lines if line.startswith("unknown")]
    assert len(unknown) == real_data.MOST_NAMES + 1
    assert unknown[-1] == f"unknown   {51 - real_data.MOST_NAMES} more files"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["{tmp}/none"], "{tmp}/none: there is no such folder; name the one with what you downloaded"),
        (["{tmp}/file"], "{tmp}/file: is a file; unpack it, and name the folder"),
        ([""], "FOLDER: is empty; name the folder with what you downloaded"),
        (["x" * 300], "cannot be used"),
        (["{tmp}/downloads", "--to", "{tmp}/" + "x" * 300], "; "),
        (["a\0b\nc"], "b c: there is no such folder"),
        (["{tmp}/downloads", "more"], "unrecognized arguments: more; usage: python -m tests.real_data"),
        (["--form", "x"], "unrecognized arguments"),
        (["{tmp}/downloads", "--to", ""], "--to: is empty; name the folder where tests look"),
        (["{tmp}/downloads", "--to"], "expected one argument; usage"),
        (["{tmp}/downloads", "--to", "{tmp}/file"], "{tmp}/file: is not a folder; name another with --to"),
        (["{tmp}/downloads", "--to", "{tmp}/file/below"], "{tmp}/file/below"),
        (["{tmp}/others", "--to", "{tmp}/data"], "{tmp}/others: holds no file that tests read"),
        (["{tmp}/void", "--to", "{tmp}/data"], "{tmp}/void: holds no file that tests read"),
        (["{tmp}/downloads", "--to", "{tmp}/blocked"], "{tmp}/blocked/meshes/plate.stl: cannot be"),
    ],
)
def test_bad_input_is_one_line(words, message, downloads, tmp_path, capsys):
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "void").mkdir()
    (tmp_path / "blocked").mkdir()
    (tmp_path / "blocked" / "meshes").write_bytes(b"")  # a file where a folder must be
    (tmp_path / "others").mkdir()
    (tmp_path / "others" / "a.stl").write_bytes(b"solid")
    status, _, err = bring(capsys, *(word.format(tmp=tmp_path) for word in words))
    assert status == 2
    assert message.format(tmp=tmp_path) in err
    assert err.startswith("real data: ") and err.count("\n") == 1
    assert not list(tmp_path.rglob("*.tmp*"))


@pytest.mark.skipif(os.name != "posix", reason="such files are POSIX's")
def test_odd_files_are_passed_by(downloads, tmp_path, capsys):
    os.mkfifo(downloads / "Plate_1.stl")
    (downloads / "loop").symlink_to(downloads)
    (downloads / "nowhere.tle").symlink_to(downloads / "gone")
    (downloads / "folder.stl").mkdir()
    with (downloads / "huge.tle").open("wb") as file:
        file.truncate(2 * real_data.MOST_BYTES)
    status, lines, err = bring(capsys, downloads, "--to", tmp_path / "data")
    assert (status, err) == (0, "")
    assert lines[-1] == f"2 of 2 files are in {tmp_path / 'data'}"


def test_the_verification_set_comes_with_the_installed_package(tmp_path):
    command = [sys.executable, "-m", "tests.real_data", "--to", str(tmp_path / "data")]
    (tmp_path / "data").mkdir()
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "placed    tle/sgp4_verification/tcppver.out" in done.stdout
    assert (tmp_path / "data" / "tle" / "sgp4_verification" / "SGP4-VER.TLE").stat().st_size == 8616


def test_the_list_is_of_the_files_that_tests_read(shared):
    """Also that NASA's originals become the very meshes that tests read."""
    for each in real_data.list_files():
        blob = (shared / each.path).read_bytes()
        assert (len(blob), hashlib.sha256(blob).hexdigest()) == (each.bytes, each.sha256)
    made = 0
    for each in real_data.list_files():
        original = shared / "meshes" / "nasa_originals"
        if each.source is not None and (Path(original) / each.source.name).is_file():
            blob = (original / each.source.name).read_bytes()
            assert real_data.in_metres(blob, each.source) == (shared / each.path).read_bytes()
            made += 1
    assert made == 7


def test_a_partly_filled_folder_skips_what_needs_the_rest(shared, tmp_path):
    shutil.copytree(Path(shared) / "tle" / "sgp4_verification", tmp_path / "tle" / "sgp4_verification")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-rs",
        "tests/orbit/sets/test_tle_text.py",
    ]
    environment = {**os.environ, "RSO_LIDAR_SHARED": str(tmp_path)}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0
    assert "catalogs is not in the folder of real data" in done.stdout
    assert "1 skipped" in done.stdout
