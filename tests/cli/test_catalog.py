"""`rso-lidar catalog`: what it lists, what it writes, and what it says to what it cannot read."""

import json
import math
import re

import pytest

from rso_lidar.cli import main
from rso_lidar.cli.catalog import compute_heights_km
from rso_lidar.errors import CatalogError
from rso_lidar.orbit import Catalog, ElementSet, SetSequence
from rso_lidar.orbit.sets.tle_text import compute_checksum
from rso_lidar.shipped import shipped

FLYBY = shipped("tle/flyby.tle")
# The ISS at three epochs in 2026, and a second object; elements made up, of the real orbit's size.
EPOCHS = ("26127.25000000", "26128.25000000", "26130.25000000")


def lines(number, name, epoch, turns="15.49000000", e="0006000", anomaly="350.0000"):
    """Return the three lines of a set with its checksums."""
    first = f"1 {number:05d}U 98067A   {epoch}  .00010000  00000+0  18000-3 0  999"
    second = f"2 {number:05d}  51.6300 100.0000 {e}  10.0000 {anomaly} {turns}00000"
    return [f"0 {name}", *(f"{line}{compute_checksum(line)}" for line in (first, second))]


@pytest.fixture
def file(tmp_path):
    """Return a catalogue: an object at three epochs, two GEO objects, a duplicate, and twelve bad records."""
    text = [line for epoch in EPOCHS for line in lines(25544, "ISS (ZARYA)", epoch)]
    text += lines(28358, "INTELSAT 10-02", EPOCHS[0], " 1.00270000", "0001000")
    text += lines(41866, "GOES 16", EPOCHS[1], " 1.00273791", "0000000")
    text += lines(41866, "GOES 16", EPOCHS[1], " 1.00273791", "0000000")
    for k in range(12):
        name, first, second = lines(60000 + k, f"BAD {k}", EPOCHS[0])
        text += [name, first, f"{second[:68]}{(int(second[68]) + 1) % 10}"]
    path = tmp_path / "some.tle"
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def call(capsys):
    """Return a function that runs the command and gives status, lines of standard output and of standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main(["catalog", *(str(argument) for argument in arguments)])
        printed = capsys.readouterr()
        return left.value.code or 0, printed.out.splitlines(), printed.err.splitlines()

    return run


def test_objects_summary_and_the_first_bad_records(call, file):
    status, out, err = call(file)
    assert (status, err) == (0, [])
    assert [re.split("  +", line)[0] for line in out[1:4]] == ["ISS (ZARYA)", "INTELSAT 10-02", "GOES 16"]
    iss, _, goes = (re.split("  +", line) for line in out[1:4])
    assert iss[1:3] == ["25544", "leo"]
    assert iss[4:] == ["51.63", "3", "2026-05-07T06:00Z to 2026-05-10T06:00Z"]
    assert goes[2:] == ["geo", "35,786 x 35,786", "51.63", "1", "2026-05-08T06:00Z"]
    assert out[4] == "some.tle: 5 good element sets, 3 objects; 1 duplicate, 12 bad records"
    assert out[5].startswith(f"bad: {file}: line 21: wrong checksum")
    assert len(out) == 16
    assert out[-1] == "and 2 more bad records; give --problems for all"


def test_all_bad_records(call, file):
    _, out, _ = call(file, "--problems")
    assert sum(line.startswith("bad: ") for line in out) == 12
    assert "more bad" not in out[-1]


def test_heights_of_the_geostationary_orbit():
    # one turn in a sidereal day: the radius is 42,164.17 km (Vallado, Fundamentals, 4th ed., sec. 2.3 gives 42,164.169)
    low, high = compute_heights_km(ElementSet("", 1, mean_motion_rev_day=1.002_737_909_350_795, eccentricity=0.0))
    assert low == high == pytest.approx(42_164.17 - 6_378.137, abs=0.01)
    low, high = compute_heights_km(ElementSet("", 1, mean_motion_rev_day=2.0, eccentricity=0.7))
    assert (high + 6_378.137) / (low + 6_378.137) == pytest.approx(1.7 / 0.3, rel=1e-12)


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        (["--name", "iss"], ["ISS (ZARYA)"]),
        (["--name", "*16"], ["GOES 16"]),
        (["--id", "41866"], ["GOES 16"]),
        (["--id", "41866,25544"], ["ISS (ZARYA)", "GOES 16"]),
        (["--id", "41866", "--id", "28358"], ["INTELSAT 10-02", "GOES 16"]),
        (["--regime", "geo"], ["INTELSAT 10-02", "GOES 16"]),
        (["--near", "2026-05-08T00:00:00Z", "--max-age-days", "0.5"], ["ISS (ZARYA)", "GOES 16"]),
        (["--regime", "heo"], []),
    ],
)
def test_filters(call, file, asked, names):
    status, out, _ = call(file, *asked)
    assert status == 0
    at = next(k for k, line in enumerate(out) if line.startswith("some.tle: "))
    if names:
        assert [re.split("  +", line)[0] for line in out[1:at]] == names
    else:
        assert out[0] == "no object found"
    assert f"of them requested), {len(names)} object{'s' * (len(names) != 1)};" in out[at]


def test_jumps_of_several_epochs(call, file):
    _, out, _ = call(file, "--id", "25544", "--id", "41866", "--jumps")
    begin = out.index("ISS (ZARYA) (NORAD 25544): 3 sets, which give way to the next half-way between their epochs:")
    assert [line.split()[0] for line in out[begin + 1 : begin + 3]] == ["2026-05-07T18:00:00Z", "2026-05-09T06:00:00Z"]
    sets = [entry for entry in Catalog.from_file(file) if entry.norad_id == 25544]
    for line, jump in zip(out[begin + 1 : begin + 3], SetSequence(tuple(sets)).jumps(), strict=True):
        assert f"jumps {jump.position_m:,.0f} m and {jump.velocity_m_s:.2f} m/s" in line
        assert math.isfinite(jump.position_m)
    assert out[begin + 3] == "GOES 16 (NORAD 41866): one set, no jump"


@pytest.mark.parametrize("suffix", [".json", ".csv", ".tle"])
def test_what_is_written_reads_the_same(call, file, tmp_path, suffix):
    output = tmp_path / f"part{suffix}"
    status, out, err = call(file, "--id", "25544", "-o", output)
    assert (status, out[-1], err) == (0, str(output), [])
    again = Catalog.from_file(output)
    assert [(entry.norad_id, entry.name, entry.omm()) for entry in again] == [
        (25544, "ISS (ZARYA)", entry.omm()) for entry in Catalog.from_file(file) if entry.norad_id == 25544
    ]
    assert again.problems == ()
    assert {place.name for place in tmp_path.iterdir()} == {"some.tle", output.name}  # no draft is left
    status, _, err = call(file, "--id", "25544", "-o", output)
    assert status == 2
    assert "exists already" in err[0]
    assert call(file, "--regime", "geo", "-o", output, "--overwrite")[0] == 0
    assert len(Catalog.from_file(output)) == 2


def test_a_set_that_no_tle_can_name_leaves_nothing(call, tmp_path):
    (entry, *_) = Catalog.from_file(FLYBY)
    source, output = tmp_path / "nine.json", tmp_path / "nine.tle"
    source.write_text(json.dumps([entry.omm() | {"NORAD_CAT_ID": 123_456_789}]), encoding="utf-8")
    status, _, err = call(source, "-o", output)
    assert (status, len(err)) == (2, 1)
    assert "write .json" in err[0]
    assert [place.name for place in tmp_path.iterdir()] == ["nine.json"]
    assert call(source, "--id", "123456789", "-o", tmp_path / "nine.csv")[0] == 0


def test_a_write_that_fails_half_way_leaves_what_was_there(call, file, tmp_path, monkeypatch):
    output = tmp_path / "a.json"
    output.write_text("[]", encoding="utf-8")

    def broken(self, path):
        path.write_text("[{", encoding="utf-8")
        raise CatalogError(f"{path}: cannot be written: no room: choose another place")

    monkeypatch.setattr(Catalog, "write", broken)
    status, _, err = call(file, "-o", output, "--overwrite")
    assert (status, err) == (2, [f"error: {output}: cannot be written: no room: choose another place"])
    assert output.read_text(encoding="utf-8") == "[]"
    assert {place.name for place in tmp_path.iterdir()} == {"some.tle", "a.json"}


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["--id", "25545"], "no object 25545 among 3; did you mean '25544'?"),
        (["--id", "60003"], "line 30: wrong checksum"),
        (["--id", "ISS"], "--id ISS: is not a catalogue number"),
        (["--id", "1234567890"], "is not a catalogue number; give up to nine digits"),
        (["--regime", "gio"], "unknown regime; did you mean 'geo'?"),
        (["--near", "2026-05-08T00:00:00Z"], "go together"),
        (["--near", "yesterday", "--max-age-days", "1"], "--near yesterday: is not a time"),
        (["--near", "2026-05-08T00:00:00", "--max-age-days", "1"], "end it with Z"),
        (["--near", "2026-05-08T00:00:00Z", "--max-age-days", "nan"], "is not an age"),
        (["--jumps"], "name it with --id"),
        (["-o", "{}/a.xls"], "unknown suffix '.xls'"),
        (["-o", "{}/none/a.json"], "there is no folder"),
        (["--name", "nothing", "-o", "{}/a.json"], "is left to write"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(call, file, tmp_path, asked, message):
    status, out, err = call(file, *(word.format(tmp_path) for word in asked))
    assert (status, out, len(err)) == (2, [], 1)
    assert message in err[0]
    assert [place.name for place in tmp_path.iterdir()] == ["some.tle"]


@pytest.mark.parametrize(
    ("content", "message"), [(b"", "is empty"), (b"\0\1\2", "is not UTF-8 text"), (b"hello\n", "does not contain")]
)
def test_what_is_no_catalogue(call, tmp_path, content, message):
    path = tmp_path / "a.tle"
    path.write_bytes(content)
    status, out, err = call(path)
    assert (status, out, len(err)) == (2, [], 1)
    assert message in err[0]


def test_a_file_that_is_not_there(call, tmp_path):
    status, _, err = call(tmp_path / "none.tle")
    assert status == 2
    assert "no such file" in err[0]


@pytest.mark.parametrize("suffix", [".json", ".csv", ".tle"])
def test_a_file_of_the_users_own_is_left_alone(call, file, tmp_path, suffix):
    own = tmp_path / f"a.part{suffix}"
    own.write_text("mine", encoding="utf-8")
    assert call(file, "--id", "25544", "-o", tmp_path / f"a{suffix}")[0] == 0
    assert own.read_text(encoding="utf-8") == "mine"
    assert len(list(tmp_path.iterdir())) == 3


def test_what_cannot_be_written_is_told_before_anything_is_shown(call, file, tmp_path, monkeypatch):
    source = tmp_path / "b.json"
    (entry,) = Catalog.from_file(file).filter(norad_id=28358)
    for change in ({"NORAD_CAT_ID": 340_000}, {"BSTAR": 1e11}, {"EPOCH": "2060-01-01T00:00:00"}):
        source.write_text(json.dumps([entry.omm() | change]), encoding="utf-8")
        status, out, err = call(source, "-o", tmp_path / "b.tle")
        assert (status, out, len(err)) == (2, [], 1)
        assert "write .json" in err[0]
    assert {place.name for place in tmp_path.iterdir()} == {"some.tle", "b.json"}

    def refused(path, mode="r", **_):
        raise PermissionError(13, "Permission denied")

    Catalog.from_file(file)
    monkeypatch.setattr("pathlib.Path.open", refused)
    status, out, err = call(file, "-o", tmp_path / "c.json")
    assert (status, out, len(err)) == (2, [], 1)
    assert "c.json: may not be written" in err[0]


def test_names_of_controls_and_halves_of_characters_are_one_row(call, file, tmp_path):
    (entry,) = Catalog.from_file(file).filter(norad_id=28358)
    names = ["A\nB\x1b[31m\x07", "x\ud800y", "[bold]z[/]"]
    records = [entry.omm() | {"OBJECT_NAME": name, "NORAD_CAT_ID": 5 + k} for k, name in enumerate(names)]
    source = tmp_path / "names.json"
    source.write_text(json.dumps(records), encoding="utf-8")
    status, out, _ = call(source)
    assert status == 0
    assert [re.split("  +", line)[0] for line in out[1:4]] == ["A B [31m", "x?y", "[bold]z[/]"]
    assert len(out) == 5


@pytest.mark.parametrize("turns", [1e-300, 1e-9, 1e300])
def test_a_mean_motion_of_no_orbit_is_a_bad_record(call, file, tmp_path, turns):
    (entry,) = Catalog.from_file(file).filter(norad_id=28358)
    source = tmp_path / "a.json"
    source.write_text(json.dumps([entry.omm(), entry.omm() | {"MEAN_MOTION": turns}]), encoding="utf-8")
    status, out, err = call(source)
    assert (status, err, len(out)) == (0, [], 4)
    assert "not that of an orbit about the Earth" in out[-1]


def test_errors_of_the_sets_of_an_object(call, file, tmp_path):
    status, out, err = call(file, "--id", 25544, "--errors")
    assert (status, err) == (0, [])
    assert "ISS (ZARYA) (NORAD 25544): differences between its own element sets by age" in out[2]
    assert any(line.startswith("consistency, not accuracy") for line in out)
    assert [line.split()[3] for line in out[4:10]] == ["0", "0", "1", "1", "1", "0"]  # pairs: after 1, 2 and 3 days
    status, out, err = call(file, "--errors")
    assert (status, out) == (2, [])
    assert err == ["error: --errors: is about one object; name it with --id"]
    status, _, err = call(file, "--id", 28358, "--errors")
    assert (status, len(err)) == (2, 1)
    assert "has one element set; differences need two or more" in err[0]
