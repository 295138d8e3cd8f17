"""Light time against closed forms, and against two legs solved on the orbits themselves."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.orbit import Epochs
from rso_lidar.pose import length
from rso_lidar.units import SPEED_OF_LIGHT_M_S as C
from tests.physics.light_time_bench import AHEAD_M, START, at_emission, bench, place, with_lidar

UM = 1e-6


@pytest.mark.parametrize("speed_m_s", [-15_000.0, -10_000.0, 10_000.0])
def test_range_of_a_target_head_on(speed_m_s, validation):
    """Light meets at c what comes at v, R / (1 - v / c) away, and returns over the same path."""
    scenario = bench((AHEAD_M, 0, 0), (speed_m_s, 0, 0))
    frame = next(rl.simulate(scenario, keep=("hits",)))
    hits = frame.kept["hits"]
    face_m = scenario.surfaces[0].corners[..., 0].min()  # of the plate, which is 8 cm thick about its origin
    validation(
        case=f"range of a plate at 50 km, range rate {speed_m_s / 1e3:g} km/s",
        source="R / (1 - v / c)",
        expected=AHEAD_M / (1.0 - speed_m_s / C),
        got=float(np.max(hits.range_m * hits.rays.direction[hits.ray, 2])) - face_m,
        tolerance=UM,
        unit="m",
    )
    assert np.nanmax(frame.labels.range_m) == pytest.approx(AHEAD_M * (1.0 + speed_m_s / C), abs=0.1)
    assert frame.truth.pose("lidar", "plate").translation[2] == AHEAD_M  # the truth is that of the emission


def test_range_of_two_that_approach_each_other(validation):
    """With the lidar at V and the target at -V: c² R / (c + V)², half of both paths."""
    scenario = bench((AHEAD_M, 0, 0), (-7_500.0, 0, 0), lidar_m_s=(7_500.0, 0, 0))
    seen, _ = place(scenario)
    validation(
        case="range of two that approach each other at 15 km/s",
        source="R / (1 + V / c)²",
        expected=AHEAD_M / (1.0 + 7_500.0 / C) ** 2,
        got=float(seen[2]),
        tolerance=UM,
        unit="m",
    )


def test_range_of_a_lidar_and_a_target_that_coast_together():
    """Only the second order in V / c is left: across the path, both paths are longer by 1 + V² / 2c²."""
    seen, _ = place(bench((AHEAD_M, 0, 0), (0, 7_500.0, 0), lidar_m_s=(0, 7_500.0, 0)))
    np.testing.assert_allclose(seen, [0, 0, AHEAD_M / math.sqrt(1 - (7_500.0 / C) ** 2)], rtol=0, atol=0.1 * UM)


@pytest.mark.parametrize("inclination_deg", [0.0, 60.0, 180.0])
def test_range_is_that_of_two_legs_solved_on_the_orbits(inclination_deg, validation):
    """Constant velocity over the flight is within 1 um of two-body motion at 50 km, up to 15 km/s.

    The legs start at the root of |P(t + τ) - L(t)| = c τ, by Brent's method on the propagated orbits.
    """
    near = orbit(0.0, 0.0)
    far = orbit(inclination_deg, math.degrees(AHEAD_M / 6_878_137.0))
    bodies = [
        rl.Follower(name="follower", motion=near, attitude={"type": "rtn"}),
        rl.Target(name="plate", model="plate", motion=far),
    ]
    begin_s = 0.0
    truth = motion.truth(bodies, Epochs(START, np.array([begin_s])))
    truth = with_lidar(truth.at(0))
    seen = motion.apply_light_time(truth, ["plate"]).poses.place("lidar", "plate")[0]

    def where(part, time_s):
        return part.states(Epochs(START, np.array([time_s]))).position_m[0]

    def leg(mover, time_s, from_m):
        rest_m = length(where(mover, time_s) - from_m)
        return brentq(
            lambda tau: float(length(where(mover, time_s + tau) - from_m)) - C * tau, 0.0, 2.0 * rest_m / C, xtol=1e-18
        )

    out_s = leg(far, begin_s, where(near, begin_s))
    back_s = leg(near, begin_s + out_s, where(far, begin_s + out_s))
    validation(
        case=f"range at 50 km on orbits inclined by {inclination_deg:g} deg to each other",
        source="both legs solved on the two-body orbits",
        expected=0.5 * C * (out_s + back_s),
        got=float(length(seen)),
        tolerance=UM,
        unit="m",
    )


def orbit(inclination_deg, anomaly_deg):
    """Return a circular orbit 500 km high."""
    return rl.orbit.Kepler(
        epoch_utc=START,
        semi_major_axis_km=6878.137,
        eccentricity=0.0,
        inclination_deg=inclination_deg,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=anomaly_deg,
    )


@pytest.mark.parametrize("speed_m_s", [7_500.0, 15_000.0])
def test_line_of_sight_to_a_crossing_target(speed_m_s, validation):
    """Light meets at τ = R / √(c² - v²) what crosses at v: tan(angle) = v / √(c² - v²)."""
    seen, _ = place(bench((AHEAD_M, 0, 0), (0, speed_m_s, 0)))
    validation(
        case=f"line of sight to what crosses at {speed_m_s / 1e3:g} km/s",
        source="atan(v / √(c² - v²))",
        expected=math.atan(speed_m_s / math.sqrt(C**2 - speed_m_s**2)),
        got=math.atan2(-seen[0], seen[2]),  # +y of the root axes is to the left
        tolerance=1e-14,
        unit="rad",
    )
    assert length(seen) == pytest.approx(C * AHEAD_M / math.sqrt(C**2 - speed_m_s**2), abs=UM)


def test_line_of_sight_of_a_lidar_that_turns_while_light_is_under_way():
    """The image is taken as light returns, 2 R / c after it left."""
    rate_deg_s = 3.0
    scenario = bench((AHEAD_M, 0, 0), (0, 0, 0), turning={"type": "spin", "axis": [0, 0, 1], "rate_deg_s": rate_deg_s})
    seen, turn = place(scenario)
    turned = math.radians(rate_deg_s) * 2.0 * AHEAD_M / C
    assert math.atan2(seen[0], seen[2]) == pytest.approx(turned, rel=1e-9)  # the lidar turns left, the plate goes right
    relative = turn.T @ at_emission(scenario).poses.place("lidar", "plate")[1]
    assert math.acos(min((np.trace(relative) - 1.0) / 2.0, 1.0)) == pytest.approx(turned, rel=1e-4)


def test_a_target_is_turned_by_the_time_of_one_leg():
    rate_deg_s = 30.0
    scenario = bench((AHEAD_M, 0, 0), (0, 0, 0), attitude={"type": "spin", "axis": [0, 0, 1], "rate_deg_s": rate_deg_s})
    _, turn = place(scenario)
    relative = at_emission(scenario).poses.place("lidar", "plate")[1].T @ turn
    angle = math.radians(rate_deg_s) * AHEAD_M / C
    np.testing.assert_allclose(
        relative, [[1, -angle, 0], [angle, 1, 0], [0, 0, 1]], rtol=0, atol=1e-8
    )  # the square of the angle, 9e-5 rad
