import hashlib

import numpy as np
import pytest

from rso_lidar.detector import list_assumed_settings
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import CurvesFile, fit_camera
from rso_lidar.evaluation.camera_calibration.fit_report import write_fit_report
from rso_lidar.mission_analysis import data_sheet, list_parameters
from rso_lidar.scenario import Lidar, Scenario
from tests.evaluation.camera_calibration.bench_for_tests import CURVES, HIDDEN, SCENARIO, make_table, write_bench


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = write_bench(tmp_path_factory.mktemp("bench"))
    lidar = Scenario.load(folder / "bench.toml").lidar
    return folder, fit_camera(lidar, CurvesFile.load(folder / "curves.toml"))


def test_the_hidden_constants_are_found(fitted):
    _, camera = fitted
    for constant in camera.fit.constants:
        sigma = (constant.high - constant.low) / 3.92
        assert abs(constant.value - HIDDEN[constant.name]) < 4.0 * sigma
    assert camera.list_misfits() == []
    assert "reference_photons" in camera.table()


def test_a_preset_states_its_origin_and_a_scenario_takes_it_by_its_path(fitted):
    folder, camera = fitted
    camera.save_preset(folder / "invented.toml")
    text = SCENARIO.replace('detector = { type = "empirical", quantum_efficiency = 0.7 }', 'preset = "invented.toml"')
    (folder / "mission.toml").write_text(text, encoding="utf-8")
    scenario = Scenario.load(folder / "mission.toml")
    assert scenario.lidar.detector == camera.fit.detector
    assert scenario.lidar.preset is None
    calibration = scenario.lidar.calibration
    assert calibration == camera.calibration
    assert calibration.data[0].sha256 == hashlib.sha256((folder / "rate.csv").read_bytes()).hexdigest()
    assert [constant.name for constant in calibration.constants] == list(HIDDEN)
    with pytest.raises(RecordingError, match="exists"):
        camera.save_preset(folder / "invented.toml")


def test_a_recorded_scenario_holds_the_calibration_without_the_file(fitted, tmp_path):
    _, camera = fitted
    camera.save_preset(tmp_path / "own.toml")
    text = SCENARIO.replace('detector = { type = "empirical", quantum_efficiency = 0.7 }', 'preset = "own.toml"')
    scenario = Scenario.loads(text, folder=tmp_path)
    (tmp_path / "own.toml").unlink()
    again = Scenario.loads(scenario.source.scenario)
    assert again.lidar.detector == camera.fit.detector
    assert again.lidar.calibration == camera.calibration


def test_check_names_a_fitted_constant_that_the_scenario_overrides(fitted, tmp_path):
    _, camera = fitted
    camera.save_preset(tmp_path / "own.toml")
    lidar = Lidar(preset=str(tmp_path / "own.toml"), receiver={"fov_deg": 2.5, "f_number": 2.8})
    assert lidar.calibration.list_overridden(lidar.detector) == []
    text = SCENARIO.replace(
        'detector = { type = "empirical", quantum_efficiency = 0.7 }',
        'preset = "own.toml"\ndetector = { reference_photons = 900 }',
    )
    lines = Scenario.loads(text, folder=tmp_path).advice()
    assert any("lidar.detector.reference_photons is not as the calibration 'invented' has it" in line for line in lines)


def test_check_and_parameters_say_what_is_measured(fitted, tmp_path):
    _, camera = fitted
    camera.save_preset(tmp_path / "own.toml")
    text = SCENARIO.replace('detector = { type = "empirical", quantum_efficiency = 0.7 }', 'preset = "own.toml"')
    scenario = Scenario.loads(text, folder=tmp_path)
    assert "fitted    reference_photons, noise_equivalent_photons: calibration 'invented'" in scenario.describe()
    assert not [line for line in scenario.advice() if "calibration" in line]
    sources = {parameter.path: parameter.source for parameter in list_parameters(scenario).parameters}
    assert sources["lidar.detector.reference_photons"] == "calibration invented"
    assert sources["lidar.detector.counts_per_photon"].startswith("default: fitted")
    assert sources["lidar.detector.quantum_efficiency"] == "scenario"
    other = Scenario.loads(text.replace("pulse_fwhm_ns = 6", "pulse_fwhm_ns = 9"), folder=tmp_path)
    (line,) = [line for line in other.advice() if "calibration" in line]
    assert "was measured at 6 ns, and lidar.laser.pulse_fwhm_ns is 9" in line


def fly(camera, folder, keys="", lidar=SCENARIO):
    """Return a scenario that takes the preset file of a fitted camera, with further keys of its detector."""
    camera.save_preset(folder / "own.toml", overwrite=True)
    own = f'preset = "own.toml"\ndetector = {{ {keys} }}'
    text = lidar.replace('detector = { type = "empirical", quantum_efficiency = 0.7 }', own)
    return Scenario.loads(text, folder=folder)


def test_a_preset_says_which_settings_are_still_assumed(fitted, tmp_path):
    """The bench states the quantum efficiency, the fit finds two constants, and all else is a default of the package."""
    _, camera = fitted
    lidar = fly(camera, tmp_path).lidar
    assumed = list_assumed_settings(lidar.detector, lidar.unstated_settings)
    assert assumed == list_assumed_settings(camera.lidar.detector.replace(**HIDDEN))
    assert {"armed_to_m", "counts_per_photon"} < set(assumed)
    assert not {"quantum_efficiency", "reference_photons", "noise_equivalent_photons"} & set(assumed)
    recorded = Scenario.loads(fly(camera, tmp_path).source.scenario).lidar
    assert list_assumed_settings(recorded.detector, recorded.unstated_settings) == assumed


def test_what_a_scenario_states_over_a_preset_is_not_assumed(fitted, tmp_path):
    """Neither a value of the user's own, nor one that happens to be the default."""
    _, camera = fitted
    same = fly(camera, tmp_path, "armed_to_m = 5000, counts_per_photon = 0.5").lidar
    assert "adc_bits" in same.unstated_settings
    assert not {"armed_to_m", "counts_per_photon"} & set(same.unstated_settings)
    later = fly(camera, tmp_path).lidar
    assert "adc_bits" not in later.replace(detector=later.detector.replace(adc_bits=14)).unstated_settings


def test_check_and_the_data_sheet_name_what_a_preset_assumes(fitted, tmp_path):
    _, camera = fitted
    scenario = fly(camera, tmp_path)
    (line,) = [line for line in scenario.describe().splitlines() if "defaults of the package" in line]
    assert "armed_to_m" in line and "quantum_efficiency" not in line and "reference_photons" not in line
    (note,) = [note for note in data_sheet(scenario.lidar, trials=50).notes if "Defaults of the package" in note]
    assert "armed_to_m" in note and "quantum_efficiency" not in note


def test_a_second_fit_keeps_what_is_assumed(fitted, tmp_path):
    folder, camera = fitted
    again = fit_camera(fly(camera, tmp_path).lidar, CurvesFile.load(folder / "curves.toml"))
    assert again.calibration.assumed == camera.calibration.assumed


def test_a_fitted_camera_refuses_another_preset_by_name(fitted, tmp_path):
    """It had no effect: the values of the file had taken the place of its name."""
    _, camera = fitted
    lidar = fly(camera, tmp_path).lidar
    with pytest.raises(
        ScenarioError, match=r"lidar\.preset: .*'invented'.*rl\.Lidar\(preset=\.\.\., laser=lidar\.laser"
    ):
        lidar.replace(preset="gsfl_1064")
    with pytest.raises(ScenarioError, match=r"'own\.toml' would not replace them"):
        lidar.replace(preset="own.toml")
    made = Lidar(preset="gsfl_1064", laser=lidar.laser, receiver=lidar.receiver)  # as the message says
    assert made.detector == Lidar(preset="gsfl_1064").detector and made.calibration is None


def test_a_rejected_fit_writes_no_preset(tmp_path):
    columns = make_table()
    columns["hits"][::2] *= 0.8  # every second point by another laser
    folder = write_bench(tmp_path, CURVES, columns)
    camera = fit_camera(Scenario.load(folder / "bench.toml").lidar, CurvesFile.load(folder / "curves.toml"))
    assert camera.fit.is_rejected
    with pytest.raises(ScenarioError, match=r"curves.toml: rejected: .*detection_rate .*sigma"):
        camera.save_preset(tmp_path / "no.toml")
    assert not (tmp_path / "no.toml").exists()


def test_no_goodness_is_said_where_no_degree_of_freedom_is_left(tmp_path):
    """Two points tell two constants; a third one in bright light, where every flash is detected, tells nothing."""
    columns = {name: values[[4, 8]] for name, values in make_table().items()}
    bright = {"OD": 0.0, "hits": 4000.0, "flashes": 4000.0}
    columns = {name: np.append(values, bright[name]) for name, values in columns.items()}
    folder = write_bench(tmp_path, CURVES, columns)
    camera = fit_camera(Scenario.load(folder / "bench.toml").lidar, CurvesFile.load(folder / "curves.toml"))
    total, freedom, p_value = camera.goodness
    residuals = camera.fit.curves[0].residuals
    assert residuals[:2] == pytest.approx(0.0, abs=1e-4)  # two constants: the curve goes through both points
    assert total == pytest.approx(float((residuals**2).sum())) and total < 1.0
    assert freedom < 1.0 and p_value is None
    assert camera.fit.p_value is None and not camera.is_rejected
    assert "degrees of freedom, P -" in camera.table()
    assert "too few to judge the fit" in write_fit_report(camera)
    preset = camera.save_preset(tmp_path / "few.toml")
    taken = Lidar(preset=str(preset), receiver={"fov_deg": 2.5, "f_number": 2.8}).calibration
    assert taken == camera.calibration and taken.p_value is None


def test_presets_that_are_none_are_refused(tmp_path):
    lens = {"fov_deg": 2.5, "f_number": 2.8}
    with pytest.raises(ScenarioError, match=r"preset: no preset file 'gone\.toml'"):
        Lidar(preset="gone.toml", receiver=lens)
    (tmp_path / "other.toml").write_text('name = "a scenario"\n', encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"other\.toml: is not a preset file: it has 'name'"):
        Lidar(preset=str(tmp_path / "other.toml"), receiver=lens)
