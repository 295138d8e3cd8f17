import hashlib

import pytest

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import CurvesFile, fit_camera
from rso_lidar.mission_analysis import list_parameters
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
    assert sources["lidar.detector.counts_per_photon"] == "scenario"
    other = Scenario.loads(text.replace("pulse_fwhm_ns = 6", "pulse_fwhm_ns = 9"), folder=tmp_path)
    (line,) = [line for line in other.advice() if "calibration" in line]
    assert "was measured at 6 ns, and lidar.laser.pulse_fwhm_ns is 9" in line


def test_a_rejected_fit_writes_no_preset(tmp_path):
    columns = make_table()
    columns["hits"][::2] *= 0.8  # every second point by another laser
    folder = write_bench(tmp_path, CURVES, columns)
    camera = fit_camera(Scenario.load(folder / "bench.toml").lidar, CurvesFile.load(folder / "curves.toml"))
    assert camera.fit.is_rejected
    with pytest.raises(ScenarioError, match=r"curves.toml: rejected: .*detection_rate .*sigma"):
        camera.save_preset(tmp_path / "no.toml")
    assert not (tmp_path / "no.toml").exists()


def test_presets_that_are_none_are_refused(tmp_path):
    lens = {"fov_deg": 2.5, "f_number": 2.8}
    with pytest.raises(ScenarioError, match=r"preset: no preset file 'gone\.toml'"):
        Lidar(preset="gone.toml", receiver=lens)
    (tmp_path / "other.toml").write_text('name = "a scenario"\n', encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"other\.toml: is not a preset file: it has 'name'"):
        Lidar(preset=str(tmp_path / "other.toml"), receiver=lens)
