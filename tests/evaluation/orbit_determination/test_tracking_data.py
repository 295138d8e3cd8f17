"""Tracking data messages of a recording: a fit to the message is the fit to the recording."""

import datetime
import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError, RsoLidarWarning, ScenarioError
from rso_lidar.evaluation.orbit_determination.tracking_data import load_observer_orbit
from rso_lidar.orbit import Epochs, State, StatedManeuver, TrackingDataMessage, write_oem, write_opm
from rso_lidar.study import fit_relative_orbit, fit_tracking_data, save_tracking_data
from rso_lidar.track import EstimatedOrbit
from tests.evaluation.orbit_determination.scenario_for_tests import EXAMPLES, load_small


@pytest.fixture(scope="module")
def made(flown):
    return fit_relative_orbit(flown, forces=None, range_noise_m=0.05)


@pytest.fixture(scope="module")
def message(flown, tmp_path_factory):
    """Return the file of the measurements of the recording."""
    return rl.save(tmp_path_factory.mktemp("tdm") / "stage.tdm", flown, range_noise_m=0.05)


def test_a_fit_to_the_message_is_the_fit_to_the_recording(made, message):
    """The message has one noise for all measurements, and no error of the attitude that is constant."""
    found = fit_tracking_data(message, made.own.orbit, forces=None)
    assert np.linalg.norm(found.position_m - made.fit.position_m) < 0.02 * np.linalg.norm(made.fit.sigma[:3])
    assert np.linalg.norm(found.velocity_m_s - made.fit.velocity_m_s) < 0.1 * np.linalg.norm(made.fit.sigma[3:])
    np.testing.assert_allclose(found.sigma, made.fit.sigma, rtol=0.1)
    assert found.statistics.n_used == made.fit.statistics.n_used


def test_the_message_states_correction_and_counts(made, message, flown, tmp_path):
    text = message.read_text()
    assert "CORRECTIONS_APPLIED = NO" in text and "attitude: star tracker 'star_tracker'" in text
    measured = TrackingDataMessage.from_file(message)
    (segment,) = measured.segments
    assert segment.correction_range_m == pytest.approx(1.48, abs=0.05)  # of the stage, by its mesh
    assert segment.sigma_offset_m == pytest.approx(made.wander_m, rel=1e-5)
    assert text.count("COMMENT INTENSITY 2024-09-17T12:00:") == len(segment.records["RANGE"][0])
    frame = flown[5]
    taken = np.isfinite(frame.range_m) & (np.abs(frame.range_m - np.nanmedian(frame.range_m)) < 5.0)
    assert f"sum {frame.intensity_counts[taken].sum():.0f} counts" in text
    applied = save_tracking_data(tmp_path / "b.tdm", flown, corrected=True, range_noise_m=0.05)
    assert "CORRECTIONS_APPLIED = YES" in applied.read_text()
    np.testing.assert_allclose(
        TrackingDataMessage.from_file(applied).find_positions()[1], measured.find_positions()[1], atol=2e-6
    )
    bare = save_tracking_data(tmp_path / "c.tdm", flown, "stage", shape=False, known_attitude=True, range_noise_m=0.05)
    assert "CORRECTION" not in bare.read_text() and "attitude: taken as known" in bare.read_text()


def test_the_observers_orbit_is_read_from_files(made, message, tmp_path):
    own = made.own.orbit
    start_utc = own.start_utc
    state = State(epoch_utc=start_utc, position_m=tuple(own.position_m), velocity_m_s=tuple(own.velocity_m_s))
    opm = write_opm(tmp_path / "own.opm", "A", "1", state, covariance=own.covariance, covariance_axes="tnw")
    epochs = Epochs(start_utc, np.arange(0.0, 300.0, 30.0))
    oem = write_oem(tmp_path / "own.oem", "A", "1", epochs, own.states(epochs))
    known = fit_tracking_data(message, own, forces=None)
    by_opm = fit_tracking_data(message, opm, "stage", forces=None)
    np.testing.assert_allclose(by_opm.position_m, known.position_m, atol=1e-5)
    np.testing.assert_allclose(by_opm.covariance, known.covariance, rtol=1e-4, atol=1e-9)
    by_oem = fit_tracking_data(message, oem, forces=None)
    np.testing.assert_allclose(by_oem.position_m, known.position_m, atol=1e-5)
    later = EstimatedOrbit(
        start_utc + datetime.timedelta(seconds=10), -10.0, own.position_m, own.velocity_m_s, own.covariance, None
    )
    np.testing.assert_allclose(fit_tracking_data(message, later).position_m, known.position_m, atol=1e-6)
    burns = write_opm(
        tmp_path / "b.opm", "A", "1", state, mass_kg=1.0, maneuvers=[StatedManeuver(1.0, (1.0, 0.0, 0.0))]
    )
    with pytest.raises(ScenarioError, match=r"b\.opm: has maneuvers, and a fit needs a coast"):
        fit_tracking_data(message, burns)


def test_an_orbit_of_the_observer_with_no_covariance_or_of_another_day_is_told(made, tmp_path):
    own = made.own.orbit
    start_utc = own.start_utc + datetime.timedelta(seconds=own.epoch_s)
    state = State(epoch_utc=start_utc, position_m=tuple(own.position_m), velocity_m_s=tuple(own.velocity_m_s))
    opm = write_opm(tmp_path / "own.opm", "A", "1", state, covariance=own.covariance)
    with pytest.warns(RsoLidarWarning, match=r"own\.opm: its epoch is 2 days from the measurements"):
        load_observer_orbit(opm, start_utc + datetime.timedelta(days=2), 0.0, None)
    opm.write_text(re.sub("(?m)^CY_X = .*$", "CY_X = 1", opm.read_text()))
    with pytest.raises(ScenarioError, match=r"own\.opm: covariance: is not positive semidefinite"):
        load_observer_orbit(opm, start_utc, 0.0, None)


def test_noise_that_nobody_states_is_asked_for(made, message, tmp_path):
    path = tmp_path / "a.tdm"
    path.write_text(message.read_text().replace("SIGMA_RANGE", "RANGE_SIGMA").replace("SIGMA_ANGLE", "ANGLE_SIGMA"))
    with pytest.raises(ScenarioError, match=r"does not state the noise of its ranges; give it \(--range-noise\)"):
        fit_tracking_data(path, made.own.orbit)
    with pytest.raises(ScenarioError, match=r"does not state the noise of its angles; give it \(--angle-noise\)"):
        fit_tracking_data(path, made.own.orbit, range_sigma_m=0.5)
    for given in ({"range_sigma_m": 0.0}, {"angle_sigma_rad": -1e-4}, {"range_sigma_m": np.nan}):
        with pytest.raises(ScenarioError, match=f"{next(iter(given))}: .* is not a standard deviation"):
            fit_tracking_data(message, made.own.orbit, **given)
    stated = TrackingDataMessage.from_file(message).segments[0]
    given = fit_tracking_data(
        path, made.own.orbit, range_sigma_m=stated.sigma_range_m, angle_sigma_rad=stated.sigma_angle_rad
    )
    known = fit_tracking_data(message, made.own.orbit)
    assert np.array_equal(given.position_m, known.position_m)


def test_what_a_recording_lacks_is_said(flown, tmp_path):
    path = tmp_path / "a.tdm"
    with pytest.raises(RecordingError, match="tdm: the recording has no frames; record some"):
        save_tracking_data(path, [])
    with pytest.raises(RecordingError, match="no target named 'stag'; did you mean 'stage'"):
        save_tracking_data(path, flown, "stag")
    with pytest.raises(RecordingError, match="corrected: the correction is that of the shape"):
        save_tracking_data(path, flown, corrected=True, shape=False)
    bare = list(rl.simulate(load_small().replace(sensor=()), frames=range(3)))
    with pytest.raises(RecordingError, match=r"no star tracker; record it .*known-attitude"):
        save_tracking_data(path, bare)
    scenario = rl.Scenario.load(EXAMPLES / "bench_plate.toml", ("lidar.receiver.n_rows=4", "lidar.receiver.n_cols=4"))
    bench = list(rl.simulate(scenario, frames=[0]))
    with pytest.raises(RecordingError, match="tdm: a local world has no inertial axes for directions"):
        save_tracking_data(path, bench)
    with pytest.raises(RecordingError, match="a local world has no Earth"):
        rl.save(path, bench)
    assert not list(tmp_path.iterdir())
