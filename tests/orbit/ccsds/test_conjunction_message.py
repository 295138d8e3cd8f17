"""Conjunction data messages: both notations, frames, and what a wrong file is told."""

import datetime
import re

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import ConjunctionMessage
from rso_lidar.orbit.earth.axes import gcrs_from_eme2000
from rso_lidar.shipped import shipped

TEXT = shipped("tle/flyby.cdm").read_text(encoding="ascii")


def to_xml(text):
    """Return the message in XML, with the containers of the standard."""
    leaves = [
        re.fullmatch(r"(\w+) = (.*?)(?: \[(.*)\])?", line).groups()
        for line in text.splitlines()
        if not line.startswith("COMMENT")
    ]

    def write(some):
        return "".join(
            f"<{key}" + (f' units="{unit}"' if unit else "") + f">{value}</{key}>\n" for key, value, unit in some
        )

    version, rest = leaves[0][1], leaves[1:]
    edges = [k for k, leaf in enumerate(rest) if leaf[0] == "OBJECT"]
    header, first, second = rest[: edges[0]], rest[edges[0] : edges[1]], rest[edges[1] :]
    body = "".join(
        f"<segment><metadata>{write(part[:9])}</metadata><data><stateVector>{write(part[9:15])}</stateVector>"
        f"<covarianceMatrix>{write(part[15:])}</covarianceMatrix></data></segment>"
        for part in (first, second)
    )
    return (
        f'<?xml version="1.0"?><cdm id="CCSDS_CDM_VERS" version="{version}"><header><COMMENT>none</COMMENT>'
        f"{write(header[:3])}</header><body><relativeMetadataData>{write(header[3:])}</relativeMetadataData>{body}"
        "</body></cdm>"
    )


def test_the_shipped_message_is_read():
    message = ConjunctionMessage.from_file("tle/flyby.cdm")
    assert (message.message_id, message.originator) == ("SYNTHETIC-1", "RSO_LIDAR")
    assert message.tca_utc == datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
    assert (message.stated_miss_m, message.stated_speed_m_s, message.stated_radius_m) == (120.0, 25.0, 6.0)
    assert message.stated_probability is None
    first, second = message.first, message.second
    assert (first.norad_id, second.norad_id) == (99003, 99002)
    assert first.label == "FOLLOWER (SYNTHETIC) (99003)"
    assert first.position_m == pytest.approx([7_078_137.0, 0.0, 0.0])
    assert np.linalg.norm(second.position_m - first.position_m) == pytest.approx(120.0, abs=0.01)
    assert np.sqrt(np.diag(second.covariance_rtn)) == pytest.approx([20.0, 150.0, 15.0, 0.15, 0.02, 0.015])
    assert second.covariance_rtn[3, 1] == second.covariance_rtn[1, 3] == pytest.approx(-0.9 * 0.15 * 150.0)


def test_xml_says_the_same_as_keywords():
    text, xml = ConjunctionMessage.from_text(TEXT), ConjunctionMessage.from_text(to_xml(TEXT))
    assert xml.tca_utc == text.tca_utc
    assert xml.stated_radius_m is None  # the radius is in a comment, which XML readers skip
    for one, other in ((text.first, xml.first), (text.second, xml.second)):
        assert one.label == other.label
        assert np.array_equal(one.position_m, other.position_m)
        assert np.array_equal(one.covariance_rtn, other.covariance_rtn)


def test_eme2000_is_turned_by_the_frame_bias():
    message = ConjunctionMessage.from_text(TEXT.replace("REF_FRAME = GCRF", "REF_FRAME = EME2000"))
    plain = ConjunctionMessage.from_text(TEXT)
    assert message.first.position_m == pytest.approx(gcrs_from_eme2000() @ plain.first.position_m)
    assert 0.1 < np.linalg.norm(message.first.position_m - plain.first.position_m) < 2.0  # 23 mas at 7000 km


def test_terms_of_velocity_may_be_left_out_but_not_a_part_of_them():
    short = "\n".join(line for line in TEXT.splitlines() if "DOT_" not in line.partition("=")[0])
    message = ConjunctionMessage.from_text(short)
    assert not message.first.has_velocity_covariance
    assert not message.first.covariance_rtn[3:].any()
    with pytest.raises(ScenarioError, match=r"^CDM: OBJECT1 lacks CTDOT_N, which the standard requires"):
        ConjunctionMessage.from_text("\n".join(line for line in TEXT.splitlines() if "CTDOT_N " not in line))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("CCSDS_CDM_VERS = 1.0", "CCSDS_OEM_VERS = 2.0", "CDM: line 1: begins with 'CCSDS_OEM_VERS = 2.0'; a CDM"),
        ("CCSDS_CDM_VERS = 1.0", "CCSDS_CDM_VERS = 7.0", "CDM: CCSDS_CDM_VERS 7.0 is not supported"),
        ("TCA = ", "TCB = ", "CDM: the message lacks TCA"),
        ("TCA = 2024-09-17", "TCA = 2024-19-17", "CDM: line 6: epoch '2024-19-17"),
        ("OBJECT = OBJECT2", "OBJECT = OBJECT3", "CDM: line .*: OBJECT OBJECT3; a message has OBJECT1 and then"),
        ("REF_FRAME = GCRF", "REF_FRAME = MOON_ME", "CDM: line 18: reference frame MOON_ME is not supported"),
        ("CR_R = 1.000000e+02 [m**2]", "CR_R = 1e2 [km**2]", r"CDM: line 25: CR_R in km\*\*2; write it in m\*\*2"),
        ("CR_R = 1.000000e+02", "CR_R = many", "CDM: line 25: CR_R 'many' is not a number"),
        ("X = 7078.137000000", "X = 7.078", "CDM: OBJECT1: its position is 7 km from the Earth's centre"),
        (
            "Y_DOT = -0.992499433 [km/s]\nZ_DOT = 7.438437260 [km/s]",
            "Y_DOT = 0\nZ_DOT = 0",
            "CDM: OBJECT1: its velocity has no part across its position",
        ),
        (
            "MISS_DISTANCE = 120",
            "MISS_DISTANCE = 120\nMISS_DISTANCE = 120",
            "CDM: line 8: MISS_DISTANCE is given twice",
        ),
        ("MISS_DISTANCE = 120", "as far as 120", "CDM: line 7: 'as far as 120 .m.' is not KEYWORD = value"),
        ("RELATIVE_SPEED = 25 [m/s]", "COLLISION_PROBABILITY = 1.5", "CDM: line 8: COLLISION_PROBABILITY is 1.5; give"),
        ("CATALOG_NAME = SATCAT", "ORBIT_CENTER = MOON", "CDM: line 12: ORBIT_CENTER MOON; only EARTH"),
        ("HBR = 6 [m]", "HBR = -6 [m]", "CDM: line 9: HBR is -6; give"),
    ],
)
def test_a_wrong_line_is_named(old, new, said):
    assert old in TEXT
    with pytest.raises(ScenarioError, match=f"^{said}"):
        ConjunctionMessage.from_text(TEXT.replace(old, new, 1))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<cdm><header>", "CDM: line 1: is not well-formed XML"),
        ("<!DOCTYPE cdm><cdm/>", "CDM: has a DOCTYPE"),
        ("<oem version='2.0'/>", "CDM: does not contain <cdm>"),
        ("<ndm><cdm version='1.0'/><cdm version='1.0'/></ndm>", "CDM: holds several <cdm>"),
        ("COMMENT nothing", "CDM: is empty"),
        (TEXT.partition("OBJECT = OBJECT2")[0], "CDM: holds 1 of the two objects"),
    ],
)
def test_a_file_that_is_none_is_refused(text, said):
    with pytest.raises(ScenarioError, match=f"^{said}"):
        ConjunctionMessage.from_text(text)


def test_a_missing_file_is_named():
    with pytest.raises(ScenarioError, match=r"^nowhere\.cdm: no such file"):
        ConjunctionMessage.from_file("nowhere.cdm")


@pytest.mark.parametrize("area", ["NaN [m**2]", "0.0 [m**2]", "-1", "unknown", "3.1 [cm**2]", "1e99"])
def test_an_area_that_is_no_area_counts_as_not_given(area):
    message = ConjunctionMessage.from_text(TEXT.replace("CR_R = ", f"AREA_PC = {area}\nCR_R = ", 1))
    assert message.first.area_m2 is None and message.stated_radius_m == 6.0
    assert (
        ConjunctionMessage.from_text(TEXT.replace("CR_R = ", "AREA_PC = 3.5 [m**2]\nCR_R = ", 1)).first.area_m2 == 3.5
    )


def test_optional_figures_that_are_unknown_count_as_not_given():
    text = TEXT.replace("MISS_DISTANCE = 120", "MISS_DISTANCE = NaN").replace(
        "RELATIVE_SPEED = 25", "RELATIVE_SPEED = N/A"
    )
    message = ConjunctionMessage.from_text(text)
    assert (message.stated_miss_m, message.stated_speed_m_s) == (None, None)
    assert np.array_equal(message.first.covariance_rtn, ConjunctionMessage.from_text(TEXT).first.covariance_rtn)


def test_keywords_without_use_never_block_a_message():
    unused = "MASS = many [stone]\nTIME_LASTOB_START = NaN\nCD_AREA_OVER_MASS = 1e99 [m]\nMASS = 3\nCDRG_R = NaN\n"
    message = ConjunctionMessage.from_text(TEXT.replace("CR_R = ", f"{unused}CR_R = ", 1))
    assert np.array_equal(message.first.position_m, ConjunctionMessage.from_text(TEXT).first.position_m)


def test_a_covariance_may_be_that_of_an_unknown_position():
    message = ConjunctionMessage.from_text(TEXT.replace("CR_R = 1.000000e+02", "CR_R = 3.7e13"))
    assert message.first.covariance_rtn[0, 0] == 3.7e13
    with pytest.raises(ScenarioError, match=r"^CDM: line 25: CR_R is 1e30; give a finite number within 1e"):
        ConjunctionMessage.from_text(TEXT.replace("CR_R = 1.000000e+02", "CR_R = 1e30"))
    nowhere = re.sub(r"(C[RTN]DOT_\w+) = \S+", r"\1 = NaN", TEXT)
    assert not ConjunctionMessage.from_text(nowhere).first.has_velocity_covariance


def test_a_prefix_of_a_namespace_and_other_messages_around_change_nothing():
    xml = to_xml(TEXT)
    body = xml.removeprefix('<?xml version="1.0"?>')
    several = f"<ndm:ndm xmlns:ndm='urn:x'><oem version='2.0'><header><TCA>no</TCA></header></oem>{body}</ndm:ndm>"
    prefixed = several.replace("<cdm ", "<ndm:cdm ").replace("</cdm>", "</ndm:cdm>")
    for text in (several, prefixed):
        message = ConjunctionMessage.from_text(text)
        assert np.array_equal(message.second.position_m, ConjunctionMessage.from_text(xml).second.position_m)
