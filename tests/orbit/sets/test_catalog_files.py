"""Catalogues of every format, mixed and dirty: what is good is kept, what is bad is told with place and reason."""

import datetime
import gzip
import json

import numpy as np
import pytest

from rso_lidar.errors import CatalogError
from rso_lidar.orbit import Catalog
from tests.orbit.sets.sets_for_tests import BOTH, ENVISAT_2013, ENVISAT_2020, TERRASAR, utc, with_checksum

RECORD = {
    "OBJECT_NAME": "STARLINK-9",
    "OBJECT_ID": "2026-100A",
    "EPOCH": "2026-05-07T01:02:03.123456",
    "MEAN_MOTION": 15.06,
    "ECCENTRICITY": 0.0001,
    "INCLINATION": 53.0,
    "RA_OF_ASC_NODE": 10.0,
    "ARG_OF_PERICENTER": 20.0,
    "MEAN_ANOMALY": 30.0,
    "NORAD_CAT_ID": 100123456,
    "BSTAR": 1e-4,
}


def strings(record):
    return {key: str(value) for key, value in record.items()}


def kvn(record, head="CCSDS_OMM_VERS = 2.0\nCOMMENT made up\n"):
    return head + "".join(f"{key} = {value}\n" for key, value in record.items())


def xml(*records):
    body = "".join(f"<{key}>{value}</{key}>" for record in records for key, value in record.items())
    return f"<omm><body><segment><metadata/><data>{body}</data></segment></body></omm>"


FORMATS = {
    "json, numbers": lambda: json.dumps([RECORD]),
    "json, one object": lambda: json.dumps(RECORD, indent=2),
    "json, strings": lambda: json.dumps([strings(RECORD) | {"TLE_LINE0": "0 X", "GP_ID": None}]),
    "json, lower case": lambda: json.dumps([{key.lower(): value for key, value in RECORD.items()}]),
    "json in data": lambda: json.dumps({"data": [RECORD]}),
    "json lines": lambda: json.dumps(RECORD) + "\n",
    "csv": lambda: ",".join(RECORD) + "\n" + ",".join(strings(RECORD).values()) + "\r\n",
    "csv, quoted": lambda: '"' + '","'.join(RECORD) + '"\n"' + '","'.join(strings(RECORD).values()) + '"\n',
    "kvn": lambda: kvn(RECORD),
    "kvn, units": lambda: kvn(RECORD).replace("53.0", "53.0 [deg]").replace("15.06", "15.06 [rev/day]"),
    "kvn, lower case, no version": lambda: (
        kvn(RECORD, "").lower().replace("starlink", "STARLINK").replace("t01", "T01")
    ),
    "xml": lambda: f'<?xml version="1.0" encoding="UTF-8"?>\n<ndm>{xml(RECORD)}</ndm>',
    "xml, namespace": lambda: xml(RECORD).replace("<omm>", '<omm xmlns="urn:ccsds:schema:ndmxml">'),
}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_one_message_in_every_format(form, mark, tmp_path):
    path = tmp_path / "catalogue.dat"  # the content tells the format
    path.write_text(mark + FORMATS[form](), encoding="utf-8", newline="")
    catalog = Catalog.from_file(path)
    assert catalog.problems == ()
    (only,) = catalog
    assert (only.name, only.norad_id) == ("STARLINK-9", 100123456)
    assert only.object_id.upper() == "2026-100A"
    assert only.epoch_utc == utc(2026, 5, 7, 1, 2, 3, 123456)
    assert (only.mean_motion_rev_day, only.inclination_deg, only.bstar_per_earth_radius) == (15.06, 53.0, 1e-4)
    assert only.where.startswith(f"{path}: ")


def test_formats_mixed_with_bad_records_between():
    bad = {**RECORD, "ECCENTRICITY": 1.5}
    text = "\n".join(
        [
            "# a comment",
            "ENVISAT",
            *ENVISAT_2013,
            kvn(RECORD),
            "0 TERRASAR-X",
            *TERRASAR,
            "an advertisement",
            "",
            "ENVISAT",
            ENVISAT_2020[0],
            "ENVISAT",
            *ENVISAT_2020,
            kvn(bad),
            kvn(RECORD | {"NORAD_CAT_ID": 7}).replace("EPOCH", "EPOCH = 2026-05-07T00:00:00\nEPOCH"),
            "1 31698",
            TERRASAR[1],
        ]
    )
    catalog = Catalog.from_text(text.replace("\n", "\r\n"), "mixed")
    assert [entry.norad_id for entry in catalog] == [27386, 100123456, 31698, 27386]
    told = "\n".join(catalog.problems)
    assert len(catalog.problems) == 5
    for message in (
        "mixed: line 26: line 2 of an element set must begin with '2 ', not 'ENVISAT'",
        "mixed: line 29: eccentricity 1.5 is not from 0 to below 1",
        "key 'EPOCH' is given twice, again in line 4",
        "line 22: 'an advertisement' is not an element line",
        "is truncated: 7 characters",
    ):
        assert message in told


def test_messages_without_a_version_follow_each_other():
    text = kvn(RECORD, "") + "\n" + kvn(RECORD | {"NORAD_CAT_ID": 6}, "COMMENT x\n")
    assert [entry.norad_id for entry in Catalog.from_text(text)] == [100123456, 6]


BROKEN_TABLES = {
    "csv, short row": (
        lambda good: f"{','.join(RECORD)}\n{good}\nA,B,C\n{good.replace('100123456', '6')}",
        "line 3: has 3 cells, the header 11",
    ),
    "csv, open quote": (
        lambda good: f'{",".join(RECORD)}\n{good}\n"A,{good}\n{good.replace("100123456", "6")}',
        "line 3: has 1 cells",
    ),
    "json, cut off": (
        lambda _: json.dumps([RECORD, RECORD | {"NORAD_CAT_ID": 6}, RECORD])[:-40],
        "line 1: this record is cut off",
    ),
    "json, a bad comma": (
        lambda _: (
            "[\n" + ",\n".join([json.dumps(RECORD), '{"NORAD_CAT_ID": 8,,}', json.dumps(RECORD | {"NORAD_CAT_ID": 6})])
        ),
        "line 3: this record is not JSON",
    ),
    "json, no object": (lambda _: json.dumps([RECORD, 5, RECORD | {"NORAD_CAT_ID": 6}]), "record 2: is not an object"),
    "json, a key twice": (
        lambda _: json.dumps([RECORD, RECORD | {"NORAD_CAT_ID": 6}])[:-1] + ', {"BSTAR": 1, "bstar": 2}]',
        "record 3: key 'BSTAR' is given twice",
    ),
    "xml, cut off": (
        lambda _: f"<ndm>{xml(RECORD)}\n{xml(RECORD | {'NORAD_CAT_ID': 6})}\n{xml(RECORD)[:60]}",
        "line 3: this message is cut off",
    ),
    "xml, a key twice": (
        lambda _: f"<ndm>{xml(RECORD)}{xml(RECORD | {'NORAD_CAT_ID': 6})}{xml(RECORD, RECORD)}</ndm>",
        "record 3: key 'OBJECT_NAME' is given twice",
    ),
}


@pytest.mark.parametrize("case", BROKEN_TABLES)
def test_a_bad_record_spoils_itself_only(case):
    make, message = BROKEN_TABLES[case]
    catalog = Catalog.from_text(make(",".join(strings(RECORD).values())), "file")
    assert [entry.norad_id for entry in catalog] == [100123456, 6]
    (problem,) = catalog.problems
    assert problem.startswith("file: ")
    assert message in problem
    assert "\n" not in problem


@pytest.mark.parametrize("form", ["json, numbers", "csv", "xml, namespace", "kvn"])
def test_a_spoilt_beginning_spoils_no_record(form):
    catalog = Catalog.from_text("HTTP/1.1 200 OK\n" + FORMATS[form]())
    assert [entry.norad_id for entry in catalog] == [100123456]
    assert len(catalog.problems) == 1


def test_texts_that_are_no_catalogue_are_one_line():
    cases = {
        "": "is empty",
        "[]": r"does not contain a two-line element set or an OMM, but '\[\]'; fetch it again",
        "{}": "OMM, but '{}'",
        "[[[": "does not contain a two-line",
        "[" * 100_000 + '"': "does not contain a two-line",
        '<!DOCTYPE x [<!ENTITY a "b">]><omm>&a;</omm>': "declares a DOCTYPE",
        "<ndm></ndm>": "does not contain a two-line",
        "EPOCH,MEAN_MOTION,BSTAR\n1,2,3": "column NORAD_CAT_ID, ECCENTRICITY",
        ",".join([*RECORD, "BSTAR"]): "column 'BSTAR' is given twice",
        ",".join(RECORD): "does not contain a two-line",
        '[{"NORAD_CAT_ID": ' + "9" * 5000 + "}]": None,
    }
    for text, message in cases.items():
        if message is None:
            catalog = Catalog.from_text(text)
            assert len(catalog) == 0
            assert len(catalog.problems) == 1
            continue
        with pytest.raises(CatalogError, match=message) as caught:
            Catalog.from_text(text)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("answer", "quoted"),
    [
        ("No elements found for this query\n", "No elements found for this query"),
        ('{"error": "blocked"}', '{"error": "blocked"}'),
        ('{"error": {"code": 403, "reason": "no login"}}\n', '{"error": {"code": 403, "reason": "no login"}}'),
        ('[{"message": "rate limit"}]', '[{"message": "rate limit"}]'),
        ('{"error": "cut o', '{"error": "cut o'),
        ("<?xml version='1.0'?><error>No data</error>", "No data"),
        (
            '<!DOCTYPE html>\n<html><style>a { "b": 1 }</style><script>x = {"@id": {"c": 1}}</script>'
            "<title>403 Forbidden</title>\n<body>Ask &amp; wait</body></html>",
            "403 Forbidden Ask & wait",
        ),
        ("ab" * 500, "ab" * 58 + "a..."),
        ("a \x1b[31m b", "a [31m b"),
    ],
)
def test_the_refusal_quotes_the_answer_of_a_server(answer, quoted):
    with pytest.raises(CatalogError) as caught:
        Catalog.from_text(answer, "answer.tle")
    begin = "answer.tle: does not contain a two-line element set or an OMM, but"
    assert str(caught.value) == f"{begin} '{quoted}'; fetch it again, or give another file"


def test_a_compressed_catalogue_is_refused_as_such(tmp_path):
    path = tmp_path / "sets.tle.gz"
    path.write_bytes(gzip.compress(b"1 25544U"))
    with pytest.raises(CatalogError, match=r"sets\.tle\.gz: is compressed \(gzip\); decompress it$"):
        Catalog.from_file(path)


@pytest.mark.parametrize("form", ["json, numbers", "csv", "xml, namespace", "kvn"])
def test_sets_of_sgp4_xp_are_left_out_because_of_their_theory(form):
    text = FORMATS[form]()
    assert "BSTAR" in text
    (problem,) = Catalog.from_text(text.replace("BSTAR", "BTERM")).problems
    assert problem.endswith(
        ": is for SGP4-XP (BTERM in place of BSTAR), another theory than SGP4; fetch elements of SGP4"
    )


def test_the_same_set_twice_is_kept_once(tmp_path):
    other = with_checksum(TERRASAR[1].replace("97.4465", "97.4466"))
    catalog = Catalog.from_text("\n".join([*BOTH, "T", *TERRASAR, *ENVISAT_2020, TERRASAR[0], other]))
    assert (len(catalog), catalog.duplicates) == (3, 2)
    (problem,) = catalog.problems
    assert "line 15: NORAD 31698 has other elements than at line 8 for the same epoch" in problem
    # those of one object in the order of epochs
    assert [entry.line1 for entry in catalog.objects()[27386]] == [ENVISAT_2013[0], ENVISAT_2020[0]]


def test_filter():
    catalog = Catalog.from_text("\n".join(BOTH) + "\n" + kvn(RECORD | {"MEAN_MOTION": 1.0027}))
    assert [entry.name for entry in catalog.filter(name="envi")] == ["ENVISAT", "ENVISAT"]
    assert [entry.name for entry in catalog.filter(name="terra*x")] == ["TERRASAR-X"]
    assert len(catalog.filter(name="terra*s")) == 0
    assert len(catalog.filter(norad_id=[27386, 31698])) == 3
    assert [entry.norad_id for entry in catalog.filter(regime="geo")] == [100123456]
    assert len(catalog.filter(regime="leo", norad_id=31698)) == 1
    assert len(catalog.filter(epoch_within=(utc(2013, 1, 1), utc(2020, 12, 31)))) == 2
    assert len(catalog.filter(max_age_days=1.0, at=utc(2020, 10, 16))) == 1
    for wrong in ({"regime": "low"}, {"max_age_days": 3.0}, {"epoch_within": (datetime.datetime(2020, 1, 1),) * 2}):
        with pytest.raises(CatalogError):
            catalog.filter(**wrong)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".xml", ".kvn", ".tle"])
def test_what_is_written_is_read_again(suffix, tmp_path):
    text = "\n".join(BOTH) + ("\n" + kvn(RECORD) if suffix != ".tle" else "")
    catalog = Catalog.from_text(text)
    path = tmp_path / f"out{suffix}"
    catalog.write(path)
    again = Catalog.from_file(path)
    assert again.problems == ()
    assert [entry.omm() for entry in again] == [entry.omm() for entry in catalog]
    with pytest.raises(CatalogError, match="not a format of catalogues"):
        catalog.write(tmp_path / "out.xls")
    with pytest.raises(CatalogError, match="the largest of a TLE"):
        Catalog.from_text(kvn(RECORD)).write(tmp_path / "out.tle")


@pytest.mark.parametrize("suffix", [".json", ".csv", ".xml", ".kvn"])
def test_no_digit_and_no_sign_of_a_name_is_lost(suffix, tmp_path):
    names = ["", "#1", "A & B <C>", 'SAY "HI", TWICE', "DEB [2]", "SATÉLITE 日本", "X = 1"]
    records = [
        RECORD
        | {
            "OBJECT_NAME": name,
            "NORAD_CAT_ID": 100_000_000 + k,
            "ECCENTRICITY": 0.1 + 0.2 + 1e-17 * k,
            "MEAN_ANOMALY": 1.0 / (3.0 + k),
            "BSTAR": -1.234567890123e-12,
            "EPOCH": "2024-09-17T12:00:00.123456789",
        }
        for k, name in enumerate(names)
    ]
    catalog = Catalog.from_text(json.dumps(records))
    assert len(catalog) == len(names)
    catalog.write(tmp_path / f"out{suffix}")
    again = Catalog.from_file(tmp_path / f"out{suffix}")
    assert again.problems == ()
    assert [entry.omm() for entry in again] == [entry.omm() for entry in catalog]


def test_written_messages_are_read_by_another_reader(tmp_path):
    from sgp4 import omm
    from sgp4.api import Satrec

    Catalog.from_text("\n".join(TERRASAR)).write(tmp_path / "out.xml")
    with (tmp_path / "out.xml").open(encoding="utf-8") as file:
        (fields,) = omm.parse_xml(file)
    satellite = Satrec()
    omm.initialize(satellite, fields)
    other = Satrec.twoline2rv(*TERRASAR)
    np.testing.assert_allclose(
        satellite.sgp4_tsince(90.0)[1], other.sgp4_tsince(90.0)[1], rtol=0.0, atol=1e-5
    )  # km: its epoch is 0.3 us coarse


def test_what_a_web_page_or_an_old_disk_puts_around():
    catalog = Catalog.from_text("<pre>\n" + "\n".join(TERRASAR) + "\n</pre>\n")
    assert [(entry.name, entry.norad_id) for entry in catalog] == [("", 31698)]
    assert [problem.split(":")[1] for problem in catalog.problems] == [" line 1", " line 4"]
    assert Catalog.from_text("\n".join(TERRASAR) + "\x1a").problems == ()
    named = RECORD | {"OBJECT_NAME": "IRIDIUM 7 [-]", "INCLINATION": "86 [deg]"}
    (only,) = Catalog.from_text(kvn(named))
    assert (only.name, only.inclination_deg) == ("IRIDIUM 7 [-]", 86.0)


def test_other_encodings(tmp_path):
    path = tmp_path / "one.tle"
    path.write_bytes("\n".join(["SATÉLITE", *TERRASAR]).encode("latin-1"))
    assert Catalog.from_file(path).sets[0].name == "SATÉLITE"
    path.write_bytes("\r\n".join(["SATÉLITE", *TERRASAR, ""]).encode("utf-16"))
    assert Catalog.from_file(path).sets[0].norad_id == 31698


def test_every_real_file_is_whole(shared):
    for path in sorted((shared / "tle" / "pairs").glob("*.tle")):
        catalog = Catalog.from_file(path)
        assert catalog.problems == ()
        assert 2 * sum(line[:2] == "1 " for line in path.read_text().splitlines()) >= 2 * len(catalog) > 0
