"""The error of interpolation in a table of states, estimated without the truth."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Drag, Epochs, Forces, Kepler, Numerical, State, convert_states
from rso_lidar.orbit.ccsds.ephemeris_arc import EphemerisArc
from rso_lidar.orbit.ccsds.interpolation_error import check_row_spacing, estimate_errors

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def orbit(axis_km=6778.0, eccentricity=0.001):
    return Kepler(
        epoch_utc=START,
        semi_major_axis_km=axis_km,
        eccentricity=eccentricity,
        inclination_deg=51.6,
        raan_deg=30.0,
        argument_of_perigee_deg=10.0,
        true_anomaly_deg=0.0,
    )


def real(motion):
    drag = Drag(area_m2=10.0, mass_kg=500.0)
    return Numerical(initial=motion, forces=Forces(zonal_degree=6, sun=True, moon=True, drag=drag))


def make_arc(motion, step_s, last_s, with_velocity=True, frame="gcrs"):
    time_s = np.arange(0.0, last_s + 1.0, step_s)
    epochs = Epochs(START, time_s)
    states = convert_states(motion.states(epochs), epochs, to_axes=frame)
    velocity = states.velocity_m_s if with_velocity else None
    return EphemerisArc("some.oem: line 4", START, 0.0, time_s[-1], time_s, states.position_m, velocity, frame)


def true_errors(arc, motion, method, degree):
    middle_s = 0.5 * (arc.time_s[1:] + arc.time_s[:-1])
    epochs = Epochs(START, middle_s)
    truth = convert_states(motion.states(epochs), epochs, to_axes=arc.frame)
    return np.linalg.norm(arc.interpolate(middle_s, method, degree)[0] - truth.position_m, axis=1)


@pytest.mark.parametrize(
    ("motion", "step_s", "with_velocity", "method", "degree", "frame"),
    [
        (orbit(), 60.0, True, "hermite", 3, "gcrs"),
        (orbit(), 600.0, True, "hermite", 7, "gcrs"),
        (orbit(), 300.0, False, "lagrange", 7, "gcrs"),
        (real(orbit()), 60.0, True, "hermite", 3, "itrs"),
        (real(orbit()), 600.0, True, "hermite", 7, "teme"),
        (real(orbit()), 1800.0, True, "hermite", 7, "gcrs"),
        (real(orbit()), 300.0, False, "lagrange", 7, "itrs"),
        (real(orbit(26_600.0, 0.73)), 300.0, True, "hermite", 7, "gcrs"),
    ],
)
def test_the_estimate_is_the_error(motion, step_s, with_velocity, method, degree, frame):
    # 5 %: what J3 to J6, drag, Sun and Moon do to the comparison
    arc = make_arc(motion, step_s, 7200.0, with_velocity, frame)
    errors = estimate_errors(arc, method, degree)
    true_m = true_errors(arc, motion, method, degree)
    assert errors.off_m.max() == pytest.approx(true_m.max(), rel=0.05)
    assert np.all(np.abs(errors.off_m - true_m[errors.first]) < errors.doubt_m + 0.05 * true_m.max())


@pytest.mark.parametrize(
    ("last_s", "with_velocity", "degree", "expected_m"),
    [(60.0, True, 7, 0.38), (300.0, True, 5, 0.014), (60.0, False, 1, 3914.0)],
)
def test_two_rows_and_few_rows_have_an_estimate(last_s, with_velocity, degree, expected_m):
    # r (n h)^4 / 384 of the cubic through two rows, and the sagitta r (n h)^2 / 8 of the chord
    arc = make_arc(orbit(), 60.0, last_s, with_velocity)
    method, order = ("lagrange", degree) if degree < 7 else arc.choose(None, degree)
    assert estimate_errors(arc, method, order).off_m.max() == pytest.approx(expected_m, rel=0.05)


@pytest.mark.parametrize(
    ("motion", "step_s", "with_velocity"),
    [
        (orbit(), 300.0, True),
        (real(orbit()), 300.0, True),
        (real(orbit()), 60.0, True),
        (real(orbit()), 60.0, False),
        (real(orbit(42_164.0)), 1800.0, True),
        (real(orbit(26_600.0, 0.73)), 60.0, False),
    ],
)
def test_good_tables_are_not_warned_of(motion, step_s, with_velocity):
    assert check_row_spacing([make_arc(motion, step_s, 14_400.0, with_velocity)], None, None) == ""


def test_rows_printed_to_a_metre_are_not_warned_of():
    # The rounding of positions to 1 m and of velocities to 1 mm/s shows as a miss, of which the estimate is in doubt
    arc = make_arc(real(orbit()), 60.0, 14_400.0)
    coarse = EphemerisArc(
        arc.where, START, 0.0, arc.end_s, arc.time_s, arc.position_m.round(), arc.velocity_m_s.round(3)
    )
    errors = estimate_errors(coarse, "hermite", 7)
    assert np.max(errors.off_m - errors.doubt_m) < 0.5


@pytest.mark.parametrize(
    ("step_s", "with_velocity"), [(1800.0, True), (3600.0, True), (86_400.0, True), (3600.0, False)]
)
def test_what_is_no_orbit_is_refused(step_s, with_velocity):
    with pytest.raises(ScenarioError, match=r"some.oem: line 4: (interpolation is off|no orbit can)") as error:
        check_row_spacing([make_arc(orbit(), step_s, 5 * step_s, with_velocity)], None, None)
    assert "\n" not in str(error.value) and f"{step_s:g} s later; take a finer table" in str(error.value)


def test_the_edges_that_useable_times_cut_off_are_not_judged():
    arc = make_arc(orbit(), 600.0, 7200.0)
    inner = EphemerisArc(arc.where, START, 2400.0, 4800.0, arc.time_s, arc.position_m, arc.velocity_m_s)
    errors = estimate_errors(inner, "hermite", 7)
    assert errors.first.tolist() == [4, 5, 6, 7]
    assert errors.off_m.max() < 0.5 * estimate_errors(arc, "hermite", 7).off_m.max()


def test_a_burn_between_rows_is_found_beside_it():
    before, after = make_arc(orbit(), 60.0, 3600.0), make_arc(orbit(), 60.0, 3600.0)
    late = after.time_s > 1810.0
    kicked = Kepler(**{**orbit().model_dump(), "semi_major_axis_km": 6788.0}).states(Epochs(START, after.time_s))
    position, velocity = before.position_m.copy(), before.velocity_m_s.copy()
    position[late] += kicked.position_m[late] - kicked.position_m[late][0] - (position[late] - position[late][0])
    velocity[late] = kicked.velocity_m_s[late]
    arc = EphemerisArc(before.where, START, 0.0, 3600.0, before.time_s, position, velocity)
    remark = check_row_spacing([arc], None, None)
    assert "12:31:00" in remark and "begin a new segment at each burn" in remark


def test_a_burn_at_a_row_is_named_though_the_error_is_greatest_beside_it():
    """The row at 300 s is of the orbit before, and shows no burn to the interval that ends there."""
    arc = make_arc(orbit(), 60.0, 600.0)
    rest = Epochs(START, arc.time_s[6:])
    at_burn = arc.position_m[5], arc.velocity_m_s[5] + np.array([0.0, 50.0, 0.0])
    after = State(
        epoch_utc=START + datetime.timedelta(seconds=300), position_m=at_burn[0], velocity_m_s=at_burn[1]
    ).states(rest)
    position, velocity = arc.position_m.copy(), arc.velocity_m_s.copy()
    position[6:], velocity[6:] = after.position_m, after.velocity_m_s
    flown = EphemerisArc(arc.where, START, 0.0, 600.0, arc.time_s, position, velocity)
    remark = check_row_spacing([flown], None, None)
    assert "12:04:00" in remark and "begin a new segment at each burn" in remark


def test_of_many_intervals_the_longest_is_judged():
    arc = make_arc(orbit(), 10.0, 60_000.0)
    keep = np.delete(np.arange(len(arc.time_s)), np.arange(3001, 3100))  # a gap of 1000 s
    gap = EphemerisArc(arc.where, START, 0.0, arc.end_s, arc.time_s[keep], arc.position_m[keep], arc.velocity_m_s[keep])
    errors = estimate_errors(gap, "hermite", 7)
    worst = int(np.argmax(errors.off_m))
    assert len(errors.first) <= 4096 and errors.first[worst] == 3000
    assert errors.off_m[worst] > 1.0
