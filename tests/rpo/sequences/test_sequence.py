"""Sequences: each leg begins where the last one ended, and the whole is one plan whose motion its impulses explain."""

import datetime
import math
from itertools import pairwise

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import rpo, units
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import find_plan
from rso_lidar.orbit import Epochs, Kepler
from rso_lidar.rpo import clohessy_wiltshire

START = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
N = math.sqrt(units.EARTH_GM_M3_S2 / 6_878e3**3)
REVOLUTION = math.tau / N
STATION = Kepler(
    epoch_utc=START,
    semi_major_axis_km=6878.0,
    eccentricity=0.0,
    inclination_deg=51.6,
    raan_deg=40.0,
    argument_of_perigee_deg=0.0,
    true_anomaly_deg=70.0,
)
HOP = {"type": "hop", "from_m": (0.0, -3000.0, 0.0), "to_m": (0.0, -1000.0, 0.0), "duration_s": 2700.0}
HOLD = {"type": "station_keeping", "duration_s": 600.0}
ROUND = {"type": "circumnavigation", "radial_m": 100.0, "cross_track_m": 50.0, "phase_deg": 90.0}
LINE = {"type": "v_bar_approach", "to_m": -50.0, "speed_m_s": 0.2}
MISSION = (
    HOP,
    HOLD,
    ROUND | {"transfer_s": 2000.0, "until": {"type": "time", "duration_s": 3000.0}},
    {"type": "hop", "to_m": (0.0, -200.0, 0.0), "duration_s": 1500.0},
    LINE,
    {"type": "drift", "duration_s": 300.0},
    {"type": "forced_circumnavigation", "radius_m": 80.0, "rate_deg_s": 0.3, "duration_s": 900.0},
    {"type": "teardrop", "cusp_m": -300.0, "turn_m": -150.0, "loops": 2},
    {"type": "waypoints", "positions_m": ((0.0, -300.0, 0.0), (20.0, -200.0, 5.0), (0.0, -100.0, 0.0)), "speed_m_s": 0.3},
    {"type": "r_bar_approach", "from_m": -200.0, "to_m": -100.0, "speed_m_s": 0.2},
    {"type": "co_elliptic", "radial_m": -500.0, "from_m": -3000.0, "to_m": -1000.0},
    {"type": "safety_ellipse", "radial_m": 100.0, "cross_track_m": 100.0, "drift_m": 50.0, "duration_s": 3000.0},
    {"type": "perch", "along_track_m": -400.0, "duration_s": 500.0},
    {"type": "glideslope", "to_m": (0.0, -60.0, 0.0), "initial_speed_m_s": 0.5, "final_speed_m_s": 0.1, "pulses": 5},
    {"type": "pulsed_station_keeping", "position_m": (20.0, -60.0, 0.0), "arc_m": 2.0, "duration_s": 900.0},
    {"type": "lambert", "to_m": (0.0, -500.0, 0.0), "duration_s": 2000.0},
)  # fmt: skip


def sequence(*legs, **fields):
    return rpo.Sequence(relative_to="station", legs=legs, **fields)


def plan(*legs, **fields):
    return sequence(*legs, **fields).plan(START, STATION)


def test_every_operation_follows_every_other():
    """Position is continuous everywhere; velocity jumps at the impulses only, and by them."""
    whole = plan(*MISSION)
    assert [part.name for part in whole.parts] == [leg["type"] for leg in MISSION]
    assert {leg["type"] for leg in MISSION} == {cls.model_fields["type"].default for cls in leg_classes()}
    edges = np.unique([leg.begin_s for leg in whole.legs[1:]] + [part.end_s for part in whole.parts])
    jumps = {round(one.time_s, 6): one.delta_v_m_s for one in whole.impulses}
    for at_s in edges:
        (before, after), (slow, fast) = whole.relative(np.array([at_s - 1e-7, at_s + 1e-7]))
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-5)
        np.testing.assert_allclose(fast - slow, jumps.get(round(at_s, 6), np.zeros(3)), rtol=0, atol=1e-6)
    assert len(jumps) == len(whole.impulses) > 12


def leg_classes():
    return (
        rpo.HopLeg, rpo.HoldLeg, rpo.CircumnavigationLeg, rpo.VBarLeg, rpo.DriftLeg, rpo.ForcedCircumnavigationLeg,
        rpo.TeardropLeg, rpo.WaypointsLeg, rpo.RBarLeg, rpo.CoEllipticLeg, rpo.SafetyEllipseLeg, rpo.LambertLeg,
        rpo.PerchLeg, rpo.GlideslopeLeg, rpo.PulsedHoldLeg,
    )  # fmt: skip


def test_impulses_and_thrust_alone_fly_the_plan():
    """An integration of Hill's equations with the plan's impulses and control arrives where the plan does."""
    from scipy.integrate import solve_ivp

    whole = plan(*MISSION[:8])

    def rates(time_s, state):
        x, _, z, u, v, w = state
        a = whole.control_m_s2(np.array([time_s]))[0]
        return [u, v, w, 3 * N * N * x + 2 * N * v + a[0], -2 * N * u + a[1], -N * N * z + a[2]]

    position, velocity = whole.relative(np.zeros(1))
    state = np.concatenate([position[0], velocity[0]])
    stops = sorted({leg.begin_s for leg in whole.legs} | {whole.duration_s})
    for begin_s, end_s in pairwise(stops):
        inside = end_s - 1e-9
        state = solve_ivp(rates, (begin_s, inside), state, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        state[3:] += sum((one.delta_v_m_s for one in whole.impulses if abs(one.time_s - end_s) < 1e-6), np.zeros(3))
    position, velocity = whole.relative(np.array([whole.duration_s]))
    np.testing.assert_allclose(state[:3], position[0], rtol=0, atol=2e-4)  # thrust errors of 1e-9 grow for 14,000 s
    np.testing.assert_allclose(state[3:], velocity[0], rtol=0, atol=1e-6)


def test_the_first_leg_alone_is_its_operation():
    alone = rpo.Hop(relative_to="station", from_m=HOP["from_m"], to_m=HOP["to_m"], duration_s=2700.0).plan(
        START, STATION
    )
    whole = plan(HOP)
    times = np.linspace(0.0, 4000.0, 41)
    np.testing.assert_array_equal(whole.relative(times), alone.relative(times))
    assert whole.delta_v_m_s == pytest.approx(alone.delta_v_m_s, rel=1e-14)
    assert whole.duration_s == alone.duration_s


def test_a_burn_between_two_legs_is_one_impulse():
    """A stop at once followed by a departure is the difference of velocities, not their sum."""
    on = HOP | {"from_m": None, "to_m": (0.0, -300.0, 0.0)}
    whole = plan(HOP, on)
    assert [one.time_s for one in whole.impulses] == [0.0, 2700.0, 5400.0]
    first, second = (plan(leg | {"from_m": start}) for leg, start in ((HOP, HOP["from_m"]), (on, HOP["to_m"])))
    merged = first.impulses[1].delta_v_m_s + second.impulses[0].delta_v_m_s
    np.testing.assert_allclose(whole.impulses[1].delta_v_m_s, merged, rtol=0, atol=1e-12)
    # tangential hops of half a revolution on one side: leaving again in the way of arrival costs less than two burns
    assert whole.delta_v_m_s < first.delta_v_m_s + second.delta_v_m_s


def test_a_stop_counts_with_the_leg_that_it_ends():
    whole = plan(HOP, HOLD)
    assert whole.parts[0].delta_v_m_s == pytest.approx(plan(HOP).delta_v_m_s, rel=1e-12)
    assert whole.parts[1].delta_v_m_s == pytest.approx(0.0, abs=1e-12)
    everything = sum(part.delta_v_m_s for part in plan(*MISSION).parts)
    assert everything == pytest.approx(plan(*MISSION).delta_v_m_s, rel=1e-9)


def test_a_planned_transfer_is_clohessy_wiltshires_and_the_cheapest_in_time():
    ends = plan(HOP, ROUND | {"duration_s": 600.0}).parts[1]
    took_s = ends.arrival_s - ends.begin_s
    costs = [plan(HOP, ROUND | {"duration_s": 600.0, "transfer_s": took_s + more}).delta_v_m_s for more in (-90, 0, 90)]
    assert costs[1] == min(costs)
    whole = plan(HOP, ROUND | {"duration_s": 600.0, "transfer_s": 1800.0})
    leaving = whole.impulses[1].delta_v_m_s + whole.relative(np.array([2700.0 - 1e-9]))[1][0]
    there = clohessy_wiltshire(HOP["to_m"], leaving, 1800.0, N)[0]
    np.testing.assert_allclose(there, [0.0, -200.0, 50.0], rtol=0, atol=1e-6)  # phase 90: behind, cross-track greatest


def test_a_start_of_its_own_is_reached_by_a_transfer_or_flown_from():
    drifting = {"position_m": (100.0, -2000.0, 0.0), "velocity_m_s": (0.0, -0.2, 0.1)}
    free = plan({"type": "drift", "duration_s": 900.0}, **drifting)
    freely = clohessy_wiltshire(*drifting.values(), np.array([900.0]), N)
    np.testing.assert_allclose(free.relative(np.array([900.0])), freely, rtol=1e-12)
    assert free.delta_v_m_s == 0.0
    away = plan(HOP | {"transfer_s": 1500.0}, **drifting)
    assert away.parts[0].arrival_s == 1500.0
    np.testing.assert_allclose(away.relative(np.array([1500.0]))[0][0], HOP["from_m"], rtol=0, atol=1e-6)


def test_after_the_last_leg_its_operation_continues_unless_it_was_cut():
    held = plan(HOP, HOLD).relative(np.array([3300.0, 9000.0]))
    np.testing.assert_allclose(held[0], [HOP["to_m"]] * 2, rtol=0, atol=1e-9)
    cut = plan(LINE | {"from_m": -200.0, "until": {"type": "range", "at_most_m": 100.0}})
    position, velocity = cut.relative(np.array([cut.duration_s, cut.duration_s + 500.0]))
    freely = clohessy_wiltshire(position[0], (0.0, 0.2, 0.0), 500.0, N)
    np.testing.assert_allclose(position[1], freely[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(velocity[1], freely[1], rtol=0, atol=1e-12)


def test_two_bodies_confirm_a_lambert_leg_late_in_a_sequence():
    """About an eccentric chief, where a leg planned at the wrong place of the orbit would miss by kilometres."""
    chief = STATION.replace(semi_major_axis_km=9000.0, eccentricity=0.2)
    legs = (
        {"type": "drift", "duration_s": 1800.0},
        {"type": "lambert", "to_m": (0.0, -400.0, 0.0), "duration_s": 2400.0},
    )
    there = sequence(*legs, position_m=(0.0, -5000.0, 0.0)).plan(START, chief)
    begun, speed = there.relative(np.array([1800.0]))
    states = chief.states(Epochs(START, np.array([1800.0])))
    moved = rl.orbit.State(
        epoch_utc=START, position_m=tuple(states.position_m[0]), velocity_m_s=tuple(states.velocity_m_s[0])
    )
    flown = rpo.Nonlinear(relative_to="station", position_m=tuple(begun[0]), velocity_m_s=tuple(speed[0]))
    arrived, _ = flown.relative(Epochs(START, np.array([2400.0])), moved)
    np.testing.assert_allclose(arrived[0], [0.0, -400.0, 0.0], rtol=0, atol=1e-5)


def test_two_bodies_fly_the_impulses_within_the_stated_error():
    """The impulses of free legs, given to two propagated orbits: off by 6 pi rho^2 / r a revolution at most, see `Hill`."""
    whole = plan(HOP | {"stop": False}, {"type": "hop", "to_m": (50.0, -600.0, 20.0), "duration_s": 2000.0}, ROUND)
    position, velocity = whole.relative(np.zeros(1))
    state = position[0], velocity[0] - whole.impulses[0].delta_v_m_s
    edges = [one.time_s for one in whole.impulses] + [whole.duration_s]
    for one, end_s in zip(whole.impulses, edges[1:], strict=True):
        now = STATION.states(Epochs(START, np.array([one.time_s])))
        chief = rl.orbit.State(
            epoch_utc=START, position_m=tuple(now.position_m[0]), velocity_m_s=tuple(now.velocity_m_s[0])
        )
        motion = rpo.Nonlinear(
            relative_to="station", position_m=tuple(state[0]), velocity_m_s=tuple(state[1] + one.delta_v_m_s)
        )
        flown = motion.relative(Epochs(START, np.array([end_s - one.time_s])), chief)
        state = flown[0][0], flown[1][0]
    off_m = float(np.linalg.norm(state[0] - whole.relative(np.array([whole.duration_s]))[0][0]))
    allowed_m = 6.0 * math.pi * 3000.0**2 / 6.878e6 * whole.duration_s / REVOLUTION
    assert 1e-3 * allowed_m < off_m < allowed_m


def test_a_description_has_the_legs_and_the_maneuvers():
    text = plan(*MISSION).describe().splitlines()
    assert text[0].startswith("sequence: ") and len(text) > len(MISSION) + 20
    assert text[1].split() == [
        "leg", "operation", "begin_s", "arrival_s", "end_s", "ended_by", "delta_v_m_s", "nearest",
    ]  # fmt: skip
    assert [line.split()[1] for line in text[2 : 2 + len(MISSION)]] == [leg["type"] for leg in MISSION]


def test_a_corridor_leads_through_the_keep_out_sphere():
    legs = (HOP | {"to_m": (0.0, -300.0, 0.0)}, LINE)
    with pytest.raises(ScenarioError, match=r"^legs\[1\]: keep_out_m: at [\d.]+ s the path is .* sphere of 200 m; go"):
        plan(*legs, keep_out_m=200.0)
    through = plan(*legs, keep_out_m=200.0, corridor_axis=(0.0, -1.0, 0.0), corridor_half_angle_deg=5.0)
    assert through.nearest_m == pytest.approx(50.0)
    assert plan(legs[0], LINE | {"keep_out_m": 40.0}, keep_out_m=200.0).nearest_m == pytest.approx(50.0)
    with pytest.raises(ScenarioError, match="outside its corridor"):
        plan(*legs, keep_out_m=200.0, corridor_axis=(0.0, 1.0, 0.0))
    arc = legs[0], {"type": "hop", "to_m": (0.0, -50.0, 0.0), "duration_s": 2500.0}
    with pytest.raises(ScenarioError, match="outside its corridor"):  # the arc bends out of the cone inside the sphere
        plan(*arc, keep_out_m=200.0, corridor_axis=(0.0, -1.0, 0.0), corridor_half_angle_deg=2.0)


def test_limits_of_thrust_hold_for_the_whole():
    whole = plan(HOP, LINE)
    largest = max(one.size_m_s for one in whole.impulses)
    steady = float(np.linalg.norm(whole.control_m_s2(np.array([3000.0]))))
    assert steady == pytest.approx(2.0 * N * 0.2, rel=1e-12)  # Fehse ch. 3
    kept = {"max_delta_v_m_s": whole.delta_v_m_s, "max_impulse_m_s": largest, "max_acceleration_m_s2": steady}
    for key, value in kept.items():
        plan(HOP, LINE, **{key: 1.0001 * value})
        with pytest.raises(ScenarioError, match=f"^{key}: "):
            plan(HOP, LINE, **{key: 0.9999 * value})


def test_a_plume_does_not_point_at_the_body_near_by():
    """Behind the body, the impulse that brakes blows ahead, at it; on the way in, the line is held by radial thrust."""
    near = {"plume_half_angle_deg": 30.0, "plume_range_m": 60.0}
    with pytest.raises(ScenarioError, match=r"^plume_half_angle_deg: at [\d.]+ s, 50 m away, the body is 0.0 deg off"):
        plan(HOP, LINE, **near)
    plan(HOP, LINE, **near | {"plume_range_m": 49.0})
    plan(HOP, LINE, {"type": "drift", "duration_s": 10.0}, **near | {"plume_range_m": 49.0})
    with pytest.raises(ScenarioError, match=r"the body is 90\.0 deg off the exhaust, less than 95 deg"):
        plan(HOP, LINE, **near | {"plume_half_angle_deg": 95.0, "plume_range_m": 400.0})


@pytest.mark.parametrize(
    ("legs", "fields", "message"),
    [
        ((), {}, "legs: needs at least 1 entries"),
        (({"type": "hop", "to_m": (0.0, 1.0, 0.0), "duration_s": 9.0},), {}, r"legs\[0\]: from_m: is missing"),
        (({"type": "drift"},), {}, r"legs\[0\]: drift: the first leg begins nowhere"),
        ((HOP | {"relative_to": "other"},), {}, r"legs\[0\].relative_to: is 'other', but the sequence is about"),
        ((HOP | {"until": {"type": "range"}},), {}, r"needs exactly one of at_most_m and at_least_m"),
        ((HOP | {"until": {"type": "dusk"}},), {}, r"legs\[0\].until: unknown type 'dusk'"),
        ((HOP | {"until": {"type": "time"}},), {}, r"needs exactly one of duration_s and at_s"),
        ((HOP | {"speed": 1.0},), {}, r"legs\[0\]: unknown key 'speed'"),
        ((HOP,), {"velocity_m_s": (0.0, 0.0, 0.0)}, "velocity_m_s: needs position_m"),
        ((HOP,), {"plume_range_m": 9.0}, "plume_half_angle_deg: belongs to plume_range_m"),
        ((HOP, HOLD | {"until": {"type": "time", "at_s": 10.0}}), {}, r"legs\[1\]: until.at_s: the leg begins at 2700"),
        (
            (HOP | {"until": {"type": "range", "at_most_m": 9.0}},),
            {},
            r"legs\[0\]: until: the condition 'range' is not met",
        ),
        ((HOP, {"type": "co_elliptic", "radial_m": 9.0}), {}, r"legs\[1\].*needs one of to_m, duration_s and until"),
        ((HOP, LINE | {"to_m": 50.0}), {}, r"legs\[1\]: VBarApproach: to_m: the straight line goes through the body"),
        ((HOP, LINE | {"from_m": -50.0}), {}, r"to_m: begins and ends at -50 m"),
        ((HOP, ROUND | {"transfer_s": REVOLUTION}), {}, r"legs\[1\]: transfer_s: transfer: after 1 revolutions"),
        (
            (HOP, {"type": "hop", "to_m": (9e6, 0.0, 0.0), "duration_s": 99.0}),
            {},
            r"legs\[1\]: to_m: 9000 km is farther",
        ),
    ],
)
def test_bad_sequences_say_why(legs, fields, message):
    with pytest.raises(ScenarioError, match=message):
        plan(*legs, **fields)


def test_legs_in_python_are_parts():
    again = sequence(
        rpo.HopLeg(from_m=HOP["from_m"], to_m=HOP["to_m"], duration_s=2700.0),
        rpo.HoldLeg(until=rpo.AfterTime(duration_s=600.0)),
    )
    assert again.plan(START, STATION).duration_s == 3300.0
    assert again == sequence(HOP, {"type": "station_keeping", "until": {"type": "time", "duration_s": 600.0}})
    assert again.make_plan(N).duration_s == 3300.0
    about = {"relative_to": "station"}
    operations = rpo.Hop(**about, **{**HOP, "keep_out_m": 90.0}), rpo.StationKeeping(**about, position_m=HOP["to_m"])
    assert sequence(*operations).legs[0].keep_out_m == 90.0
    assert sequence(*operations).plan(START, STATION).duration_s == pytest.approx(2700.0 + REVOLUTION)
    with pytest.raises(ScenarioError, match="unknown type 'rendezvous'"):
        sequence(rpo.Rendezvous(**about, position_m=(0.0, -9.0, 0.0), duration_s=99.0))


def test_a_scenario_flies_a_sequence_from_its_text(tmp_path):
    text = """
        version = 1
        name = "sequence"
        seed = 1
        [time]
        start_utc = 2026-05-01T00:00:00Z
        duration_s = 4000
        frame_rate_hz = 0.01
        [[target]]
        name = "station"
        model = "sphere"
        size_m = 2
        [target.motion]
        type = "kepler"
        epoch_utc = 2026-05-01T00:00:00Z
        semi_major_axis_km = 6878
        eccentricity = 0
        inclination_deg = 51.6
        raan_deg = 40
        argument_of_perigee_deg = 0
        true_anomaly_deg = 70
        [follower]
        attitude = { type = "look_at", at = "station" }
        [follower.motion]
        type = "sequence"
        relative_to = "station"
        keep_out_m = 20
        [[follower.motion.legs]]
        type = "hop"
        from_m = [0, -500, 0]
        to_m = [0, -200, 0]
        duration_s = 2000
        [[follower.motion.legs]]
        type = "v_bar_approach"
        to_m = -30
        speed_m_s = 0.5
        until = { type = "range", at_most_m = 60 }
        [[follower.motion.legs]]
        type = "station_keeping"
        duration_s = 600
        [lidar.laser]
        wavelength_nm = 1064
        energy_mj = 5
        pulse_fwhm_ns = 8
        divergence_deg = 5
        [lidar.receiver]
        fov_deg = 5
        f_number = 2.8
        transmission = 0.67
        [lidar.detector]
        type = "gsfl"
    """
    scenario = rl.Scenario.loads(text)
    truth = rl.motion.truth(scenario.bodies, scenario.epochs())
    place = truth.poses.link("station.rtn", "follower").translation_m
    planned, _ = scenario.follower.motion.plan(START, scenario.target[0].motion).relative(scenario.epochs().time_s)
    np.testing.assert_allclose(place, planned, rtol=0, atol=1e-6)
    assert np.linalg.norm(place[-1]) == pytest.approx(60.0, abs=1e-6)
    again = rl.Scenario.loads(scenario.dumps())
    assert again == scenario
    described = find_plan(scenario.follower, scenario.bodies, START).describe()
    assert "sequence: 2880.0 s" in described and "v_bar_approach" in described
