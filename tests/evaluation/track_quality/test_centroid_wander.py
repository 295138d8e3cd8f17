"""The wander of a centroid: known processes are measured, and what is none is refused."""

import numpy as np
import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.evaluation import Tracking, measure_centroid_wander

STEP_S = 2.0


def track(offset_m, time_s=None):
    """Return what trackers make of a centroid with an offset (time, 3) along, across and across, off the boresight."""
    along = np.array([0.05, -0.02, 1.0])
    along /= np.linalg.norm(along)
    right = np.cross([0.0, 1.0, 0.0], along)
    right /= np.linalg.norm(right)
    error = offset_m @ np.stack([along, right, np.cross(along, right)])
    middle = 150.0 * along + error
    time_s = STEP_S * np.arange(len(error)) if time_s is None else time_s
    table = {"time_s": time_s}
    for k, axis in enumerate(Tracking.AXES):
        table |= {f"centroid_{axis}_m": middle[:, k], f"centroid_error_{axis}_m": error[:, k]}
    return Tracking("run", "body", table, {}, 0.05, 1e-4)


def make_process(count, tau_s, sigma_m, noise_m, seed=1):
    rng, decay = np.random.default_rng(seed), np.exp(-STEP_S / tau_s)
    rows = [sigma_m * rng.standard_normal(3)]
    for _ in range(count - 1):
        rows.append(decay * rows[-1] + np.sqrt(1.0 - decay**2) * sigma_m * rng.standard_normal(3))
    return np.array(rows) + noise_m * rng.standard_normal((count, 3))


def test_a_gauss_markov_process_is_measured_in_white_noise():
    """12,000 s of 60 s in three axes: the time has a relative standard error of below 10 %, and a sigma of 5 to 7 %."""
    offset_m = np.array([-1.5, 0.2, 0.0]) + make_process(6000, 60.0, np.array([0.6, 0.2, 0.2]), 0.1)
    offset_m[100:130] = np.nan
    wander = measure_centroid_wander(track(offset_m))
    assert wander.centroid.correlation_time_s == pytest.approx(60.0, rel=0.3)
    assert wander.centroid.along_sigma_m == pytest.approx(0.6, rel=0.25)
    assert wander.centroid.across_sigma_m == pytest.approx(0.2, rel=0.25)
    assert wander.mean_m[0] == pytest.approx(-1.5, abs=4 * 0.6 / np.sqrt(100.0))
    assert wander.lengths == pytest.approx(11_998.0 / wander.centroid.correlation_time_s)
    assert "correlation time" in wander.describe()


def test_a_body_that_turns_evenly_falls_to_1_over_e_after_a_fifth_of_a_turn():
    """The autocorrelation of a sine is a cosine: 1/e at 0.1901 of its period."""
    time_s = STEP_S * np.arange(2000)
    offset_m = np.zeros((2000, 3))
    offset_m[:, 0] = 0.5 * np.sin(2.0 * np.pi * time_s / 200.0)
    wander = measure_centroid_wander(track(offset_m))
    assert wander.centroid.correlation_time_s == pytest.approx(
        200.0 * np.arccos(np.exp(-1.0)) / (2.0 * np.pi), rel=0.01
    )
    assert wander.centroid.along_sigma_m == pytest.approx(0.5 / np.sqrt(2.0), rel=0.01)
    assert wander.centroid.across_sigma_m == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("offset_m", "time_s", "problem"),
    [
        (np.zeros((10, 3)), None, "10 fixes are fewer than 20"),
        (np.full((50, 3), np.nan), None, "0 fixes are fewer than 20"),
        (make_process(400, 60.0, 0.0, 0.1), None, "no wander to measure"),
        (np.zeros((50, 3)), None, "no wander to measure"),
        (np.outer(np.linspace(0.0, 1.0, 60), [1.0, 0.0, 0.0]), np.geomspace(1.0, 100.0, 60), "uneven steps"),
    ],
    ids=["few", "none", "white", "still", "uneven"],
)
def test_what_is_no_wander_is_refused_in_one_line(offset_m, time_s, problem):
    with pytest.raises(RecordingError, match=problem) as error:
        measure_centroid_wander(track(offset_m, time_s))
    assert "\n" not in str(error.value)
