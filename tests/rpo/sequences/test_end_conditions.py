"""Conditions that end legs, each against a closed form or an evaluation of its own."""

import math

import numpy as np
import pytest

from rso_lidar import rpo
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Forces, Numerical, find_eclipses, sun_position_m
from tests.rpo.sequences.test_sequence import REVOLUTION, START, STATION, N, plan

PERTURBED = Numerical(initial=STATION, forces=Forces(zonal_degree=6))
ELLIPSE = {"type": "circumnavigation", "radial_m": 100.0}


def length_s(leg, **until):
    part = plan(leg | {"until": until}).parts[0]
    assert part.ended_by == until["type"]
    return part.end_s - part.arrival_s


@pytest.mark.parametrize(
    ("phase", "angle", "turned"), [(0, 270, 90), (0, 180, 180), (0, 0, 360), (90, 90, 180), (90, 270, 360)]
)
def test_an_angle_of_the_ellipse_is_passed_at_its_phase(phase, angle, turned):
    """Round the 2:1 ellipse the craft goes backward: above (0), behind (270), below (180), ahead (90)."""
    found = length_s(ELLIPSE | {"phase_deg": float(phase)}, type="angle", angle_deg=float(angle))
    assert found == pytest.approx(turned / 360.0 * REVOLUTION, abs=1e-6)


def test_an_angle_between_the_axes_is_the_arc_tangent():
    """tan(angle) = y / x = -2 tan(phase)."""
    found = length_s(ELLIPSE, type="angle", angle_deg=-30.0)
    assert found == pytest.approx(math.atan(0.5 * math.tan(math.radians(30.0))) / N, abs=1e-6)
    crossing = length_s(ELLIPSE | {"cross_track_m": 80.0}, type="angle", angle_deg=45.0, plane="radial_cross")
    assert crossing == pytest.approx(math.atan(100.0 / 80.0) / N, abs=1e-6)  # z = 80 sin, x = 100 cos


def test_a_range_of_the_ellipse_and_of_drift():
    """r^2 = b^2 (1 + 3 sin^2 u)."""
    found = length_s(ELLIPSE, type="range", at_least_m=150.0)
    assert found == pytest.approx(math.asin(math.sqrt((1.5**2 - 1.0) / 3.0)) / N, abs=1e-6)
    below = {"type": "co_elliptic", "radial_m": -300.0, "from_m": -5000.0}
    assert length_s(below, type="range", at_most_m=500.0) == pytest.approx(4600.0 / (1.5 * N * 300.0), abs=1e-4)


def test_a_range_that_is_only_touched_is_found():
    found = length_s(ELLIPSE | {"phase_deg": 45.0}, type="range", at_least_m=200.0 - 1e-7)
    assert found == pytest.approx(REVOLUTION / 8.0, abs=0.1)


def test_times_of_the_leg_and_of_the_sequence():
    hold = {"type": "station_keeping"}
    first = hold | {"position_m": (0.0, -50.0, 0.0), "until": {"type": "time", "duration_s": 2.0 * REVOLUTION}}
    parts = plan(first, hold | {"until": {"type": "time", "at_s": 5.0 * REVOLUTION}}).parts
    assert [part.end_s for part in parts] == pytest.approx([2.0 * REVOLUTION, 5.0 * REVOLUTION])


def test_what_holds_already_ends_a_leg_at_once():
    parts = plan(
        {"type": "station_keeping", "position_m": (0.0, -50.0, 0.0), "until": {"type": "range", "at_most_m": 60.0}},
        {"type": "hop", "to_m": (0.0, -30.0, 0.0), "duration_s": 900.0},
    ).parts
    assert parts[0].end_s == 0.0
    assert parts[1].end_s == 900.0


def test_the_suns_angle_is_that_of_an_integrated_orbit():
    """The chief flown by J2 to J6, its axes and the Sun evaluated apart: the angle at the end is what was asked for."""
    hold = {"type": "station_keeping", "position_m": (0.0, -100.0, 0.0)}
    asked = [{"at_most_deg": 60.0}, {"at_least_deg": 140.0}] * 4
    legs = [hold | {"until": {"type": "sun_angle", **bound}} for bound in asked]
    parts = rpo.Sequence(relative_to="station", legs=legs).plan(START, PERTURBED).parts
    for part, bound in zip(parts[1:], asked[1:], strict=True):
        assert part.end_s > part.begin_s
        at = Epochs(START, np.array([part.end_s]))
        states = PERTURBED.states(at)
        r, v = states.position_m[0], states.velocity_m_s[0]
        along = np.cross(np.cross(r, v), r)
        toward = sun_position_m(at)[0] - r
        cosine = np.dot(along, toward) / np.linalg.norm(along) / np.linalg.norm(toward)  # the body is ahead
        assert math.degrees(math.acos(cosine)) == pytest.approx(*bound.values(), abs=0.05)


@pytest.mark.parametrize("lit", [True, False])
def test_light_and_shadow_come_with_the_eclipse(lit):
    """The eclipses are searched for apart, about an orbit that is integrated with J2 to J6."""
    hold = {"type": "station_keeping", "position_m": (0.0, -100.0, 0.0), "until": {"type": "time", "duration_s": 900.0}}
    until = {"type": "sunlight", "lit": not lit}
    legs = [
        hold,
        {"type": "station_keeping", "until": until},
        {"type": "station_keeping", "until": until | {"lit": lit}},
    ]
    parts = rpo.Sequence(relative_to="station", legs=legs).plan(START, PERTURBED).parts
    eclipses = find_eclipses(PERTURBED, Epochs(START, np.array([0.0, 4.0 * REVOLUTION])))
    edges = [one.penumbra_to_s for one in eclipses] if lit else [one.umbra_from_s for one in eclipses]
    assert min(abs(edge - parts[2].end_s) for edge in edges) < 0.1


def test_passive_safety_is_that_of_the_plan():
    """The approach ends where the drift after it would come to within 40 m; the plan's own search says the same."""
    line = {"type": "v_bar_approach", "from_m": -400.0, "to_m": -20.0, "speed_m_s": 0.1}
    whole = plan(line | {"until": {"type": "passive_safety", "at_most_m": 150.0, "horizon_s": 3000.0}})
    assert 0.0 < whole.parts[0].end_s < 3800.0
    assert whole.passive_safety_m(3000.0) == pytest.approx(150.0, abs=0.05)
    longer = plan(line | {"until": {"type": "range", "at_most_m": 30.0}})
    assert longer.passive_safety_m(3000.0) < 150.0


def test_a_hop_is_left_once_drift_is_safe():
    hop = {"type": "hop", "from_m": (0.0, -60.0, 0.0), "to_m": (0.0, -500.0, 0.0), "duration_s": 2000.0}
    until = {"type": "passive_safety", "at_least_m": 59.0, "horizon_s": REVOLUTION}
    assert plan(hop | {"until": until}).parts[0].end_s == 0.0  # it leaves for good
    with pytest.raises(ScenarioError, match="'passive_safety' is not met"):
        plan(hop | {"until": until | {"at_least_m": 5000.0}})
