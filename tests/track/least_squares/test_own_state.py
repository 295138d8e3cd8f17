"""The own orbit from GNSS: forces, outliers, errors without numbers, and what is refused."""

import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Forces
from rso_lidar.track import EstimatedOrbit, GnssErrors, fit_own_state
from rso_lidar.track.least_squares.own_state import MOST_SOLUTIONS, describe_forces

UTC = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
TIME_S = np.arange(0.0, 300.0, 10.0)
STATE = np.array([6.9e6, 0.0, 0.0, 0.0, 4560.0, 6080.0])
ERRORS = GnssErrors(2.0, 0.02, 1.0, 0.01, 60.0, 1.5)
TRUE = EstimatedOrbit(UTC, 0.0, STATE[:3], STATE[3:], np.zeros((6, 6)), Forces())


def measured(time_s=TIME_S):
    there = TRUE.states(Epochs(UTC, time_s))
    return there.position_m.copy(), there.velocity_m_s.copy()


def test_exact_solutions_give_the_exact_orbit_at_any_epoch():
    made = fit_own_state(TIME_S, *measured(), ERRORS, start_utc=UTC)
    assert made.orbit.epoch_s == 0.0 and made.orbit.forces == Forces()
    assert np.allclose(made.orbit.vector, STATE, rtol=0, atol=1e-5)
    later = fit_own_state(TIME_S, *measured(), ERRORS, start_utc=UTC, epoch_s=250.0)
    assert np.allclose(later.orbit.move_epoch(0.0).vector, STATE, rtol=0, atol=1e-5)
    # Transitions without J2: a thousandth of a covariance.
    moved = made.orbit.move_epoch(250.0).covariance
    assert np.allclose(np.diag(moved), np.diag(later.orbit.covariance), rtol=1e-2)


def test_outliers_and_gaps_do_not_matter():
    position, velocity = measured()
    position[[4, 20]] += [5e3, -40.0, 0.0]
    velocity[9] += 1.0
    position[12] = np.nan
    made = fit_own_state(TIME_S, position, velocity, ERRORS, start_utc=UTC)
    assert (made.statistics.n_used, made.statistics.n_rejected) == (26, 3)
    assert made.statistics.time_s[~made.statistics.used].tolist() == [40.0, 90.0, 200.0]
    assert np.allclose(made.orbit.vector, STATE, rtol=0, atol=1e-4)
    text = made.describe()
    assert "26 of 29 solutions of GNSS, 3 outliers; forces: J2" in text and "sigma [m]" in text


def test_slow_errors_do_not_average_out():
    position, velocity = measured()
    white, slow = (
        fit_own_state(TIME_S, position, velocity, errors, start_utc=UTC).orbit.covariance
        for errors in (GnssErrors(2.0, 0.02), GnssErrors(2.0, 0.02, 2.0, 0.02, 1e4))
    )
    assert (np.diag(slow) > 2.0 * np.diag(white)).all()
    assert np.sqrt(slow[2, 2]) > 1.5  # about the slow error itself, 2 m


def test_a_receiver_without_stated_errors_and_many_solutions():
    time_s = np.linspace(0.0, 200.0, MOST_SOLUTIONS + 20)
    made = fit_own_state(time_s, *measured(time_s), GnssErrors(0.0, 0.0), start_utc=UTC)
    assert len(made.statistics.used) == MOST_SOLUTIONS
    assert "1,000 of 1,000 solutions of GNSS, selected evenly of 1,020, 0 outliers" in made.describe()
    assert np.allclose(made.orbit.vector, STATE, rtol=0, atol=1e-5)


def test_what_cannot_be_fitted_is_refused():
    position, velocity = measured()
    with pytest.raises(ScenarioError, match="30 instants need positions and velocities"):
        fit_own_state(TIME_S, position[:4], velocity, ERRORS, start_utc=UTC)
    with pytest.raises(ScenarioError, match="needs 3 or more valid solutions of GNSS, not 2"):
        fit_own_state(TIME_S[:2], position[:2], velocity[:2], ERRORS, start_utc=UTC)
    with pytest.raises(ScenarioError, match=r"own orbit: only . of 30 measurements agree"):
        fit_own_state(TIME_S, position * (1.0 + TIME_S[:, None] / 1e6), velocity, ERRORS, start_utc=UTC)
    with pytest.raises(ScenarioError, match="own orbit: no orbit fits; check"):
        fit_own_state(TIME_S, position * (1.0 + TIME_S[:, None] / units.DAY_S), velocity, ERRORS, start_utc=UTC)


def test_forces_in_words():
    assert describe_forces(None) == describe_forces(Forces(zonal_degree=0)) == "forces: two-body motion"
    assert describe_forces(Forces(zonal_degree=4, sun=True)) == "forces: J2 to J4, sun"
