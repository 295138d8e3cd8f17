"""Quantities of a flight that do not depend on who asks, nor on what lies beyond the run."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.study.targeting.flight_quantities import TargetedFlight

ORBIT = "epoch_utc = 2026-05-01T00:00:00Z, eccentricity = 0.001, argument_of_perigee_deg = 0"
TEXT = f"""
version = 1
name = "run"
[time]
start_utc = 2026-05-01T00:00:00Z
duration_s = DURATION
frame_rate_hz = 0.01
[[target]]
name = "sat"
model = "plate"
motion = {{ type = "kepler", {ORBIT}, semi_major_axis_km = 6878, inclination_deg = 51, raan_deg = 0, true_anomaly_deg = 0 }}
[[target]]
name = "other"
model = "plate"
motion = {{ type = "kepler", {ORBIT}, semi_major_axis_km = 7878, inclination_deg = 98, raan_deg = 4, true_anomaly_deg = 90 }}
[follower]
motion = {{ type = "v_bar_approach", relative_to = "sat", from_m = -500, to_m = -50, speed_m_s = 0.5 }}
attitude = {{ type = "look_at", at = "sat" }}
[lidar]
preset = "gsfl_1064"
"""


def fly(duration_s, target="sat"):
    return TargetedFlight(rl.Scenario.loads(TEXT.replace("DURATION", f"{duration_s:g}")), target)


@pytest.mark.parametrize("duration_s", [100.0, 450.0, 900.0, 3600.0])
def test_delta_v_is_that_of_the_run(duration_s):
    """Held at 0.5 m/s along the track of a circle: |a| = 2 n v but for the eccentricity (Clohessy, Wiltshire)."""
    n_rad_s = math.sqrt(3.986004418e14 / 6878e3**3)
    impulses = 0.5 + 0.5 * (duration_s >= 900.0)
    held = 2.0 * n_rad_s * 0.5 * min(duration_s, 900.0)
    assert fly(duration_s).delta_v_m_s == pytest.approx(
        impulses + held, rel=3e-3
    )  # twice the eccentricity, and a little


def test_a_push_is_the_same_whoever_asks():
    mine, of_other = fly(900.0).pushes, fly(900.0, "other").pushes
    assert len(mine) == len(of_other) == 2
    for one, same in zip(mine, of_other, strict=True):
        assert np.allclose(one.direction, same.direction, atol=1e-12)
