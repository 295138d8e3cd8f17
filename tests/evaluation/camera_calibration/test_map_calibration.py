import hashlib
import json

import numpy as np
import pytest
from typer.testing import CliRunner

import rso_lidar as rl
from rso_lidar.cli.app import app
from rso_lidar.detector import read_pixel_maps
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import CurvesFile, fit_camera, save_fit_report
from rso_lidar.scenario import Scenario
from tests.evaluation.camera_calibration.map_bench_for_tests import (
    MAPS,
    SCENARIO,
    SHOTS,
    make_maps,
    write_map_bench,
)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = write_map_bench(tmp_path_factory.mktemp("maps"))
    camera = fit_camera(Scenario.load(folder / "bench.toml").instrument, CurvesFile.load(folder / "curves.toml"))
    (folder / "cameras").mkdir()
    camera.save_preset(folder / "cameras" / "mine.toml")
    text = SCENARIO.replace('detector = { type = "gsfl", armed_to_m = 100 }', 'preset = "cameras/mine.toml"')
    (folder / "mission.toml").write_text(text, encoding="utf-8")
    return folder, camera


def test_the_maps_are_a_file_with_their_origin(fitted):
    folder, _ = fitted
    maps = read_pixel_maps(str(folder / "cameras" / "mine.npz"))
    truth, live = make_maps(), ~maps.dead
    assert np.argwhere(maps.dead).tolist() == [[2, 3]]
    beside = (maps.maps["gain_factor"] - truth["gain"] / truth["gain"][live].mean())[live]
    assert np.abs(beside).max() < 5.0 * 0.3 / 333.0 * 1.2  # noise of the bench; 1.2: slope of counts over gain at most
    assert np.abs((maps.maps["t0_ns"] - truth["t0_ns"] + truth["t0_ns"][live].mean())[live]).max() < 5.0 * 0.2 / 14.99
    origin = json.loads(maps.provenance)
    assert origin["name"] == "mine"
    assert origin["tables"][0]["sha256"] == hashlib.sha256((folder / "maps.npz").read_bytes()).hexdigest()
    assert "rso-lidar" in origin["versions"]


def test_a_scenario_takes_the_preset_with_its_maps_from_another_folder(fitted):
    folder, _ = fitted
    scenario = Scenario.load(folder / "mission.toml")
    detector = scenario.instrument.detector
    assert detector.maps.file == str(folder / "cameras" / "mine.npz")
    assert detector.maps.gain_spread_fraction == pytest.approx(make_maps()["gain"].std(), rel=0.05)
    assert (
        scenario.lidar.calibration.maps_sha256
        == hashlib.sha256((folder / "cameras" / "mine.npz").read_bytes()).hexdigest()
    )
    assert not [line for line in scenario.advice() if "calibration" in line]
    assert "maps of the pixels: calibration 'mine'" in scenario.describe()


def test_a_recording_names_the_maps_and_flies_again_with_the_same_bytes(fitted, tmp_path):
    folder, _ = fitted
    scenario = Scenario.load(folder / "mission.toml")
    sha256 = hashlib.sha256((folder / "cameras" / "mine.npz").read_bytes()).hexdigest()
    assert f"# file mine.npz of the lidar: SHA-256 {sha256}" in scenario.source.scenario
    rl.save(tmp_path / "run.h5", rl.simulate(scenario))
    with rl.open(tmp_path / "run.h5") as recording:
        again = Scenario.loads(recording.source.scenario, folder=folder)
        frame, (other,) = recording[0], list(rl.simulate(again))
    assert np.array_equal(frame.intensity_counts, other.intensity_counts)
    assert np.isnan(frame.range_m[2, 3])  # dead
    live = np.isfinite(frame.range_m)
    gain = make_maps()["gain"]
    assert np.corrcoef(gain[live], frame.intensity_counts[live])[0, 1] > 0.8  # a gain spread of 10 % over shot noise


def test_check_tells_of_other_maps_than_the_calibration_has(fitted, tmp_path):
    folder, camera = fitted
    for name in ("mission.toml",):
        (tmp_path / name).write_text((folder / name).read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "cameras").mkdir()
    camera.save_preset(tmp_path / "cameras" / "mine.toml")
    maps = read_pixel_maps(str(tmp_path / "cameras" / "mine.npz"))
    maps.maps["t0_ns"].setflags(write=True)
    maps.maps["t0_ns"][0, 0] += 1.0
    maps.save(tmp_path / "cameras" / "mine.npz", overwrite=True)
    (line,) = [line for line in Scenario.load(tmp_path / "mission.toml").advice() if "calibration" in line]
    assert line.startswith("lidar.detector.maps.file is not as the calibration 'mine' has it")


def test_maps_of_another_array_are_refused(fitted, tmp_path):
    folder, _ = fitted
    text = (
        (folder / "mission.toml")
        .read_text(encoding="utf-8")
        .replace("n_rows = 6, n_cols = 8", "n_rows = 8, n_cols = 6")
    )
    with pytest.raises(ScenarioError, match="is of 6 x 8 pixels, and the receiver has 8 x 6"):
        Scenario.loads(text, folder=folder).instrument  # noqa: B018
    gone = (folder / "mission.toml").read_text(encoding="utf-8") + 'detector = { maps = { file = "gone.npz" } }\n'
    with pytest.raises(ScenarioError, match=r"no file 'gone\.npz'"):
        Scenario.loads(gone, folder=folder).instrument  # noqa: B018


def test_an_existing_file_of_maps_is_kept_and_no_preset_written(fitted, tmp_path):
    _, camera = fitted
    (tmp_path / "own.npz").write_text("mine", encoding="utf-8")
    with pytest.raises(RecordingError, match=r"own\.npz.*exists"):
        camera.save_preset(tmp_path / "own.toml")
    assert not (tmp_path / "own.toml").exists()


def test_the_report_has_the_maps_and_their_pictures(fitted, tmp_path):
    _, camera = fitted
    page = save_fit_report(camera, tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "<b>Accepted.</b>" in page
    assert "constants of each pixel" in page
    assert "gain_factor" in page
    assert save_fit_report(camera, tmp_path / "fit.png").stat().st_size > 10_000
    assert "map of counts_mean at 9000" in camera.table()


def test_the_command_line_writes_the_preset_with_its_maps_or_nothing(tmp_path):
    write_map_bench(tmp_path)
    run = CliRunner().invoke
    at = ["camera", "fit", str(tmp_path / "bench.toml"), "--data", str(tmp_path / "curves.toml")]
    done = run(app, [*at, "-o", str(tmp_path / "mine.toml")])
    assert done.exit_code == 0, done.output
    assert done.output.split()[-2:] == [str(tmp_path / "mine.toml"), str(tmp_path / "mine.npz")]
    write_map_bench(tmp_path, MAPS.replace("photons = 9000", "photons = 90000", 1))
    with pytest.raises(ScenarioError, match="10 times too low, it seems"):
        fit_camera(Scenario.load(tmp_path / "bench.toml").instrument, CurvesFile.load(tmp_path / "curves.toml"))


def test_raw_shots_of_another_detector_than_the_chain_are_refused(tmp_path):
    write_map_bench(tmp_path, SHOTS)
    lidar = Scenario.load(tmp_path / "bench.toml").lidar.replace(detector=rl.Empirical())
    with pytest.raises(ScenarioError, match=r'waveform: needs the full chain; set lidar\.detector\.type = "gsfl"'):
        fit_camera(lidar, CurvesFile.load(tmp_path / "curves.toml"))
    fit = fit_camera(Scenario.load(tmp_path / "bench.toml").lidar, CurvesFile.load(tmp_path / "curves.toml"))
    (baseline,) = fit.fit.constants
    assert abs(baseline.value - 60.0) < 5.0 * 5.6 / 2000**0.5  # white noise of 2,000 samples
    assert fit.tables == ("shots.npz",) * 3
