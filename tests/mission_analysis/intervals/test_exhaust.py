"""The exhaust of a plan against what the inertial states alone show: jumps of velocity, and acceleration beyond gravity."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.intervals.exhaust import IMPULSE_S
from rso_lidar.mission_analysis.passes.search_objects import BodyTrajectory
from rso_lidar.orbit import Epochs

GM_M3_S2 = 3.986004418e14
DAY_S = 86400.0
TEXT = """
version = 1
name = "exhaust"
[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 1800
frame_rate_hz = 0.1
[[target]]
name = "station"
model = "cubesat_3u"
[target.motion]
type = "kepler"
epoch_utc = 2024-09-17T12:00:00Z
semi_major_axis_km = 6978.137
eccentricity = 0
inclination_deg = 51.6
raan_deg = 20
argument_of_perigee_deg = 0
true_anomaly_deg = 40
[lidar]
preset = "long_range_1064"
[follower]
attitude = { type = "rtn" }
[follower.motion]
"""
SEQUENCE = """
type = "sequence"
relative_to = "station"
legs = [
  { type = "hop", from_m = [0, -400, 0], to_m = [0, -100, 0], duration_s = 900 },
  { type = "forced_circumnavigation", axis = [0, 1, 0], radius_m = 100, rate_deg_s = 0.04 },
]
"""
HALF_DEG = 100.0
SPAN_S = 15000.0  # of which the forced circle takes 1.5 turns, the last half beyond the duration of the plan


def make_scenario(motion=SEQUENCE):
    return rl.Scenario.loads(TEXT + motion)


def search(scenario, when, days=SPAN_S / DAY_S):
    own, station = BodyTrajectory(scenario, "follower"), BodyTrajectory(scenario, "station")
    table = rl.study.events({"station": station}, own, when, start_utc=scenario.time.start_utc, days=days)
    return [(row.from_s, row.to_s) for row in table.rows]


def off_exhaust_deg(push, line):
    cosine = -np.sum(push * line, axis=1) / (np.linalg.norm(push, axis=1) * np.linalg.norm(line, axis=1))
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def see(scenario, time_s):
    """Return position and velocity of the follower, and the line from it to the station, in inertial axes."""
    epochs = Epochs(scenario.time.start_utc, time_s)
    own = BodyTrajectory(scenario, "follower").states(epochs)
    other = BodyTrajectory(scenario, "station").states(epochs)
    return own.position_m, own.velocity_m_s, other.position_m - own.position_m


def push_beyond_gravity(scenario, time_s, step_s=2.0):
    """Return the acceleration of the follower beyond two-body gravity, from five-point differences of its velocity."""
    (two, one, minus_one, minus_two) = (see(scenario, time_s + k * step_s)[1] for k in (2.0, 1.0, -1.0, -2.0))
    acceleration = (8.0 * (one - minus_one) - (two - minus_two)) / (12.0 * step_s)
    position = see(scenario, time_s)[0]
    gravity = -GM_M3_S2 * position / np.linalg.norm(position, axis=1)[:, None] ** 3
    return acceleration - gravity


def test_held_thrust_blows_at_the_body_where_its_acceleration_beyond_gravity_says_so():
    """On a slow forced circle the tide turns the thrust about the body: the exhaust sweeps over it again and again."""
    scenario = make_scenario()
    spans = [span for span in search(scenario, f"plume({HALF_DEG}deg, 150m)") if span[1] > 1500.0]
    time_s = np.arange(1500.0, SPAN_S - 5.0, 10.0)
    off_deg = off_exhaust_deg(push_beyond_gravity(scenario, time_s), see(scenario, time_s)[2])
    held = off_deg < HALF_DEG
    mask = np.any([(time_s > begin) & (time_s < end) for begin, end in spans], axis=0)
    assert np.count_nonzero(np.diff(held.astype(int))) >= 5
    edges = np.array(spans).ravel()
    near = np.abs(edges[:, None] - time_s).min(axis=0) < 0.1
    assert (mask == held)[~near].all()
    inner = edges[(edges > 1500.0) & (edges < SPAN_S - 5.0)]
    off_deg = off_exhaust_deg(push_beyond_gravity(scenario, inner), see(scenario, inner)[2])
    # the plan is linear: relative to gravity it misses by 1.5 (100 m / 7000 km) of its tide, 2e-5 rad
    assert np.abs(off_deg - HALF_DEG).max() < math.degrees(1e-4)


def test_an_impulse_blows_at_the_body_where_the_jump_of_velocity_says_so():
    """Impulses of the hop, of the transfer and of the insertion, each judged by the velocities on both sides of it."""
    scenario = make_scenario()
    body = scenario.bodies[-1]
    plan = rl.motion.find_plan(body, scenario.bodies, scenario.time.start_utc)
    instants = [impulse.time_s for impulse in plan.impulses]
    assert len(instants) == 3 and instants[0] == 0.0
    for half_deg, range_m in ((60.0, 5000.0), (60.0, 150.0), (120.0, 5000.0)):
        expected = []
        for at, impulse in zip(instants, plan.impulses, strict=True):
            beside = np.array([at - 1e-3, at + 1e-3])
            _, velocity, line = see(scenario, beside[beside >= 0.0])
            jump = velocity[-1:] - velocity[:1]
            if at == 0.0:  # no state before it; in rtn axes the body is ahead, along +y
                off_deg = math.degrees(math.acos(-impulse.delta_v_m_s[1] / impulse.size_m_s))
            else:
                off_deg = float(off_exhaust_deg(jump, line[-1:])[0])
            if off_deg < half_deg and np.linalg.norm(line[-1]) < range_m:
                expected.append((at, at + IMPULSE_S))
        spans = search(scenario, f"plume({half_deg}deg, {range_m}m)", days=1400.0 / DAY_S)
        assert np.allclose(spans, [span for span in expected if span[0] < 1400.0], atol=1e-6)


def test_conditions_combine_with_the_plume():
    scenario = make_scenario()
    plume = f"plume({HALF_DEG}deg, 150m)"
    whole, near, other = (search(scenario, f"{plume}{rest}") for rest in ("", " and range < 150m", " and range > 150m"))
    assert whole and np.allclose(near, whole, atol=1e-3) and not other
    rest = search(scenario, f"not {plume}")
    assert sum(end - begin for begin, end in (*whole, *rest)) == pytest.approx(SPAN_S, abs=0.01)


def test_limits_of_the_sequence_stand_for_those_that_are_left_out():
    limits = "plume_half_angle_deg = 10\nplume_range_m = 50\n"
    scenario = make_scenario(SEQUENCE + limits)
    assert search(scenario, "plume") == search(scenario, "plume(10deg, 0.05km)")


@pytest.mark.parametrize(
    ("when", "motion", "message"),
    [
        ("plume", SEQUENCE, r"^when: plume: needs the half angle .* or give the sequence plume_half_angle_deg"),
        ("plume(30deg)", SEQUENCE, r"^when: plume\(30deg\): needs the half angle .*; write plume\(30deg, 200m\)$"),
        ("plume(30, 200)", SEQUENCE, r"^when: plume\(30, 200\): needs"),
        ("plume(200m, 30deg)", SEQUENCE, r"^when: plume\(200m, 30deg\): needs"),
        ("plume(-3deg, 200m)", SEQUENCE, r"^when: plume\(-3deg, 200m\): needs"),
        ("plume(180deg, 200m)", SEQUENCE, r"^when: plume\(180deg, 200m\): needs the half angle of the exhaust, below"),
        ("plume(30deg, 0m)", SEQUENCE, r"^when: plume\(30deg, 0m\): needs"),
        ("plume(30deg, 2m, 3m)", SEQUENCE, r"^when: plume\(30deg, 2m, 3m\): needs"),
        ("plume(1.2.3deg, 2m)", SEQUENCE, r"^when: plume\(1.2.3deg, 2m\): needs"),
        ("plume < 3", SEQUENCE, "is not compared"),
        (
            "plume(30deg, 2m)",
            'type = "hill"\nrelative_to = "station"\nposition_m = [0, -9, 0]\nvelocity_m_s = [0, 0, 0]\n',
            "^when: plume needs a plan, and follower of exhaust flies none; give it a motion that is a proximity",
        ),
    ],
)
def test_a_plume_that_cannot_be_searched_is_named(when, motion, message):
    with pytest.raises(ScenarioError, match=message):
        search(make_scenario(motion), when)


def test_a_plume_needs_the_follower_of_a_scenario():
    scenario = make_scenario()
    own, station = BodyTrajectory(scenario, "follower"), BodyTrajectory(scenario, "station")
    with pytest.raises(ScenarioError, match=r"^when: plume needs a follower that flies a plan; give its scenario as"):
        rl.study.events({"a": own, "b": station}, None, "plume(30deg, 9m)", start_utc=scenario.time.start_utc, days=0.1)


def test_a_burn_of_finite_length_fires_as_long_as_it_lasts():
    """Burns of a hop at 5 mm/s2: the commanded change of velocity over the acceleration is their length."""
    plan = '{ type = "hop", relative_to = "station", from_m = [0, -400, 0], to_m = [0, -100, 0], duration_s = 900 }'
    flown = f'type = "flown"\nplan = {plan}\nthrusters = {{ acceleration_m_s2 = 0.005 }}\n'
    scenario = make_scenario(flown)
    follower = scenario.follower
    commands = rl.motion.list_commands(follower, scenario.bodies, scenario.time.start_utc, 1800.0)
    assert len(commands) == 2
    spans = search(scenario, "plume(179.9deg, 1km)", days=1800.0 / DAY_S)
    lengths = [end - begin for begin, end in spans]
    assert lengths == pytest.approx([command.size_m_s / 0.005 for command in commands], abs=0.05)
    assert min(lengths) > 10.0 * IMPULSE_S
