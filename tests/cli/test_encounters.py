"""`rso-lidar encounters`: what it prints, what it writes, and what it refuses."""

import csv
import datetime
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.cli import encounters as command
from rso_lidar.cli import table
from rso_lidar.errors import RsoLidarError, RsoLidarWarning
from rso_lidar.orbit import Catalog, Epochs, Fleet, State, orbit_state_matrix, write_oem, write_opm
from rso_lidar.records import BodyState
from rso_lidar.shipped import shipped
from tests.orbit.sets.sets_for_tests import with_checksum

FLYBY = str(shipped("tle/flyby.tle"))
ASKED = ["--follower", "99003", "--within", "20km", "--start", "2024-09-17T11:00:00Z", "--days", "0.125"]


@pytest.fixture
def call(alone):
    return alone(command.encounters)


def test_table_csv_plot_and_scenario(call, tmp_path):
    places = [tmp_path / name for name in ("a.csv", "a.png", "a.toml")]
    out = call(FLYBY, *ASKED, "--csv", places[0], "--plot", places[1], "--scenario", "1", "-o", places[2])
    assert "1.5" in out
    assert "good to about a kilometre" in out
    assert all(place.stat().st_size > 100 for place in places)
    assert rl.Scenario.load(places[2]).target[0].name
    assert len(list(tmp_path.iterdir())) == 3  # no drafts are left
    with pytest.raises(RsoLidarError, match=r"a\.csv: exists already"):
        call(FLYBY, *ASKED, "--csv", places[0])
    call(FLYBY, *ASKED, "--csv", places[0], "--overwrite")


def test_docked_craft_cost_the_scenario_alone(call, tmp_path):
    text = Path(FLYBY).read_text(encoding="utf-8")
    lines = text.strip().split("\n")[-2:]
    twin = [with_checksum(line.replace(" 99003", " 99004", 1)) for line in lines]
    both = tmp_path / "both.tle"
    both.write_text("\n".join(["FOLLOWER", *lines, "TWIN", *twin]) + "\n", encoding="utf-8")
    with pytest.raises(RsoLidarError, match=r"^scenario 1: TWIN .*docked or one object.*; give another row$") as caught:
        call(both, *ASKED, "--csv", tmp_path / "a.csv", "--scenario", 1, "-o", tmp_path / "a.toml")
    assert "\n" not in str(caught.value)
    assert sorted(place.name for place in tmp_path.iterdir()) == ["a.csv", "both.tle"]
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["docked"] == "the catalogue gives both the same elements"


@pytest.mark.slow
def test_the_plate_that_was_asked_for_is_the_target_of_the_scenario(call, tmp_path):
    place = tmp_path / "a.toml"
    call(FLYBY, *ASKED, "--target-size", "3.5m", "--reflectance", 0.1, "--scenario", 1, "-o", place)
    target = rl.Scenario.load(place).target[0]
    assert (target.size_m, target.material.reflectance) == (3.5, 0.1)
    call(FLYBY, *ASKED, "--scenario", 1, "-o", place, "--overwrite")
    target = rl.Scenario.load(place).target[0]
    assert (target.size_m, target.material) == (None, None)


def test_nothing_found_is_no_error(call, tmp_path):
    asked = [word if word != "20km" else "1m" for word in ASKED]
    out = call(FLYBY, *asked, "--csv", tmp_path / "a.csv", "--plot", tmp_path / "a.png")
    assert "no encounter found" in out
    assert [place.name for place in tmp_path.iterdir()] == ["a.csv"]  # a header; nothing to draw


def test_a_lidar_of_a_scenario_file(call, tmp_path):
    out = call(FLYBY, *ASKED, "--lidar", shipped("examples/tle_flyby.toml"), "--scenario", 1, "-o", tmp_path / "a.toml")
    assert "tle_flyby.toml: reaches 1,000 to 3,000 m" in out
    assert rl.Scenario.load(tmp_path / "a.toml").lidar.detector.armed_to_m == 3000


def test_fields_of_scenarios_are_set_as_for_a_run(call, tmp_path):
    out = call(FLYBY, *ASKED, "--lidar", shipped("examples/tle_flyby.toml"), "--set", "lidar.detector.armed_to_m=2500")
    assert "tle_flyby.toml: reaches 1,000 to 2,500 m" in out
    hop = shipped("examples/tdrs_approach.toml")
    asked = (hop, "--follower", hop, "--within", "2km", "--start", "2024-09-17T12:00:00Z", "--days", "0.01")
    rest = ["--set", "follower.motion.position_m=[0,-1500,0]", "--set", "follower.motion.velocity_m_s=[0,0,0]"]
    call(*asked, *rest, "--csv", tmp_path / "a.csv")
    (row,) = read_rows(tmp_path / "a.csv")
    assert float(row["range_m"]) == pytest.approx(1500.0, abs=1.0)  # at rest behind a geosynchronous target, for 14 min
    assert "no encounter found" in call(*asked)
    with pytest.raises(RsoLidarError, match="--set name=x: changes scenarios, and none of the files is one"):
        call(FLYBY, *ASKED, "--set", "name=x")


def test_exclusions_by_options(call, tmp_path):
    place = tmp_path / "a.csv"
    out = call(FLYBY, *ASKED, "--sun-exclusion", 100, "--keep-out", "1500m", "--csv", place)
    assert "Sun 100 deg while any of it is seen" in out
    assert "keep-out: 1500 m about each object" in out
    with place.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["sun_kept"] for row in rows} == {"true", "false"}
    assert {row["moon_kept"] for row in rows} == {""}  # not asked
    assert all(row["keep_out_kept"] == str(float(row["range_m"]) >= 1500.0).lower() for row in rows)
    assert all(0.0 < float(row["clear_s"]) <= float(row["inside_s"]) for row in rows)
    assert all(0.0 <= float(row["moon_angle_deg"]) <= 180.0 for row in rows)


def test_constraints_of_the_scenario_file_hold_and_options_come_first(call, tmp_path):
    camera = tmp_path / "camera.toml"
    text = Path(shipped("examples/tle_flyby.toml")).read_text(encoding="utf-8")
    corridor = '[[constraints.corridor]]\ntarget = "stage"\naxis = [1, 0, 0]\nhalf_angle_deg = 20\n'
    camera.write_text(
        f"{text}\n[constraints]\nmoon_exclusion_deg = 15\nearth_exclusion_deg = 4\n{corridor}", encoding="utf-8"
    )
    out = call(FLYBY, *ASKED, "--lidar", camera, "--moon-exclusion", 25, "--scenario", 1, "-o", tmp_path / "a.toml")
    assert "keeps off Moon 25 deg, Earth's limb 4 deg" in out
    assert "corridor[0]: not applicable: it turns with stage" in out
    made = rl.Scenario.load(tmp_path / "a.toml").constraints
    assert (made.moon_exclusion_deg, made.earth_exclusion_deg, made.corridor) == (25.0, 4.0, ())


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (["--within", "50"], "has no unit; write 50km or 50m"),
        (["--within", "50miles"], "unknown unit 'miles'"),
        (["--within", "near"], "is not a length"),
        (["--start", "tomorrow"], "is not a time; write for example"),
        (["--start", "2024-09-17T11:00:00"], "end it with Z"),
        (["--days", "-1"], "--days: -1 is not a time span"),
        (["--follower", "99004"], "did you mean"),
        (["--all-pairs"], "exclude each other; give --follower or --all-pairs"),
        (["--target-size", "1"], "--target-size 1: has no unit"),
        (["--target-size", "0m"], "--target-size: 0 is out of range"),
        (["--reflectance", "2"], "--reflectance: 2 is out of range"),
        (["--flash-rate", "0"], "--flash-rate: 0 is out of range"),
        (["--follower", FLYBY], "holds 2 objects"),
        (["--lidar", "long_range"], "did you mean 'long_range_1064'"),
        (["--sun-exclusion", "0"], "give degrees over 0, under 180"),
        (["--earth-exclusion", "nan"], "--earth-exclusion nan: is not an angle"),
        (["--keep-out", "500"], "--keep-out 500: has no unit; write 500km or 500m"),
        (["--keep-out", "0m"], "--keep-out: 0 m is not a radius"),
        (["--min-duration", "nan"], "--min-duration nan: is not a duration"),
        (["--csv", "{}/a.txt"], "end its name with .csv"),
        (["--scenario", "1", "-o", "{}/a.h5"], "end its name with .toml"),
        (["--sort", "rnage"], "did you mean 'range'"),
        (["--scenario", "1"], "go together"),
        (["-o", "{}/a.toml"], "go together"),
        (["-o", "{}/a.cvs"], "unknown suffix '.cvs'; did you mean '.csv'"),
        (["-o", "{}/a"], "has no suffix"),
        (["-o", "{}/a.csv", "--csv", "{}/b.csv"], "--csv names another"),
        (["-o", "{}/a.png", "--plot", "{}/b.png"], "--plot names another"),
        (["--scenario", "99", "-o", "{}/a.toml"], "give a number from 1 to"),
        (["--csv", "{}/none/a.csv"], "there is no folder"),
        (["--plot", "{}/a.xyz"], "unknown suffix '.xyz'"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(call, tmp_path, changed, message):
    changed = [word.format(tmp_path) for word in changed]
    with pytest.raises(RsoLidarError) as told:
        call(FLYBY, *ASKED, *changed)
    assert message in str(told.value)
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


def test_a_catalogue_that_is_not_there(call, tmp_path):
    with pytest.raises(RsoLidarError, match="no such file"):
        call(tmp_path / "none.tle", *ASKED)


@pytest.fixture
def named():
    """Return the encounters of the flyby, with names that look like markup."""
    names = ["[/x] :smile:", "[bold]y"]
    sets = list(rl.orbit.Catalog.from_file(FLYBY))
    sets = [type(entry)(**{**entry.__dict__, "name": name}) for entry, name in zip(sets, names, strict=True)]
    start = datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC)
    return command.find(sets, 99003, within_m=20e3, start_utc=start, days=0.125)


@pytest.fixture
def terminal(monkeypatch):
    """Return a function that makes standard output a terminal of so many columns."""
    import rich.console

    plain = rich.console.Console

    def make(width):
        console = plain(force_terminal=True, width=width, color_system=None, markup=False, emoji=False)
        monkeypatch.setattr(table, "make_console", lambda: console)

    return make


@pytest.mark.parametrize("width", [40, 60, 80, 100, 120, 160, 250])
def test_a_terminal_shows_what_fits_and_names_the_rest(named, terminal, capsys, width):
    terminal(width)
    command.print_encounters(named)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= width
    if width < 60:  # even what names an encounter is cut short
        return
    heads, rows = named.cells()
    head = next(line for line in lines if line.strip().startswith("#"))
    rest = " ".join(line.strip() for line in lines)
    if width >= 80:
        shown = [name for name in heads if name in head]
        assert {"#", "object", "closest approach, UTC", "range, km"} <= set(shown)
        assert len(lines[lines.index(head) + 1 : lines.index(head) + 1 + len(rows)]) == len(rows)
        assert ("too wide for this terminal" in rest) == (len(shown) < len(heads))
        assert all(name in rest for name in heads)  # in the table, or in the line that names the rest
    if width == 250:
        assert "too wide" not in rest and all(name in head for name in heads)
        widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
        first = lines[lines.index(head) + 1]
        assert max(len(line.rstrip()) for line in (head, first)) == sum(widths) + 2 * (len(widths) - 1)


def test_a_terminal_shows_names_as_they_are(named, terminal, capsys):
    terminal(250)
    command.print_encounters(named)
    out = capsys.readouterr().out
    assert all(name in out for name in ("[/x] :smile:", "[bold]y"))


def test_a_pipe_gets_a_table_of_80_columns_and_the_names_of_the_rest(named, capsys):
    command.print_encounters(named)
    lines = capsys.readouterr().out.splitlines()
    heads, rows = named.cells()
    (hidden,) = [line for line in lines if line.startswith("not in 80 columns: ")]
    listed = hidden.partition(": ")[2].partition("; write all")[0].split("; ")
    assert max(map(len, lines[1 : 2 + len(rows)])) <= 80
    assert [head for head in heads if head in lines[1]] == [head for head in heads if head not in listed]
    assert lines[lines.index(hidden) + 1 :] == named.notes()
    assert "light" in lines[1]


@pytest.mark.slow
def test_the_suffix_of_o_says_what_is_written(call, tmp_path):
    call(FLYBY, *ASKED, "-o", tmp_path / "a.csv")
    call(FLYBY, *ASKED, "--csv", tmp_path / "b.csv", "-o", tmp_path / "a.png")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


PAIRS = [word for word in ASKED if word not in ("--follower", "99003")]


@pytest.mark.slow
def test_all_pairs_of_several_files_name_both(call, tmp_path):
    hop = shipped("examples/tdrs_approach.toml")
    out = call(FLYBY, hop, *PAIRS, "--all-pairs", "--start", "2024-09-17T12:00:00Z", "-o", tmp_path / "a.csv")
    assert "any two of 4 objects within 20 km" in out
    assert "follower" in out.splitlines()[1] and "the lidar is on the object named first" in out
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    pairs = {(row["follower_name"], row["name"]) for row in rows}
    assert pairs == {("ROCKET BODY (SYNTHETIC)", "FOLLOWER (SYNTHETIC)"), ("tdrs", "tdrs_approach follower")}


def test_the_follower_of_a_scenario_and_what_its_lidar_gets(call, tmp_path):
    hop = shipped("examples/tdrs_approach.toml")
    more = ["--start", "2024-09-17T12:00:00Z", "--days", "0.02", "--lidar", hop, "-o", tmp_path / "a.csv"]
    out = call(hop, "--within", "20km", *more, "--follower", hop, "--target-size", "2m")
    assert "a facing square plate of 2 m side, reflectance 0.3 (assumed), flashes at 0.2 Hz" in out
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["name"] == "tdrs" and float(row["photons"]) > 100.0
    assert float(row["found_probability"]) >= float(row["best_probability"]) > 0.9


def test_an_input_is_no_output(call, tmp_path):
    catalog = tmp_path / "a.csv"
    text = Path(FLYBY).read_bytes()
    catalog.write_bytes(text)
    with pytest.raises(RsoLidarError, match=r"a\.csv: is an input of this command; give another name"):
        call(catalog, *ASKED, "-o", catalog, "--overwrite")
    assert catalog.read_bytes() == text


def test_neither_follower_nor_pairs(call):
    with pytest.raises(RsoLidarError, match="needs the object with the lidar; give --follower or --all-pairs"):
        call(FLYBY, *PAIRS)


CLOSEST = datetime.datetime(2024, 9, 17, 12, 0, 3, 919_000, tzinfo=datetime.UTC)  # as the table of the search prints it
SHORT = ["--follower", "99003", "--within", "20km", "--start", "2024-09-17T11:50:00Z", "--days", "0.02"]
SIGMA = np.array(
    [100.0, 300.0, 120.0, 0.3, 0.1, 0.1]
)  # along rtn axes, velocities relative to inertial axes [m], [m/s]
AGES = (
    "age_days,radial_m,along_m,cross_m,radial_m_s,along_m_s,cross_m_s\n0,100,300,120,.3,.1,.1\n2,100,300,120,.3,.1,.1\n"
)


@pytest.fixture
def messages(tmp_path):
    """Write an OEM of the object and an OPM of the follower, with the covariances of `AGES`, and return options."""
    first, second = Catalog.from_file(FLYBY).sets
    time_s = np.arange(-30.0, 31.0, 5.0)
    place, speed = Fleet([first, second], CLOSEST).at(np.zeros(len(time_s), int), time_s)
    oem = write_oem(tmp_path / "a.oem", "STAGE", "2024-002B", Epochs(CLOSEST, time_s), BodyState(place, speed))
    rows = "\n".join(" ".join(f"{(i == j) * SIGMA[i] ** 2 / 1e6:.9e}" for j in range(i + 1)) for i in range(6))
    block = f"COVARIANCE_START\nEPOCH = 2024-09-17T12:00:03.919\nCOV_REF_FRAME = RTN\n{rows}\nCOVARIANCE_STOP\n"
    oem.write_text(oem.read_text(encoding="utf-8") + block, encoding="utf-8")
    place, speed = Fleet([first, second], CLOSEST).at(np.ones(1, int), np.zeros(1))
    turn = orbit_state_matrix("rtn", place[0], speed[0])
    state = State(epoch_utc=CLOSEST, position_m=tuple(place[0].tolist()), velocity_m_s=tuple(speed[0].tolist()))
    covariance = turn @ np.diag(SIGMA**2) @ turn.T
    opm = write_opm(tmp_path / "b.opm", "OURS", "2024-002C", state, covariance=covariance, covariance_axes="tnw")
    (tmp_path / "ages.csv").write_text(AGES, encoding="utf-8")
    return ["--covariance", f"99002={oem}", "--covariance", f"99003={opm}"]


def read_rows(place):
    with place.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_messages_give_the_probability_of_a_table_with_their_sigmas(call, tmp_path, messages):
    """An OEM in RTN and an OPM in TNW, against the same sigmas along rtn axes; their states are those of the sets."""
    ages, radii = ["--covariance", tmp_path / "ages.csv"], ["--hard-body", "99002=0.03m", "--hard-body", "99003=0.02m"]
    call(FLYBY, *SHORT, *radii, *messages, "--csv", tmp_path / "a.csv")
    call(FLYBY, *SHORT, "--radius", "0.05m", *ages, "--csv", tmp_path / "b.csv")
    (given,), (expected,) = read_rows(tmp_path / "a.csv"), read_rows(tmp_path / "b.csv")
    assert (given["covariance"], given["follower_covariance"]) == ("a.oem", "b.opm")
    assert (given["hard_body_radius_m"], given["hard_body_source"]) == ("0.05", "0.02 m + 0.03 m")
    for column in ("foster_probability", "mahalanobis", "sigma_along_m"):
        # The closest approach is rounded to 1 ms, 7.5 m of 7000 km, by which the axes of each object turn. That changes the
        # radial variance by 8 x 1e-6 (300 m against 100 m), and the probability by 12 times that, 3.5 sigma away.
        assert float(given[column]) == pytest.approx(float(expected[column]), rel=2e-4), column
    assert float(given["collision_probability"]) == pytest.approx(6.13e-7 * (0.05 / 6.0) ** 2, rel=2e-3)  # as the area
    assert float(expected["sigma_along_m"]) == pytest.approx(300.0 * np.sqrt(2.0), rel=1e-3)


def test_a_message_near_its_epoch_is_propagated_and_says_so(call, tmp_path):
    """A CDM at noon, 4 s before the closest approach: 4 s of 0.15 m/s are little beside its sigma of 150 m.

    Its orbits are others than those of the element sets, which have the same numbers.
    """
    with pytest.warns(RsoLidarWarning, match=r"flyby\.cdm: its orbit is 4,\d{3} km from .*, whose errors it states"):
        call(FLYBY, *SHORT, "--radius", "6m", "--covariance", shipped("tle/flyby.cdm"), "--csv", tmp_path / "a.csv")
    (row,) = read_rows(tmp_path / "a.csv")
    assert row["covariance"] == "flyby.cdm, propagated by 3.92 s"
    assert 0.0 < float(row["collision_probability"]) < 1e-20  # 11 sigma away


@pytest.mark.slow
def test_the_history_of_sets_is_a_source(call, tmp_path):
    """Ten sets a tenth of a day apart, with anomalies that advance without J2: they differ by kilometres along the track."""
    first, second = Path(FLYBY).read_text(encoding="utf-8").strip().split("\n")[1:3]
    lines = []
    for k in range(10):
        anomaly = (270.0 + (k - 9) * 0.1 * 360.0 * 15.06) % 360.0
        epoch = f"{first[:20]}{260.6 + 0.1 * k:012.8f}{first[32:]}"
        lines += [with_checksum(epoch), with_checksum(f"{second[:43]}{anomaly:8.4f}{second[51:]}")]
    (tmp_path / "history.tle").write_text("\n".join(["STAGE\n" + "\n".join(lines[i : i + 2]) for i in range(0, 20, 2)]))
    (tmp_path / "ages.csv").write_text(AGES, encoding="utf-8")
    call(
        *(FLYBY, *SHORT, "--radius", "0.01m", "--covariance", f"99002={tmp_path / 'history.tle'}"),
        *("--covariance", tmp_path / "ages.csv", "--csv", tmp_path / "a.csv"),
    )
    (row,) = read_rows(tmp_path / "a.csv")
    assert "pairs of its own sets" in row["covariance"]
    errors = rl.study.estimate_set_errors(list(Catalog.from_file(tmp_path / "history.tle").sets))
    assert errors.sigma[0, 1] > 3000.0
    assert float(row["sigma_along_m"]) == pytest.approx(np.hypot(errors.sigma[0, 1], 300.0), rel=1e-2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--covariance", "12345=ages.csv"], "covariances: no object of the search has the name or number '12345'"),
        (["--hard-body", "12345=2m"], "hard_bodies: no object of the search has the name or number '12345'"),
        (["--hard-body", "99002=2m", "--hard-body", "99002=3m"], "--hard-body: names an object twice"),
        (["--hard-body", "99002"], "--hard-body 99002: needs an object and a value"),
        (["--hard-body", "99002=-2m"], "'-2m' is no length"),
        (["--covariance", "99002="], "--covariance 99002=: needs an object and a value"),
        (["--covariance", "99002=bare.oem"], "bare.oem: has no covariance of STAGE"),
        (["--covariance", "99002=bad.oem"], "bad.oem: is not positive semidefinite: a variance is below 0"),
        (["--covariance", "99002=flat.oem"], "flat.oem: is not .*; correct its terms"),
        (["--covariance", f"99002={FLYBY}"], "has one element set; differences need two or more"),
    ],
)
def test_what_is_no_source_is_one_line(call, tmp_path, messages, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    text = (tmp_path / "a.oem").read_text(encoding="utf-8")
    (tmp_path / "bare.oem").write_text(text.split("COVARIANCE_START")[0], encoding="utf-8")
    (tmp_path / "bad.oem").write_text(text.replace("1.000000000e-02", "-1.0"), encoding="utf-8")
    (tmp_path / "flat.oem").write_text(text.replace("\n0.000000000e+00 9", "\n1.0 9", 1), encoding="utf-8")
    with pytest.raises(RsoLidarError, match=message) as caught:
        call(FLYBY, *SHORT, "--radius", "6m", *options)
    assert "\n" not in str(caught.value)
