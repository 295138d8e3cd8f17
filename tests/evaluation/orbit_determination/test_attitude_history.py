"""The attitude over a recording: interpolation, gaps, and the errors that a star tracker states."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.evaluation.orbit_determination.attitude_history import read_star_tracker
from rso_lidar.records import StarTrackerSamples
from rso_lidar.sensors import StarTracker

RATE = np.array([0.0, 0.01, 0.02])
PART = StarTracker(
    name="tracker", rate_hz=1.0, mount={"euler_zyx_deg": (90.0, 0.0, 0.0)}, cross_boresight_arcsec=5.0,
    boresight_arcsec=50.0, slow_cross_boresight_arcsec=3.0, slow_boresight_arcsec=0.0, misalignment_arcsec=4.0,
)  # fmt: skip


@pytest.fixture
def history():
    time_s = np.array([0.0, 1.0, 2.0, 3.0, 6.0, 7.0])
    turned = Rotation.from_rotvec(np.outer(time_s, RATE)).as_quat()
    valid = np.array([True, True, True, True, True, False])
    turned[5] = np.nan
    return read_star_tracker(StarTrackerSamples(time_s, time_s, valid, turned), PART)


def test_between_samples_the_rate_is_constant(history):
    attitude, rate, factor = history.find(np.array([0.25, 2.0, 3.0]))
    assert np.allclose(attitude[0], Rotation.from_rotvec(0.25 * RATE).as_matrix())
    assert np.allclose(rate, RATE)
    assert factor == pytest.approx([0.25**2 + 0.75**2, 1.0, 1.0])


def test_gaps_and_instants_outside_have_no_attitude(history):
    attitude, _, _ = history.find(np.array([-0.1, 4.0, 5.9, 6.0, 6.1]))
    assert np.isfinite(attitude).all(axis=(1, 2)).tolist() == [False, False, False, True, False]


def test_the_rate_before_a_gap_is_that_of_the_samples_before_it():
    """A turn of 400 deg over the gap is 40 deg to a rotation vector: the rate over it would be wrong by a factor of ten."""
    time_s, rate = np.array([0.0, 1.0, 2.0, 402.0]), np.array([0.0, 0.0, 1.0]) * units.DEG
    turned = Rotation.from_rotvec(np.outer(time_s, rate)).as_quat()
    history = read_star_tracker(StarTrackerSamples(time_s, time_s, np.ones(4, bool), turned), PART)
    assert np.allclose(history.find(np.array([2.0]))[1], rate)


def test_errors_are_those_of_the_mount(history):
    assert np.sqrt(np.diag(history.white_rad2)) / units.ARCSEC == pytest.approx([5.0, 5.0, 50.0])
    assert history.slow_rad / units.ARCSEC == pytest.approx([5.0, 5.0, 4.0])  # 3 and 4 arcsec; about the boresight, 4
    assert history.source == "star tracker 'tracker'"


def test_one_sample_is_no_history():
    one = StarTrackerSamples(np.zeros(1), np.zeros(1), np.ones(1, bool), np.array([[0.0, 0.0, 0.0, 1.0]]))
    assert np.isnan(read_star_tracker(one, PART).find(np.zeros(2))[0]).all()
