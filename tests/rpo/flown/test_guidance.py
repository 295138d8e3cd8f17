"""Guidance: corrected plans end where they should, by either model, with errors on the way, and by users' own objects."""

import datetime
import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Drag, Epochs, Forces, Kepler, RadiationPressure
from rso_lidar.rpo import (
    AfterTime,
    Circumnavigation,
    CircumnavigationLeg,
    Flown,
    Guidance,
    Hop,
    HopLeg,
    NavigationErrors,
    PerchLeg,
    PlannedImpulse,
    RelativeStart,
    Sequence,
    StationKeeping,
    Thrusters,
    TwoImpulseGuidance,
    VBarApproach,
    Waypoints,
)

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
POINT = Forces(zonal_degree=0)
REAL = Forces(
    zonal_degree=6,
    drag=Drag(area_m2=4.0, mass_kg=200.0),
    radiation_pressure=RadiationPressure(area_m2=4.0, mass_kg=200.0),
    sun=True,
    moon=True,
)


def chief(height_km=500.0, e=0.0005, inclination_deg=51.6):
    return Kepler(
        epoch_utc=START,
        semi_major_axis_km=6378.137 + height_km,
        eccentricity=e,
        inclination_deg=inclination_deg,
        raan_deg=40.0,
        argument_of_perigee_deg=15.0,
        true_anomaly_deg=30.0,
    )


def hop(duration_s=2700.0):
    return Hop(relative_to="t", from_m=(0.0, -5000.0, 0.0), to_m=(0.0, -300.0, 0.0), duration_s=duration_s)


def miss_m(plan, guidance=None, around=None, **more):
    flight = Flown(plan=plan, forces=more.pop("forces", REAL), guidance=guidance, **more).fly(START, around or chief())
    return float(np.linalg.norm(flight.find_miss_m()))


@pytest.mark.parametrize(
    ("around", "duration_s"),
    [
        (chief(e=0.001), 2700.0),
        pytest.param(chief(e=0.001), 5677.0, marks=pytest.mark.slow),
        (chief(35_786.0, inclination_deg=0.05), 39_600.0),
        (chief(2000.0, e=0.1), 2700.0),
    ],
)
def test_a_hop_of_five_kilometres_ends_within_a_metre_once_corrected(around, duration_s):
    plan = hop(duration_s)
    assert miss_m(plan, None, around) > 5.0
    # one correction on the way, by forces that are known: what is left is where the search ends
    assert miss_m(plan, TwoImpulseGuidance(at_s=(0.4 * duration_s,)), around) < 1e-3
    # J2 alone is known: a second correction is for the rest
    assert miss_m(plan, TwoImpulseGuidance(at_s=(0.4 * duration_s, 0.8 * duration_s), forces=Forces()), around) < 1.0


def test_clohessy_wiltshire_needs_several_corrections():
    once, often = (
        TwoImpulseGuidance(at_s=at_s, model="clohessy_wiltshire") for at_s in ((1350.0,), (900.0, 1800.0, 2430.0))
    )
    assert miss_m(hop(), often) < 1.0 < miss_m(hop(), once)


def test_arrival_matches_the_velocity_of_the_plan():
    guidance = TwoImpulseGuidance(at_s=(1350.0,))
    flight = Flown(plan=hop(), forces=REAL, guidance=guidance).fly(START, chief())
    velocity = flight.relative(np.array([2700.0]))[1][0]
    np.testing.assert_allclose(velocity, 0.0, atol=1e-6)  # the plan is at rest there
    assert [one.time_s for one in flight.list_commands(2700.0)] == [0.0, 1350.0, 2700.0]


def test_every_transfer_of_waypoints_is_corrected():
    way = Waypoints(
        relative_to="t",
        positions_m=((0.0, -3000.0, 0.0), (-200.0, -1500.0, 100.0), (0.0, -500.0, 0.0)),
        times_s=(0.0, 1500.0, 3000.0),
    )
    flight = Flown(plan=way, forces=REAL, guidance=TwoImpulseGuidance(every_s=700.0)).fly(START, chief())
    at = np.array([1500.0, 3000.0])
    assert np.linalg.norm(flight.relative(at)[0] - way.positions_m[1:], axis=1).max() < 1e-3


@pytest.mark.slow
def test_a_held_path_is_followed_with_noise_of_navigation():
    """Corrections every two minutes hold it to a few times the noise of navigation; without them it drifts off."""
    line = VBarApproach(relative_to="t", from_m=-1000.0, to_m=-100.0, duration_s=5000.0)
    assert miss_m(line) > 3.0
    known = NavigationErrors(position_sigma_m=0.05, velocity_sigma_m_s=1e-4)
    assert miss_m(line, TwoImpulseGuidance(every_s=120.0), navigation=known, seed=1) < 0.5


@pytest.mark.slow
def test_an_endless_hold_is_corrected_as_long_as_it_is_asked_for():
    stay = StationKeeping(relative_to="t", position_m=(0.0, -200.0, 0.0))
    begin = RelativeStart(position_m=(5.0, -210.0, 2.0), velocity_m_s=(0.0, 0.01, 0.0))
    flight = Flown(plan=stay, forces=REAL, start=begin, guidance=TwoImpulseGuidance(every_s=300.0)).fly(START, chief())
    late = flight.relative(np.linspace(600.0, 8000.0, 75))[0]
    assert np.linalg.norm(late - stay.position_m, axis=1).max() < 0.1
    free = Flown(plan=stay, forces=REAL, start=begin).fly(START, chief()).relative(np.array([8000.0]))[0][0]
    assert np.linalg.norm(free - stay.position_m) > 50.0


def test_a_free_ellipse_is_led_back_to_itself():
    round_ = Circumnavigation(relative_to="t", radial_m=100.0)
    guidance = TwoImpulseGuidance(every_s=1000.0)
    flight = Flown(plan=round_, forces=REAL, guidance=guidance).fly(START, chief())
    at = np.arange(2000.0, 7000.0, 1000.0)  # the last correction is in the second revolution
    off = flight.relative(at)[0] - flight.plan.relative(at)[0]
    assert np.linalg.norm(off, axis=1).max() < 1e-3


def test_a_horizon_keeps_a_long_leg_near_its_plan():
    """Three revolutions before the next leg: aimed at their end, a correction lets the path stray on the way."""
    period_s = 5677.0
    ellipse = CircumnavigationLeg(radial_m=100.0, cross_track_m=50.0, until=AfterTime(duration_s=3.0 * period_s))
    rounds = Sequence(relative_to="t", legs=[ellipse, HopLeg(to_m=(0.0, -500.0, 0.0), duration_s=2500.0)])
    plan = rounds.plan(START, chief())
    time_s = np.linspace(period_s, 2.9 * period_s, 100)

    def stray_m(horizon_s):
        guidance = TwoImpulseGuidance(every_s=2500.0, horizon_s=horizon_s)
        flight = Flown(plan=rounds, forces=Forces(), guidance=guidance).fly(START, chief())
        return float(np.linalg.norm(flight.relative(time_s)[0] - plan.relative(time_s)[0], axis=1).max())

    # e = 0.0005 moves an ellipse of 200 m by some 3 e n t 200 m: 0.8 m in 2500 s, against several in three revolutions
    assert stray_m(2500.0) < 1.0
    assert stray_m(None) > 3.0


def test_an_update_waits_for_the_end_of_a_burn():
    """Each correction arrives at the instant of the next one. Asked within that burn, guidance would make it up twice."""
    guidance = TwoImpulseGuidance(every_s=1500.0, horizon_s=1500.0)
    ellipse = Circumnavigation(relative_to="t", radial_m=100.0, cross_track_m=50.0, duration_s=9000.0)
    slow = Thrusters(acceleration_m_s2=2e-3)  # some 10 s for 2 cm/s
    flights = [Flown(plan=ellipse, forces=Forces(), guidance=guidance, thrusters=one).fly(START, chief())
               for one in (Thrusters(), slow)]  # fmt: skip
    exact, finite = (sum(one.size_m_s for one in flight.list_commands(9000.0)) for flight in flights)
    assert finite == pytest.approx(exact, rel=0.1)
    burns = flights[1].list_maneuvers(9000.0)
    assert len(burns) > 5
    assert all(before.edges_s[-1] <= after.edges_s[0] + 1e-9 for before, after in itertools.pairwise(burns))
    assert np.linalg.norm(flights[1].find_miss_m()) < 1.0


def test_corrections_replaced_near_half_a_revolution_amplify_errors_across_the_track():
    """With n = 1.107e-3 rad/s: sin(n 800 s) / sin(n 2600 s) = 2.97; the flight multiplies the error as `check` says."""
    start = RelativeStart(position_m=(0.0, -500.0, 1.0), velocity_m_s=(0.0, 0.0, 0.0))
    plan = StationKeeping(relative_to="t", position_m=(0.0, -500.0, 0.0))
    perch = Sequence(relative_to="t", legs=[PerchLeg(along_track_m=-500.0, until=AfterTime(duration_s=9000.0)), plan])

    def fly(horizon_s):
        motion = Flown(
            plan=perch, forces=Forces(zonal_degree=0), start=start,
            guidance=TwoImpulseGuidance(every_s=1800.0, horizon_s=horizon_s),
        )  # fmt: skip
        epochs = Epochs(START, np.array([1800.0, 3600.0]))
        return motion.relative(epochs, chief(e=0.0))[0][:, 2], motion.validity(epochs, chief(e=0.0))

    (before, after), (line,) = fly(2600.0)
    assert abs(after / before) == pytest.approx(2.97, rel=0.01)
    assert "by 2.97; make horizon_s shorter than a quarter of a revolution, 1419 s" in line
    (before, after), lines = fly(1400.0)
    assert abs(after) < abs(before)
    assert not lines


def test_errors_of_burns_leave_what_they_must():
    """After the last correction, an error of its burn grows freely until arrival: position sigma about s T for a short T."""
    poor = Thrusters(magnitude_sigma_m_s=2e-3, pointing_sigma_m_s=2e-3)
    ends = []
    for seed in range(24):
        motion = Flown(
            plan=hop(), forces=POINT, guidance=TwoImpulseGuidance(at_s=(1500.0, 2400.0)), thrusters=poor, seed=seed
        )
        ends.append(motion.fly(START, chief()).find_miss_m())
    rms = math.sqrt(np.mean(np.square(ends)))
    assert rms == pytest.approx(2e-3 * 300.0, rel=5.0 / math.sqrt(2.0 * 3 * 24))


def test_finite_burns_are_corrected():
    slow = Thrusters(acceleration_m_s2=0.02, rise_s=0.5, fall_s=0.5)
    assert miss_m(hop(), thrusters=slow) > 50.0  # the first burn cannot begin before the start, so it comes late
    assert miss_m(hop(), TwoImpulseGuidance(at_s=(300.0, 2400.0)), thrusters=slow) < 1.0


def test_a_correction_that_is_too_small_is_not_made():
    flight = Flown(plan=hop(), forces=REAL, guidance=TwoImpulseGuidance(at_s=(1350.0,), least_m_s=1.0)).fly(
        START, chief()
    )
    assert [one.time_s for one in flight.list_commands(3000.0)] == [0.0, 2700.0]


@dataclass(frozen=True)
class Brake:
    """A user's own guidance: stop relative to the body at one instant, and forget the plan."""

    at_s: float
    answer: object = None

    def next_s(self, after_s):
        return self.at_s if after_s < self.at_s else math.inf

    def replan(self, update):
        return [PlannedImpulse(update.time_s, -update.velocity_m_s)] if self.answer is None else self.answer


def test_a_users_own_guidance_flies():
    assert isinstance(Brake(100.0), Guidance)
    flight = Flown(plan=hop(), forces=REAL, guidance=Brake(600.0)).fly(START, chief())
    before, after = flight.relative(np.array([599.9, 600.0]))[1]
    assert np.linalg.norm(before) > 1.0
    np.testing.assert_allclose(after, 0.0, atol=1e-6)
    assert len(flight.list_commands(4000.0)) == 2


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (3.0, "return a list of PlannedImpulse"),
        ((PlannedImpulse(10.0, np.zeros(3)),), "from 600 s on"),
        ((PlannedImpulse(700.0, np.zeros(2)),), "with 3 numbers"),
        ((PlannedImpulse(700.0, np.full(3, np.nan)),), "with 3 numbers"),
        ((PlannedImpulse(700.0, np.full(3, 1e5)),), "correct it"),
    ],
)
def test_what_a_users_guidance_must_not_answer(answer, message):
    flight = Flown(plan=hop(), forces=REAL, guidance=Brake(600.0, answer)).fly(START, chief())
    with pytest.raises(ScenarioError, match=message):
        flight.relative(np.array([1000.0]))
