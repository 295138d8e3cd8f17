"""The worked studies under examples/studies run, and say what their pages say."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.scene import models
from rso_lidar.study import Study
from rso_lidar.study.trades.plan import make_trade_plan

STUDIES = Path(__file__).resolve().parents[3] / "examples" / "studies"


@pytest.fixture(scope="module")
def divergence():
    return runpy.run_path(str(STUDIES / "divergence.py"), run_name="study")


def test_each_study_has_its_page():
    for name in ("classify", "divergence", "tumbling", "lunar_descent"):
        assert (STUDIES / f"{name}.py").is_file() and (STUDIES / f"{name}.md").is_file()


@pytest.mark.slow
def test_the_widest_beam_detects_at_its_range_and_no_farther(divergence):
    lidar = divergence["camera"](105.0, divergence["TRIGGER"])
    beam_deg = divergence["widest_deg"](lidar, 10_000.0, None)
    assert beam_deg == pytest.approx(0.751, abs=0.002)  # as divergence.md says
    assert divergence["reach_m"](lidar, beam_deg, None) == pytest.approx(10_000.0, rel=2e-3)


def test_the_trade_says_what_its_page_says():
    """Two rows of the page, flown again: to the digits that are printed there."""
    lines = (STUDIES / "trade_lens.md").read_text(encoding="utf-8").splitlines()
    told = {int(cells[1]): cells[2:-1] for line in lines if re.match(r"\| \d", line) for cells in [line.split("|")]}
    plan, _ = make_trade_plan(Study.load(STUDIES / "trade_lens.toml"))
    assert len(told) == 10
    for row in (34, 14):
        merits = plan.row(row)["merits"]
        beam, lens, energy, photons, pixels, share, ranked, error_m, rms_m = (cell.strip(" %") for cell in told[row])
        assert [float(text) for text in plan.settings(row).values()] == [float(beam), float(lens), float(energy)]
        assert float(photons) == pytest.approx(merits["photons_per_pixel"], abs=0.51)
        assert float(pixels) == pytest.approx(merits["returns_on_target"], abs=0.051)
        assert float(share) == pytest.approx(100.0 * merits["detection_fraction"], abs=0.051)
        assert (ranked == "yes") == (merits["detection_fraction"] >= plan.study.min_detection_fraction)
        assert float(error_m) == pytest.approx(merits["range_error_m"], abs=0.00051)
        assert float(rms_m) == pytest.approx(merits["range_rms_m"], abs=0.00051)


def test_silhouettes_are_those_of_the_shape():
    """A sphere's is the same from everywhere, and its disc."""
    study = runpy.run_path(str(STUDIES / "classify.py"), run_name="study")
    turned = [Rotation.identity()]
    area = study["silhouettes_m2"]("sphere", turned)
    side_m = study["size_m"]("sphere")[0]
    assert area == pytest.approx(0.25 * np.pi * side_m**2, rel=0.01)  # rays a tenth of a pixel apart, chords of facets


def test_the_seven_are_asked_about_and_a_folder_of_meshes_where_one_is_given():
    study = runpy.run_path(str(STUDIES / "classify.py"), run_name="study")
    assert set(study["craft"]()) == set(study["SEVEN"]) <= set(models())
    assert study["craft"]("meshes")["lro"] == "meshes/lro.stl"
    (row,) = study["study"]({"cubesat_3u": "cubesat_3u"}, attitudes=3)
    assert row["worst_m"] <= row["mean_m"] <= row["best_m"] < row["light_m"]
    assert row["silhouette_m2"] < row["box_m2"] * 1.05
    assert 50 < row["detected"] < 200


@pytest.mark.slow
def test_heights_of_the_ground_are_those_of_the_frames():
    study = runpy.run_path(str(STUDIES / "lunar_descent.py"), run_name="study")
    scenario = rl.Scenario.load(STUDIES.parent / "lunar_descent.toml")
    frames = list(rl.simulate(scenario, frames=slice(24, None, 6)))  # six of the sixty, from 400 m on
    found = study["build_elevation_map"](frames, "site", 60.0, 1.0)
    truth = study["build_true_elevation"](scenario.surfaces[0], found)
    whole = study["compare_maps"](found, truth)[0]
    assert whole.coverage > 0.95
    # The page's 4.5 cm and less than nothing: in the middle, where pixels are smaller than cells.
    assert whole.rms_m < 0.08
    assert abs(whole.bias_m) < 0.01
    said, there = study["hazards"](found), study["hazards"](truth)
    known = (said != study["UNKNOWN"]) & (there != study["UNKNOWN"])
    assert np.mean(said[known] == there[known]) > 0.95


@pytest.mark.slow
def test_the_approach_to_a_tumbling_stage_is_the_one_that_is_told(tmp_path):
    study = runpy.run_path(str(STUDIES / "tumbling.py"), run_name="study")
    table, nis = study["flown"](study["ZOOM"], 0.01)
    rows = study["bands"](table)
    assert sum(row["frames"] for row in rows) == 27.0  # the bands hold all of it
    assert table["true_range_m"][0] == pytest.approx(2000.0, rel=1e-3)
    assert table["true_range_m"][-1] == pytest.approx(50.0, rel=0.1)
    for row in rows:
        assert -3.4 < row["ahead"] < -0.8  # half a diameter, to half of what a slanted stage hides behind it
        assert row["cw_error"] < 1.0 < row["centroid_error"]  # the shape is known, and so are the burns
    assert nis["cw"] < 5.0 < nis["cv"]
    assert rows[0]["fewest"] < 100 < rows[-1]["fewest"]  # the zoom keeps the stage in the field
    picture = study["save_figure"](study["figure"]({"zoom": table, "again": table}), tmp_path / "t.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "camera zoom; NIS" in study["told"]("zoom", table, nis)
