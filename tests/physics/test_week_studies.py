"""The weeks of examples/studies: eclipses, drift and light against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl

STUDIES = Path(__file__).resolve().parents[2] / "examples" / "studies"
EARTH_RADIUS_M = 6_378_137.0
STEP_S = 2.0
SUN_HALF_ANGLE_RAD = math.asin(6.957e8 / 1.5027e11)  # IAU 2015 radius, and the distance on 22 September 2024


@pytest.fixture(scope="module")
def geo_week():
    return rl.Scenario.load(STUDIES / "geo_week.toml")


def offset_m(chief, other):
    """Offset in rtn axes, by their definition, (n, 3) [m]."""
    radial = chief.position_m / np.linalg.norm(chief.position_m, axis=-1, keepdims=True)
    normal = np.cross(chief.position_m, chief.velocity_m_s)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    axes = np.stack([radial, np.cross(normal, radial), normal], axis=-2)
    return np.einsum("tij,tj->ti", axes, other.position_m - chief.position_m)


def test_the_eclipse_at_the_equinox_is_that_of_two_cones(geo_week):
    """Through the middle of the shadow a satellite turns by twice the disk's radius, more or less the Sun's, at 15 deg/h."""
    client = geo_week.target[0].motion
    middle_s = 5.0 * 86_400.0 + 36_900.0
    epochs = rl.orbit.Epochs(geo_week.time.start_utc, middle_s + np.arange(-3000.0, 3000.0, STEP_S))
    position_m = client.states(epochs).position_m
    lit = rl.orbit.sunlit_fraction(position_m, rl.orbit.sun_position_m(epochs))
    disk_rad = math.asin(EARTH_RADIUS_M / np.linalg.norm(position_m, axis=1).mean())
    rad_s = 2.0 * math.pi / 86_400.0
    # beta of 0.2 deg shortens the chord by 2.5e-4 (1.1 s), eccentricity 0.0003 changes the rate by up to 6e-4 (2.6 s),
    # and the Sun's right ascension by 2.3e-4 (1.0 s); its parallax of 9e-5 rad in all is 1.2 s, and the grid misses a step
    bound_s = 1.1 + 2.6 + 1.0 + 1.2 + STEP_S
    penumbra_s, umbra_s = STEP_S * (lit < 1.0).sum(), STEP_S * (lit <= 0.0).sum()
    assert penumbra_s == pytest.approx(2.0 * (disk_rad + SUN_HALF_ANGLE_RAD) / rad_s, abs=bound_s)
    assert umbra_s == pytest.approx(2.0 * (disk_rad - SUN_HALF_ANGLE_RAD) / rad_s, abs=bound_s)


def test_the_drift_is_that_of_its_height(geo_week):
    """Three pi times the height a revolution (Fehse ch. 3); Sun and Moon change the height by some per cent in a day."""
    epochs = rl.orbit.Epochs(geo_week.time.start_utc, np.array([3.0, 4.0]) * 86_164.1)
    place_m = offset_m(geo_week.target[0].motion.states(epochs), geo_week.follower.motion.states(epochs))
    assert place_m[1, 1] - place_m[0, 1] == pytest.approx(3.0 * math.pi * 5400.0, rel=0.02)
    assert geo_week.follower.motion.delta_v_m_s == pytest.approx(2.0 * math.pi / 86_164.1 * 5400.0 / 2.0, rel=1e-3)


def test_the_phase_of_the_ellipse_decides_for_days_on_which_side_the_light_is():
    """An ellipse turns with the Sun in rtn axes, once a revolution: it stays on one side (Clohessy and Wiltshire)."""
    scenario = rl.Scenario.load(STUDIES / "leo_week.toml")
    plan = scenario.follower.motion.plan
    chief = scenario.target[0].motion
    start_utc = scenario.time.start_utc
    time_s = np.arange(0.0, 86_400.0, 60.0)
    epochs = rl.orbit.Epochs(start_utc, time_s)
    state = chief.states(epochs)
    sun_m = rl.orbit.sun_position_m(epochs) - state.position_m
    sun_m /= np.linalg.norm(sun_m, axis=1, keepdims=True)
    toward_sun = offset_m(state, type(state)(state.position_m + sun_m, state.velocity_m_s))
    for phase_deg, side in ((180.0, 1.0), (0.0, -1.0)):
        turned = plan.replace(phase_deg=phase_deg)
        place_m, _ = turned.plan(start_utc, chief).relative(time_s)
        assert (side * np.einsum("ti,ti->t", place_m, toward_sun) > 0.0).all()
