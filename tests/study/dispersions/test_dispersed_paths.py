"""Dispersions against closed forms, an independent integrator, and each other."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rso_lidar.orbit import Epochs, Forces, Kepler
from rso_lidar.rpo import DeviationFlow, NavigationErrors, PlannedImpulse, Thrusters
from rso_lidar.study.dispersions.dispersed_flight import DispersedFlight
from rso_lidar.study.dispersions.dispersed_paths import Disperser
from rso_lidar.study.dispersions.nominal_flight import GuidanceInstant, NominalFlight
from rso_lidar.units import EARTH_GM_M3_S2

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CHIEF = Kepler(
    epoch_utc=START, semi_major_axis_km=6878.137, eccentricity=0.0, inclination_deg=51.6, raan_deg=40.0,
    argument_of_perigee_deg=0.0, true_anomaly_deg=30.0,
)  # fmt: skip
N = math.sqrt(EARTH_GM_M3_S2 / 6878137.0**3)
POINT = Forces(zonal_degree=0)


def axes_of(time_s):
    state = CHIEF.states(Epochs(START, time_s))
    momentum = np.cross(state.position_m, state.velocity_m_s)
    radial = state.position_m / np.linalg.norm(state.position_m, axis=1)[:, None]
    cross = momentum / np.linalg.norm(momentum, axis=1)[:, None]
    turn = np.zeros((len(time_s), 3))
    turn[:, 2] = np.linalg.norm(momentum, axis=1) / np.sum(state.position_m**2, axis=1)
    return np.stack([radial, np.cross(cross, radial), cross], axis=2), turn


def flight(**more):
    """Return a flight on the orbit of the body approached, where Clohessy-Wiltshire's equations hold for small errors."""
    craft = lambda time_s: CHIEF.states(Epochs(START, time_s)).position_m  # noqa: E731
    return NominalFlight(START, craft, axes_of, **({"forces": POINT} | more))


def covariance(**sigmas):
    return np.diag([sigmas.get(name, 0.0) ** 2 for name in ("r", "t", "n", "vr", "vt", "vn")])


def test_an_error_of_velocity_along_the_track_grows_as_clohessy_and_wiltshire_say():
    """After whole revolutions an along-track error v has grown to -3 v t along the track (Vallado 4th ed. eq. 6-65)."""
    period_s = 2.0 * math.pi / N
    sample_s = np.array([0.0, period_s, 2.0 * period_s])
    made = Disperser(DispersedFlight(flight(), sample_s, covariance(vt=1e-3))).find_linear().covariance
    np.testing.assert_allclose(np.sqrt(made[:, 1, 1]), 3.0 * 1e-3 * sample_s, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.sqrt(made[:, 0, 0]), 0.0, atol=2e-6)
    half = (
        Disperser(DispersedFlight(flight(), np.array([0.5 * period_s]), covariance(vt=1e-3)))
        .find_linear()
        .covariance[0]
    )
    assert math.sqrt(half[0, 0]) == pytest.approx(4.0 * 1e-3 / N, rel=1e-6)  # 2 (1 - cos nt) v / n


def test_runs_and_linear_covariance_agree_where_errors_are_small():
    """2000 runs: the variance has a relative standard error of sqrt(2 / 2000) = 3.2 %; 5 of them for 27 numbers."""
    sample_s = np.linspace(0.0, 7200.0, 9)
    sigmas = covariance(r=2.0, t=5.0, n=3.0, vr=0.004, vt=0.002, vn=0.003)
    burns = tuple(PlannedImpulse(at_s, np.array(v)) for at_s, v in ((0.0, (0.1, 0.5, 0.0)), (4000.0, (-0.3, 0.1, 0.2))))
    more = {
        "burns": burns,
        "updates": (GuidanceInstant(1500.0, 2900.0), GuidanceInstant(5000.0, 6000.0)),
        "thrusters": Thrusters(
            magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0, magnitude_sigma_m_s=0.002, pointing_sigma_m_s=0.001
        ),
        "navigation": NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.001),
        "held_s": ((6000.0, 7000.0),),
        "control_m_s2": lambda time_s: np.outer((time_s >= 6000.0) & (time_s < 7000.0), [2e-4, -1e-4, 3e-4]),
    }
    disperser = Disperser(DispersedFlight(flight(forces=Forces(), **more), sample_s, sigmas))
    linear = disperser.find_linear()
    numbers = np.random.default_rng(3).standard_normal((2000, disperser.n_numbers))
    paths = disperser.fly(numbers)
    found = np.array([np.cov(paths.deviation_m[:, k].T) for k in range(9)])
    spread = np.diagonal(found, axis1=1, axis2=2) / np.diagonal(linear.covariance[:, :3, :3], axis1=1, axis2=2)
    assert np.abs(spread - 1.0).max() < 5.0 * math.sqrt(2.0 / 2000.0)
    total = sum(linear.shares.values())
    variance_m2 = np.diagonal(linear.covariance[:, :3, :3], axis1=1, axis2=2)
    np.testing.assert_allclose(total, variance_m2, rtol=1e-9, atol=1e-18)  # a nanometre; less is rounding alone
    last = {name: share[-1] for name, share in linear.shares.items()}
    np.testing.assert_allclose(last.pop("start"), 0.0, atol=1e-18)  # the corrections have taken it away
    assert len(last) == 2 and all((share > 0.1).all() for share in last.values())


def test_deviations_of_kilometres_follow_an_independent_integrator():
    """DOP853 with tolerances of 1e-12, and Kepler's orbits of both bodies, where the force is that of a point."""
    reference = lambda time_s: CHIEF.states(Epochs(START, time_s)).position_m  # noqa: E731
    flow = DeviationFlow(np.array([0.0, 5000.0, 11000.0]), reference, POINT, START)
    begin = np.array([[3000.0, -200.0], [-8000.0, 50.0], [500.0, 100.0], [2.0, 0.1], [-3.0, 0.0], [1.0, 0.2]])
    made = flow.advance(1, flow.advance(0, begin))
    chief = CHIEF.states(Epochs(START, np.array([0.0, 11000.0])))
    for k in range(2):
        start = np.concatenate([chief.position_m[0], chief.velocity_m_s[0]]) + begin[:, k]
        pull = lambda _, y: np.concatenate([y[3:], -EARTH_GM_M3_S2 * y[:3] / np.linalg.norm(y[:3]) ** 3])  # noqa: E731
        end = solve_ivp(pull, (0.0, 11000.0), start, method="DOP853", rtol=1e-12, atol=1e-6).y[:, -1]
        np.testing.assert_allclose(made[:3, k], end[:3] - chief.position_m[1], atol=0.01)


def test_corrections_bring_the_path_back_but_for_navigation():
    sample_s = np.array([3000.0])
    sigmas = covariance(r=20.0, t=50.0, n=30.0, vr=0.04, vt=0.02, vn=0.03)
    blind = Disperser(DispersedFlight(flight(), sample_s, sigmas)).find_linear().covariance[0]
    exact = (
        Disperser(DispersedFlight(flight(updates=(GuidanceInstant(1000.0, 3000.0),)), sample_s, sigmas))
        .find_linear()
        .covariance[0]
    )
    assert np.sqrt(np.trace(blind[:3, :3])) > 100.0
    assert np.sqrt(np.trace(exact)) < 1e-3  # position and, by the arrival, velocity
    noise = NavigationErrors(position_sigma_m=1.0, velocity_sigma_m_s=1e-3)
    left = Disperser(
        DispersedFlight(flight(updates=(GuidanceInstant(1000.0, 3000.0),), navigation=noise), sample_s, sigmas)
    ).find_linear()
    assert left.shares["navigation"][0].sum() == pytest.approx(np.trace(left.covariance[0, :3, :3]), rel=1e-6)


def test_without_burns_the_craft_goes_where_it_would_drift():
    """A flight with one burn at rest: without it, the craft stays on the body's orbit."""
    burn = PlannedImpulse(100.0, np.array([0.0, 0.5, 0.0]))
    later = np.array([100.0, 3000.0])

    def craft(time_s):
        state = CHIEF.states(Epochs(START, np.array([100.0])))
        axes = axes_of(np.array([100.0]))[0][0]
        moved = np.concatenate([state.position_m[0], state.velocity_m_s[0] + axes @ burn.delta_v_m_s])
        pull = lambda _, y: np.concatenate([y[3:], -EARTH_GM_M3_S2 * y[:3] / np.linalg.norm(y[:3]) ** 3])  # noqa: E731
        after = solve_ivp(pull, (100.0, 3001.0), moved, method="DOP853", rtol=1e-12, atol=1e-6, dense_output=True).sol
        before = CHIEF.states(Epochs(START, time_s)).position_m
        return np.where((time_s < 100.0)[:, None], before, after(np.maximum(time_s, 100.0))[:3].T)

    disperser = Disperser(
        DispersedFlight(NominalFlight(START, craft, axes_of, POINT, burns=(burn,)), later, covariance())
    )
    drifting = disperser.fly(np.zeros((1, disperser.n_numbers)), without_burns=True).deviation_m[0]
    nominal = craft(later) - CHIEF.states(Epochs(START, later)).position_m
    axes, _ = axes_of(later)
    np.testing.assert_allclose(drifting, -np.einsum("tji,tj->ti", axes, nominal), atol=0.01)
    assert np.linalg.norm(drifting[1]) > 1000.0


def test_a_run_has_the_same_bits_alone_and_among_others():
    disperser = Disperser(DispersedFlight(
        flight(updates=(GuidanceInstant(1000.0, 2000.0),), thrusters=Thrusters(magnitude_sigma_fraction=0.01)),
        np.array([500.0, 3000.0]), covariance(r=5.0, vt=0.01),
    ))  # fmt: skip
    numbers = np.random.default_rng(1).standard_normal((50, disperser.n_numbers))
    together = disperser.fly(numbers)
    alone = disperser.fly(numbers[17:18])
    assert together.deviation_m[17].tobytes() == alone.deviation_m[0].tobytes()
    assert together.delta_v_m_s[17] == alone.delta_v_m_s[0]


def test_errors_of_the_target_move_it_and_are_seen_with_the_opposite_sign():
    """The same error of both craft, as two independent ones, doubles the variance of their difference."""
    sample_s = np.linspace(0.0, 6000.0, 5)
    sigmas = covariance(r=2.0, t=5.0, n=3.0, vr=0.004, vt=0.002, vn=0.003)
    chief = lambda time_s: CHIEF.states(Epochs(START, time_s)).position_m  # noqa: E731
    alone = Disperser(DispersedFlight(flight(), sample_s, sigmas)).find_linear()
    both = Disperser(DispersedFlight(flight(chief_m=chief), sample_s, sigmas, sigmas)).find_linear()
    np.testing.assert_allclose(both.covariance, 2.0 * alone.covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(both.shares["target"], both.shares["start"], rtol=1e-9)
    only = Disperser(DispersedFlight(flight(chief_m=chief), sample_s, covariance(), sigmas))
    numbers = np.zeros((1, only.n_numbers))
    numbers[0, -6:] = [1.0, -0.5, 0.3, 0.2, 0.7, -1.0]
    opposite = np.zeros((1, 6))
    opposite[0] = -numbers[0, -6:]
    moved = Disperser(DispersedFlight(flight(), sample_s, sigmas)).fly(opposite).deviation_m
    # the second order of gravity has one sign for both: 3 GM d^2 / r^4 over 6000 s, for deviations of 60 m
    assert np.abs(only.fly(numbers).deviation_m - moved).max() < 0.1
    with_none = Disperser(DispersedFlight(flight(), sample_s, sigmas))
    assert with_none.n_numbers == 6 and with_none.sources == ("start", "burns", "navigation")


def test_errors_that_both_bodies_share_leave_their_distance_alone():
    """Both on one orbit: P_f + P_t - C - C^T, which is 0 for the same error of both, and P_rel for a relative fit."""
    sample_s = np.linspace(0.0, 6000.0, 4)
    sigmas = covariance(r=2.0, t=5.0, n=3.0, vr=0.004, vt=0.002, vn=0.003)
    relative = covariance(r=0.2, t=0.1, n=0.3, vr=1e-4, vt=2e-4, vn=3e-4)
    more = {"chief_m": lambda time_s: CHIEF.states(Epochs(START, time_s)).position_m}
    same = Disperser(DispersedFlight(flight(**more), sample_s, sigmas, sigmas, sigmas))
    alone = Disperser(DispersedFlight(flight(), sample_s, sigmas)).find_linear().covariance
    assert np.abs(same.find_linear().covariance[:, :3, :3]).max() < 1e-9 * alone[:, :3, :3].max()
    numbers = np.random.default_rng(2).standard_normal((20, same.n_numbers))
    assert np.abs(same.fly(numbers).deviation_m).max() < 1e-3
    close = Disperser(DispersedFlight(flight(**more), sample_s, sigmas + relative, sigmas, sigmas))
    expected = Disperser(DispersedFlight(flight(), sample_s, relative)).find_linear().covariance
    np.testing.assert_allclose(close.find_linear().covariance, expected, rtol=1e-5, atol=1e-7)
    half = Disperser(DispersedFlight(flight(**more), sample_s, sigmas, sigmas, 0.5 * sigmas))
    np.testing.assert_allclose(half.find_linear().covariance, alone, rtol=1e-6, atol=1e-9)  # 1 + 1 - 2 x 0.5
    drawn = half.fly(np.random.default_rng(7).standard_normal((4000, half.n_numbers))).deviation_m
    spread = drawn.std(axis=0, ddof=1)[0] / np.sqrt(np.diag(alone[0, :3, :3]))
    assert np.abs(spread - 1.0).max() < 5.0 / math.sqrt(2.0 * 4000)


@pytest.mark.slow
def test_runs_and_linear_covariance_agree_with_errors_of_the_target_in_the_closed_loop():
    """2000 runs, as above; corrections take out what navigation sees of the target's errors, too."""
    sample_s = np.linspace(0.0, 7200.0, 9)
    sigmas = covariance(r=2.0, t=5.0, n=3.0, vr=0.004, vt=0.002, vn=0.003)
    more = {
        "chief_m": lambda time_s: CHIEF.states(Epochs(START, time_s)).position_m,
        "updates": (GuidanceInstant(1500.0, 2900.0), GuidanceInstant(5000.0, 6000.0)),
        "navigation": NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.001),
        "thrusters": Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=1.0),
    }
    disperser = Disperser(DispersedFlight(flight(forces=Forces(), **more), sample_s, sigmas, 4.0 * sigmas))
    linear = disperser.find_linear()
    numbers = np.random.default_rng(5).standard_normal((2000, disperser.n_numbers))
    paths = disperser.fly(numbers)
    found = np.array([np.cov(paths.deviation_m[:, k].T) for k in range(9)])
    spread = np.diagonal(found, axis1=1, axis2=2) / np.diagonal(linear.covariance[:, :3, :3], axis1=1, axis2=2)
    assert np.abs(spread - 1.0).max() < 5.0 * math.sqrt(2.0 / 2000.0)
    total = sum(linear.shares.values())
    np.testing.assert_allclose(total, np.diagonal(linear.covariance[:, :3, :3], axis1=1, axis2=2), rtol=1e-9)
    loose = Disperser(
        DispersedFlight(flight(forces=Forces(), chief_m=more["chief_m"]), sample_s, sigmas, 4.0 * sigmas)
    ).find_linear()
    assert linear.shares["target"][-1].sum() < 0.1 * loose.shares["target"][-1].sum()
