"""The encounter table: geometry against the scenario's own truth, reach, order, filters, files, and bad input."""

import csv
import dataclasses
import datetime
import math

import numpy as np
import pytest
from matplotlib.dates import date2num
from matplotlib.text import Text

import rso_lidar as rl
from rso_lidar import motion, orbit
from rso_lidar.detector import LaserPulse, predict
from rso_lidar.errors import CatalogError, RecordingError, ScenarioError
from rso_lidar.mission_analysis.budgets.pixel_light import filled_pixel_photons
from rso_lidar.mission_analysis.passes.encounter_figure import encounter_figure
from rso_lidar.orbit import (
    Catalog,
    ElementSet,
    angle_rad,
    earth_limb_angle_rad,
    moon_position_m,
    sun_position_m,
    sunlit_fraction,
)
from rso_lidar.orbit.sets import teme
from rso_lidar.scenario import Constraints, Corridor, Lidar
from rso_lidar.shipped import shipped
from rso_lidar.study import encounters, reach_m, scenario_text

FLYBY = shipped("tle/flyby.tle")
START = datetime.datetime(2024, 9, 17, 11, 0, tzinfo=datetime.UTC)
CLOSEST = datetime.datetime(2024, 9, 17, 12, 0, tzinfo=datetime.UTC)


@pytest.fixture(scope="module")
def table():
    """Return the shipped synthetic flyby: 1.5 km at 25 m/s on 2024-09-17T12:00:00Z (tle/make_synthetic.py)."""
    return encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.125)


def nearest(table):
    return min(table.rows, key=lambda row: abs(row.time_s - 3600.0))


def test_the_shipped_flyby_is_found(table):
    row = nearest(table)
    assert row.norad_id == 99002
    # the epoch of both sets; 1e-4 degree, the last digit of their angles, is 12 m, half a second of this pass
    assert row.time_s == pytest.approx(3600.0, abs=5.0)
    assert row.range_m == pytest.approx(1500.0, abs=20.0)
    assert row.speed_m_s == pytest.approx(25.0, abs=0.5)
    # a straight pass turns the line of sight by v / r at its nearest: 25 / 1500 rad/s, 0.95 deg/s
    assert row.slew_deg_s == pytest.approx(math.degrees(row.speed_m_s / row.range_m), rel=1e-4)
    # and turns it fastest by 3 sqrt(3) / 8 (v / r)^2, at 30 degrees
    expected = 3.0 * math.sqrt(3.0) / 8.0 * math.degrees((row.speed_m_s / row.range_m) ** 2)
    assert row.peak_turning_deg_s2 == pytest.approx(expected, rel=0.03)
    assert row.turning_deg_s2 < 0.1 * row.peak_turning_deg_s2


def test_time_in_reach_and_slew_of_a_straight_pass(table):
    row = nearest(encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.125, max_slew_deg_s=0.5))
    half_chord_m = math.sqrt(table.reach_m[1] ** 2 - row.range_m**2)
    # the pass is straight to a per cent over these minutes
    assert row.lidar_s == pytest.approx(2.0 * half_chord_m / row.speed_m_s, rel=0.04)
    # rate = v r0 / (r0^2 + v^2 t^2) is above the limit for |t| < sqrt(r0 v / limit - r0^2) / v
    limit = math.radians(0.5)
    fast_s = 2.0 * math.sqrt(row.range_m * row.speed_m_s / limit - row.range_m**2) / row.speed_m_s
    assert row.inside_s - row.slew_s == pytest.approx(fast_s, rel=0.03)
    assert row.usable_s == pytest.approx(row.lidar_s - fast_s, rel=0.04)


def test_geometry_is_that_of_the_scenario(table):
    number = table.rows.index(nearest(table)) + 1
    row = table.rows[number - 1]
    scenario = rl.Scenario.loads(scenario_text(table, number))
    # At 2 Hz there would be 1,292 frames, and 1,250 is the most.
    assert (scenario.time.duration_s, scenario.time.frame_rate_hz) == (646.0, 1.0)
    at_s = (table.start_utc - scenario.time.start_utc).total_seconds() + row.time_s
    truth = motion.truth(scenario.bodies, orbit.Epochs(scenario.time.start_utc, np.array([at_s])))
    name = scenario.target[0].name
    line = truth.states[name].position_m[0] - truth.states["follower"].position_m[0]
    assert np.linalg.norm(line) == pytest.approx(row.range_m, abs=1e-3)
    rate = truth.states[name].velocity_m_s[0] - truth.states["follower"].velocity_m_s[0]
    assert np.linalg.norm(rate) == pytest.approx(row.speed_m_s, abs=1e-3)
    sun = truth.sun_direction[0]
    cosine = float(np.sum(line * sun) / np.linalg.norm(line))
    assert row.sun_angle_deg == pytest.approx(math.degrees(math.acos(cosine)), abs=1e-3)
    assert row.phase_deg == pytest.approx(180.0 - row.sun_angle_deg, abs=1e-2)  # the Sun is far away
    moon = (
        moon_position_m(orbit.Epochs(scenario.time.start_utc, np.array([at_s]))) - truth.states["follower"].position_m
    )
    assert row.moon_angle_deg == pytest.approx(math.degrees(angle_rad(line, moon)[0]), abs=1e-6)
    # the attitude looks at the object at the closest approach: along body +x
    seen = truth.poses.pose("follower", name).translation
    assert np.allclose(np.atleast_2d(seen)[0] / row.range_m, [1.0, 0.0, 0.0], atol=1e-4)


@pytest.mark.slow
def test_the_scenario_runs_and_sees_the_object(table):
    number = table.rows.index(nearest(table)) + 1
    scenario = rl.Scenario.loads(scenario_text(table, number))
    assert scenario.time.start_utc.microsecond == 0
    middle = round((CLOSEST - scenario.time.start_utc).total_seconds() * scenario.time.frame_rate_hz)
    assert 0 < middle < scenario.time.n_frames
    (frame,) = rl.simulate(scenario, frames=[middle])
    assert (frame.labels.target == 0).any()
    assert scenario.describe()


def test_reach_is_where_half_of_the_flashes_detect_a_plate():
    for preset in ("gsfl_1064", "long_range_1064", "proximity_1570"):
        lidar = Lidar(preset=preset)
        near, far = reach_m(lidar)
        assert near == lidar.detector.sees_from_m
        photons = filled_pixel_photons(lidar.laser, lidar.receiver, 0.30 / math.pi, far)
        share = min(1.0, 1.0 / (far * lidar.receiver.pixel_tangent) ** 2)  # of the pixel that 1 m2 fills
        pulse = LaserPulse(*lidar.laser.pulse, lidar.laser.pulse_fwhm_s)
        detected = predict(lidar.detector, pulse, np.array([photons * share]), 0.0, only_probability=True).probability
        if far < lidar.detector.sees_to_m:
            assert detected == pytest.approx(0.5, abs=1e-3)
        else:
            assert detected >= 0.5


def test_order_filters_and_limit():
    def ask(**changes):
        return encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.2, **changes).rows

    rows = ask(sort="time")
    assert len(rows) > 1
    assert [row.time_s for row in rows] == sorted(row.time_s for row in rows)
    by_range = ask()
    assert [row.range_m for row in by_range] == sorted(row.range_m for row in rows)
    assert [row.speed_m_s for row in ask(sort="speed")] == sorted(row.speed_m_s for row in rows)
    assert ask(limit=1) == by_range[:1]
    assert all(row.sunlit_fraction >= 0.5 for row in ask(sunlit=True))
    longest = max(row.inside_s for row in rows)
    assert [row.inside_s for row in ask(min_duration_s=longest)] == [longest]


def test_csv_has_units_and_all_rows(table, tmp_path):
    place = table.csv(tmp_path / "a.csv")
    with place.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(table)
    assert float(rows[0]["range_m"]) == pytest.approx(table.rows[0].range_m)
    assert {"speed_m_s", "inside_s", "phase_deg", "slew_deg_s", "age_days"} <= set(rows[0])
    with pytest.raises(RecordingError, match="exists already"):
        table.csv(place)
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]


def test_table_says_that_elements_are_no_prediction(table):
    text = table.table()
    assert "good to about a kilometre" in text
    assert text.splitlines()[2].split()[0] == "1"


def test_figure_draws_every_row(table):
    times = np.datetime64("2024-09-17T11:00:00", "ms") + np.arange(4).astype("timedelta64[h]")
    figure = encounter_figure(
        times, np.array([1.0, 5e3, 2e4, 3e4]), np.full(4, 5.0), np.array([1, 0, 1, 1], bool), list("abcd"), 5e4, 8e3
    )
    axes = figure.axes[0]
    assert sum(len(dots.get_offsets()) for dots in axes.collections) == 4
    assert axes.get_yscale() == "log"
    figure.canvas.draw()


def test_a_table_draws_its_ranges_and_colours_its_speeds(table):
    dots = [dots for dots in table.figure().axes[0].collections if len(dots.get_offsets())]
    drawn = sorted(
        (float(y), float(c)) for each in dots for (_, y), c in zip(each.get_offsets(), each.get_array(), strict=True)
    )
    rows = [row for row in table.rows if not row.docked]
    fast = max(row.speed_m_s for row in rows) >= 1000.0
    expected = sorted((row.range_m / 1e3, row.speed_m_s / (1e3 if fast else 1.0)) for row in rows)
    np.testing.assert_allclose(drawn, expected, rtol=1e-9)


def test_the_figure_shows_the_whole_window_and_names_an_object_once():
    """Four encounters of one object within two hours of a window of three days."""
    start = np.datetime64("2024-09-17T00:00:00", "ms")
    times = start + np.arange(4).astype("timedelta64[h]") // 2
    window = (start, start + np.timedelta64(3, "D"))
    figure = encounter_figure(
        times, np.full(4, 2e3), np.full(4, 25.0), np.full(4, True), ["STAGE"] * 4, 2e4, window_utc=window
    )
    axes = figure.axes[0]
    first, last = (date2num(end) for end in window)
    low, high = axes.get_xlim()
    assert low < first and high > last and high - low < 1.05 * (last - first)
    assert axes.get_xlabel() == "UTC, 2024-09-17 to 2024-09-19"
    assert [text.get_text() for text in axes.texts].count("STAGE") == 1
    assert figure.axes[1].get_ylabel() == "Relative speed [m/s]"


def test_the_reach_is_written_where_it_covers_no_encounter():
    """Encounters that drift away cross the line of the reach at its right end."""
    hours = np.arange(160)
    times = np.datetime64("2024-09-17T00:00:00", "ms") + hours.astype("timedelta64[h]")
    range_m, dark = 1e2 + 54.0 * hours, hours % 2 == 0
    figure = encounter_figure(times, range_m, np.full(160, 5.0), dark, ["STAGE"] * 160, 1e4, 8.09e3)
    figure.canvas.draw()
    axes = figure.axes[0]
    (label,) = [text for text in axes.texts if text.get_text() == "lidar sees 1 m² to 8.09 km"]
    points = np.concatenate([axes.transData.transform(dots.get_offsets()) for dots in axes.collections])
    assert not label.get_window_extent().count_contains(points)


def test_names_cover_no_point_and_no_other_name():
    rng = np.random.default_rng(11)
    minutes = rng.integers(0, 1440, 60)
    times = np.datetime64("2024-09-17T00:00:00", "ms") + minutes.astype("timedelta64[m]")
    range_m = rng.uniform(100.0, 5e4, 60)
    names = [f"TRANSPORTER-16 OBJECT {k}" for k in range(60)]
    figure = encounter_figure(times, range_m, np.full(60, 5.0), minutes % 2 == 0, names, 5e4, 8e3)
    figure.canvas.draw()
    axes = figure.axes[0]
    labels = [text for text in axes.texts if text.get_text() in names]
    assert len(labels) >= 3
    boxes = [Text.get_window_extent(text) for text in labels]
    points = np.concatenate([axes.transData.transform(dots.get_offsets()) for dots in axes.collections])
    assert len(points) == 60
    for k, box in enumerate(boxes):
        assert not any(box.contains(*point) for point in points)
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


ASKED = Constraints(
    sun_exclusion_deg=100.0,
    moon_exclusion_deg=60.0,
    earth_exclusion_deg=10.0,
    keep_out_m=1200.0,
    corridor=(
        Corridor(target="x", axes="rtn", axis=(0, -1, 0), half_angle_deg=30.0, to_m=1300.0),
        Corridor(target="x", axes="port", axis=(1, 0, 0), half_angle_deg=30.0),
    ),
)


@pytest.fixture(scope="module")
def asked():
    return encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.5, constraints=ASKED)


def flown(elements, start_utc, time_s):
    return teme.propagate_sgp4(elements, orbit.Epochs(start_utc, time_s))


def clear(table, row, time_s):
    """Return whether each exclusion is kept at some instants, by the words of `Constraints`: Sun, Moon, Earth."""
    asked, epochs = table.constraints, orbit.Epochs(table.start_utc, time_s)
    own = flown(table.follower, table.start_utc, time_s).position_m
    line = flown(row.elements, table.start_utc, time_s).position_m - own
    sun, moon = sun_position_m(epochs), moon_position_m(epochs)
    return (
        (sunlit_fraction(own, sun) == 0.0) | (np.degrees(angle_rad(line, sun - own)) >= asked.sun_exclusion_deg),
        np.degrees(angle_rad(line, moon - own)) >= asked.moon_exclusion_deg,
        np.degrees(earth_limb_angle_rad(line, own)) >= asked.earth_exclusion_deg,
    )


def test_exclusions_at_the_closest_approach_and_for_how_long_they_are_kept(asked):
    assert {row.sun_kept for row in asked.rows} == {True, False}
    for row in asked.rows[:4]:
        at = clear(asked, row, np.array([row.time_s]))
        assert [row.sun_kept, row.moon_kept, row.earth_kept] == [bool(kept[0]) for kept in at]
        kept = np.all(clear(asked, row, np.linspace(row.stay.enter_s, row.stay.leave_s, 20_001)), axis=0)
        assert 0.0 < row.clear_s < row.inside_s
        # 0.1 s between the instants here; the table promises a per cent
        assert row.clear_s == pytest.approx(np.mean(kept) * row.inside_s, rel=0.01, abs=0.3)
        assert row.usable_s <= min(row.clear_s, row.lidar_s, row.slew_s) + 1e-9


def test_exclusions_of_a_formation_that_stays_all_day():
    chief = next(entry for entry in Catalog.from_file(FLYBY) if entry.norad_id == 99003)
    bare = chief.__dict__ | {"line1": "", "line2": ""}
    lead = ElementSet(**bare)
    other = ElementSet(**bare | {"norad_id": 7, "eccentricity": chief.eccentricity + 3e-5})
    table = encounters(
        [other], lead, within_m=20e3, start_utc=START, days=1.0, constraints=ASKED.replace(earth_exclusion_deg=1.0)
    )
    (row,) = table.rows
    assert row.inside_s == 86_400.0
    # half a turn of the line of sight an orbit: seconds count
    kept = np.all(clear(table, row, np.linspace(0.0, 86_400.0, 43_201)), axis=0)
    assert 0.05 < np.mean(kept) < 0.95
    assert row.clear_s == pytest.approx(np.mean(kept) * 86_400.0, rel=0.01)


def test_without_exclusions_all_is_clear_and_nothing_said(table, asked):
    bare = encounters(FLYBY, 99003, within_m=20e3, start_utc=START, days=0.5)
    assert [row.closest_utc for row in bare.rows] == [row.closest_utc for row in asked.rows]
    for row in bare.rows:
        assert row.clear_s == pytest.approx(row.inside_s, abs=1e-6)
        assert (row.sun_kept, row.keep_out_kept, row.corridor_kept, row.breaks) == (None, None, None, ())
        assert row.corridor_angle_deg is None
    assert "clear" not in bare.table()
    assert "breaks" in asked.table()


def test_keep_out_and_corridor_at_the_closest_approach(asked):
    kept = []
    for row in asked.rows:
        at = np.array([row.time_s])
        body = flown(row.elements, START, at)
        back = flown(asked.follower, START, at).position_m[0] - body.position_m[0]
        out = body.position_m[0] / np.linalg.norm(body.position_m[0])
        normal = np.cross(body.position_m[0], body.velocity_m_s[0])
        along = np.cross(normal / np.linalg.norm(normal), out)
        angle_deg = math.degrees(math.acos(float(np.sum(-along * back)) / row.range_m))
        assert row.corridor_angle_deg == pytest.approx(angle_deg, abs=1e-4)
        inside = angle_deg <= 30.0 and row.range_m <= 1300.0
        assert row.corridor_kept == (None if row.range_m > 1300.0 else inside)
        assert row.keep_out_kept == (row.range_m >= 1200.0 or inside)  # a corridor leads through the sphere
        kept.append((row.keep_out_kept, row.corridor_kept))
    assert {(True, None), (True, True)} & set(kept)
    assert any(row.range_m < 1200.0 for row in asked.rows)


def test_a_sphere_alone_is_held_to_every_object():
    table = encounters(
        FLYBY,
        99003,
        within_m=20e3,
        start_utc=START,
        days=0.5,
        constraints=Constraints(keep_out_m={"a": 5.0, "b": 1200.0}),
    )
    assert {row.keep_out_kept for row in table.rows} == {True, False}
    assert all(row.keep_out_kept == (row.range_m >= 1200.0) for row in table.rows)
    assert all(row.breaks == (() if row.keep_out_kept else ("keep-out",)) for row in table.rows)
    assert "keep-out: 1200 m about each object, the largest of a, b" in table.table()


def test_notes_say_what_was_asked_and_what_element_sets_cannot_tell(asked):
    notes = "\n".join(asked.notes())
    assert "Sun 100 deg while any of it is seen, Moon 60 deg, Earth's limb 10 deg" in notes
    assert "corridor[0]: 30 deg about [0, -1, 0] in the rtn axes of each object, from 0 m to 1300 m" in notes
    assert "corridor[1]: not applicable: it turns with port" in notes


@pytest.mark.slow
def test_the_scenario_carries_facts_and_constraints(asked):
    number, row = next((k, row) for k, row in enumerate(asked.rows, start=1) if row.breaks)
    text = scenario_text(asked, number)
    facts = "\n".join(line for line in text.splitlines() if line.startswith("#"))
    for fact in (
        f"row {number} of {len(asked)}",
        row.closest_utc,
        f"{row.range_m / 1e3:.3f} km",
        f"{row.speed_m_s:.1f} m/s",
    ):
        assert fact in facts
    assert "good to about a kilometre" in facts
    assert f"BEWARE: at the closest approach it violates [constraints]: {', '.join(row.breaks)}" in facts
    scenario = rl.Scenario.loads(text)
    (corridor,) = scenario.constraints.corridor  # the other is in axes that this target has not
    assert corridor == ASKED.corridor[0].replace(target=scenario.target[0].name)
    assert scenario.constraints.replace(corridor=()) == ASKED.replace(corridor=())
    assert "constraints.keep_out_m" in scenario.describe()


@pytest.mark.slow
def test_an_encounter_of_messages_is_written_inline():
    sets = [
        ElementSet(**{**entry.__dict__, "line1": "", "line2": "", "norad_id": entry.norad_id + 10**8})
        for entry in Catalog.from_file(FLYBY)
    ]
    table = encounters(sets, 99003 + 10**8, within_m=20e3, start_utc=START, days=0.125)
    text = scenario_text(table, 1)
    assert 'type = "omm"' in text
    assert rl.Scenario.loads(text).describe()


def test_of_several_sets_of_a_follower_the_nearest_in_time_names_it():
    sets = list(Catalog.from_file(FLYBY))
    own = next(entry for entry in sets if entry.norad_id == 99003)
    for days in (-3, 2):
        epoch_utc = own.epoch_utc + datetime.timedelta(days=days)
        sets.append(ElementSet(**{**own.__dict__, "line1": "", "line2": "", "epoch_utc": epoch_utc}))
    assert encounters(sets, 99003, within_m=20e3, start_utc=START, days=0.125).follower.epoch_utc == own.epoch_utc
    at = START + datetime.timedelta(days=2)
    later = encounters(sets, 99003, within_m=20e3, start_utc=at, days=0.02)
    assert later.follower.epoch_utc == own.epoch_utc + datetime.timedelta(days=2)


def test_names_write_nothing_into_the_scenario():
    sets = list(Catalog.from_file(FLYBY))
    names = ["B\nseed = 77\n#", 'Q"""\'\\ "\x00\x7f\ud800']
    sets = [ElementSet(**{**entry.__dict__, "name": name}) for entry, name in zip(sets, names, strict=True)]
    object.__setattr__(sets[0], "name", names[0])  # even where a name went past its cleaning
    table = encounters(sets, 99003, within_m=20e3, start_utc=START, days=0.125)
    text = scenario_text(table, 1)
    assert rl.Scenario.loads(text).seed == 99002
    assert [line for line in text.splitlines() if line.startswith("seed")] == ["seed    = 99002"]
    assert text.isascii()


def test_docked_craft_share_elements_and_have_no_line_of_sight():
    (chief, other) = sorted(Catalog.from_file(FLYBY), key=lambda entry: entry.norad_id)[-2:]
    twin = ElementSet(**{**chief.__dict__, "line1": "", "line2": "", "norad_id": 7, "name": "DOCKED"})
    table = encounters(
        [twin, other], ElementSet(**{**twin.__dict__, "norad_id": 8}), within_m=1.0, start_utc=START, days=0.1
    )
    (row,) = table.rows
    assert (row.label, row.range_m) == ("DOCKED", 0.0)
    assert math.isnan(row.phase_deg)
    assert row.docked == "the catalogue gives both the same elements"
    with pytest.raises(
        ScenarioError, match=r"^scenario 1: DOCKED and .* are docked or one object: .*; give another row$"
    ):
        scenario_text(table, 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"days": 0.0}, "days: 0 is not a time span"),
        ({"days": math.nan}, "days: nan is not a time span"),
        ({"within_m": 0.0}, "within: 0 m is not a search distance"),
        ({"start_utc": datetime.datetime(2024, 9, 17)}, "start: a time without an offset"),
        ({"max_slew_deg_s": -1.0}, "max_slew: -1 deg/s"),
        ({"within_m": "20km"}, "within: '20km' is not a number; give one in m"),
        ({"start_utc": "2024-09-17T11:00:00Z"}, "start: '2024-09-17T11:00:00Z' is not a time"),
        ({"days": None}, "days: 'None' is not a number"),
        ({"sort": "x"}, "sort: 'x' is not a sort order; use one of range, time, speed"),
        ({"limit": 0}, "limit: '0' is not a number of rows"),
        ({"limit": 1.5}, "limit: '1.5' is not a number of rows"),
        ({"min_duration_s": math.nan}, "min_duration: nan s is not a duration"),
        ({"follower": 99003.0}, "follower: '99003.0' is not an object"),
        ({"catalog": None}, "catalogue: 'None' is not a catalogue"),
        ({"catalog": [1, 2]}, "catalogue: '1' in it is not an element set"),
    ],
)
def test_what_means_nothing_is_refused(changes, message):
    given = {"catalog": FLYBY, "follower": 99003, "within_m": 20e3, "start_utc": START, "days": 0.1} | changes
    with pytest.raises((ScenarioError, CatalogError), match=message):
        encounters(**given)


def test_an_unknown_follower_is_told_with_a_guess():
    with pytest.raises(CatalogError, match=r"flyby.tle: no follower '99004' among .*did you mean '9900[23]'\?"):
        encounters(FLYBY, 99004, within_m=20e3, start_utc=START, days=0.1)


@pytest.mark.parametrize(("number", "message"), [(0, "there are"), (99, "give a number from 1 to")])
def test_a_row_that_is_not_there(table, number, message):
    with pytest.raises(ScenarioError, match=message):
        scenario_text(table, number)


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("ENVISAT", "envisat"),
        ("SL-16 R/B", "zenit_stage"),
        ("SL-8 R/B", "rocket_body"),
        ("SL-16 DEB", "debris_plate"),
        ("INTELSAT 901", "comsat"),
        ("TDRS 3", "tdrs"),
        ("NOBODY KNOWS", "cubesat_3u"),
    ],
)
def test_an_object_is_drawn_as_its_name_suggests(name, model):
    from rso_lidar.mission_analysis.passes.scenario_lines import guess_model

    assert guess_model(name)[0] == model


def test_trajectories_have_no_number_in_the_table_and_gaps_are_counted_by_object(tmp_path):
    chief, other = (
        rl.Kepler(
            epoch_utc=START, semi_major_axis_km=7000.0, eccentricity=0.0, inclination_deg=50.0, raan_deg=10.0,
            argument_of_perigee_deg=0.0, true_anomaly_deg=anomaly_deg,
        )
        for anomaly_deg in (0.0, 0.01)
    )  # fmt: skip
    table = encounters({"other": other}, chief, within_m=50e3, start_utc=START, days=0.1)
    assert table.rows[0].minima == 1
    heads, first = (
        line.split(",") for line in table.csv(tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[:2]
    )
    cells = dict(zip(heads, first, strict=True))
    assert cells["norad_id"] == cells["follower_norad_id"] == ""
    gaps = dataclasses.replace(
        table, rejected=(("x", "no state before 1 s"), ("x", "no state after 9 s"), ("y", "decayed"))
    )
    assert any(line.startswith("2 objects not flown, or not to the end: x: no state before") for line in gaps.notes())
