"""The data sheet of a camera: the same figures in every file, each with origin and uncertainty, within 80 columns."""

import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import CameraFigure, DetectorTraits
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.mission_analysis import data_sheet
from rso_lidar.mission_analysis.camera.figure_text import format_interval, format_value


@pytest.fixture(scope="module")
def sheet():
    return data_sheet("gsfl_1064", trials=400)


@pytest.mark.parametrize("camera", ["gsfl_1064", "geiger_1064", "empirical"])
def test_every_figure_has_an_origin_and_trials_have_an_interval(camera, sheet):
    lidar = rl.Lidar(preset="gsfl_1064", detector=rl.Empirical()) if camera == "empirical" else camera
    made = sheet if camera == "gsfl_1064" else data_sheet(lidar, trials=100)
    for figure in made.figures:
        assert figure.how and len(figure.how) <= 15 and len(figure.meaning) <= 34
        if "trials" in figure.how:
            assert figure.low <= figure.high
    names = [figure.name for figure in made.figures]
    assert len(set(names)) == len(names)
    needed = {"noise_equivalent_photons", "false_alarms_per_frame", "dynamic_range_db", "range_walk_m", "snr_strong"}
    assert needed | {f"photons_at_{percent}_percent" for percent in (50, 90, 95, 99)} <= set(names)
    assert max(map(len, made.table().splitlines())) <= 80


def test_range_figures_contain_the_curve_of_the_walk(sheet):
    """The camera's own 5 cm of jitter is the least scatter; with the matched filter there is no walk beyond its error."""
    assert sheet.find("range_sigma_strong_m").value == pytest.approx(0.05, rel=4.0 * 1.166 / math.sqrt(400) + 0.05)
    assert sheet.find("range_walk_m").low < 0.005
    late = data_sheet(
        rl.Lidar(preset="gsfl_1064", detector=rl.Gsfl(ranging=rl.detector.Ranging(algorithm="leading_edge"))),
        trials=100,
    )
    assert late.find("range_walk_m").low > 0.3  # docs/instrument.md: the whole walk


def test_dynamic_range_is_twenty_decibel_a_decade(sheet):
    ratio = sheet.find("saturation_photons").value / sheet.find("photons_at_50_percent").value
    assert 10.0 ** (sheet.find("dynamic_range_db").value / 20.0) == pytest.approx(ratio)


def test_files_hold_the_same_figures(sheet, tmp_path):
    places = [sheet.save(tmp_path / f"sheet{suffix}") for suffix in (".csv", ".json", ".html", ".png")]
    rows = list(csv.DictReader(io.StringIO(places[0].read_text(encoding="utf-8"))))
    assert [float(row["photons"]) for row in rows] == pytest.approx(sheet.curve.photons.tolist(), rel=1e-6)
    held = json.loads(places[1].read_text(encoding="utf-8"), parse_constant=pytest.fail)
    by_name = {figure["name"]: figure for figure in held["figures"]}
    assert by_name["nep_w_per_sqrt_hz"]["value"] == pytest.approx(sheet.find("nep_w_per_sqrt_hz").value)
    assert held["curve"]["trials"] == 400 and held["notes"] == list(sheet.notes)
    page = places[2].read_text(encoding="utf-8")
    assert all(figure.name in page for figure in sheet.figures)
    assert "<script" not in page and "http" not in page
    with pytest.raises(RecordingError, match="unknown suffix"):
        sheet.save(tmp_path / "sheet.txt")
    with pytest.raises(RecordingError, match="exists"):
        sheet.save(places[0])


def test_notes_name_what_is_not_the_users(sheet):
    assert any("amplifier.noise_electrons" in note and "armed_to_m" in note for note in sheet.notes)
    own = rl.Gsfl(quantum_efficiency=0.6, armed_to_m=800.0, maps=rl.detector.Maps())
    notes = "\n".join(data_sheet(rl.Lidar(preset="gsfl_1064", detector=own), trials=50).notes)
    assert "quantum_efficiency" not in notes and "armed_to_m" not in notes
    assert "Closed forms leave out: maps" in notes


def test_the_page_of_the_camera_states_its_figures():
    """Values that no trial decides; the scenario is the one of the page."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "camera.md").read_text(encoding="utf-8")
    block = page.partition("```toml\n")[2].partition("```")[0]
    made = data_sheet(rl.Scenario.loads(block), trials=50)
    rows = dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|.*\| (?:closed form|form and trials) \|$", page, re.MULTILINE))
    stated = {
        figure.meaning: f"{figure.value:.4g}" if "detection" in figure.meaning else format_value(figure)
        for figure in made.figures
    }
    shared = set(rows) & set(stated)
    assert len(shared) >= 9
    for meaning in shared:
        value = rows[meaning].rstrip("0").rstrip(".") if "detection" in meaning else rows[meaning]
        assert value == stated[meaning]


def test_a_detector_of_ones_own_tells_its_traits_and_its_trials():
    class Own:
        traits = DetectorTraits(sees_to_m=400.0, threshold_photons=20.0)

        def detect(self, photons, rng):
            seen = photons.photons > 20.0 + rng.standard_normal(len(photons.photons))
            range_m = np.full(photons.shape[0] * photons.shape[1], np.nan)
            range_m[photons.pixel[seen]] = photons.delay_s[seen] * rl.units.RANGE_PER_DELAY_M_S
            planes = (
                values.reshape(photons.shape)
                for values in (range_m, np.zeros(len(range_m)), np.zeros(len(range_m), bool))
            )
            return rl.records.Reading(*planes), None

    made = data_sheet(rl.Lidar(preset="gsfl_1064", detector=Own()), trials=1000)
    half = made.find("photons_at_50_percent")
    assert half.low < 20.0 < half.high or half.value == pytest.approx(20.0, rel=0.01)
    assert format_value(made.find("saturation_photons")) == "no limit"
    assert "nep_w_per_sqrt_hz" not in {figure.name for figure in made.figures}


def test_figures_that_a_camera_lacks_are_one_line(sheet):
    with pytest.raises(ScenarioError, match=r"'nep': no figure of gsfl_1064.*known: responsivity_a_per_w"):
        sheet.find("nep")
    with pytest.raises(ScenarioError, match="no camera of that name"):
        data_sheet("gsfl_1046")


@pytest.mark.parametrize(
    ("value", "unit", "says"),
    [
        (0.0, "1/s", "0 /s"),
        (2.5e-15, "W/√Hz", "2.5 fW/√Hz"),
        (1.8e8, "Hz", "180 MHz"),
        (math.nan, "m", "unknown"),
        (0.0234, "m", "2.34 cm"),
        (108_776.4, "photons", "108,776"),
        (3e-7, "", "3.0e-07"),
    ],
)
def test_values_have_readable_units(value, unit, says):
    assert format_value(CameraFigure("name", "meaning", value, unit, "setting")) == says
    assert format_interval(CameraFigure("name", "meaning", value, unit, "setting")) == ""
