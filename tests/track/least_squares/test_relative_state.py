"""The relative orbit: models, epochs, biases, outliers, and what is refused."""

import datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Forces
from rso_lidar.track import EstimatedOrbit, SightBias, fit_relative_state
from rso_lidar.track.least_squares.relative_prediction import RelativePrediction
from rso_lidar.track.least_squares.relative_state import find_sight_axes

UTC = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
SPEED_M_S = (units.EARTH_GM_M3_S2 / 6.93e6) ** 0.5
TIME_S = np.arange(0.0, 2000.0, 100.0)
STATE = np.array([30.0, -800.0, 50.0, 0.1, 0.2, -0.05])
SPREAD = np.tile(np.diag([0.04, 0.01, 0.01]), (len(TIME_S), 1, 1))


def own(forces=None, sigma=0.0):
    covariance = sigma**2 * np.diag(np.repeat([1.0, 1e-6], 3))
    start = np.array([6.93e6, 0.0, 0.0]), np.array([0.0, 0.6 * SPEED_M_S, 0.8 * SPEED_M_S])
    return EstimatedOrbit(UTC, 0.0, *start, covariance, forces)


def lines(motion="nonlinear", forces=None):
    return RelativePrediction(own(forces), TIME_S, motion).predict(STATE)


@pytest.mark.parametrize(
    ("motion", "forces"), [("nonlinear", None), ("nonlinear", Forces()), ("yamanaka_ankersen", None), ("hill", None)]
)
def test_exact_measurements_give_the_exact_state(motion, forces):
    fit = fit_relative_state(TIME_S, lines(motion, forces), SPREAD, own(forces), motion=motion)
    # under forces, two flights of 25 steps each, good to 1.7e-6 m and 1.8e-9 m/s; without them, rounding at 6.9e6 m
    steps = 0 if forces is None else 2 * 25
    assert np.allclose(fit.position_m, STATE[:3], rtol=0, atol=1e-6 + steps * 1.7e-6)
    assert np.allclose(fit.velocity_m_s, STATE[3:], rtol=0, atol=1e-8 + steps * 1.8e-9)
    assert fit.motion == motion and fit.statistics.n_used == len(TIME_S) and not fit.offset_m.any()
    assert fit.normalize_error(STATE[:3], STATE[3:]) < 1e-6


def test_the_state_holds_at_the_epoch_that_is_asked_for():
    fit = fit_relative_state(TIME_S, lines(), SPREAD, own(), epoch_s=700.0)
    flown = own().states(Epochs(UTC, TIME_S))
    there = flown.position_m + lines()
    axes = np.linalg.norm(there[7])
    assert fit.epoch_s == fit.own.epoch_s == 700.0
    assert fit.position_m[0] == pytest.approx((there[7] / axes) @ -lines()[7], abs=1e-6)  # radially outward
    assert np.linalg.norm(fit.position_m) == pytest.approx(np.linalg.norm(lines()[7]), abs=1e-6)


def test_an_offset_of_the_centroid_is_known_or_estimated():
    line = lines()
    axes = find_sight_axes(line, own().states(Epochs(UTC, TIME_S)))
    offset = np.array([-1.2, 0.3, 0.0])
    seen = line + np.einsum("nji,j->ni", axes, offset)
    stated = fit_relative_state(TIME_S, seen, SPREAD, own(), bias=SightBias(tuple(offset)))
    # The axes across are those of the measured line of sight, which the offset turns by 0.3 / 800.
    assert np.allclose(stated.position_m, STATE[:3], rtol=0, atol=0.3 * 0.3 / 800.0 * 5.0)
    free = fit_relative_state(TIME_S, seen, SPREAD, own(), bias=SightBias((-1.0, 0.0, 0.0), (np.inf, np.inf, 0.0)))
    assert np.allclose(free.offset_m, offset, atol=5e-3) and (free.offset_sigma_m[:2] > 0.0).all()
    assert (free.sigma[:2] > stated.sigma[:2]).all()
    assert "centroid minus origin" in free.describe()
    ignored = fit_relative_state(TIME_S, seen, SPREAD, own())
    assert np.linalg.norm(ignored.position_m - STATE[:3]) > 0.2


def test_a_misalignment_is_estimated_where_the_follower_turns():
    line = lines()
    turned = Rotation.from_rotvec(np.outer(TIME_S, [1e-3, -2e-3, 1.5e-3])).as_matrix()
    turn = np.array([1e-3, -5e-4, 2e-3])
    seen = line + np.cross(turned @ turn, line)
    fit = fit_relative_state(
        TIME_S, seen, SPREAD, own(), bias=SightBias(turn_sigma_rad=(1.0, 1.0, 1.0)), inertial_from_body=turned
    )
    assert np.allclose(fit.turn_rad, turn, atol=2e-5) and "rotation about body axes" in fit.describe()


def test_an_uncertain_own_orbit_widens_the_covariance():
    narrow, wide = (fit_relative_state(TIME_S, lines(), SPREAD, own(sigma=sigma)) for sigma in (0.0, 1e4))
    assert (np.linalg.eigvalsh(wide.covariance - narrow.covariance) > -1e-12).all()
    assert wide.sigma[0] > 1.2 * narrow.sigma[0]


def test_outliers_are_rejected():
    line = lines()
    line[[3, 11]] += [[40.0, 0.0, 5.0], [0.0, -6.0, 3.0]]
    line[5] = np.nan
    fit = fit_relative_state(TIME_S, line, SPREAD, own())
    assert fit.statistics.time_s[~fit.statistics.used].tolist() == [300.0, 1100.0]
    assert np.allclose(fit.position_m, STATE[:3], rtol=0, atol=1e-5)
    assert "17 of 19 measurements, 2 outliers" in fit.describe("tdrs") and "relative to tdrs" in fit.describe("tdrs")


def test_sight_axes_along_the_orbit_normal_are_still_axes():
    flown = own().states(Epochs(UTC, TIME_S[:1]))
    axes = find_sight_axes(np.array([[0.0, -0.8, 0.6]]) * 50.0, flown)
    assert np.allclose(axes[0] @ axes[0].T, np.eye(3))


def test_what_cannot_be_fitted_is_refused():
    line = lines()
    with pytest.raises(ScenarioError, match="20 instants need positions"):
        fit_relative_state(TIME_S, line[:3], SPREAD, own())
    with pytest.raises(ScenarioError, match="needs 3 or more measurements, not 2"):
        fit_relative_state(TIME_S[:2], line[:2], SPREAD[:2], own())
    with pytest.raises(ScenarioError, match="none of nonlinear, yamanaka_ankersen, hill"):
        fit_relative_state(TIME_S, line, SPREAD, own(), motion="kepler")
    with pytest.raises(ScenarioError, match="needs inertial_from_body"):
        fit_relative_state(TIME_S, line, SPREAD, own(), bias=SightBias(turn_sigma_rad=(1e-3, 0.0, 0.0)))
    with pytest.raises(ScenarioError, match="do not determine a state"):
        fit_relative_state(np.zeros(len(TIME_S)), np.tile(line[0], (len(TIME_S), 1)), SPREAD, own())
    with pytest.raises(ScenarioError, match="tenth of the orbit's radius"):
        fit_relative_state(TIME_S, line * 2e4, SPREAD, own())


def test_the_orbit_of_the_target_has_the_errors_of_both_with_their_correlation():
    """Fits to the same lines from displaced followers say how the target's state follows the follower's."""
    known = own(sigma=100.0)
    fit = fit_relative_state(TIME_S, lines(), SPREAD, known)
    target = fit.find_target_orbit()
    assert np.allclose(target.position_m - known.position_m, lines()[0], rtol=0, atol=1e-5)
    columns = []
    for k, step in enumerate(np.repeat([20.0, 0.02], 3)):
        place = np.zeros(6)
        place[k] = step
        ends = []
        for vector in (known.vector + place, known.vector - place):
            moved = EstimatedOrbit(UTC, 0.0, vector[:3], vector[3:], known.covariance, None)
            ends.append(fit_relative_state(TIME_S, lines(), SPREAD, moved, epoch_s=0.0).find_target_orbit().vector)
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    follows = np.stack(columns, axis=-1)
    exact = fit_relative_state(TIME_S, lines(), SPREAD, own()).find_target_orbit().covariance  # the follower is known
    expected = follows @ known.covariance @ follows.T + exact
    scale = np.sqrt(np.diag(expected))
    # derivatives are those of linear motion: 800 m of 6.9e6 m changes them by 1e-4
    assert np.allclose(target.covariance / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=0, atol=2e-4)
    assert scale[0] == pytest.approx(100.0, rel=1e-3)  # an error of both that is the same
