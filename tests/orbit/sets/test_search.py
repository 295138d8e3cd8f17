"""Element sets: pasted lines, and the search in a catalogue."""

import pytest

from rso_lidar.errors import CatalogError, RsoLidarError
from rso_lidar.orbit import Tle
from rso_lidar.orbit.sets.search import check_lines, search_sets
from rso_lidar.shipped import shipped

TDRS = shipped("tle/tdrs.tle").read_text(encoding="utf-8")


def make_lines(number, name=""):
    """Return a set with another number, and right checksums."""
    one, two = [line for line in TDRS.splitlines() if line[:2] in ("1 ", "2 ")][:2]

    def seal(line):
        body = f"{line[:2]}{number:05d}{line[7:68]}"
        return body + str(sum(int(c) if c.isdigit() else c == "-" for c in body) % 10)

    return "\n".join(([name] if name else []) + [seal(one), seal(two)]) + "\n"


def test_pasted_lines_are_those_that_a_motion_takes():
    lines = check_lines(TDRS)
    assert Tle(lines=lines).lines == lines
    assert check_lines("\r\n\n" + TDRS.replace("\n", "  \r\n") + "\n\n") == lines


@pytest.mark.parametrize("text", ["", "words", TDRS.splitlines()[0], "1 2 3\n2 3 4", "\0", "1 " * 70])
def test_what_is_no_set_is_refused_in_one_line(text):
    with pytest.raises(RsoLidarError) as caught:
        check_lines(text)
    assert "\n" not in str(caught.value)
    assert "pasted" in str(caught.value)


def test_a_wrong_checksum_is_refused():
    lines = check_lines(TDRS)
    wrong = [*lines[:-1], lines[-1][:-1] + str((int(lines[-1][-1]) + 1) % 10)]
    with pytest.raises(RsoLidarError, match=r"(?i)checksum"):
        check_lines("\n".join(wrong))


def test_two_sets_are_refused():
    with pytest.raises(CatalogError, match="paste one"):
        check_lines(make_lines(11) + make_lines(12))


def test_a_catalogue_is_searched_by_name_and_number(tmp_path):
    text = "".join(make_lines(20000 + k, f"OBJECT {chr(65 + k)}") for k in range(20))
    catalogue = tmp_path / "all.tle"
    catalogue.write_text(text, encoding="utf-8")
    assert len(search_sets(catalogue, "", 50)) == 20
    assert len(search_sets(catalogue, "", 5)) == 5
    (by_number,) = search_sets(catalogue, "20003", 50).items()
    (by_name,) = search_sets(catalogue, "object d", 50).items()
    assert by_number == by_name
    assert "OBJECT D (20003), 20" in by_number[0]
    assert check_lines("\n".join(by_number[1])) == by_number[1]
    with pytest.raises(CatalogError, match="no two-line set has 'zenith'"):
        search_sets(catalogue, "zenith", 50)


def test_every_shipped_set_is_found_and_can_be_flown():
    for path in sorted(shipped("tle").glob("*.tle")):
        for lines in search_sets(path, "", 3).values():
            assert check_lines("\n".join(lines)) == lines
