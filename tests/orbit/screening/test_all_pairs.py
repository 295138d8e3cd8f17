"""All pairs of objects: what each of them finds in turn as the follower, and what a fine grid of SGP4 finds."""

import dataclasses
import datetime
import itertools

import numpy as np
import pytest

from rso_lidar.orbit import ElementSet, screen, screen_pairs

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
HALF_DAY = 43_200.0


def make_objects(count, seed=5):
    """Return element sets in one shell, some of them eccentric."""
    rng = np.random.default_rng(seed)
    low, high = [15.0, 0.0, 40.0, 0.0, 0.0, 0.0], [15.4, 0.004, 100.0, 360.0, 360.0, 360.0]
    return [
        ElementSet(
            name=f"OBJECT {k}",
            norad_id=k + 1,
            epoch_utc=START,
            mean_motion_rev_day=float(row[0]),
            eccentricity=float(row[1]) if k % 5 else 0.03,
            inclination_deg=float(row[2]),
            raan_deg=float(row[3]),
            argument_of_perigee_deg=float(row[4]),
            mean_anomaly_deg=float(row[5]),
            bstar_per_earth_radius=1e-5,
        )
        for k, row in enumerate(rng.uniform(low, high, (count, 6)))
    ]


def list_in_turn(objects, within_m):
    """Return (lower, upper, times and ranges) of all close approaches, with each object in turn as the follower."""
    return sorted(
        (one, one + 1 + stay.which, stay.enter_s, stay.leave_s, stay.time_s, stay.range_m)
        for one in range(len(objects) - 1)
        for stay in screen(objects[one], objects[one + 1 :], START, HALF_DAY, within_m).approaches
    )


def list_pairs(objects, within_m):
    return sorted(
        (stay.lead, stay.which, stay.enter_s, stay.leave_s, stay.time_s, stay.range_m)
        for stay in screen_pairs(objects, START, HALF_DAY, within_m).approaches
    )


@pytest.mark.parametrize("within_m", [10e3, 100e3])
def test_they_are_those_of_each_in_turn(within_m):
    objects = make_objects(100)
    pairs, turns = list_pairs(objects, within_m), list_in_turn(objects, within_m)
    assert len(pairs) == len(turns) > (0 if within_m < 50e3 else 100)
    assert [row[:2] for row in pairs] == [row[:2] for row in turns]
    assert np.array(pairs)[:, 2:5] == pytest.approx(np.array(turns)[:, 2:5], abs=1e-3)
    assert np.array(pairs)[:, 5] == pytest.approx(np.array(turns)[:, 5], abs=1e-3)


def test_nothing_is_missed_that_a_fine_grid_finds():
    objects, within_m = make_objects(60, seed=9), 80e3
    found = screen_pairs(objects, START, HALF_DAY, within_m)
    time_s = np.arange(0.0, HALF_DAY, 4.0)
    place = found.objects.fleet.grid(np.arange(len(objects)), time_s)[0]
    seen = 0
    for a, b in itertools.combinations(range(len(objects)), 2):
        inside = time_s[np.linalg.norm(place[b] - place[a], axis=1) < within_m]
        stays = [stay for stay in found.approaches if (stay.lead, stay.which) == (a, b)]
        seen += len(inside)
        for at in inside:
            assert any(stay.enter_s - 1e-3 <= at <= stay.leave_s + 1e-3 for stay in stays)
    assert seen > 100


def test_several_sets_of_an_object_follow_one_another():
    """Sets of the same elements six hours apart: joined, they are one close approach after the other, as in turn."""
    single = make_objects(12, seed=2)
    shifted = dataclasses.replace(
        single[3],
        epoch_utc=START + datetime.timedelta(hours=6),
        mean_anomaly_deg=(single[3].mean_anomaly_deg + 60.0) % 360.0,
    )
    objects = [*single[:3], [single[3], shifted], *single[4:]]
    pairs, turns = list_pairs(objects, 300e3), list_in_turn(objects, 300e3)
    assert [row[:2] for row in pairs] == [row[:2] for row in turns]
    assert any(3 in row[:2] for row in pairs)
    assert np.array(pairs)[:, 2:] == pytest.approx(np.array(turns)[:, 2:], abs=1e-2)


def test_what_cannot_be_propagated_is_named():
    objects = make_objects(6)
    objects[2] = dataclasses.replace(
        objects[2], bstar_per_earth_radius=0.9, mean_motion_rev_day=16.4, eccentricity=0.001
    )
    found = screen_pairs(objects, START, 20 * HALF_DAY, 50e3)
    assert [label for label, _ in found.rejected] == [objects[2].label]


def test_one_object_has_no_pair():
    found = screen_pairs(make_objects(1), START, HALF_DAY, 1e6)
    assert (found.approaches, found.near) == ((), 0)
