"""Screening: nothing that a fine grid of SGP4 finds is missed, and every minimum, entry and exit is where it should be."""

import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit import Catalog, ElementSet, Fleet, screen
from rso_lidar.orbit.screening.orbit_bounds import OrbitBounds, _group_by_span

EPOCH = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
START = EPOCH + datetime.timedelta(hours=5, seconds=0.25)


def elements(number, turns, e=0.001, i=53.0, raan=10.0, argument=20.0, anomaly=0.0, bstar=1e-5):
    """Return an element set from mean elements [rev/day, deg]."""
    return ElementSet(
        name=f"OBJECT {number}",
        norad_id=number,
        epoch_utc=EPOCH,
        mean_motion_rev_day=turns,
        eccentricity=e,
        inclination_deg=i,
        raan_deg=raan % 360.0,
        argument_of_perigee_deg=argument % 360.0,
        mean_anomaly_deg=anomaly % 360.0,
        bstar_per_earth_radius=bstar,
    )


LEO = elements(1, 15.2)
GEO = elements(2, 1.00273, e=0.0002, i=0.05, raan=80.0, argument=0.0, anomaly=30.0)
GTO = elements(3, 2.27, e=0.727, i=7.0, argument=180.0, anomaly=0.0)


def fleet():
    """Return some 330 objects: crossing, nearly equal, in formation, eccentric, resonant, neighbours at GEO."""
    rng = np.random.default_rng(20260507)
    sets = []

    def add(count, **spread):
        for _ in range(count):
            drawn = {name: float(rng.uniform(*ends)) for name, ends in spread.items()}
            sets.append(elements(1000 + len(sets), **drawn))

    around = {"raan": (0.0, 360.0), "argument": (0.0, 360.0), "anomaly": (0.0, 360.0)}
    add(110, turns=(15.1, 15.35), e=(0.0001, 0.003), i=(40.0, 100.0), **around)
    # nearly the orbit of LEO, a degree of phase is 120 km: drifting by, and grazing the limit
    near = {"raan": (9.0, 11.0), "argument": (19.0, 21.0), "anomaly": (-2.0, 2.0), "i": (52.5, 53.5)}
    add(50, turns=(15.19, 15.21), e=(0.0005, 0.0015), **near)
    # formations about LEO and GEO that stay within the limit all day
    add(
        12,
        turns=(15.2, 15.2),
        e=(0.0009, 0.0011),
        i=(52.98, 53.02),
        raan=(9.98, 10.02),
        argument=(20, 20),
        anomaly=(-0.1, 0.1),
    )
    add(25, turns=(1.0026, 1.0028), e=(0.0, 0.0005), i=(0.0, 0.1), raan=(79, 81), argument=(-1, 1), anomaly=(29, 31))
    add(60, turns=(2.0, 2.6), e=(0.70, 0.74), i=(0.0, 30.0), **around)
    add(30, turns=(2.265, 2.275), e=(0.725, 0.729), i=(6.5, 7.5), raan=(9, 11), argument=(179, 181), anomaly=(-6, 6))
    add(20, turns=(2.004, 2.008), e=(0.68, 0.74), i=(62.0, 65.0), **around)  # resonant, Molniya
    add(15, turns=(1.9, 2.1), e=(0.0, 0.02), i=(54.0, 56.0), **around)
    add(10, turns=(15.9, 16.2), e=(0.0, 0.005), i=(30.0, 98.0), bstar=(1e-4, 5e-3), **around)  # soon to decay
    return sets


def on_a_grid(follower, objects, duration_s, step_s):
    """Return ranges [m] (object, time) of SGP4 on a fine grid, by the library alone."""
    from sgp4.api import SatrecArray

    time_s = np.arange(0.0, duration_s + 1e-6, step_s)
    since = (START - EPOCH).total_seconds() + time_s
    dates = np.full(time_s.shape, 2_461_167.5), since / 86_400.0  # JD of 2026-05-07
    _, lead, _ = SatrecArray([follower.satrec()]).sgp4(*dates)
    ranges = np.empty((len(objects), len(time_s)))
    for begin in range(0, len(objects), 50):
        error, position, _ = SatrecArray([entry.satrec() for entry in objects[begin : begin + 50]]).sgp4(*dates)
        apart = np.linalg.norm(position - lead, axis=2) * 1e3
        ranges[begin : begin + 50] = np.where(error == 0, apart, np.nan)
    return time_s, ranges


def held_against_the_grid(found, objects, time_s, ranges, within_m):
    """Assert that stays and minima agree with the grid, point by point, and return how many minima it has."""
    step_s = time_s[1] - time_s[0]
    inside = np.zeros(ranges.shape, dtype=bool)
    minima = {k: [] for k in range(len(objects))}
    for stay in found.approaches:
        inside[stay.which] |= (time_s >= stay.enter_s) & (time_s <= stay.leave_s)
        minima[stay.which] += stay.minima_s.tolist()
    # a point on the limit itself may fall on either side: the entry is good to 0.1 ms, at 15 km/s 1.5 m
    with np.errstate(invalid="ignore"):
        clear = np.abs(ranges - within_m) > 2.0
        expected = ranges <= within_m
        assert np.array_equal(inside & clear, expected & clear)
        dips = (ranges[:, 1:-1] < ranges[:, :-2]) & (ranges[:, 1:-1] <= ranges[:, 2:]) & (ranges[:, 1:-1] < within_m)
    for k, at in zip(*np.nonzero(dips), strict=True):
        nearest = min((abs(time - time_s[at + 1]) for time in minima[k]), default=np.inf)
        assert nearest <= step_s + 1e-3, f"{objects[k].label} at {time_s[at + 1]} s is missed"
    return int(dips.sum())


@pytest.mark.parametrize(
    ("follower", "within_m"),
    [
        (LEO, 150e3),
        pytest.param(GEO, 300e3, marks=pytest.mark.slow),
        pytest.param(GTO, 600e3, marks=pytest.mark.slow),
        (LEO, 3e3),
    ],
)
def test_nothing_is_missed_that_a_fine_grid_finds(follower, within_m):
    objects, duration_s = fleet(), 8 * 3600.0 + 7.0
    found = screen(follower, objects, START, duration_s, within_m)
    time_s, ranges = on_a_grid(follower, objects, duration_s, 5.0)
    count = held_against_the_grid(found, objects, time_s, ranges, within_m)
    least = {150e3: 60, 300e3: 2, 600e3: 8, 3e3: 1}[within_m]
    assert count >= least, "the test has too little to find"
    for stay in found.approaches:
        assert np.all(stay.minima_m <= within_m)
        assert np.all(np.diff(stay.minima_s) > 0)
        assert stay.entered == (stay.enter_s > 0.0)
        assert stay.left == (stay.leave_s < duration_s)


@pytest.mark.parametrize("step_s", [300.0, 600.0])
def test_an_encounter_that_the_cubic_misses_is_found_by_its_error_bound(step_s):
    """A transfer orbit meets a circular one at its perigee, half a metre apart, limit 20 m, wherever the grid falls.

    At perigee the fourth derivative is (1 + 3 e) mu^2 / r^5, on the circle mu^2 / r^5, both along r: the cubic errs
    by h^4 / 384 times their difference, 0.5 km for h = 300 s, and without a bound nothing would come within the limit.
    """
    follower = elements(1, 15.984746, raan=12.1581, anomaly=3.4391)
    there = elements(3, 2.27, e=0.727, argument=40.0)
    h4, r_m = step_s**4, 6.647e6
    assert 3.0 * 0.727 * 3.986e14**2 / r_m**5 * h4 / 384.0 > 500.0  # m: far outside the limit
    for phase in (0.0, 0.2, 0.45, 0.5, 0.7):
        begin = START + datetime.timedelta(seconds=20064.002 - (2.0 + phase) * step_s)
        (stay,) = screen(follower, [there], begin, 5.0 * step_s, 20.0, step_s).approaches
        assert stay.time_s == pytest.approx((2.0 + phase) * step_s, abs=2e-3)
        assert stay.range_m < 1.0


def test_minima_and_edges_are_good_to_the_millisecond():
    objects, within_m = fleet(), 150e3
    found = screen(LEO, objects, START, 6 * 3600.0, within_m)
    lead, others = found.follower, found.objects
    checked = 0
    for stay in found.approaches:

        def apart_m(times, which=stay.which):
            which = np.full(len(times), which)
            return np.linalg.norm(others.at(which, times)[0] - lead.at(np.zeros_like(which), times)[0], axis=1)

        # a central difference over 10 ms changes its sign within a millisecond of the minimum; slow ones are flatter than
        # float64 can tell (range 1e-9 m, speed squared over range is how fast the rate turns)
        for at in stay.minima_s[(stay.minima_s > 0.02) & (stay.minima_s < 6 * 3600.0 - 0.02)]:
            around = apart_m(at + np.array([-0.011, 0.009, -0.009, 0.011, -5.0, 0.0, 5.0]))
            assert around[5] <= around[4] + 1e-6 and around[5] <= around[6] + 1e-6
            if around[4] + around[6] - 2 * around[5] > 25.0:  # turns by more than 1 m/s^2: a real crossing
                assert around[1] < around[0] and around[3] > around[2]
                checked += 1
        ends = [(stay.enter_s, stay.entered), (stay.leave_s, stay.left)]
        for edge in [time for time, crossed in ends if crossed]:
            before, after = apart_m(np.array([edge - 1e-3, edge + 1e-3]))
            assert (before - within_m) * (after - within_m) <= 0.0
    assert checked > 15


def test_a_formation_is_one_long_stay_with_several_minima():
    mate = elements(10, 15.2, e=0.0011, anomaly=0.02)
    (stay,) = screen(LEO, [mate], START, 86_400.0, 50e3).approaches
    assert (stay.enter_s, stay.leave_s, stay.entered, stay.left) == (0.0, 86_400.0, False, False)
    assert 14 <= len(stay.minima_s) <= 32  # a relative ellipse is nearest once or twice in each of 15.2 revolutions


@pytest.mark.parametrize("i", [0.0, 53.0])
def test_of_equal_minima_the_first_counts(i):
    """One craft behind another on a circle without drag: each revolution has the same minima, and rounding ranks them.

    The time is the first minimum's however the anomaly is moved by 1e-9 deg. Over the equator the range varies by
    millimetres only, so that rounding moves a minimum itself, by seconds.
    """
    found = []
    for moved in (0.0, 1e-9, -1e-9, 2e-9):
        one, two = (elements(k, 15.0, e=0.0, i=i, bstar=0.0, anomaly=k * (0.01 + moved)) for k in (0, 1))
        (stay,) = screen(one, [two], START, 43200.0, 50e3).approaches
        lowest = stay.minima_m <= stay.minima_m.min() + 1e-3
        assert lowest.sum() >= 7 and stay.time_s == stay.minima_s[lowest][0]
        found.append(stay.time_s)
    assert np.ptp(found) < (30.0 if i == 0.0 else 0.1)


def test_the_same_elements_twice_are_one_stay_at_range_zero():
    twin = elements(11, 15.2)
    (stay,) = screen(LEO, [twin], START, 7200.0, 1e3).approaches
    assert stay.range_m == 0.0
    assert (stay.enter_s, stay.leave_s) == (0.0, 7200.0)


def test_a_dip_at_the_edge_of_the_span_counts():
    objects = fleet()
    whole = screen(LEO, objects, START, 4 * 3600.0, 150e3)
    stay = next(stay for stay in whole.approaches if stay.entered and stay.left and stay.leave_s - stay.enter_s > 4.0)
    cut = screen(LEO, [whole.objects.elements(stay.which, 0.0)], START, stay.time_s - 1.0, 150e3)
    last = cut.approaches[-1]
    assert not last.left
    assert last.time_s == pytest.approx(stay.time_s - 1.0)  # nearest where the span ends


def test_the_size_of_the_step_changes_nothing():
    objects = fleet()
    coarse, fine = (screen(LEO, objects, START, 4 * 3600.0, 60e3, step_s=step) for step in (300.0, 40.0))
    assert [stay.which for stay in coarse.approaches] == [stay.which for stay in fine.approaches]
    for a, b in zip(coarse.approaches, fine.approaches, strict=True):
        assert a.range_m == pytest.approx(b.range_m, abs=1e-3)
        assert a.enter_s == pytest.approx(b.enter_s, abs=2e-3)


def test_shells_and_speeds_contain_what_is_flown():
    objects, duration_s = fleet(), 86_400.0
    flown = Fleet(objects, START)
    bounds = OrbitBounds(flown, np.arange(len(objects)), np.tile([0.0, duration_s], (len(objects), 1)))
    position, velocity, _ = flown.grid(np.arange(len(objects)), np.arange(0.0, duration_s, 97.0))
    radius, speed = np.linalg.norm(position, axis=2), np.linalg.norm(velocity, axis=2)
    whole = ~np.isnan(radius).any(axis=1)
    assert whole.sum() > 300
    # 20 km are left of the margin of 50
    assert np.all(radius[whole].min(axis=1) > bounds.perigee_m[whole] + 20e3)
    assert np.all(radius[whole].max(axis=1) < bounds.apogee_m[whole] - 20e3)
    assert np.all(speed[whole].max(axis=1) < bounds.speed_m_s[whole])
    # Beyond the margin of 50 km and the spread of osculating apogees, what J2 may add: 4 J2 R² a² / q³.
    axis = 1.0 / (2.0 / radius - speed**2 / units.EARTH_GM_M3_S2)
    e = np.linalg.norm(
        np.cross(velocity, np.cross(position, velocity)) / units.EARTH_GM_M3_S2 - position / radius[..., None], axis=2
    )
    apogee, perigee = (axis * (1.0 + e))[whole], (axis * (1.0 - e))[whole]
    added = bounds.apogee_m[whole] - apogee.max(axis=1) - np.ptp(apogee, axis=1) - 50e3
    q, a = perigee.min(axis=1), 0.5 * (perigee.min(axis=1) + apogee.max(axis=1))
    expected = 4.0 * units.EARTH_J2 * units.EARTH_RADIUS_M**2 * a**2 / q**3
    assert np.median(np.abs(added / expected - 1.0)) < 0.1


def test_rows_of_other_spans_than_the_widest_are_in_lots_too():
    lots = _group_by_span(np.array([[0.0, 10.0], [0.0, 5.0], [0.0, 10.0], [5.0, 10.0]]))
    assert [lot.tolist() for lot in lots] == [[0, 2], [1, 3]]


def test_what_decays_is_listed_and_the_rest_is_used():
    doomed = elements(20, 16.45, e=0.0005, bstar=0.05)
    found = screen(LEO, [doomed, elements(21, 15.2, anomaly=0.05)], START, 5 * 86_400.0, 50e3)
    ((label, why),) = found.rejected
    assert label == doomed.label
    assert "by 2026-05-" in why
    assert {stay.which for stay in found.approaches} == {1}


def test_a_follower_that_decays_is_told():
    with pytest.raises(PropagationError, match=r"follower OBJECT 20 .*SGP4 has no state at 2026-05-.*shorter span"):
        screen(elements(20, 16.45, e=0.0005, bstar=0.05), [LEO], START, 5 * 86_400.0, 50e3)


def test_no_objects_no_stays():
    assert screen(LEO, [], START, 600.0, 50e3).approaches == ()


def test_a_real_catalogue_against_a_grid_of_five_seconds(shared):
    catalog = Catalog.from_file(shared / "tle" / "catalogs" / "celestrak_active_2026-05-07.tle")
    follower = next(entry for entry in catalog if entry.norad_id == 31698)
    objects = [entry for entry in catalog if entry.norad_id != 31698][::12]
    found = screen(follower, objects, START, 4 * 3600.0, 100e3)
    time_s, ranges = on_a_grid(follower, objects, 4 * 3600.0, 5.0)
    assert held_against_the_grid(found, objects, time_s, ranges, 100e3) >= 5
