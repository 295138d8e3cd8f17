"""The worked studies under examples/studies run, and say what their pages say."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl

STUDIES = Path(__file__).resolve().parents[2] / "examples" / "studies"


@pytest.fixture(scope="module")
def divergence():
    return runpy.run_path(str(STUDIES / "divergence.py"), run_name="study")


def test_each_study_has_its_page():
    for name in ("classify", "divergence", "lunar_descent"):
        assert (STUDIES / f"{name}.py").is_file() and (STUDIES / f"{name}.md").is_file()


def test_the_widest_beam_detects_at_its_range_and_no_farther(divergence):
    lidar = divergence["camera"](105.0, divergence["TRIGGER"])
    beam_deg = divergence["widest_deg"](lidar, 10_000.0, None)
    assert beam_deg == pytest.approx(0.751, abs=0.002)  # as divergence.md says
    assert divergence["reach_m"](lidar, beam_deg, None) == pytest.approx(10_000.0, rel=2e-3)


def test_silhouettes_are_those_of_the_shape(monkeypatch):
    """A sphere's is the same from everywhere, and its disc."""
    study = runpy.run_path(str(STUDIES / "classify.py"), run_name="study")
    turned = [Rotation.identity()]
    area = study["silhouettes_m2"]("sphere", turned)
    side_m = study["size_m"]("sphere")[0]
    assert area == pytest.approx(0.25 * np.pi * side_m**2, rel=0.01)  # rays a tenth of a pixel apart, chords of facets


def test_without_shared_meshes_the_shipped_models_are_asked_about(monkeypatch):
    monkeypatch.delenv("RSO_LIDAR_SHARED", raising=False)
    study = runpy.run_path(str(STUDIES / "classify.py"), run_name="study")
    assert set(study["craft"]()) == set(study["SHIPPED"])
    (row,) = study["study"]({"cubesat_3u": "cubesat_3u"}, attitudes=3)
    assert row["worst_m"] <= row["mean_m"] <= row["best_m"] < row["light_m"]
    assert row["silhouette_m2"] < row["box_m2"] * 1.05
    assert 50 < row["detected"] < 200


def test_heights_of_the_ground_are_those_of_the_frames():
    study = runpy.run_path(str(STUDIES / "lunar_descent.py"), run_name="study")
    scenario = rl.Scenario.load(STUDIES.parent / "lunar_descent.toml")
    frames = list(rl.simulate(scenario, frames=slice(24, None, 6)))  # six of the sixty, from 400 m on
    found = study["elevation_map"](frames, "site", 60.0, 1.0)
    truth = study["true_elevation"](scenario.surfaces[0], found)
    whole = study["agreement"](found, truth)[0]
    assert whole.coverage > 0.95
    # The page's 4.5 cm and less than nothing: in the middle, where pixels are smaller than cells.
    assert whole.rms_m < 0.08
    assert abs(whole.bias_m) < 0.01
    said, there = study["hazards"](found), study["hazards"](truth)
    known = (said != study["UNKNOWN"]) & (there != study["UNKNOWN"])
    assert np.mean(said[known] == there[known]) > 0.95
