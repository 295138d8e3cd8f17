"""Events: expressions, objects of every kind, passes against skyfield's, and what is written."""

import csv
import dataclasses
import datetime
import json
import re
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import CatalogError, ScenarioError
from rso_lidar.mission_analysis.intervals.expression import (
    Combination,
    Condition,
    find_in_windows,
    parse_expression,
)
from rso_lidar.mission_analysis.intervals.gantt_figure import gantt_figure
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.orbit import GroundStation, NamedTrajectory
from rso_lidar.shipped import shipped
from tests.orbit.sets.sets_for_tests import TERRASAR

FLYBY = str(shipped("tle/flyby.tle"))
HOP = Path(shipped("examples/tdrs_approach.toml"))
START = datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC)
WORDS = {"range": "length", "lit": None, "contact": None, "found": "number", "sun": "angle"}


def test_and_binds_more_than_or_and_not_most():
    low = Condition("range", (), True, 5e4)
    lit, dark = Condition("lit"), Combination("not", (Condition("lit"),))
    seen = Condition("contact", ("Graz", "target"))
    assert parse_expression("range<50km", WORDS) == low
    text = "not lit or range < 50 km and contact(Graz, target)"
    assert parse_expression(text, WORDS) == Combination("or", (dark, Combination("and", (low, seen))))
    text = "(lit or found >= 1e-1) and range<=5e4m"
    either = Combination("or", (lit, Condition("found", (), False, 0.1)))
    assert parse_expression(text, WORDS) == Combination("and", (either, low))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "ends where a condition is needed"),
        ("range", "needs a limit; write for example range < 5m"),
        ("range < 50", "has no unit; write 50m"),
        ("range < 50 and lit", "has no unit"),
        ("range < 50deg", "has the unknown unit 'deg'"),
        ("range < near", "'near' is not a number"),
        ("range < 1.2.3m", "is not a number"),
        ("range < 1e999m", "is not a number"),
        ("rnage < 5m", "did you mean 'range'"),
        ("lit < 3", "is not compared"),
        ("lit lit", "is one too many; join conditions by and, or"),
        ("lit and", "ends where a condition is needed"),
        ("(lit", "where ')' is needed"),
        ("lit)", "is one too many"),
        ("and lit", "'and' is not a condition"),
        ("lit & lit", "'&' is not understood"),
        ("found > 50", "'found' is a probability; compare it with a number from 0 to 1"),
        ("sun > 30rad", "'sun' is an angle; compare it with at most 180deg"),
        ("range < -5km", "'range' is never negative; compare it with 0 or more"),
        ("contact()", "')' comes where an argument is needed"),
        ("contact(Graz,)", "')' comes where an argument is needed"),
        ("not " * 60 + "lit", "nested too deeply"),
        (" or ".join(["lit"] * 201), "has 201 conditions; give at most 200 in one expression"),
    ],
)
def test_what_is_wrong_in_an_expression_is_one_line(text, message):
    with pytest.raises(ScenarioError) as told:
        parse_expression(text, WORDS)
    assert message in str(told.value)
    assert "\n" not in str(told.value)


def test_spans_are_combined_as_sets():
    held = {"a": [(1.0, 3.0), (5.0, 9.0)], "b": [(2.0, 6.0)]}

    def find(condition, windows):
        spans = held[condition.word]
        cut = [(max(b, c), min(e, d)) for b, e in spans for c, d in windows]
        return [span for span in cut if span[1] > span[0]]

    words = {"a": None, "b": None}
    windows = [(0.0, 4.0), (4.0, 10.0)]
    for text, expected in (
        ("a and b", [(2, 3), (5, 6)]),
        ("a or b", [(1, 4), (4, 9)]),
        ("not a", [(0, 1), (3, 4), (4, 5), (9, 10)]),
        ("not (a and b)", [(0, 2), (3, 4), (4, 5), (6, 10)]),
        ("not not a", [(1, 3), (5, 9)]),
        ("not (a or b)", [(0, 1), (9, 10)]),
        ("a and not b", [(1, 2), (6, 9)]),
    ):
        assert find_in_windows(parse_expression(text, words), find, windows) == expected, text


def test_contacts_are_the_passes_of_skyfield():
    from skyfield.api import EarthSatellite, load, wgs84

    (entry,) = rl.orbit.Catalog.from_text("\n".join(TERRASAR))
    start = entry.epoch_utc.replace(hour=0, minute=0, second=0, microsecond=0)
    station = GroundStation(47.0671, 15.4933, 539.4, least_elevation_deg=5.0, name="G")
    other = rl.Kepler(
        epoch_utc=start, semi_major_axis_km=7000.0, eccentricity=0.0, inclination_deg=98.0, raan_deg=0.0,
        argument_of_perigee_deg=0.0, true_anomaly_deg=0.0,
    )  # fmt: skip
    objects = [entry, NamedTrajectory("other", other)]
    table = rl.study.events(objects, entry.norad_id, "contact(G)", start_utc=start, days=3, stations=[station])
    scale = load.timescale(builtin=True)
    begin = scale.from_datetime(start)
    there = wgs84.latlon(station.latitude_deg, station.longitude_deg, elevation_m=station.height_m)
    satellite = EarthSatellite(*TERRASAR, ts=scale)
    times, kinds = satellite.find_events(there, begin, begin + 3.0, altitude_degrees=5.0)
    rises, sets = ([(t - begin) * 86400.0 for t, kind in zip(times, kinds, strict=True) if kind == k] for k in (0, 2))
    assert len(table) == len(rises) > 8
    # skyfield narrows events to half a second
    np.testing.assert_allclose([row.from_s for row in table.rows], rises, atol=0.5)
    np.testing.assert_allclose([row.to_s for row in table.rows], sets, atol=0.5)


def test_a_follower_that_flies_relative_motion_is_an_object_like_any_other():
    station = GroundStation(0.0, -47.0, name="S")  # below the satellite
    names = {"contact": "contact(S)", "target": "contact(S, target)", "near": "range < 1km"}
    table = rl.study.events(HOP, HOP, names, days=0.03, stations=[station])
    spans = {row.event: (row.from_s, row.to_s) for row in table.rows}
    assert spans["contact"] == spans["target"] == (pytest.approx(0.0, abs=1e-3), pytest.approx(2592.0))
    scenario = rl.Scenario.load(HOP)
    (edge,) = {edge for edge in spans["near"] if 0.0 < edge < 2592.0}
    truth = rl.truth(scenario, np.array([edge]))
    assert np.linalg.norm(truth.pose("follower", "tdrs").translation) == pytest.approx(1000.0, abs=1e-3)


def test_field_and_beam_are_those_of_the_truth_of_the_run():
    scenario = rl.Scenario.load(shipped("examples/tle_flyby.toml"))
    place = Path(shipped("examples/tle_flyby.toml"))
    days = scenario.time.duration_s / 86400.0
    table = rl.study.events(place, place, ["field", "angle(+x) < 40deg", "regard", "beam"], days=days)
    spans = {name: [(r.from_s, r.to_s) for r in table.rows if r.event == name] for name in table.expressions}
    time_s = np.linspace(0.0, scenario.time.duration_s, 50)
    truth, _ = rl.mission_analysis.fly_open_loop(scenario, range(0, scenario.time.n_frames, 20), drive=False)
    line = np.broadcast_to(truth.poses.link("follower", "stage").translation_m, (len(truth.time_s), 3))
    ahead = np.degrees(np.arccos(line[:, 0] / np.linalg.norm(line, axis=1))) < 40.0
    for at, held in zip(truth.time_s, ahead, strict=True):
        assert held == any(begin - 1e-3 <= at <= end + 1e-3 for begin, end in spans["angle(+x) < 40deg"])
    assert spans["field"] and spans["beam"] and time_s[-1] > 0.0  # the PTU tracks it


def test_found_and_pixels_follow_the_range():
    names = ["found > 0.5", "pixels > 2", "range < 5km"]
    plate = rl.study.ViewedPlate(side_m=2.0)
    table = rl.study.events(FLYBY, 99003, names, start_utc=START, days=0.125, plate=plate)
    lidar = rl.Lidar(preset="long_range_1064")
    far_m = 2.0 / (2.0 * lidar.receiver.pixel_tangent)
    for row in table.rows:
        if row.event == "pixels > 2" and row.begins:
            assert row.farthest_m == pytest.approx(far_m, rel=1e-6)
    light = PlateLight(lidar, plate, rl.scenario.Finding())
    many = np.full(256, 0.0)
    edges_m = [row.farthest_m for row in table.rows if row.event == "found > 0.5" and row.begins and row.ends]
    for range_m in edges_m:  # the mean over the pixels, which the search tabulates over range
        assert light.find_in_flash(many + range_m, many, many).mean() == pytest.approx(0.5, abs=0.02)
    assert len(edges_m) > 1
    assert {row.event for row in table.rows} == set(names)


def test_keep_out_spares_the_corridor(tmp_path):
    place = tmp_path / "hop.toml"
    corridor = '[[constraints.corridor]]\ntarget = "tdrs"\naxes = "rtn"\naxis = [0, -1, 0]\nhalf_angle_deg = 4\n'
    place.write_text(f"{HOP.read_text()}\n[constraints]\nkeep_out_m = 2000\n{corridor}", encoding="utf-8")
    names = ["keep_out", "corridor", "range < 2km"]
    table = rl.study.events(place, place, names, days=2700 / 86400)
    total = {name: sum(row.duration_s for row in table.rows if row.event == name) for name in names}
    both = rl.study.events(place, place, ["range < 2km and not corridor"], days=2700 / 86400)
    assert sum(row.duration_s for row in both.rows) == pytest.approx(total["keep_out"], abs=0.01)
    assert 0.0 < total["keep_out"] < total["range < 2km"]
    closer = rl.study.events(place, place, ["keep_out"], days=2700 / 86400, keep_out_m=500.0)  # and the same corridor
    sphere = rl.study.events(place, place, ["range < 500m and not corridor"], days=2700 / 86400)
    assert [(row.from_s, row.to_s) for row in closer.rows] == [
        (pytest.approx(row.from_s, abs=1e-3), pytest.approx(row.to_s, abs=1e-3)) for row in sphere.rows
    ]
    assert closer.rows[0].from_s > both.rows[0].from_s + 10.0


@pytest.fixture(scope="module")
def table():
    names = {"look": "range < 4km and lit", "dark": "umbra and range < 4km"}
    return rl.study.events(FLYBY, 99003, names, start_utc=START, days=0.25)


def test_csv_and_json_have_the_same_rows(table, tmp_path):
    with table.save(tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    tree = json.loads(table.save(tmp_path / "a.json").read_text(encoding="utf-8"))
    assert len(rows) == len(tree["events"]) == len(table) > 3
    assert [row["begin_utc"] for row in rows] == [row["begin_utc"] for row in tree["events"]]
    assert tree["expressions"] == dict(table.expressions)
    assert float(rows[0]["nearest_m"]) == pytest.approx(tree["events"][0]["nearest_m"], rel=1e-8)


def test_the_calendar_keeps_to_rfc_5545(table, tmp_path):
    raw = table.save(tmp_path / "a.ics").read_bytes()
    lines = raw.decode().split("\r\n")
    assert lines.pop() == "" and not any("\n" in line for line in lines)
    assert max(len(line.encode()) for line in lines) <= 75
    unfolded = raw.decode().replace("\r\n ", "").split("\r\n")
    assert unfolded[:2] == ["BEGIN:VCALENDAR", "VERSION:2.0"]
    starts = [line.partition(":")[2] for line in unfolded if line.startswith("DTSTART")]
    ends = [line.partition(":")[2] for line in unfolded if line.startswith("DTEND")]
    assert len(starts) == len(table)
    for row, begin, end in zip(table.rows, starts, ends, strict=True):
        first, last = (
            (datetime.datetime.strptime(text, "%Y%m%dT%H%M%SZ").replace(tzinfo=datetime.UTC) - START).total_seconds()
            for text in (begin, end)
        )
        assert first <= row.from_s + 1e-6 < first + 1.0 and last - 1.0 < row.to_s + 1e-6 <= last + 1e-3
    uids = [line for line in unfolded if line.startswith("UID")]
    assert len(set(uids)) == len(uids)
    assert all(re.search(r"(?<!\\)[,;]", line.partition(":")[2]) is None for line in unfolded if line[:7] == "SUMMARY")


def test_the_picture_has_a_line_for_each_expression(table):
    (axes,) = table.figure().axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["look", "dark"]
    bars = [len(collection.get_paths()) for collection in axes.collections]
    assert sum(bars) == len(table)


def test_objects_of_one_name_have_lines_of_their_own(table):
    twins = tuple(dataclasses.replace(row, norad_id=row.norad_id + 1) for row in table.rows)
    (axes,) = dataclasses.replace(table, rows=(*table.rows, *twins), labels=("A", "A")).figure().axes
    assert len(axes.get_yticklabels()) == 2 * len(table.expressions)


def test_a_row_becomes_a_scenario_that_shows_the_event(table):
    number = next(k for k, row in enumerate(table.rows, 1) if row.event == "look" and row.begins and row.ends)
    row = table.rows[number - 1]
    scenario = rl.Scenario.loads(rl.study.event_scenario_text(table, number))
    begins = (scenario.time.start_utc - START).total_seconds()
    assert begins <= row.from_s and row.to_s <= begins + scenario.time.duration_s
    truth = rl.truth(scenario, np.array([row.nearest_s - begins]))
    name = scenario.target[0].name
    assert np.linalg.norm(truth.pose("follower", name).translation) == pytest.approx(row.nearest_m, abs=1.0)
    with pytest.raises(ScenarioError, match="give a number from 1 to"):
        rl.study.event_scenario_text(table, 99)


def test_where_a_trajectory_ends_an_event_ends():
    low = rl.Kepler(
        epoch_utc=START, semi_major_axis_km=6950.0, eccentricity=0.0, inclination_deg=98.0, raan_deg=0.0,
        argument_of_perigee_deg=0.0, true_anomaly_deg=0.0,
    )  # fmt: skip

    class Brief:
        def states(self, epochs):
            bad = epochs.since(START) > 1000.0
            if bad.any():
                raise rl.errors.PropagationError("it ends; search fewer days", bad)
            return low.states(epochs)

    other = low.replace(true_anomaly_deg=0.1)
    objects = [NamedTrajectory("brief", Brief())]
    table = rl.study.events(objects, NamedTrajectory("low", other), "range < 20km", start_utc=START, days=0.1)
    (row,) = table.rows
    assert (row.from_s, row.to_s) == (0.0, pytest.approx(1000.0, abs=1e-3))
    assert not row.begins and not row.ends
    assert any("has no state" in why for _, why in table.rejected)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"when": "contact(Graz)"}, "needs the name of a station"),
        ({"when": "umbra(sun)"}, "is about follower or target"),
        ({"when": "angle(up) < 3deg"}, "needs one axis"),
        ({"when": "beam"}, "needs the attitude of a scenario's follower"),
        ({"when": "angle(+x) < 3deg"}, "needs the attitude of a scenario's follower"),
        ({"when": "keep_out"}, "needs a radius"),
        ({"when": "corridor"}, "needs a corridor"),
        ({"when": "range(a) < 3m"}, "takes no arguments"),
        ({"when": ["lit", "lit"]}, "two expressions have one name"),
        ({"when": {"a": 3}}, "is not an expression"),
        ({"when": []}, "no expression is given"),
        ({"days": 0.0}, "days: 0 is not a time span"),
        ({"start_utc": None}, "start: is needed"),
        ({"min_duration_s": -1.0}, "is not a duration"),
        ({"limit": 0}, "is not a number of rows"),
        ({"stations": [GroundStation(1.0, 2.0)]}, "one has no name"),
    ],
)
def test_what_makes_no_sense_is_one_line(options, message):
    with pytest.raises(ScenarioError) as told:
        rl.study.events(FLYBY, 99003, **{"when": "lit", "start_utc": START, "days": 0.01} | options)
    assert message in str(told.value)
    assert "\n" not in str(told.value)


def test_one_object_alone_has_no_events():
    (entry,) = rl.orbit.Catalog.from_text("\n".join(TERRASAR))
    with pytest.raises(CatalogError, match="events need two or more objects"):
        rl.study.events([entry], start_utc=START)


def test_short_bars_are_not_snapped_to_pixels():
    """Snapped, a hundred bars of 10 minutes a week are two or three pixels wide in turn, as if they lasted longer."""
    bars = [(6000.0 * k, 6000.0 * k + 600.0) for k in range(100)]
    (axes,) = gantt_figure([("see", bars, 0)], np.datetime64("2024-09-17T00:00:00"), 6e5, "Events").axes
    assert [drawn.get_snap() for drawn in axes.collections] == [False]
