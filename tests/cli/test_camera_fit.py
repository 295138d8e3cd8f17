"""`rso-lidar camera fit`: exit status, output, and what it refuses."""

from functools import partial

import pytest

from rso_lidar.scenario import Lidar
from tests.evaluation.camera_calibration.bench_for_tests import CURVES, make_table, write_bench
from tests.evaluation.camera_calibration.map_bench_for_tests import write_map_bench


@pytest.fixture
def call(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_bench(tmp_path)
    return partial(rso_lidar, "camera", "fit")


def test_a_fit_prints_its_table_and_writes_what_is_asked_for(call, tmp_path):
    outputs = ("own.toml", "own.html", "own.png")
    status, said, _ = call("bench.toml", "--data", "curves.toml", *(part for name in outputs for part in ("-o", name)))
    assert status == 0
    assert "noise_equivalent_photons" in said
    assert said.splitlines()[-3:] == ["own.html", "own.png", "own.toml"]
    lidar = Lidar(preset="own.toml", receiver={"fov_deg": 2.5, "f_number": 2.8})
    assert lidar.calibration.name == "invented"


def test_a_rejected_fit_leaves_its_report_and_no_preset(call, tmp_path):
    columns = make_table()
    columns["hits"][::2] *= 0.8
    write_bench(tmp_path, CURVES, columns)
    status, said, lines = call("bench.toml", "--data", "curves.toml", "-o", "own.toml", "-o", "own.html")
    assert status == 2
    assert "Not reproduced: detection_rate" in said
    assert len(lines) == 1 and lines[0].startswith("error: curves.toml: rejected: the detector cannot have given")
    assert (tmp_path / "own.html").exists() and not (tmp_path / "own.toml").exists()


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('density = "OD"', 'density = "ND"', "rate.csv: detection_rate: has no column 'ND'"),
        ("photons = 10000", "photons = 1e7", "detection_rate: its photons are 1,000 times too high, it seems"),
        ('"noise_equivalent_photons"]', '"counts_per_photon"]', "these curves hardly depend on counts_per_photon"),
        ('trials = "flashes"', "trials = -3", "curves.toml: curve[0].trials"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(call, tmp_path, old, new, line):
    (tmp_path / "curves.toml").write_text(CURVES.replace(old, new), encoding="utf-8")
    status, said, lines = call("bench.toml", "--data", "curves.toml", "-o", "own.toml", "-o", "own.html")
    assert status == 2 and said == ""
    assert len(lines) == 1 and line in lines[0]
    assert not (tmp_path / "own.toml").exists() and not (tmp_path / "own.html").exists()


def test_an_output_that_exists_is_kept(call, tmp_path):
    (tmp_path / "own.toml").write_text("mine", encoding="utf-8")
    status, _, lines = call("bench.toml", "--data", "curves.toml", "-o", "own.toml")
    assert status == 2 and "exists already" in lines[0]
    assert (tmp_path / "own.toml").read_text(encoding="utf-8") == "mine"


def test_maps_that_exist_are_kept_and_nothing_is_written(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_map_bench(tmp_path)
    (tmp_path / "own.npz").write_bytes(b"mine")
    status, said, lines = rso_lidar(
        "camera", "fit", "bench.toml", "--data", "curves.toml", "-o", "own.toml", "-o", "own.html"
    )
    assert status == 2 and said == "" and "own.npz: exists already" in lines[0]
    assert (tmp_path / "own.npz").read_bytes() == b"mine"
    assert not (tmp_path / "own.toml").exists() and not (tmp_path / "own.html").exists()
