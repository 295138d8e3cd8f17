"""Plans flown by real forces: starts, chiefs with forces of their own, axes of impulses, seeds, scenarios."""

import datetime
import math
from dataclasses import dataclass

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Drag, Epochs, Forces, Impulse, Kepler, Numerical
from rso_lidar.rpo import (
    Flown,
    Hop,
    NavigationErrors,
    Nonlinear,
    RelativeStart,
    StationKeeping,
    Thrusters,
    TwoImpulseGuidance,
    VBarApproach,
)

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
CHIEF = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6878.137,
    eccentricity=0.0005,
    inclination_deg=51.6,
    raan_deg=40.0,
    argument_of_perigee_deg=15.0,
    true_anomaly_deg=30.0,
)
HOP = Hop(relative_to="station", from_m=(0.0, -5000.0, 0.0), to_m=(0.0, -300.0, 0.0), duration_s=2700.0)
POINT = Forces(zonal_degree=0)


def test_impulses_of_a_plan_are_those_of_nonlinear_in_the_chiefs_axes():
    """The flight of a plan is the nonlinear motion from its start, with its impulses as maneuvers."""
    plan, times = HOP.plan(START, CHIEF), np.linspace(0.0, 3000.0, 31)
    kicks = tuple(
        Impulse(at_s=one.time_s, delta_v_m_s=tuple(one.delta_v_m_s.tolist()), axes="chief_rtn") for one in plan.impulses
    )
    other = Nonlinear(
        relative_to="station", position_m=HOP.from_m, velocity_m_s=(0.0, 0.0, 0.0), forces=Forces(), maneuvers=kicks
    )
    got = Flown(plan=HOP, forces=Forces()).relative(Epochs(START, times), CHIEF)
    wanted = other.relative(Epochs(START, times), CHIEF)
    # The flight also integrates the switch of the held leg, which changes the lengths of its steps. So the two differ by
    # the errors of some 35 steps each. A step may be wrong by 1e-6 m + 1e-13 r = 1.7e-6 m and 1.8e-9 m/s.
    np.testing.assert_allclose(got[0], wanted[0], rtol=0, atol=2 * 35 * 1.7e-6)
    np.testing.assert_allclose(got[1], wanted[1], rtol=0, atol=2 * 35 * 1.8e-9)


def test_a_small_plan_about_a_circular_point_mass_is_flown_as_planned():
    """Where the planner's equations hold, flight and plan differ by their neglected second order only."""
    round_chief, times = CHIEF.replace(eccentricity=0.0), np.linspace(0.0, 3600.0, 37)
    small = VBarApproach(relative_to="station", from_m=-100.0, to_m=-20.0, duration_s=3000.0)
    got = Flown(plan=small, forces=POINT).relative(Epochs(START, times), round_chief)[0]
    wanted = small.relative(Epochs(START, times), round_chief)[0]
    # up to 6 pi rho^2 / r a revolution (see Hill) for 100 m, held by thrust that does not know of it
    assert np.linalg.norm(got - wanted, axis=1).max() < 6.0 * math.pi * 100.0**2 / 6.9e6


def test_a_numerical_chief_keeps_its_own_forces_and_maneuvers():
    """The flight about it is the difference of two numerical orbits, its burn among them."""
    burn = Impulse(at_s=500.0, delta_v_m_s=(0.0, 0.02, 0.0))
    heavy = Forces(drag=Drag(area_m2=10.0, mass_kg=1000.0))
    light = Forces(drag=Drag(area_m2=10.0, mass_kg=50.0))
    chief = Numerical(initial=CHIEF, forces=heavy, maneuvers=(burn,))
    motion = Flown(
        plan=StationKeeping(relative_to="station", position_m=(0.0, -1000.0, 0.0)),
        forces=light,
        start=RelativeStart(position_m=(0.0, -1000.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0)),
    )
    flight = motion.fly(START, chief)
    times = np.array([0.0, 499.0, 1500.0, 5000.0])
    start = flight.reference.place(np.array([0.0, -1000.0, 0.0]), np.zeros(3))
    alone = Numerical(
        initial=rl.orbit.State(
            epoch_utc=START,
            position_m=tuple(start.position_m.tolist()),
            velocity_m_s=tuple(start.velocity_m_s.tolist()),
        ),
        forces=light,
    )
    there, here = chief.states(Epochs(START, times)), alone.states(Epochs(START, times))
    got = motion.relative(Epochs(START, times), chief)[0]
    apart = np.linalg.norm(here.position_m - there.position_m, axis=1)
    # 55 steps of other lengths in each flight, good to 1.7e-6 m
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), apart, rtol=0, atol=2 * 55 * 1.7e-6)
    assert abs(apart[-1] - 1000.0) > 100.0  # the burn moves the chief away
    with pytest.raises(ScenarioError, match="leave chief_forces out"):
        motion.replace(chief_forces=Forces()).fly(START, chief)


def test_forces_default_to_the_chiefs_and_unlike_gravity_is_said():
    chief = Numerical(initial=CHIEF, forces=Forces(zonal_degree=4, moon=True))
    assert Flown(plan=HOP).fly(START, chief).settings.forces == chief.forces
    assert Flown(plan=HOP).fly(START, CHIEF).settings.forces == Forces()
    epochs = Epochs(START, np.linspace(0.0, 100.0, 5))
    assert Flown(plan=HOP).validity(epochs, chief) == []
    (line,) = Flown(plan=HOP, forces=Forces()).validity(epochs, chief)
    assert "zonal_degree, moon" in line


def test_the_start_may_be_an_orbit():
    place = Nonlinear(
        relative_to="station", position_m=(100.0, -5100.0, 30.0), velocity_m_s=(0.1, 0.0, -0.1), forces=POINT
    )
    flown = Flown(plan=HOP, forces=POINT)
    relative = flown.replace(start=RelativeStart(position_m=place.position_m, velocity_m_s=place.velocity_m_s))
    state = relative.fly(START, CHIEF).reference.place(np.array(place.position_m), np.array(place.velocity_m_s))
    orbit = rl.orbit.State(
        epoch_utc=START, position_m=tuple(state.position_m.tolist()), velocity_m_s=tuple(state.velocity_m_s.tolist())
    )
    epochs = Epochs(START, np.array([0.0, 1000.0]))
    one, other = (flown.replace(start=start).relative(epochs, CHIEF) for start in (relative.start, orbit))
    np.testing.assert_allclose(one[0], other[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(one[0][0], place.position_m, rtol=0, atol=1e-6)
    jump = HOP.plan(START, CHIEF).impulses[0].delta_v_m_s
    np.testing.assert_allclose(one[1][0], np.array(place.velocity_m_s) + jump, rtol=0, atol=1e-8)


def test_keep_out_is_watched_on_the_flown_path():
    past = HOP.replace(to_m=(0.0, -290.0, 0.0), keep_out_m=285.0)
    epochs = Epochs(START, np.linspace(0.0, 3600.0, 361))
    (line,) = Flown(plan=past, forces=Forces(zonal_degree=2)).validity(epochs, CHIEF)
    assert "inside the sphere of 285 m; add guidance" in line
    corrected = Flown(plan=past, forces=Forces(), guidance=TwoImpulseGuidance(at_s=(1350.0, 2700.0)))
    assert corrected.validity(Epochs(START, np.linspace(0.0, 2700.0, 271)), CHIEF) == []


NOISY = Thrusters(magnitude_sigma_fraction=0.01, pointing_sigma_deg=0.5)
SCENARIO = """
version = 1
name = "hop"
seed = 3
time = {{ start_utc = 2024-09-17T12:00:00Z, duration_s = 40, frame_rate_hz = 0.1 }}
lidar = {{ preset = "gsfl_1064" }}

[[target]]
name = "station"
model = "plate"
[target.motion]
type = "numerical"
forces = {{ zonal_degree = 2, moon = true }}
initial = {{ type = "kepler", epoch_utc = 2024-09-17T12:00:00Z, semi_major_axis_km = 6878, eccentricity = 0.0005, \
inclination_deg = 51.6, raan_deg = 40, argument_of_perigee_deg = 15, true_anomaly_deg = 30 }}

[follower]
attitude = {{ type = "look_at", at = "station" }}
[follower.motion]
type = "flown"
plan = {{ type = "hop", relative_to = "station", from_m = [0, -200, 0], to_m = [0, -100, 0], duration_s = 900 }}
thrusters = {{ acceleration_m_s2 = 0.05, magnitude_sigma_fraction = 0.05, pointing_sigma_deg = 1 }}
navigation = {{ position_sigma_m = 0.5 }}
{more}
"""


def scenario(more='guidance = { type = "two_impulse", every_s = 20 }'):
    return rl.Scenario.loads(SCENARIO.replace("\\\n", "").format(more=more))


@pytest.mark.slow
def test_a_scenario_flies_it_and_its_seed_moves_it():
    one = scenario()
    epochs = one.epochs()
    truth = rl.motion.truth(one.bodies, epochs)
    place = truth.poses.pose("station.rtn", "follower").translation
    np.testing.assert_allclose(place[0], (0.0, -200.0, 0.0), rtol=0, atol=1e-6)
    alone = rl.motion.truth(one.bodies, one.epochs(np.array([3])))
    np.testing.assert_array_equal(alone.states["follower"].position_m[0], truth.states["follower"].position_m[3])
    other = rl.motion.truth(one.with_seed(4).bodies, epochs).states["follower"].position_m
    again = rl.motion.truth(scenario().bodies, epochs).states["follower"].position_m
    np.testing.assert_array_equal(again, truth.states["follower"].position_m)
    assert np.linalg.norm(other - again, axis=1)[-1] > 1e-3
    fixed = scenario("seed = 9")
    assert fixed.bodies[-1].motion.seed == 9
    text = one.describe()
    assert "hop flown, with guidance, relative to station" in text and "m off the plan at 9" in text


def test_specific_force_of_its_sensors_is_the_thrust():
    course = rl.motion.Course(scenario().bodies, scenario().epochs(), local=False)
    follower = rl.motion.FollowerMotion(course)
    moved = follower.find(np.array([0.5, 30.0]), frozenset(), lambda: np.empty(0))
    size = np.linalg.norm(moved.specific_force_m_s2, axis=1)
    flight = scenario().bodies[-1].motion.fly(START, scenario().bodies[0].motion)
    np.testing.assert_allclose(size, np.linalg.norm(flight.thrust_m_s2(np.array([0.5, 30.0])), axis=1), rtol=1e-9)
    assert size[0] == pytest.approx(0.05, rel=1e-6)


@dataclass
class Unfrozen:
    """Guidance that cannot be hashed."""

    def next_s(self, after_s):
        return math.inf

    def replan(self, update):
        return update.impulses


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"guidance": Unfrozen()}, "make it a frozen dataclass"),
        ({"guidance": {"type": "two_impulse"}}, "exactly one of at_s and every_s"),
        ({"guidance": {"at_s": (20.0, 10.0)}}, "not in order of time"),
        ({"guidance": {"every_s": 5.0, "model": "clohessy_wiltshire", "forces": {}}}, "predicts without forces"),
        ({"thrusters": {"acceleration_m_s2": 1.0, "thrust_n": 2.0}}, "at most one of"),
        ({"thrusters": {"thrust_n": 2.0}}, "mass_kg: belongs to thrust_n"),
        ({"thrusters": {"isp_s": 200.0}}, "isp_s: belongs to"),
        ({"thrusters": {"rise_s": 0.1}}, "an impulse has no rise"),
        ({"thrusters": {"magnitude_error_fraction": -1.0}}, "no thrust is left"),
        ({"plan": {"type": "hill"}}, "plan"),
        ({"start": {"type": "relative", "position_m": (0.0, 0.0, 0.0)}}, "velocity_m_s"),
        ({"guidance": 3.0}, "guidance"),
    ],
)
def test_bad_input_is_one_line(fields, message):
    with pytest.raises(ScenarioError, match=message) as caught:
        Flown(**{"plan": HOP, **fields}).fly(START, CHIEF)
    assert "\n" not in str(caught.value)


def test_errors_repeat_for_a_seed():
    motion = Flown(plan=HOP, forces=POINT, thrusters=NOISY, navigation=NavigationErrors(position_sigma_m=1.0))
    at = np.array([2000.0])
    ends = [motion.replace(seed=seed).fly(START, CHIEF).relative(at)[0][0] for seed in (1, 1, 2)]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert np.linalg.norm(ends[0] - ends[2]) > 1.0
