"""Lines of element sets: fields to the last digit, shifted columns, and lines written anew."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import CatalogError, RsoLidarWarning
from rso_lidar.orbit import Catalog, ElementSet
from rso_lidar.orbit.sets.element_set import parse_epoch
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.tle_text import compute_checksum, format_tle, parse_norad_id

# CelesTrak: TerraSAR-X
LINES = (
    "1 31698U 07026A   26074.52702793  .00001102  00000+0  55648-4 0  9991",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 39001",
)


def summed(line):
    return line[:68] + str(compute_checksum(line))


def test_every_field():
    (only,) = parse_lines(LINES, "file")
    assert only == ElementSet(
        name="",
        norad_id=31698,
        line1=LINES[0],
        line2=LINES[1],
        where="file: line 1",
        object_id="2007-026A",
        # day 74.52702793 of 2026: 15 March, 0.52702793 day = 45535.213152 s
        epoch_utc=datetime.datetime(2026, 3, 15, 12, 38, 55, 213152, tzinfo=datetime.UTC),
        mean_motion_rev_day=15.19149353,
        eccentricity=0.0001759,
        inclination_deg=97.4465,
        raan_deg=83.5666,
        argument_of_perigee_deg=83.56,
        mean_anomaly_deg=276.5835,
        bstar_per_earth_radius=5.5648e-5,
        mean_motion_dot_rev_day2=1.102e-5,
        element_set_no=999,
        rev_at_epoch=3900,
    )


def test_fields_are_sgp4s(shared):
    """Vallado's reader, in the sgp4 package, finds the same numbers in every verification case."""
    text = (shared / "tle" / "sgp4_verification" / "SGP4-VER.TLE").read_text()
    sets = parse_lines(text.split("\n"), "ver")
    assert len(sets) == 33
    for entry in sets:
        model = entry.satrec()
        ours = [entry.eccentricity, entry.bstar_per_earth_radius, entry.mean_motion_rev_day * 2 * np.pi / 1440]
        ours += [
            angle * np.pi / 180
            for angle in (entry.inclination_deg, entry.raan_deg, entry.argument_of_perigee_deg, entry.mean_anomaly_deg)
        ]
        theirs = [model.ecco, model.bstar, model.no_kozai, model.inclo, model.nodeo, model.argpo, model.mo]
        np.testing.assert_allclose(ours, theirs, rtol=4e-16 * 4, atol=0)
        ndots = [entry.mean_motion_dot_rev_day2, entry.mean_motion_ddot_rev_day3]
        per_minute = 1440 / (2 * np.pi)
        np.testing.assert_allclose(
            ndots, [model.ndot * per_minute * 1440, model.nddot * per_minute * 1440**2], rtol=1e-14
        )
        day = (entry.epoch_utc - datetime.datetime(2000, 1, 1, 12, tzinfo=datetime.UTC)) / datetime.timedelta(days=1)
        assert day == pytest.approx(model.jdsatepoch - 2451545.0 + model.jdsatepochF, abs=1e-11)


def test_shifted_columns_keep_the_checksum_and_are_seen():
    shifted = LINES[1][:8] + LINES[1][9:17] + " " + LINES[1][17:]
    assert (len(shifted), compute_checksum(shifted)) == (69, compute_checksum(LINES[1]))
    (only,) = parse_lines((LINES[0], shifted[:16] + "0" + shifted[17:]), "file")
    assert "column 17 is '0' and should be blank" in only.problem


@pytest.mark.parametrize(
    ("line", "change", "message"),
    [
        (1, (20, 32, "367.00000000"), "is not a year and day"),
        (1, (20, 32, "366.00000000"), "is not a year and day (2026 has 365 days)"),
        (1, (20, 32, "366.99999999"), "is not a year and day (2026 has 365 days)"),
        (1, (20, 32, "000.50000000"), "is not a year and day (2026 has 365 days)"),
        (1, (18, 32, "24367.00000000"), "is not a year and day (2024 has 366 days)"),
        (1, (18, 32, "57366.00000000"), "is not a year and day (1957 has 365 days)"),
        (1, (62, 63, "4"), "SGP4-XP (ephemeris type 4), another theory than SGP4; fetch elements of SGP4"),
        (2, (8, 16, "190.0000"), "inclination 190 is not from 0 to 180"),
        (2, (52, 63, " 0.00000000"), "mean motion 0 rev/day is not above 0"),
        (2, (26, 33, "00x1759"), "eccentricity '00x1759' is not a number"),
    ],
)
def test_numbers_that_are_no_orbit(line, change, message):
    lines = list(LINES)
    first, end, text = change
    lines[line - 1] = summed(lines[line - 1][:first] + text + lines[line - 1][end:])
    (only,) = parse_lines(lines, "file")
    assert message in only.problem


def test_numbers_in_five_columns():
    assert [parse_norad_id(field) for field in ("00005", "    5", "A0000", "Z9999")] == [5, 5, 100000, 339999]
    assert [parse_norad_id(field) for field in ("I0000", " A005", "", "1 234")] == [None] * 4


def test_lines_written_anew_are_those_that_were_read(shared):
    """Without its lines, a set gives them back: all but the sign of a zero and of the exponent of a zero."""
    for entry in Catalog.from_file(shared / "tle" / "catalogs" / "celestrak_stations_2026-05-30.tle"):
        again = format_tle(ElementSet(**{**entry.__dict__, "line1": "", "line2": ""}))
        assert again[1] == entry.line2
        assert again[0][:44] + again[0][53:68] == entry.line1[:44] + entry.line1[53:68]
        (read,) = parse_lines(again, entry.where.rpartition(":")[0])
        assert read.problem is None
        assert read.mean_motion_ddot_rev_day3 == entry.mean_motion_ddot_rev_day3


def test_what_no_tle_can_hold():
    (only,) = parse_lines(LINES, "file")
    bare = ElementSet(**{**only.__dict__, "line1": "", "line2": ""})
    assert format_tle(ElementSet(**{**bare.__dict__, "norad_id": 270000}))[0].startswith("1 T0000U 07026A   26074.5")
    with pytest.raises(CatalogError, match="above 339999, the largest of a TLE"):
        format_tle(ElementSet(**{**bare.__dict__, "norad_id": 340000}))
    with pytest.raises(CatalogError, match="do not fit the columns"):
        format_tle(ElementSet(**{**bare.__dict__, "mean_motion_dot_rev_day2": 12.5}))


@pytest.mark.parametrize(
    "change",
    [
        {"mean_motion_rev_day": 1e-9},  # would be written as 0
        {"mean_motion_rev_day": 99.0},
        {"epoch_utc": datetime.datetime(2057, 1, 1, tzinfo=datetime.UTC)},  # would be read as 1957
        {"bstar_per_earth_radius": 1e11},
        {"classification": "\u536b"},
        {"inclination_deg": float("nan")},
    ],
)
def test_what_a_tle_would_lose_is_not_written(change):
    (only,) = parse_lines(LINES, "file")
    with pytest.raises(CatalogError, match=r"^NORAD 31698: its numbers do not fit the columns of a TLE; write \.json$"):
        format_tle(ElementSet(**{**only.__dict__, "line1": "", "line2": "", **change}))


def test_a_spoilt_line_2_names_no_other_object():
    bad, good = parse_lines([LINES[0], "\0" + LINES[1][1:], *LINES], "file")
    assert "must begin with '2 '" in bad.problem
    assert (good.name, good.problem) == ("", None)


def test_controls_in_an_element_line_are_seen():
    for sign in "\x1b\0\t\x7f":
        (only,) = parse_lines([LINES[0][:9] + sign + LINES[0][10:], LINES[1]], "file")
        assert only.problem is not None
        assert only.problem.isprintable()


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("2024-12-31T23:59:59.9999999", "25001.00000000"),  # 2024 has 366 days
        ("2025-12-31T23:59:59.999568", "26001.00000000"),  # half a step of 864 us, 432 us, before the new year
        ("2025-12-31T23:59:59.999567999", "25365.99999999"),
        ("2025-03-31T23:59:59.9999999", "25091.00000000"),
        ("2024-12-31T12:00:00", "24366.50000000"),
        ("1999-12-31T23:59:59.9999", "00001.00000000"),
        ("2056-12-31T23:59:59.9999", "56366.99999999"),  # two digits cannot say 2057
    ],
)
def test_an_epoch_is_the_nearest_that_the_columns_hold(text, columns):
    (only,) = parse_lines(LINES, "file")
    epoch, rest_ns = parse_epoch(text)
    change = {"line1": "", "line2": "", "epoch_utc": epoch, "epoch_rest_ns": rest_ns}
    lines = format_tle(ElementSet(**{**only.__dict__, **change}))
    assert lines[0][18:32] == columns
    (read,) = parse_lines(lines, "file")
    assert read.problem is None
    assert abs((read.epoch_utc - epoch).total_seconds()) <= (864e-6 if epoch.year == 2056 else 433e-6)


def test_a_day_that_a_leap_year_has_is_read():
    text = LINES[0][:18] + "24366.50000000" + LINES[0][32:]
    (only,) = parse_lines((summed(text), LINES[1]), "file")
    assert (only.problem, only.epoch_utc) == (None, datetime.datetime(2024, 12, 31, 12, tzinfo=datetime.UTC))


def test_a_set_that_no_tle_can_hold_does_not_stop_the_others(tmp_path):
    (only,) = parse_lines(LINES, "file")
    bare = {**only.__dict__, "line1": "", "line2": ""}
    sets = [ElementSet(**{**bare, "norad_id": number}) for number in (7, 340_000, 9, 500_000)]
    with pytest.warns(RsoLidarWarning) as told:
        Catalog(tuple(sets), where="some.json").write(tmp_path / "some.tle")
    assert [str(warning.message) for warning in told] == [
        "some.json: 2 of 4 element sets are left out, the first is NORAD 340000: its number is above 339999, the "
        "largest of a TLE; write .json"
    ]
    assert [entry.norad_id for entry in Catalog.from_file(tmp_path / "some.tle")] == [7, 9]
    with pytest.raises(CatalogError, match="above 339999"):
        Catalog(tuple(sets[1::2])).write(tmp_path / "none.tle")
    assert not (tmp_path / "none.tle").exists()


def test_one_bad_day_spoils_one_record():
    text = summed(LINES[0][:18] + "25366.50000000" + LINES[0][32:])
    catalog = Catalog.from_text("\n".join((text, LINES[1], *LINES)), "some.tle")
    assert len(catalog) == 1
    assert catalog.problems == (
        "some.tle: line 1: epoch '25366.50000000' is not a year and day (2025 has 365 days); fetch the set again",
    )
