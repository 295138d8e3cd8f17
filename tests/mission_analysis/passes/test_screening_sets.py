"""Screening with several element sets per object: held against fine grids over trajectories of the nearest sets."""

import datetime
import itertools
import warnings

import numpy as np
import pytest

from rso_lidar.errors import PropagationError
from rso_lidar.mission_analysis.passes.encounter_figure import encounter_figure
from rso_lidar.orbit import Catalog, ElementSet, Epochs, SetSequence, screen
from rso_lidar.orbit.sets.teme import propagate_in_teme
from rso_lidar.study import encounters, scenario_text

EPOCH = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
START = EPOCH + datetime.timedelta(hours=5, seconds=0.25)
DAY_S = 86_400.0


def elements(number, hours=0.0, turns=15.2, e=0.001, i=53.0, raan=10.0, argument=20.0, anomaly=0.0):
    """Return an element set whose epoch is some hours after EPOCH, of mean elements [rev/day, deg] there."""
    return ElementSet(
        name=f"OBJECT {number}",
        norad_id=number,
        epoch_utc=EPOCH + datetime.timedelta(hours=hours),
        mean_motion_rev_day=turns,
        eccentricity=e,
        inclination_deg=i,
        raan_deg=raan % 360.0,
        argument_of_perigee_deg=argument % 360.0,
        mean_anomaly_deg=anomaly % 360.0,
        bstar_per_earth_radius=1e-5,
    )


def several(rng, number, count, **about):
    """Return sets of one object, some hours apart, each off the motion of the first by some kilometres."""
    hours = np.sort(rng.uniform(-6.0, 40.0, count))
    # secular rates of J2 [deg/day], Vallado, Fundamentals of Astrodynamics, 4th ed., 9-38 and 9-40: a = 1.079 R there
    cosine = np.cos(np.radians(about["i"]))
    j2 = 0.75 * 1.0826e-3 / 1.079**2 * 360.0 * 15.2
    turned = {"raan": -2.0 * j2 * cosine, "argument": j2 * (5.0 * cosine**2 - 1.0), "anomaly": 360.0 * 15.2}
    made = []
    for at in hours.tolist():
        angles = {name: value + turned.get(name, 0.0) * at / 24.0 for name, value in about.items()}
        angles["i"] += float(rng.normal(0.0, 0.005))
        angles["anomaly"] += float(rng.normal(0.0, 0.005))
        made.append(elements(number, hours=at, **angles))
    return made


def crowd(seed):
    """Return a follower of seven sets and 60 objects of one to nine: in formation, drifting by, crossing."""
    rng = np.random.default_rng(seed)
    own = several(rng, 1, 7, i=53.0, raan=10.0, argument=20.0, anomaly=0.0)
    objects = []
    for k in range(60):
        wide = k >= 40  # the last cross
        about = {
            "i": float(rng.uniform(45.0, 100.0) if wide else rng.uniform(52.99, 53.01)),
            "raan": float(rng.uniform(0.0, 360.0) if wide else rng.uniform(9.9, 10.1)),
            "argument": 20.0,
            "anomaly": float(rng.uniform(0.0, 360.0) if wide else rng.uniform(-0.3, 0.3)),
        }
        objects.append(several(rng, 100 + k, int(rng.integers(1, 10)), **about))
    return own, objects


def flown(sets, start_utc, time_s):
    """Return positions [m] (time, 3) of the set nearest in epoch at each instant, TEME axes, and its number."""
    trajectory, epochs = SetSequence(tuple(sets)), Epochs(start_utc, time_s)
    number, position = trajectory.which(epochs), np.empty((len(time_s), 3))
    for k in np.unique(number):
        position[number == k] = propagate_in_teme(trajectory.sets[k], epochs.at(number == k))[0]
    return position, number


def held_against_the_grid(found, own, objects, start_utc, duration_s, within_m, step_s=5.0):
    """Assert that stays and minima agree with a grid, and return how many minima and how many jumps in stays it has."""
    time_s = np.arange(0.0, duration_s + 1e-6, step_s)
    lead, leads = flown(own, start_utc, time_s)
    count = jumps = 0
    for number, sets in enumerate(objects):
        position, which = flown(sets, start_utc, time_s)
        apart = np.linalg.norm(position - lead, axis=1)
        stays = [stay for stay in found.approaches if stay.which == number]
        stays.sort(key=lambda stay: stay.enter_s)
        inside = np.zeros(len(time_s), dtype=bool)
        for stay in stays:
            inside |= (time_s >= stay.enter_s) & (time_s <= stay.leave_s)
        # a point on the limit may fall on either side: the entry is good to 0.1 ms, at 15 km/s 1.5 m
        clear = np.abs(apart - within_m) > 2.0
        assert np.array_equal(inside & clear, (apart <= within_m) & clear)
        # no two stays of an object touch: they are joined
        assert all(after.enter_s - before.leave_s > 1e-3 for before, after in itertools.pairwise(stays))
        minima = np.concatenate([np.zeros(0), *(stay.minima_s for stay in stays)])
        dips = (apart[1:-1] < apart[:-2]) & (apart[1:-1] <= apart[2:]) & (apart[1:-1] < within_m)
        for at in time_s[1:-1][dips]:
            assert np.abs(minima - at).min(initial=np.inf) <= step_s + 1e-3, f"{sets[0].label} at {at} s is missed"
        for stay in stays:
            assert (stay.entered, stay.left) == (stay.enter_s > 0.0, stay.leave_s < duration_s)
            of = (time_s >= stay.enter_s) & (time_s <= stay.leave_s)
            assert stay.range_m <= apart[of].min(initial=np.inf) + 1e-3
            assert np.all(np.diff(stay.minima_s) > 0.0)
            lowest(stay, own, sets, start_utc, duration_s)
            jumps += int(np.count_nonzero(np.diff(which[of])) + np.count_nonzero(np.diff(leads[of])))
        count += int(dips.sum())
    return count, jumps


def lowest(stay, own, sets, start_utc, duration_s):
    """Assert that each minimum of a stay is one of the course with its jumps: 10 ms beside it the range is greater."""
    # 0.1 us on both sides too, of which a jump may be between: at 15 km/s that is 1.5 mm
    time_s = (stay.minima_s[:, None] + np.array([-0.01, -1e-7, 1e-7, 0.01])).ravel()
    time_s = np.clip(time_s, 0.0, duration_s)
    position, _ = flown(sets, start_utc, time_s)
    lead, _ = flown(own, start_utc, time_s)
    before, *at, after = np.linalg.norm(position - lead, axis=1).reshape(-1, 4).T
    assert np.abs(at - stay.minima_m).min(axis=0).max(initial=0.0) < 2e-3
    # slow ones turn by less than float64 tells: angles of SGP4 of some 100 rad round to 1e-14 rad, 1e-7 m, in four states
    assert np.all(stay.minima_m <= before + 5e-6) and np.all(stay.minima_m <= after + 5e-6)


@pytest.mark.parametrize(("within_m", "seed", "least"), [(20e3, 1, (800, 100)), (3e3, 2, (20, 2))])
def test_nothing_is_missed_that_a_fine_grid_over_the_nearest_sets_finds(within_m, seed, least):
    own, objects = crowd(seed)
    found = screen(own, objects, START, 1.2 * DAY_S, within_m)
    assert found.follower.several.all() and 20 < found.objects.several.sum() < 60
    count, jumps = held_against_the_grid(found, own, objects, START, 1.2 * DAY_S, within_m)
    assert count >= least[0] and jumps >= least[1], "the test has too little to find"


def test_one_set_for_one_of_the_two_and_many_for_the_other():
    own, objects = crowd(3)
    for some, others in ((own[:1], objects), (own, [sets[:1] for sets in objects])):
        found = screen(some, others, START, 0.5 * DAY_S, 20e3)
        count, jumps = held_against_the_grid(found, some, others, START, 0.5 * DAY_S, 20e3)
        assert count > 10 and jumps > 5


def test_the_same_set_at_two_epochs_changes_nothing():
    """What one set says of itself half a day later, to the last digit, leaves stays as they are: nothing jumps."""
    mate = elements(10, e=0.0011, anomaly=0.02)
    (one,) = screen(elements(1), [mate], START, DAY_S, 50e3).approaches
    # an equal set under another name of the epoch, 1 us away: the switch is between equal motions
    twin = ElementSet(**{**mate.__dict__, "epoch_rest_ns": 1.0})
    (two,) = screen(elements(1), [[mate, twin]], EPOCH - datetime.timedelta(hours=12), DAY_S, 50e3).approaches
    (whole,) = screen(elements(1), [mate], EPOCH - datetime.timedelta(hours=12), DAY_S, 50e3).approaches
    assert len(one.minima_s) > 10
    # 7.6 km/s over 1 ns is 8 um
    assert two.minima_m == pytest.approx(whole.minima_m, abs=1e-3)
    assert (two.enter_s, two.leave_s, two.entered, two.left) == (0.0, DAY_S, False, False)


def test_a_jump_into_and_out_of_the_limit_is_an_entry_and_an_exit():
    far, near = elements(10, hours=0.0, anomaly=3.0), elements(10, hours=4.0, anomaly=15.2 * 60.0 + 0.5 + 0.05)
    own = elements(1, hours=0.0)
    later = elements(10, hours=8.0, anomaly=15.2 * 120.0 + 1.0 + 5.0)
    found = screen(own, [[far, near, later]], EPOCH, 8 * 3600.0, 100e3)
    (stay,) = found.approaches
    assert (stay.entered, stay.left) == (True, True)
    assert stay.enter_s == pytest.approx(2 * 3600.0, abs=1e-3)  # half-way between the epochs
    assert stay.leave_s == pytest.approx(6 * 3600.0, abs=1e-3)
    held_against_the_grid(found, [own], [[far, near, later]], EPOCH, 8 * 3600.0, 100e3)


def test_a_set_that_decays_after_it_has_been_taken_over_is_not_listed():
    doomed = ElementSet(**{**elements(20, turns=16.45, e=0.0005).__dict__, "bstar_per_earth_radius": 0.05})
    sound = elements(20, hours=2.0)
    alone = screen(elements(1), [doomed], START, 5 * DAY_S, 50e3)
    assert [label for label, _ in alone.rejected] == [doomed.label]
    assert screen(elements(1), [[doomed, sound]], START, 5 * DAY_S, 50e3).rejected == ()


@pytest.mark.slow
def test_the_table_flies_the_nearest_sets_and_says_so():
    own, objects = crowd(4)
    sets = [*own, *(entry for some in objects for entry in some)]
    table = encounters(sets, 1, within_m=20e3, start_utc=START, days=1.0)
    assert table.screened == 60
    assert f"{table.switching} objects with more than one element set" in table.table()
    assert max(row.switches for row in table.rows) > 3
    for row in table.rows:
        mine = [entry for entry in sets if entry.norad_id == row.norad_id]
        at = START + datetime.timedelta(seconds=row.time_s)
        # a minimum beside a jump may lie 0.1 ms before the switch
        nearest_s = min(abs((entry.epoch_utc - at).total_seconds()) for entry in mine)
        assert abs(row.age_days) * DAY_S == pytest.approx(nearest_s, abs=1e-3)
        assert abs((row.elements.epoch_utc - at).total_seconds()) == pytest.approx(nearest_s, abs=1e-3)
        assert abs(row.follower_age_days) * DAY_S == pytest.approx(
            min(abs((entry.epoch_utc - at).total_seconds()) for entry in own), abs=1e-3
        )
    number = next(k for k, row in enumerate(table.rows, start=1) if row.follower is not table.follower)
    text = scenario_text(table, number)
    assert table.rows[number - 1].follower.epoch_utc.isoformat()[:19] in text


def test_the_warning_of_a_stale_follower_is_of_the_sets_flown():
    mate = elements(10, hours=15 * 24.0)
    with pytest.warns(UserWarning, match=r"follower OBJECT 1 .*flown up to 15.0 days from its epoch 2026-05-07T00:00Z"):
        encounters([elements(1), mate], 1, within_m=1e3, start_utc=EPOCH, days=15.0)
    fresh = [elements(1, hours=24.0 * day) for day in (0, 5, 10, 15)]  # no warning, which would be an error here
    encounters([*fresh, mate], 1, within_m=1e3, start_utc=EPOCH, days=15.0)


def test_sets_too_far_from_their_epochs_are_not_flown():
    old, mate = elements(9, hours=-5.1 * 365.25 * 24.0), elements(10, anomaly=0.01)
    table = encounters([elements(1), old, mate], 1, within_m=50e3, start_utc=EPOCH, days=0.1)
    assert {row.norad_id for row in table.rows} == {10}
    ((label, why),) = table.rejected
    assert label == "OBJECT 9 (NORAD 9)"
    assert why.startswith("it is more than 5 years from the epoch of the elements")
    with pytest.raises(PropagationError, match=r"^follower OBJECT 9 \(NORAD 9\): .* more than 5 years from the epoch"):
        encounters([elements(1), old, mate], 9, within_m=50e3, start_utc=EPOCH, days=0.1)


@pytest.mark.parametrize(
    ("name", "follower", "start", "days", "within_m", "least"),
    [
        ("terrasarx_tandemx_2026", 31698, None, 3.0, 5e3, 20),
        ("iss_progressms34_2026", 25544, datetime.datetime(2026, 4, 25, 12, tzinfo=datetime.UTC), 3.0, 50e3, 10),
        ("css_tianzhou9_2026", 48274, datetime.datetime(2026, 5, 6, 12, tzinfo=datetime.UTC), 2.0, 50e3, 10),
        ("iss_cygnus_ng24_2026", 25544, None, 2.0, 2e3, 10),  # some share epochs but for 0.4 ms
    ],
)
def test_real_pairs_against_a_grid_over_their_trajectories(shared, name, follower, start, days, within_m, least):
    catalog = Catalog.from_file(shared / "tle" / "pairs" / f"{name}.tle")
    by_number = catalog.objects()
    own = by_number.pop(follower)
    objects = list(by_number.values())
    start = start or own[len(own) // 2].epoch_utc
    found = screen(own, objects, start, days * DAY_S, within_m)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        count, jumps = held_against_the_grid(found, own, objects, start, days * DAY_S, within_m)
    assert count >= least and jumps >= 1


def test_a_picture_of_no_encounter_is_not_written_and_that_is_said(tmp_path):
    from typer.testing import CliRunner

    from rso_lidar.cli.app import app
    from rso_lidar.shipped import shipped

    place = tmp_path / "none.png"
    asked = ["encounters", str(shipped("tle/flyby.tle")), "--follower", "99003", "--within", "1m"]
    done = CliRunner().invoke(app, [*asked, "--start", "2024-09-17T11:00:00Z", "--days", "0.001", "--plot", str(place)])
    assert done.exit_code == 0
    assert "no picture written: no encounter to draw" in done.output
    assert not place.exists()


def test_the_time_axis_of_the_picture_bears_the_days_of_its_rows():
    start = np.datetime64("2026-05-07T01:00:00", "ms")
    for hours, days in (((0, 20), "UTC, 2026-05-07"), ((0, 30), "UTC, 2026-05-07 to 2026-05-08"), ((), "UTC")):
        times = start + np.array(hours, dtype="timedelta64[h]")
        some = np.ones(len(hours))
        figure = encounter_figure(times, 1e3 * some, some, some > 0.0, ["A"] * len(hours), 2e3)
        figure.draw_without_rendering()
        axes = figure.axes[0]
        assert axes.get_xlabel() == days
        assert axes.xaxis.get_offset_text().get_text() == ""
