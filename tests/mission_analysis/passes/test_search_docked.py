"""Docked craft: what element sets cannot tell apart is one row without a scenario, and a formation is not."""

import csv
import datetime
import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Catalog, ElementSet
from rso_lidar.study import encounters, scenario_text

EPOCH = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
ARC_DEG = 1e3 / 6.8e6 * 180.0 / math.pi  # 1 km along or across an orbit at 400 km


def elements(number, hours=0.0, e=1e-3, i=51.6, anomaly=0.0, turns=15.5, **changes):
    """Return a set some hours after EPOCH, on the mean motion of the one there; `anomaly` [deg] is ahead of it."""
    # secular rates of J2 [deg/day], Vallado, Fundamentals of Astrodynamics, 4th ed., 9-38 and 9-40: a = 1.0654 R
    j2 = 0.75 * 1.0826e-3 / 1.0654**2 * 360.0 * 15.5
    c, days = math.cos(math.radians(51.6)), hours / 24.0
    fields = {
        "raan_deg": 100.0 - 2.0 * j2 * c * days,
        "argument_of_perigee_deg": 30.0 + j2 * (5.0 * c * c - 1.0) * days,
        "mean_anomaly_deg": (anomaly + 360.0 * 15.5 * days) % 360.0,
        **changes,
    }
    return ElementSet(
        name=f"CRAFT {number}",
        norad_id=number,
        epoch_utc=EPOCH + datetime.timedelta(hours=hours),
        mean_motion_rev_day=turns,
        eccentricity=e,
        inclination_deg=i,
        bstar_per_earth_radius=0.0,
        **fields,
    )


def table_of(sets, within_m=50e3, days=0.5, **more):
    return encounters(sets, 1, within_m=within_m, start_utc=EPOCH, days=days, **more)


def test_equal_elements_under_other_numbers_are_one_row_each_and_stand_last():
    passing = elements(5, i=60.0, anomaly=0.3)
    table = table_of([elements(1), elements(2), elements(3), passing])
    assert [row.norad_id for row in table.rows][-2:] == [2, 3]
    assert {row.norad_id for row in table.rows[:-2]} == {5}
    assert [row.docked for row in table.rows[-2:]] == ["the catalogue gives both the same elements"] * 2
    assert all(not row.docked for row in table.rows[:-2])
    assert all(math.isnan(row.usable_s) and math.isnan(row.lidar_s) for row in table.rows[-2:])
    text = table.table()
    assert text.count("(docked or one object)") == 2
    assert "docked or one object: CRAFT 2, CRAFT 3: the catalogue gives both the same elements; no encounter" in text
    assert rl.Scenario.loads(scenario_text(table, 1)).target[0].name == "craft_5"
    for number in (len(table) - 1, len(table)):
        with pytest.raises(ScenarioError, match=f"^scenario {number}: CRAFT . and CRAFT 1 are docked or one object"):
            scenario_text(table, number)


def test_one_stack_by_two_authors_is_folded_whatever_the_limit(tmp_path):
    """1.2 km along the track, 40 m radial, 50 m across; a limit of 1.2 km cuts that into many stays."""
    mate = elements(2, anomaly=1.2 * ARC_DEG, e=1e-3 + 20.0 / 6.8e6, i=51.6 + 0.05 * ARC_DEG)
    for within_m in (50e3, 1.2e3):
        table = table_of([elements(1), mate], within_m=within_m)
        (row,) = table.rows
        assert row.docked.startswith("the sets differ by no more than their own errors: radial")
        assert "of 144 m, along the track 1." in row.docked
        assert "of 178 m" in row.docked
    assert row.minima > 3
    with table.csv(tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        (told,) = csv.DictReader(file)
    assert told["docked"] == row.docked
    assert told["usable_s"] == "nan"


@pytest.mark.parametrize(
    "formation",
    [
        {"e": 1e-3 + 300.0 / 6.8e6},  # an ellipse of 300 m, radial
        {"i": 51.6 + 0.4 * ARC_DEG},  # 400 m across
        {"anomaly": 6.0 * ARC_DEG},  # 6 km ahead: beyond twice 1 km and 3 km a day
        {"turns": 15.505},  # drifts by
    ],
    ids=lambda formation: next(iter(formation)),
)
def test_a_formation_beyond_the_errors_is_an_encounter(formation):
    table = table_of([elements(1), elements(2, **formation)])
    assert [row.docked for row in table.rows] == [""] * len(table.rows)
    assert "docked" not in table.table()
    assert rl.Scenario.loads(scenario_text(table, 1)).target[0].name == "craft_2"


def test_equal_elements_for_a_part_of_the_span_widen_the_bound():
    """Sets of one stack: equal at first, then up to 1.8 km apart along the track and 230 m radial."""
    own = [elements(1), elements(1, hours=8.0)]
    mate = [elements(2), elements(2, hours=8.0, anomaly=1.3 * ARC_DEG, e=1e-3 + 230.0 / 6.8e6)]
    table = table_of([*own, *mate])
    (row,) = table.rows
    assert row.range_m < 1e-3
    assert row.docked.startswith("the catalogue gives both the same elements for ")
    assert "% of the time, and else the sets differ by no more than their own errors" in row.docked
    (alone,) = table_of([own[0], mate[1]]).rows  # without the equal sets that much is a formation
    assert alone.docked == ""


def test_a_craft_that_leaves_is_no_docked_one_but_its_start_is_refused():
    gone = [elements(2), elements(2, hours=8.0, anomaly=20.0 * ARC_DEG)]
    table = table_of([elements(1), elements(1, hours=8.0), *gone])
    (row,) = table.rows
    assert row.docked == ""
    assert row.range_m < 1e-3
    with pytest.raises(
        ScenarioError, match=r"^scenario 1: at the closest approach .* the same elements, .*; give another"
    ):
        scenario_text(table, 1)


@pytest.mark.parametrize(
    ("name", "start", "days", "folded"),
    [
        # one stack: other sets for a part of the time, up to 1.8 km apart by their own errors
        ("iss_progressms32_2026", "2026-03-20T00:00:00", 1.0, True),
        ("iss_cygnus_ng24_2026", "2026-05-05T00:00:00", 1.0, True),
        ("css_tianzhou9_2026", "2026-04-10T00:00:00", 1.0, True),
        # formation flight, 0.05 to 1.7 km apart
        ("terrasarx_tandemx_2026", "2026-04-10T00:00:00", 1.0, False),
        ("terrasarx_tandemx_2025-10", "2025-10-03T12:00:00", 0.5, False),
        ("prisma_mango_tango_2010-08-12", "2010-08-12T05:30:00", 0.25, False),
    ],
)
def test_real_pairs(shared, name, start, days, folded):
    catalog = Catalog.from_file(shared / "tle" / "pairs" / f"{name}.tle")
    start_utc = datetime.datetime.fromisoformat(f"{start}+00:00")
    table = encounters(catalog, next(iter(catalog.objects())), within_m=50e3, start_utc=start_utc, days=days)
    assert [bool(row.docked) for row in table.rows] == [folded] * max(len(table.rows), 1)
    if folded:
        with pytest.raises(ScenarioError, match="are docked or one object"):
            scenario_text(table, 1)


def test_the_stack_of_a_station(shared):
    catalog = Catalog.from_file(shared / "tle" / "catalogs" / "celestrak_stations_2026-05-30.tle")
    start = datetime.datetime(2026, 5, 30, 12, tzinfo=datetime.UTC)
    table = encounters(catalog, 25544, within_m=50e3, start_utc=start, days=1.0)
    assert sum(bool(row.docked) for row in table.rows) == 8
    assert np.all([row.inside_s > 86_399.0 for row in table.rows if row.docked])
