"""An estimated orbit as a trajectory: its states, and its covariance at another epoch."""

import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import Epochs, Forces
from rso_lidar.track import EstimatedOrbit

UTC = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
SPEED_M_S = (units.EARTH_GM_M3_S2 / 7e6) ** 0.5
PERIOD_S = 2.0 * np.pi * 7e6 / SPEED_M_S
SPREAD = np.diag(np.repeat([100.0, 1e-4], 3))


def make(forces=None, epoch_s=30.0):
    return EstimatedOrbit(UTC, epoch_s, np.array([7e6, 0, 0]), np.array([0, SPEED_M_S, 0]), SPREAD, forces)


@pytest.mark.parametrize("forces", [None, Forces()])
def test_states_hold_at_the_epoch_whatever_the_start_of_the_epochs(forces):
    orbit = make(forces)
    for start, time_s in ((UTC, 30.0), (UTC + datetime.timedelta(seconds=20.0), 10.0)):
        there = orbit.states(Epochs(start, np.array([time_s])))
        assert np.allclose(there.position_m[0], orbit.position_m, atol=1e-6)
        assert np.allclose(there.velocity_m_s[0], orbit.velocity_m_s, atol=1e-9)


def test_another_epoch_and_back_is_the_same_estimate():
    orbit = make(Forces())
    back = orbit.move_epoch(400.0).move_epoch(30.0)
    assert np.allclose(back.vector, orbit.vector, atol=1e-6)
    scale = np.sqrt(np.diag(SPREAD))
    # Transitions are those of two-body motion; J2 changes them by a thousandth.
    assert np.allclose(back.covariance / np.outer(scale, scale), np.eye(6), rtol=0, atol=2e-3)
    assert orbit.move_epoch(30.0) is orbit


def test_an_error_along_the_velocity_grows_as_kepler_says():
    """A velocity error dv along-track shifts the body by 3 dv in each unit of time, after whole revolutions."""
    later = make(epoch_s=0.0).move_epoch(PERIOD_S)
    alone = EstimatedOrbit(
        UTC, 0.0, later.position_m, np.array([0, SPEED_M_S, 0]), np.diag([0, 0, 0, 0, 1e-4, 0]), None
    )
    grown = alone.move_epoch(PERIOD_S).covariance
    assert np.sqrt(grown[1, 1]) == pytest.approx(3.0 * PERIOD_S * 1e-2, rel=1e-6)


def test_its_covariances_over_time_are_those_of_other_epochs():
    orbit = make(epoch_s=0.0)
    epochs = Epochs(UTC, np.array([-600.0, 0.0, 900.0]))
    history = orbit.covariances(epochs, "craft")
    assert history.label == "craft" and len(orbit.covariances().epochs) == 1
    for k, time_s in enumerate(epochs.time_s):
        expected = orbit.move_epoch(time_s).covariance
        scale = np.sqrt(np.diag(expected))
        # both transitions are central differences, good to 1e-8
        assert np.allclose(history.matrices[k] / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-6)
