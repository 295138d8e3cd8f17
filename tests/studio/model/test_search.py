"""Element sets: pasted lines, and the search in a catalogue."""

import pytest

from rso_lidar.errors import CatalogError, RsoLidarError
from rso_lidar.orbit import Omm, Tle
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.search import read_pasted_set, search_sets

TDRS = shipped("tle/tdrs.tle").read_text(encoding="utf-8")


def make_lines(number, name=""):
    """Return a set with another number, and right checksums."""
    one, two = [line for line in TDRS.splitlines() if line[:2] in ("1 ", "2 ")][:2]

    def seal(line):
        body = f"{line[:2]}{number:05d}{line[7:68]}"
        return body + str(sum(int(c) if c.isdigit() else c == "-" for c in body) % 10)

    return "\n".join(([name] if name else []) + [seal(one), seal(two)]) + "\n"


OMM = """OBJECT_NAME = TDRS 3
NORAD_CAT_ID = 100019548
EPOCH = 2024-09-17T03:12:45.123456
MEAN_MOTION = 1.00271
ECCENTRICITY = 0.0041
INCLINATION = 13.9
RA_OF_ASC_NODE = 345.0
ARG_OF_PERICENTER = 200.0
MEAN_ANOMALY = 160.0
BSTAR = 0
"""


def test_a_pasted_set_is_the_motion_that_its_lines_state():
    motion = read_pasted_set(TDRS)
    assert isinstance(motion, Tle)
    assert "\n".join(motion.lines) == TDRS.strip()
    assert read_pasted_set("\r\n\n" + TDRS.replace("\n", "  \r\n") + "\n\n") == motion


def test_a_pasted_message_is_a_motion_with_its_numbers():
    motion = read_pasted_set(OMM)
    assert isinstance(motion, Omm)
    assert (motion.object_name, motion.norad_id, motion.inclination_deg) == ("TDRS 3", 100019548, 13.9)


@pytest.mark.parametrize(
    "text", ["", "words", TDRS.splitlines()[0], "1 2 3\n2 3 4", "\0", "1 " * 70, OMM.replace("0.0041", "1.5")]
)
def test_what_is_no_set_is_refused_in_one_line(text):
    with pytest.raises(RsoLidarError) as caught:
        read_pasted_set(text)
    assert "\n" not in str(caught.value)
    assert "pasted" in str(caught.value)


def test_a_wrong_checksum_is_refused():
    lines = TDRS.split()
    wrong = TDRS.strip()[:-1] + str((int(lines[-1][-1]) + 1) % 10)
    with pytest.raises(RsoLidarError, match=r"(?i)checksum"):
        read_pasted_set(wrong)


def test_two_sets_are_refused():
    with pytest.raises(CatalogError, match="paste one"):
        read_pasted_set(make_lines(11) + make_lines(12))


def test_words_beside_a_set_are_refused():
    with pytest.raises(CatalogError, match="pasted text: line 1: 'see below'"):
        read_pasted_set(f"see below\n\n{make_lines(11, 'A')}")


def test_a_catalogue_is_searched_by_name_and_number(tmp_path):
    text = "".join(make_lines(20000 + k, f"OBJECT {chr(65 + k)}") for k in range(20))
    catalogue = tmp_path / "all.tle"
    catalogue.write_text(text + OMM + make_lines(11)[:-2] + "x\n", encoding="utf-8")
    assert len(search_sets(catalogue, "", 50)) == 21  # without the last one, whose checksum is wrong
    assert len(search_sets(catalogue, "", 5)) == 5
    (by_number,) = search_sets(catalogue, "20003", 50).items()
    (by_name,) = search_sets(catalogue, "object d", 50).items()
    assert by_number == by_name
    assert "OBJECT D (20003), 20" in by_number[0]
    assert read_pasted_set("\n".join(by_number[1].lines)) == by_number[1]
    assert list(search_sets(catalogue, "tdrs", 50).values()) == [read_pasted_set(OMM)]
    with pytest.raises(CatalogError, match="no set has 'zenith'"):
        search_sets(catalogue, "zenith", 50)


def test_every_shipped_set_is_found():
    for path in sorted(shipped("tle").glob("*.tle")):
        for motion in search_sets(path, "", 3).values():
            assert read_pasted_set("\n".join(motion.lines)) == motion
