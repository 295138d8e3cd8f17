"""The report of a pixel: its numbers are those of the frame, and its fitted pulse lies on its samples."""

import numpy as np
import pytest

import rso_lidar as rl

APPROACH = "examples/tdrs_approach.toml"


@pytest.fixture(scope="module")
def frame():
    """Return the last frame of the approach, with its waveforms."""
    (made,) = rl.simulate(rl.Scenario.load(APPROACH), frames=[539], keep=("waveforms", "taps"))
    return made


def brightest(frame):
    row, col = np.unravel_index(int(frame.intensity_counts.argmax()), frame.valid.shape)
    return int(row), int(col)


def test_the_reported_pulse_lies_on_the_samples(frame):
    report = rl.study.report_pixel(frame, rl.Scenario.load(APPROACH).instrument, brightest(frame))
    samples, pulse = report.curves["samples"], report.curves["reported pulse"]
    fitted = np.interp(samples[:, 0], pulse[:, 0], pulse[:, 1])
    assert np.abs(fitted - samples[:, 1]).max() < 0.1 * np.ptp(samples[:, 1])
    assert report.instants_ns["trigger"] < report.instants_ns["reported"] + 20.0


def test_numbers_are_those_of_the_frame(frame):
    pixel = brightest(frame)
    said = dict(rl.study.report_pixel(frame, rl.Scenario.load(APPROACH).instrument, pixel).numbers)
    assert said["Target"] == "tdrs"
    assert said["True range"] == f"{frame.labels.range_m[pixel]:,.3f} m"
    error_m = float(frame.range_m[pixel]) - float(frame.labels.range_m[pixel])
    assert float(said["Error"].removesuffix(" cm")) == pytest.approx(100.0 * error_m, abs=0.06)
    assert said["Intensity"].startswith(f"{frame.intensity_counts[pixel]:,} counts")


def test_the_sky_has_no_range_and_no_curves(frame):
    row, col = np.argwhere((frame.labels.target < 0) & ~frame.valid)[0]
    report = rl.study.report_pixel(frame, rl.Scenario.load(APPROACH).instrument, (int(row), int(col)))
    assert dict(report.numbers)["Target"] == "sky"
    assert dict(report.numbers)["Measured range"] == "no return"
    assert report.curves == {}
    assert "no samples" in report.note


def test_a_detector_without_waveforms_is_named():
    scenario = rl.Scenario.load(APPROACH)
    scenario = scenario.replace(lidar=scenario.lidar.replace(detector=rl.Empirical()))
    (frame,) = rl.simulate(scenario, frames=[539])
    assert "empirical" in rl.study.report_pixel(frame, scenario.instrument, brightest(frame)).note
