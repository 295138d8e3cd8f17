"""Element sets: what is read, what is chosen, and what is refused with file, line and cure."""

import numpy as np
import pytest

from rso_lidar.errors import CatalogError, ScenarioError
from rso_lidar.orbit import Catalog, Tle, read_element_sets
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.selection import select_set
from tests.orbit.sets.sets_for_tests import BOTH, ENVISAT_2013, ENVISAT_2020, TERRASAR, utc, with_checksum


def test_names_numbers_and_epochs():
    sets = parse_lines(["# a comment", "", *[line + "  \r" for line in BOTH]], "file")
    assert [entry.name for entry in sets] == ["ENVISAT", "ENVISAT", "TERRASAR-X"]
    assert [entry.norad_id for entry in sets] == [27386, 27386, 31698]
    assert [entry.problem for entry in sets] == [None] * 3
    # day 296.16551405 of 2013 is 23 October, 0.16551405 day = 3 h 58 min 20.413920 s
    assert sets[0].epoch_utc == utc(2013, 10, 23, 3, 58, 20, 413920)
    assert sets[2].label == "TERRASAR-X (NORAD 31698)"


def test_a_file_without_names(tmp_path):
    path = tmp_path / "two.tle"
    path.write_text("\n".join(TERRASAR))
    (only,) = read_element_sets(path)
    assert (only.name, only.norad_id, only.label) == ("", 31698, "NORAD 31698")


def test_nearest_epoch_is_chosen():
    sets = parse_lines(BOTH, "file")
    assert select_set(sets, "file", name="Envisat", near_utc=utc(2014, 1, 1)).line1 == ENVISAT_2013[0]
    assert select_set(sets, "file", name="envisat", near_utc=utc(2019, 1, 1)).line1 == ENVISAT_2020[0]
    assert select_set(sets, "file", norad_id=27386).line1 == ENVISAT_2020[0]  # the newest


def test_several_objects_must_be_told_apart():
    sets = parse_lines(BOTH, "file.tle")
    with pytest.raises(
        CatalogError, match=r"file\.tle: .*ENVISAT \(NORAD 27386\), TERRASAR-X \(NORAD 31698\).* name or norad_id"
    ):
        select_set(sets, "file.tle")
    with pytest.raises(CatalogError, match="did you mean 'TERRASAR-X'"):
        select_set(sets, "file.tle", name="terrasar")
    with pytest.raises(CatalogError, match="no object with norad_id 5"):
        select_set(sets, "file.tle", norad_id=5)
    twins = parse_lines(["TWIN", *TERRASAR, "TWIN", *ENVISAT_2013], "file")
    with pytest.raises(CatalogError, match="choose one with norad_id"):
        select_set(twins, "file", name="twin")


def test_alpha5_numbers():
    # Space-Track: A0000 is 100000, Z9999 is 339999, I and O are left out
    for field, number in [
        ("A0000", 100000),
        ("H9999", 179999),
        ("J0000", 180000),
        ("P0000", 230000),
        ("Z9999", 339999),
    ]:
        lines = [with_checksum(line[:2] + field + line[7:]) for line in TERRASAR]
        (only,) = parse_lines(lines, "file")
        assert (only.norad_id, only.problem) == (number, None)
    for field in ("I0000", "O0000", "a0000"):
        lines = [with_checksum(line[:2] + field + line[7:]) for line in TERRASAR]
        with pytest.raises(CatalogError):
            select_set(parse_lines(lines, "file"), "file")


BROKEN = {
    "checksum": (
        (TERRASAR[0][:-1] + "5", TERRASAR[1]),
        r"line 5: wrong checksum: its digits add up to 1, its last is '5'",
    ),
    "checksum 2": (
        (TERRASAR[0], TERRASAR[1][:-1] + "7"),
        r"line 6: wrong checksum: its digits add up to 1, its last is '7'",
    ),
    "truncated": ((TERRASAR[0], TERRASAR[1][:-6]), r"line 6: is truncated: 63 characters"),
    "too long": ((TERRASAR[0] + "12", TERRASAR[1]), r"line 5: is too long: 71 characters"),
    "other object": ((TERRASAR[0], ENVISAT_2020[1]), r"line 6: is of object '27386', the line before it of '31698'"),
    "line number": ((TERRASAR[0], "3" + TERRASAR[1][1:]), r"line 6: line 2 of an element set must begin with '2 '"),
    "one line": ((TERRASAR[0],), r"line 5: the file ends before line 2"),
    "not a number": (
        (TERRASAR[0], with_checksum(TERRASAR[1].replace("97.4465", "97.x465"))),
        r"line 6: inclination ' 97.x465' is not a number",
    ),
    "drag": (
        (with_checksum(TERRASAR[0].replace("55648-4", "5564.-4")), TERRASAR[1]),
        r"line 5: drag term ' 5564.-4' is not a number",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_set_is_refused_and_stops_no_other(case, tmp_path):
    lines, message = BROKEN[case]
    path = tmp_path / "mixed.tle"
    path.write_text("\n".join(["ENVISAT", *ENVISAT_2020, "TERRASAR-X", *lines]) + "\n")
    sets = read_element_sets(path)
    assert select_set(sets, str(path), norad_id=27386).line1 == ENVISAT_2020[0]
    with pytest.raises(CatalogError, match=r"mixed\.tle: " + message) as caught:
        select_set(sets, str(path), name="TERRASAR-X")
    assert "\n" not in str(caught.value)
    alone = parse_lines(lines, "alone")
    with pytest.raises(CatalogError, match=r"alone: line"):
        select_set(alone, "alone")


def test_a_lost_line_1():
    sets = parse_lines(["A", TERRASAR[1], "ENVISAT", *ENVISAT_2020], "file")
    assert select_set(sets, "file", name="ENVISAT").problem is None
    with pytest.raises(CatalogError, match="line 2: a line 2 without its line 1"):
        select_set(sets, "file", norad_id=31698)


def test_files_that_are_no_catalogues(tmp_path):
    cases = {
        "binary.tle": (b"\x89PNG\r\n\x1a\n\xff\xfe\x00", "not UTF-8 text"),
        "nul.tle": (b"1 \0", "not UTF-8 text"),
        "empty.tle": (b" \n", "is empty"),
        "page.html": (b"<html>\n<p>404</p>\n</html>", "does not contain a two-line element set"),
    }
    for name, (content, message) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(CatalogError, match=message) as caught:
            read_element_sets(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(CatalogError, match="no such file"):
        read_element_sets(tmp_path / "missing.tle")
    with pytest.raises(CatalogError, match="is a folder"):
        read_element_sets(tmp_path)


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "one.tle"
    path.write_text("\n".join(TERRASAR))
    assert read_element_sets(path)[0].norad_id == 31698
    path.write_text("\n".join(["ENVISAT", *ENVISAT_2020]))
    assert read_element_sets(path)[0].norad_id == 27386


def test_real_catalogues_are_whole(shared):
    for name, count in [("celestrak_active_2019-07-30", 2224), ("celestrak_geo_2026-05-30", 574)]:
        sets = read_element_sets(shared / "tle" / "catalogs" / f"{name}.tle")
        assert len(sets) == count
        assert [entry.problem for entry in sets if entry.problem] == []


@pytest.mark.parametrize("spoilt", ["-010000", "001.000", "0.10000", "1e-3000", "       x"[-7:]])
def test_an_eccentricity_that_is_no_number_spoils_its_set_only(spoilt, tmp_path):
    bad = with_checksum(ENVISAT_2020[1][:26] + spoilt + ENVISAT_2020[1][33:])
    path = tmp_path / "a.tle"
    path.write_text("\n".join([*ENVISAT_2013, ENVISAT_2020[0], bad, *TERRASAR]))
    catalog = Catalog.from_file(path)
    assert [entry.norad_id for entry in catalog] == [27386, 31698]
    (problem,) = catalog.problems
    assert f"line 4: eccentricity '{spoilt}' is not a number" in problem
    assert Tle(file=str(path), norad_id=31698).elements().norad_id == 31698
    with pytest.raises(ScenarioError, match=f"line 2: eccentricity '{spoilt}' is not a number"):
        Tle(lines=(ENVISAT_2020[0], bad))


@pytest.mark.parametrize("byte", [b"\0", b"\xff", b"\x1b", b"\x85"])
@pytest.mark.parametrize("at", range(0, 350, 7))
def test_one_bad_byte_costs_at_most_its_record(byte, at, tmp_path):
    content = "\n".join(["\u536b\u661f", *ENVISAT_2013, *ENVISAT_2020, "TERRASAR-X", *TERRASAR]).encode()
    path = tmp_path / "a.tle"
    path.write_bytes(content[:at] + byte + content[at + 1 :])
    catalog = Catalog.from_file(path)
    assert len(catalog) >= 2
    assert all(entry.name.isprintable() and len(entry.name) < 20 for entry in catalog)
    assert all(problem.isprintable() for problem in catalog.problems)
    if len(catalog) == 2:
        assert catalog.problems
    if at > 10:  # a line that is no UTF-8 makes no other line another text
        assert catalog.sets[0].name in ("\u536b\u661f", "")


def test_what_a_filter_is_asked_wrongly():
    catalog = Catalog.from_text("\n".join(BOTH))
    assert len(catalog.filter(norad_id=np.int64(31698))) == 1
    assert len(catalog.filter(norad_id=np.array([31698, 27386]))) == 3
    assert catalog.trajectory(np.int32(31698)).sets[0].norad_id == 31698
    now = utc(2020, 1, 1)
    wrong = [
        ({"norad_id": "31698"}, "norad_id: '31698' is not a catalogue number"),
        ({"norad_id": ["31698"]}, "not a catalogue number"),
        ({"norad_id": 31698.0}, "not a catalogue number"),
        ({"norad_id": True}, "not a catalogue number"),
        ({"name": 5}, "name: '5' is not text"),
        ({"at": "2024", "max_age_days": 1.0}, "at: '2024' is not a time"),
        ({"at": now, "max_age_days": float("nan")}, "max_age_days: 'nan' is not an age"),
        ({"at": now, "max_age_days": -1.0}, "is not an age"),
        ({"at": now, "max_age_days": "1"}, "is not an age"),
        ({"epoch_within": ("2024-01-01",)}, "is not a span; give two times"),
        ({"epoch_within": "2024"}, "is not a span"),
        ({"epoch_within": 5}, "is not a span"),
        ({"epoch_within": (now, "2024-01-01")}, "epoch_within: '2024-01-01' is not a time"),
        ({"epoch_within": (now, None)}, "is not a time"),
        ({"epoch_within": (now, utc(2019, 1, 1))}, "ends before it begins"),
    ]
    for asked, message in wrong:
        with pytest.raises(CatalogError, match=message) as caught:
            catalog.filter(**asked)
        assert "\n" not in str(caught.value)


def test_what_is_no_file_and_no_text():
    for path in (None, 5, b"a.tle", ["a.tle"]):
        with pytest.raises(CatalogError, match="is not a path"):
            Catalog.from_file(path)
        with pytest.raises(CatalogError, match="is not a path"):
            Catalog.from_text("\n".join(BOTH)).write(path)
    for text in (None, b"1 27386U"):
        with pytest.raises(CatalogError, match="not text"):
            Catalog.from_text(text)
