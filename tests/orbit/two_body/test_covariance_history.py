"""Covariances between epochs against propagated truth, and state matrices against neighbours in turning axes."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import (
    CovarianceHistory,
    Epochs,
    Forces,
    Numerical,
    State,
    gcrs_state_matrix,
    integrate_orbit,
    invert_state_matrix,
    orbit_state_matrix,
)
from rso_lidar.orbit.two_body.orbit_axes import orbit_axes_matrix
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative.reference_orbit import find_relative_state

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LOW = State(epoch_utc=START, position_m=(6.9e6, 0.3e6, 0.2e6), velocity_m_s=(-400.0, 1200.0, 7450.0))
RTN = np.diag(np.square([10.0, 100.0, 8.0, 0.1, 0.01, 0.008]))


def find_true(orbit, times_s):
    """Propagate a covariance in rtn axes under the oblate Earth, by differences of integrated orbits."""
    start = np.array([*LOW.position_m, *LOW.velocity_m_s])
    columns = []
    for k, step in enumerate([10.0] * 3 + [0.01] * 3):
        shift = np.zeros(6)
        shift[k] = step
        ahead, behind = (
            integrate_orbit(*np.split(start + sign * shift, 2), START, Forces(), ())(times_s) for sign in (1.0, -1.0)
        )
        columns.append((ahead - behind) / (2.0 * step))
    transition = np.stack(columns, axis=-1)
    turn = orbit_state_matrix("rtn", start[:3], start[3:])
    return transition @ (turn @ RTN @ turn.T) @ np.swapaxes(transition, 1, 2)


class EndingOrbit:
    """The orbit of an ephemeris that ends with its last covariance."""

    def __init__(self, last_s):
        self.orbit, self.last_s = Numerical(initial=LOW, forces=Forces(zonal_degree=0)), last_s

    def states(self, epochs):
        bad = (epochs.since(START) < 0.0) | (epochs.since(START) > self.last_s)
        if bad.any():
            raise PropagationError("outside the ephemeris", bad)
        return self.orbit.states(epochs)


@pytest.mark.parametrize("axes", [None, "rtn"])
def test_beyond_an_ephemeris_that_ends_with_its_covariances_both_go_on(axes):
    known = Epochs(START, np.array([0.0, 600.0]))
    ending = EndingOrbit(600.0)
    endless = ending.orbit
    pair = [
        CovarianceHistory.from_axes("craft", orbit, known, np.stack([RTN, 2.0 * RTN])) for orbit in (ending, endless)
    ]
    later = Epochs(START, np.array([-300.0, 300.0, 600.0, 900.0, 2000.0]))
    found, expected = (history.at(later, axes=axes, beyond="two_body") for history in pair)
    scale = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))
    assert np.abs((found - expected) / (scale[:, :, None] * scale[:, None, :])).max() < 1e-6
    with pytest.raises(PropagationError, match="it spans"):
        pair[0].at(later, axes=axes)


def test_between_epochs_the_covariance_is_that_of_the_perturbed_orbit():
    orbit = Numerical(initial=LOW)
    known_s, between_s = np.arange(0.0, 7201.0, 1800.0), np.arange(900.0, 7200.0, 1800.0)
    true = find_true(orbit, np.sort(np.concatenate([known_s, between_s])))
    history = CovarianceHistory("craft", "truth", orbit, Epochs(START, known_s), true[::2])
    found = history.at(Epochs(START, between_s))
    states = orbit.states(Epochs(START, between_s))
    back = invert_state_matrix(orbit_state_matrix("rtn", states.position_m, states.velocity_m_s))
    sigma, expected = (
        np.sqrt(np.diagonal(back @ matrix @ np.swapaxes(back, 1, 2), axis1=1, axis2=2))
        for matrix in (found, true[1::2])
    )
    assert np.abs(sigma / expected - 1.0).max() < 0.01  # J2 is 1e-3 of gravity, over a third of a revolution
    np.testing.assert_allclose(history.at(Epochs(START, known_s)), true[::2], rtol=1e-12)


def test_beyond_its_epochs_a_covariance_is_an_error_or_propagated():
    turn = orbit_state_matrix("rtn", np.array(LOW.position_m), np.array(LOW.velocity_m_s))
    given = turn @ RTN @ turn.T
    history = CovarianceHistory("craft", "file", LOW, Epochs(START, np.zeros(1)), given[None])
    with pytest.raises(PropagationError, match=r"does not cover 1 of 2 instants, first 2024-09-17T12:10:00\.000Z"):
        history.at(Epochs(START, np.array([0.0, 600.0])))
    forward = history.at(Epochs(START, np.array([600.0])), beyond="two_body")
    there = CovarianceHistory("craft", "file", LOW, Epochs(START, np.array([600.0])), forward)
    again = there.at(START, beyond="two_body")[0]
    scale = np.sqrt(np.outer(np.diag(given), np.diag(given)))
    assert np.abs((again - given) / scale).max() < 1e-5
    bare = given.copy()
    bare[3:] = bare[:, 3:] = 0.0
    place = CovarianceHistory("craft", "file", LOW, Epochs(START, np.zeros(1)), bare[None], has_velocity=False)
    with pytest.raises(PropagationError, match="has no terms of velocity"):
        place.at(Epochs(START, np.array([600.0])), beyond="two_body")


@pytest.mark.parametrize(
    ("matrix", "problem"),
    [
        (-np.eye(6), "not positive semidefinite: a variance is below 0"),
        (np.ones((6, 6)) + np.diag([0.0] * 5 + [-0.5]), "not positive semidefinite"),
        (np.full((6, 6), np.nan), "finite numbers"),
        (np.eye(3), "shape"),
    ],
)
def test_what_is_no_covariance_is_refused(matrix, problem):
    with pytest.raises(ScenarioError, match=problem):
        CovarianceHistory("craft", "file", LOW, Epochs(START, np.zeros(1)), matrix[None])


def test_an_orbit_without_a_plane_has_no_covariance_along_it():
    class Falling:
        def states(self, epochs):
            return BodyState(np.tile([7e6, 0.0, 0.0], (len(epochs), 1)), np.zeros((len(epochs), 3)))

    start = Epochs(START, np.zeros(1))
    history = CovarianceHistory("craft", "file", Falling(), start, RTN[None])
    for ask in (
        lambda: history.at(START, axes="rtn"),
        lambda: history.at(Epochs(START, np.array([9.0])), beyond="two_body"),
        lambda: CovarianceHistory.from_axes("craft", Falling(), start, RTN[None], source="file"),
    ):
        with pytest.raises(ScenarioError, match=r"^file: a velocity of the orbit has no part across its position"):
            ask()


@pytest.mark.parametrize("rotating", [False, True])
def test_covariances_along_the_orbit_are_given_back_along_it(rotating):
    epochs = Epochs(START, np.array([0.0, 900.0]))
    history = CovarianceHistory.from_axes("craft", LOW, epochs, np.array([RTN, 4.0 * RTN]), rotating=rotating)
    np.testing.assert_allclose(history.at(epochs, axes="rtn", rotating=rotating)[1], 4.0 * RTN, rtol=1e-9, atol=1e-9)
    if not rotating:  # else the sigma of an inertial velocity has omega x r, too
        np.testing.assert_allclose(history.sigma[0], [10.0, 100.0, 8.0, 0.1, 0.01, 0.008], rtol=1e-9)
    with pytest.raises(ScenarioError, match="craft: covariances need shape"):
        CovarianceHistory.from_axes("craft", LOW, epochs, RTN[None])


@pytest.mark.parametrize(("axes", "problem"), [("lvlh", "means two things"), ("gcrs", "'gcrs' are unknown")])
def test_axes_that_are_no_axes_of_an_orbit_are_refused(axes, problem):
    history = CovarianceHistory("craft", "file", LOW, Epochs(START, np.zeros(1)), RTN[None])
    with pytest.raises(ScenarioError, match=problem):
        history.at(START, axes=axes)
    with pytest.raises(ScenarioError, match=problem):
        CovarianceHistory.from_axes("craft", LOW, history.epochs, RTN[None], axes)


@pytest.mark.parametrize("axes", ["rtn", "tnw", "ntw", "vnc", "lvlh_ccsds"])
def test_rotating_axes_turn_as_they_do_from_instant_to_instant(axes):
    step_s = 0.5
    epochs = Epochs(START, np.array([-step_s, 0.0, step_s]))
    states = LOW.states(epochs)
    turn = orbit_axes_matrix(axes, states.position_m, states.velocity_m_s)
    neighbour = np.array([30.0, -200.0, 50.0, 0.2, -0.1, 0.3])  # inertial, relative to the orbit
    moved = neighbour[:3] + np.outer(epochs.time_s, neighbour[3:])
    place = np.einsum("nji,nj->ni", turn, moved)
    rate = (place[2] - place[0]) / (2.0 * step_s)
    back = invert_state_matrix(gcrs_state_matrix(axes, epochs, states, rotating=True))[1]
    np.testing.assert_allclose(back @ neighbour, [*place[1], *rate], rtol=1e-5, atol=1e-6)
    along = invert_state_matrix(gcrs_state_matrix(axes, epochs, states))[1]
    np.testing.assert_allclose(
        along @ neighbour, np.concatenate([turn[1].T @ neighbour[:3], turn[1].T @ neighbour[3:]])
    )


def test_a_state_in_rtn_axes_is_that_of_relative_motion():
    chief = LOW.states(Epochs(START, np.zeros(1)))
    off = np.array([30.0, -200.0, 50.0, 0.2, -0.1, 0.3])
    relative = find_relative_state(chief, BodyState(chief.position_m + off[:3], chief.velocity_m_s + off[3:]))
    back = invert_state_matrix(orbit_state_matrix("rtn", chief.position_m, chief.velocity_m_s, rotating=True))
    np.testing.assert_allclose(back[0] @ off, np.concatenate(relative, axis=1)[0], rtol=1e-7)
