"""Proximity operations by name: each flies what it says, about any chief, and refuses what cannot be flown."""

import datetime
import math

import numpy as np
import pytest

from rso_lidar import rpo, units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Kepler

START = datetime.datetime(2026, 5, 1, tzinfo=datetime.UTC)
N = math.sqrt(units.EARTH_GM_M3_S2 / 6_878e3**3)
REVOLUTION = math.tau / N
C = {"relative_to": "station"}


def station(eccentricity=0.0, axis_km=6878.0):
    return Kepler(
        epoch_utc=START,
        semi_major_axis_km=axis_km,
        eccentricity=eccentricity,
        inclination_deg=51.6,
        raan_deg=40.0,
        argument_of_perigee_deg=15.0,
        true_anomaly_deg=70.0,
    )


EACH = [
    rpo.StationKeeping(**C, position_m=(30.0, -100.0, 10.0)),
    rpo.VBarApproach(**C, from_m=-500.0, to_m=-20.0, speed_m_s=0.2),
    rpo.VBarApproach(**C, from_m=500.0, to_m=20.0, hops=3),
    rpo.RBarApproach(**C, from_m=-500.0, to_m=-20.0, duration_s=2000.0),
    rpo.RBarApproach(**C, from_m=-500.0, to_m=-20.0, hops=2, speed_m_s=0.4),
    rpo.Hop(**C, from_m=(0.0, -3000.0, 0.0), to_m=(0.0, -300.0, 0.0), duration_s=2700.0),
    rpo.Hop(**C, from_m=(0.0, -3000.0, 50.0), to_m=(0.0, -300.0, 0.0), duration_s=2000.0, stop=False),
    rpo.CoElliptic(**C, radial_m=-500.0, from_m=-5000.0, to_m=1000.0),
    rpo.Circumnavigation(**C, radial_m=100.0, cross_track_m=50.0, phase_deg=200.0, center_along_track_m=20.0),
    rpo.SafetyEllipse(**C, radial_m=100.0, cross_track_m=80.0, drift_m=200.0, center_along_track_m=-1000.0),
    rpo.Teardrop(**C, cusp_m=300.0, turn_m=150.0, loops=3),
    rpo.Teardrop(**C, cusp_m=-300.0, period_s=1500.0, along_track_m=-40.0),
    rpo.ForcedCircumnavigation(**C, radius_m=50.0, period_s=1200.0, axis=(1.0, 0.0, 1.0)),
    rpo.ForcedCircumnavigation(**C, radius_m=50.0, rate_deg_s=0.3, axis=(1.0, 0.0, 0.0), phase_deg=90.0),
    rpo.Waypoints(**C, positions_m=((0.0, -500.0, 0.0), (50.0, -200.0, 10.0), (0.0, -50.0, 0.0)), speed_m_s=0.3),
    rpo.Waypoints(
        **C,
        positions_m=((0.0, -500.0, 0.0), (50.0, -200.0, 10.0), (0.0, -50.0, 0.0)),
        times_s=(0.0, 900.0, 1800.0),
        stop=True,
        hold_s=60.0,
    ),
    rpo.Rendezvous(**C, position_m=(-900.0, -8000.0, 100.0), velocity_m_s=(0.0, 1.5, 0.0), duration_s=3000.0),
    rpo.Perch(**C, along_track_m=-80.0),
    rpo.PulsedStationKeeping(**C, position_m=(30.0, -100.0, 10.0), arc_m=3.0),
    rpo.Glideslope(
        **C, from_m=(-60.0, -400.0, 30.0), to_m=(0.0, -20.0, 0.0), initial_speed_m_s=0.8, final_speed_m_s=0.05, pulses=7
    ),
    rpo.Lambert(**C, from_m=(-1000.0, -8000.0, 100.0), to_m=(0.0, -100.0, 0.0), duration_s=3000.0),
]


def ids(part):
    return part.type


def flown(part, times, chief=None):
    return part.relative(Epochs(START, np.asarray(times, dtype=float)), chief or station())


@pytest.mark.parametrize("part", EACH, ids=ids)
def test_velocity_is_the_slope_and_legs_join(part):
    plan = part.plan(START, station())
    joints = np.array([leg.begin_s for leg in plan.legs[1:]])
    times = np.linspace(5.0, 1.3 * plan.duration_s, 61)
    times = times[np.all(np.abs(times[:, None] - joints) > 2.0, axis=1)] if len(joints) else times
    (ahead, _), (behind, _), (_, velocity) = flown(part, times + 1.0), flown(part, times - 1.0), flown(part, times)
    # h^2 / 6 times the third derivative: rate^3 times the size of what is flown
    size = max(np.abs(flown(part, times)[0]).max(), 1.0)
    rate = max(N, 2 * math.pi / 1200.0 if part.type == "forced_circumnavigation" else 0.0)
    np.testing.assert_allclose(0.5 * (ahead - behind), velocity, rtol=0, atol=2.0 * rate**3 * size + 1e-6)
    for at_s in joints:
        (before, after), _ = flown(part, [at_s - 1e-6, at_s])
        np.testing.assert_allclose(before, after, rtol=0, atol=1e-4)


@pytest.mark.parametrize("part", EACH, ids=ids)
def test_impulses_are_what_jumps(part):
    plan = part.plan(START, station())
    for impulse in plan.impulses:
        if impulse.time_s > 0.0 and sum(other.time_s == impulse.time_s for other in plan.impulses) == 1:
            _, (before, after) = flown(part, [impulse.time_s - 1e-6, impulse.time_s])
            np.testing.assert_allclose(after - before, impulse.delta_v_m_s, rtol=0, atol=1e-7)
    assert plan.delta_v_m_s == pytest.approx(
        sum(impulse.size_m_s for impulse in plan.impulses) + plan.continuous_delta_v_m_s
    )


@pytest.mark.parametrize("part", EACH, ids=ids)
def test_an_instant_has_the_same_bits_alone(part):
    plan = part.plan(START, station())
    times = np.linspace(0.0, 1.2 * plan.duration_s, 101)
    position, velocity = flown(part, times)
    for k in (0, 1, 50, 84, 100):
        alone = flown(part, times[k : k + 1])
        np.testing.assert_array_equal(alone[0][0], position[k])
        np.testing.assert_array_equal(alone[1][0], velocity[k])


@pytest.mark.parametrize("part", EACH, ids=ids)
def test_plans_say_themselves_and_bound_their_path(part):
    plan = part.plan(START, station())
    assert part.plan(START, station()) is plan  # made once
    assert plan.describe().startswith(f"{part.type}: ")
    position, _ = plan.relative(np.linspace(0.0, plan.duration_s, 2001))
    distance = np.linalg.norm(position, axis=1)
    assert plan.nearest_m <= distance.min() + 1e-9
    # between samples it comes nearer by no more than half a step of the fastest
    assert plan.nearest_m >= distance.min() - np.linalg.norm(np.diff(position, axis=0), axis=1).max()
    safety = plan.passive_safety()
    assert safety.distance_m >= 0.0
    assert 0.0 <= safety.failure_s <= plan.duration_s
    assert safety.nearest_s <= plan.duration_s + safety.horizon_s + 1.0


@pytest.mark.parametrize("part", EACH, ids=ids)
def test_a_keep_out_sphere_is_kept(part):
    nearest_m, _ = part.plan(START, station()).nearest()
    if nearest_m > 1.0:
        part.replace(keep_out_m=0.99 * nearest_m).plan(START, station())
    with pytest.raises(
        ScenarioError, match=r"keep_out_m: at [\d.]+ s the path is .* inside the sphere of .*; go round"
    ):
        flown(part.replace(keep_out_m=1.01 * nearest_m + 1.0), [0.0])


def test_what_follows_the_plan_is_kept_out_too():
    # without a stop the arc goes on, and later passes the body
    part = rpo.Hop(
        **C, from_m=(0.0, -500.0, 0.0), to_m=(0.0, -100.0, 0.0), duration_s=1000.0, stop=False, keep_out_m=90.0
    )
    assert flown(part, [0.0, 990.0])[0].shape == (2, 3)
    late = np.arange(1000.0, 2000.0, 5.0)
    with pytest.raises(ScenarioError, match="inside the sphere of 90 m"):
        flown(part, late)


def test_begin_and_end_are_where_they_were_asked():
    for part, start, end in [
        (EACH[1], (0.0, -500.0, 0.0), (0.0, -20.0, 0.0)),
        (EACH[2], (0.0, 500.0, 0.0), (0.0, 20.0, 0.0)),
        (EACH[3], (-500.0, 0.0, 0.0), (-20.0, 0.0, 0.0)),
        (EACH[4], (-500.0, 0.0, 0.0), (-20.0, 0.0, 0.0)),
        (EACH[6], (0.0, -3000.0, 50.0), (0.0, -300.0, 0.0)),
        (EACH[7], (-500.0, -5000.0, 0.0), (-500.0, 1000.0, 0.0)),
        (EACH[10], (300.0, 0.0, 0.0), (300.0, 0.0, 0.0)),
        (EACH[14], (0.0, -500.0, 0.0), (0.0, -50.0, 0.0)),
        (EACH[16], (-900.0, -8000.0, 100.0), (0.0, 0.0, 0.0)),
    ]:
        duration_s = part.plan(START, station()).duration_s
        position, _ = flown(part, [0.0, duration_s - 1e-7, duration_s])
        np.testing.assert_allclose(position, [start, end, end], rtol=0, atol=1e-5)


def test_waypoints_are_met_on_time_and_held():
    part = EACH[15]
    position, velocity = flown(part, [900.0, 930.0, 959.9, 1800.0])
    np.testing.assert_allclose(position[:3], 3 * [[50.0, -200.0, 10.0]], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(velocity[:3], np.zeros((3, 3)))
    assert [impulse.time_s for impulse in part.plan(START, station()).impulses] == [0.0, 900.0, 960.0, 1800.0]


def test_teardrop_turns_where_it_was_asked():
    for turn_m in (150.0, 1.0, -40.0):
        part = rpo.Teardrop(**C, cusp_m=300.0, turn_m=turn_m, loops=2)
        each_s = part.loop_s(N)
        position, _ = part.make_plan(N).relative(np.linspace(0.0, each_s, 2001))
        assert position[1000, 0] == pytest.approx(turn_m, abs=1e-6)
        assert position[:, 0].min() == pytest.approx(turn_m, abs=1e-6)
        np.testing.assert_allclose(position[:, 1], -position[::-1, 1], rtol=0, atol=1e-6)
        assert each_s < REVOLUTION
    assert rpo.Teardrop(**C, cusp_m=300.0, turn_m=0.0).loop_s(N) / REVOLUTION == pytest.approx(0.406, abs=5e-4)


def test_forced_circle():
    part = rpo.ForcedCircumnavigation(**C, radius_m=50.0, period_s=1200.0, phase_deg=90.0)
    position, velocity = flown(part, [0.0, 300.0])
    np.testing.assert_allclose(position, [[0.0, 50.0, 0.0], [-50.0, 0.0, 0.0]], atol=1e-12)
    assert np.linalg.norm(velocity, axis=1) == pytest.approx(math.tau * 50.0 / 1200.0)
    # in the orbit's plane, with it, at rate w: the pull needed is |w^2 + 2 n w (+ 3 n^2 in x)| r
    rate, plan = math.tau / 1200.0, part.plan(START, station())
    n = plan.mean_motion_rad_s
    control = plan.control_m_s2(np.array([0.0, 300.0]))
    assert control[0, 1] == pytest.approx(-50.0 * (rate**2 + 2 * n * rate), rel=1e-12)
    assert control[1, 0] == pytest.approx(50.0 * (rate**2 + 2 * n * rate + 3 * n**2), rel=1e-12)


def test_a_whole_revolution_reaches_only_some_places():
    whole = 2.0 * math.pi / station_mean_motion()
    hop = rpo.Hop(**C, from_m=(0.0, -500.0, 0.0), to_m=(0.0, -100.0, 0.0), duration_s=whole)
    assert hop.plan(START, station()).impulses[0].delta_v_m_s[0] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(
        ScenarioError, match=r"transfer: after 1 revolutions .* in the orbit's plane .*; change the duration"
    ):
        flown(hop.replace(to_m=(50.0, -100.0, 0.0)), [0.0])
    half = rpo.Hop(**C, from_m=(0.0, -500.0, 0.0), to_m=(0.0, -100.0, 10.0), duration_s=0.5 * whole)
    with pytest.raises(ScenarioError, match=r"transfer: after 0.5 revolutions .* across the orbit's plane .*half"):
        flown(half, [0.0])
    route = rpo.Waypoints(**C, positions_m=((0.0, -500.0, 0.0), (9.0, -100.0, 0.0)), times_s=(0.0, whole))
    with pytest.raises(ScenarioError, match=r"positions_m\[1\]: transfer"):
        flown(route, [0.0])


def station_mean_motion():
    return EACH[0].plan(START, station()).mean_motion_rad_s


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: rpo.Hop(**C, from_m=(0.0, 1.0, 0.0), to_m=(0.0, 2.0, 0.0), duration_s=0.0),
            "duration_s: .*infinite speed",
        ),
        (lambda: rpo.Hop(**C, from_m=(0.0, 1.0, 0.0), to_m=(0.0, 2.0, 0.0), duration_s=-1.0), "is negative"),
        (lambda: rpo.VBarApproach(**C, from_m=5.0, to_m=5.0, speed_m_s=1.0), "approach has no length"),
        (lambda: rpo.VBarApproach(**C, from_m=5.0, to_m=-5.0, speed_m_s=1.0), "goes through the body"),
        (lambda: rpo.VBarApproach(**C, from_m=5.0, to_m=1.0, speed_m_s=1.0, duration_s=1.0), "not both"),
        (lambda: rpo.RBarApproach(**C, from_m=5.0, to_m=1.0), "needs speed_m_s or duration_s"),
        (lambda: rpo.CoElliptic(**C, radial_m=-5.0, from_m=0.0, to_m=-100.0), "never gets"),
        (lambda: rpo.CoElliptic(**C, radial_m=0.0, from_m=0.0, to_m=-100.0), "there is no drift"),
        (lambda: rpo.CoElliptic(**C, radial_m=5.0, from_m=0.0), "exactly one of to_m and duration_s"),
        (lambda: rpo.SafetyEllipse(**C, radial_m=9.0, cross_track_m=9.0, drift_m=90.0), "no longer encloses"),
        (
            lambda: rpo.SafetyEllipse(**C, radial_m=9.0, cross_track_m=9.0, phase_difference_deg=90.0),
            "height and cross-track vanish together",
        ),
        (lambda: rpo.Teardrop(**C, cusp_m=100.0, turn_m=200.0), "turns nearer"),
        (lambda: rpo.Teardrop(**C, cusp_m=0.0, turn_m=200.0), "a loop does not exist"),
        (lambda: rpo.Teardrop(**C, cusp_m=100.0), "exactly one of turn_m and period_s"),
        (lambda: rpo.ForcedCircumnavigation(**C, radius_m=5.0), "exactly one of rate_deg_s and period_s"),
        (lambda: rpo.Waypoints(**C, positions_m=((0.0, 1.0, 0.0), (0.0, 2.0, 0.0))), "exactly one of times_s"),
        (
            lambda: rpo.Waypoints(**C, positions_m=((0.0, 1.0, 0.0), (0.0, 2.0, 0.0)), times_s=(0.0, 0.0)),
            r"times_s\[1\]: 0 s leaves no time",
        ),
        (lambda: rpo.Waypoints(**C, positions_m=((0.0, 1.0, 0.0), (0.0, 2.0, 0.0)), times_s=(0.0,)), "give as many"),
        (
            lambda: rpo.Waypoints(**C, positions_m=((0.0, 1.0, 0.0), (0.0, 2.0, 0.0)), speed_m_s=1.0, hold_s=9.0),
            "set stop = true",
        ),
        (
            lambda: rpo.Waypoints(**C, positions_m=((0.0, 1.0, 0.0), (0.0, 1.0, 0.0)), speed_m_s=1.0),
            r"positions_m\[1\]: is the same as the position before",
        ),
    ],
)
def test_what_cannot_be_flown_says_why(make, message):
    with pytest.raises(ScenarioError, match=message):
        make()


def test_a_plan_that_depends_on_the_chief_says_why():
    with pytest.raises(ScenarioError, match="takes less than one revolution"):
        flown(rpo.Teardrop(**C, cusp_m=100.0, period_s=9000.0), [0.0])
    with pytest.raises(ScenarioError, match="leave no time for 3"):
        flown(EACH[-1].replace(revolutions=3), [0.0])
    with pytest.raises(ScenarioError, match=r"within \d+ km of the Earth's centre, and hits it"):
        flown(EACH[-1].replace(duration_s=1.1 * REVOLUTION, revolutions=1, branch="low"), [0.0])


def test_lambert_and_clohessy_wiltshire_agree_near_by():
    # second order over the radius: (500 m)^2 / 6878 km = 4 cm, some times over
    near = {"duration_s": 2500.0}
    exact = rpo.Lambert(**C, from_m=(0.0, -500.0, 20.0), to_m=(0.0, -50.0, 0.0), **near)
    linear = rpo.Hop(**C, from_m=(0.0, -500.0, 20.0), to_m=(0.0, -50.0, 0.0), **near)
    times = np.linspace(0.0, 2600.0, 27)
    np.testing.assert_allclose(flown(exact, times)[0], flown(linear, times)[0], rtol=0, atol=0.1)
    # without a branch the cheaper of two orbits is taken
    again = exact.replace(duration_s=1.4 * REVOLUTION, revolutions=1)
    low, high = (again.replace(branch=branch).plan(START, station()).delta_v_m_s for branch in ("low", "high"))
    assert again.plan(START, station()).delta_v_m_s == min(low, high)
    assert max(low, high) > 10.0 * min(low, high)


def test_validity_is_told_where_it_is_stretched():
    epochs = Epochs(START, np.linspace(0.0, 3000.0, 31))
    assert EACH[5].validity(epochs, station()) == []
    (far,) = EACH[5].replace(from_m=(0.0, -30_000.0, 0.0)).validity(epochs, station())
    assert far.startswith("hop: the separation reaches 30.0 km")
    assert "use lambert" in far
    (round_,) = EACH[5].validity(epochs, station(0.03, 7500.0))
    assert round_.startswith("hop: the chief's eccentricity is 0.0300")
    assert EACH[-1].validity(epochs, station(0.03, 7500.0)) == []
    long = EACH[-1].replace(duration_s=3.4 * REVOLUTION, revolutions=3)
    (many,) = long.validity(Epochs(START, np.array([0.0, 30_000.0])), station())
    assert many.startswith("lambert: in 3.4 revolutions the Earth's flattening")


def test_a_transfer_that_never_starts_drifts_by_two_bodies():
    # from rest 40 km behind on the V-bar the chord's end is (40 km)^2 / 2 r = 116 m high: it falls back 12 pi of that
    part = rpo.Lambert(**C, from_m=(0.0, -40_000.0, 0.0), to_m=(0.0, -200.0, 0.0), duration_s=4000.0)
    drift, _ = part.plan(START, station()).adrift(np.array([0.0, REVOLUTION]))
    np.testing.assert_allclose(drift[0], part.from_m, rtol=0, atol=1e-6)
    height = 0.5 * 40e3**2 / 6878e3
    assert drift[1, 1] - drift[0, 1] == pytest.approx(-12.0 * math.pi * height, rel=0.05)


def test_lambert_takes_as_many_revolutions_as_cost_least():
    """1.26 revolutions of a low chief: with none the transfer costs kilometres a second, with one it is a drift."""
    low = Kepler(
        epoch_utc=START,
        semi_major_axis_km=6778.0,
        eccentricity=0.0005,
        inclination_deg=51.6,
        raan_deg=40.0,
        argument_of_perigee_deg=15.0,
        true_anomaly_deg=30.0,
    )
    fields = {**C, "from_m": (0, -10000, 0), "to_m": (0, -500, 0), "duration_s": 7000.0}
    chosen = rpo.Lambert(**fields).plan(START, low).delta_v_m_s
    each = []
    for revolutions in (0, 1):
        try:
            each.append(rpo.Lambert(**fields, revolutions=revolutions).plan(START, low).delta_v_m_s)
        except ScenarioError:  # through the Earth, or no such transfer
            continue
    assert chosen == min(each) < 5.0


@pytest.mark.parametrize(("phase_deg", "ahead_deg"), [(25.0, 40.0), (200.0, -70.0)])
def test_ellipses_about_a_body_are_lovell_and_spencers(phase_deg, ahead_deg):
    """x = h + b cos u, y = c + d u' - 2 b sin u, z = q sin(u + a), u = n t + phase; d along the track each revolution."""
    n = 1.1e-3
    time = np.linspace(0.0, 1.7 * math.tau / n, 37)
    u, ahead = n * time + math.radians(phase_deg), math.radians(ahead_deg)
    shape = {**C, "radial_m": 120.0, "cross_track_m": 70.0, "phase_deg": phase_deg, "phase_difference_deg": ahead_deg}
    still = rpo.Circumnavigation(**shape, center_along_track_m=-35.0).make_plan(n)
    walking = rpo.SafetyEllipse(**shape, center_along_track_m=500.0, drift_m=-90.0).make_plan(n)
    for plan, centre_m, drift_m in ((still, -35.0, 0.0), (walking, 500.0, -90.0)):
        height_m = -drift_m / (3.0 * math.pi)
        along = centre_m + drift_m * n * time / math.tau - 240.0 * np.sin(u)
        expected = np.stack([height_m + 120.0 * np.cos(u), along, 70.0 * np.sin(u + ahead)], axis=-1)
        position, velocity = plan.relative(time)
        np.testing.assert_allclose(position, expected, atol=1e-8)
        rates = [-120.0 * np.sin(u), drift_m / math.tau - 240.0 * np.cos(u), 70.0 * np.cos(u + ahead)]
        np.testing.assert_allclose(velocity, n * np.stack(rates, axis=-1), atol=1e-11)
