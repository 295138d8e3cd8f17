"""Objects of a search: what files hold, what may be given instead, and what is refused."""

import datetime
import pathlib

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import CatalogError, ScenarioError
from rso_lidar.mission_analysis.passes.search_objects import collect_objects, is_catalog_file, load_follower
from rso_lidar.orbit import Epochs, Kepler, NamedTrajectory, write_oem
from rso_lidar.shipped import shipped
from rso_lidar.study import encounters, scenario_text

FLYBY = str(shipped("tle/flyby.tle"))
HOP = str(shipped("examples/tdrs_approach.toml"))
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
_ELEMENTS = {"eccentricity": 0.001, "inclination_deg": 50.0, "raan_deg": 0.0, "argument_of_perigee_deg": 0.0}
ORBIT = Kepler(epoch_utc=START, semi_major_axis_km=6950.0, true_anomaly_deg=0.0, **_ELEMENTS)


@pytest.fixture
def files(tmp_path):
    """Return files of an OEM with one object, an OEM with two, and a CSV table."""
    epochs = Epochs(START, np.arange(0.0, 4000.0, 60.0))
    states = ORBIT.states(epochs)
    write_oem(tmp_path / "one.oem", "ONE", "2026-001A", epochs, states)
    write_oem(tmp_path / "two.oem", "TWO", "2026-002A", epochs, states)
    first, second = ((tmp_path / name).read_text(encoding="ascii") for name in ("one.oem", "two.oem"))
    (tmp_path / "both.oem").write_text(first + second[second.index("META_START") :], encoding="ascii")
    rows = np.column_stack([epochs.time_s, states.position_m])
    text = "time_s, x_m, y_m, z_m\n" + "\n".join(",".join(map(repr, row)) for row in rows.tolist())
    (tmp_path / "table.csv").write_text(text, encoding="ascii")
    return tmp_path


def test_files_of_every_kind(files):
    names = {
        "one.oem": ["ONE"],
        "both.oem": ["ONE", "TWO"],
        "table.csv": ["table"],
        HOP: ["tdrs", "tdrs_approach follower"],
    }
    for file, expected in names.items():
        found = collect_objects(files / file)
        assert [entry.name for entry in found.entries] == expected
        place = np.linalg.norm(found.entries[0].states(Epochs(START, np.zeros(1))).position_m)
        assert place > 6.5e6
    assert len(collect_objects([FLYBY, files / "one.oem", ORBIT]).entries) == 4
    assert [entry.name for entry in collect_objects({"mine": ORBIT}).entries] == ["mine"]
    assert is_catalog_file(FLYBY) and not is_catalog_file(HOP) and not is_catalog_file(3)


def test_followers_from_files(files):
    assert load_follower(HOP).name == "tdrs_approach follower"
    assert load_follower(str(files / "one.oem")).name == "ONE"
    with pytest.raises(CatalogError, match=r"both\.oem: holds 2 objects \(ONE, TWO\); give it as a catalogue"):
        load_follower(str(files / "both.oem"))
    with pytest.raises(CatalogError, match=r"flyby\.tle: holds 2 objects"):
        load_follower(FLYBY)


def test_names_find_trajectories(files):
    both = files / "both.oem"
    assert [entry.name for entry in collect_objects(both).find("two", both)] == ["TWO"]
    with pytest.raises(
        CatalogError, match=r"no follower 'twq' among 2 element sets and trajectories; did you mean 'TWO'"
    ):
        collect_objects(both).find("twq", both)
    twice = [NamedTrajectory("ONE", ORBIT), NamedTrajectory("ONE", ORBIT)]
    with pytest.raises(CatalogError, match="'one' names 2 trajectories and 0 element sets"):
        collect_objects(twice).find("one", twice)


def test_the_follower_of_a_scenario_has_its_plain_name_where_no_other_scenario_is_given(files, tmp_path):
    objects = collect_objects([FLYBY, HOP])
    for name in ("follower", "Follower", "tdrs_approach follower"):
        assert [entry.name for entry in objects.find(name, HOP)] == ["tdrs_approach follower"]
    both = collect_objects([HOP, str(shipped("examples/safety_ellipse.toml"))])
    several = "'follower' names 2 trajectories; give one of 'tdrs_approach follower', 'safety_ellipse follower'"
    with pytest.raises(CatalogError, match=several):
        both.find("follower", HOP)
    with pytest.raises(CatalogError, match="no follower ''"):
        objects.find(" ", HOP)
    again = tmp_path / "tdrs_approach.toml"  # of the same name in another folder
    again.write_text(pathlib.Path(HOP).read_text(encoding="utf-8"), encoding="utf-8")
    entries = collect_objects([HOP, again]).entries
    assert [entry.name_in_source for entry in entries if entry.name.endswith(" follower")] == ["follower", "follower"]
    # those of several files under one name, each by its own
    assert [entry.name for entry in collect_objects([files / "both.oem", files / "one.oem"]).find("one one", "")] == [
        "one ONE"
    ]


def test_a_tracking_data_message_is_no_catalogue_and_names_the_command_that_takes_it(tmp_path):
    track = tmp_path / "track.tdm"
    track.write_text("CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2024-09-17T12:00:00\nORIGINATOR = X\n", encoding="ascii")
    for read in (collect_objects, lambda path: load_follower(str(path))):
        with pytest.raises(
            CatalogError, match=r"track\.tdm: .* \(TDM\) holds measurements.* rso-lidar fit track\.tdm --own"
        ):
            read(track)


def test_a_file_given_twice_is_read_once(files):
    assert [entry.name for entry in collect_objects([files / "both.oem", str(files / "both.oem")]).entries] == [
        "ONE",
        "TWO",
    ]


def test_equal_names_of_several_files_are_told_apart(files):
    names = [entry.name for entry in collect_objects([files / "both.oem", files / "one.oem"]).entries]
    assert names == ["both ONE", "TWO", "one ONE"]


def test_an_object_that_has_no_state_at_first_is_still_the_follower(files):
    """A file of element sets and a scenario hold one object; the scenario has no state before its start."""
    scenario = str(shipped("examples/tle_flyby.toml"))
    begin = datetime.datetime(2024, 9, 17, 11, 50, tzinfo=datetime.UTC)
    found = encounters([FLYBY, scenario], load_follower(scenario), within_m=20e3, start_utc=begin, days=0.02)
    (one,) = [row for row in found.rows if row.docked]
    assert one.name.startswith("FOLLOWER") and one.docked == "both have the same states"
    assert np.isnan([one.photons, one.target_pixels, one.found_probability]).all()
    assert all(row.range_m > 1e3 for row in found.rows if row is not one)


def test_a_follower_is_not_its_own_encounter(files):
    """Neither by a file whose names are told apart, nor as the object that the catalogue holds."""
    other = Kepler(epoch_utc=START, semi_major_axis_km=6950.0, true_anomaly_deg=0.1, **_ELEMENTS)
    search = {"within_m": 50e3, "start_utc": START, "days": 0.01}
    found = encounters([files / "both.oem", files / "one.oem"], load_follower(files / "one.oem"), **search)
    assert {row.name for row in found.rows} == {"both ONE", "TWO"}  # the same states in another file
    found = encounters({"a": ORBIT, "b": other}, ORBIT, **search)
    assert {row.name for row in found.rows} == {"b"} and found.follower.name == "a"


def test_a_follower_that_cannot_be_used_says_why(tmp_path):
    lines = shipped("tle/tdrs.tle").read_text(encoding="ascii").splitlines()
    bad = tmp_path / "bad.tle"
    bad.write_text("\n".join([*lines[:-1], lines[-1][:-1] + str((int(lines[-1][-1]) + 1) % 10)]), encoding="ascii")
    with pytest.raises(CatalogError, match=r"(?i)bad\.tle: .*checksum"):
        load_follower(str(bad))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (3, "is not a catalogue; give a path"),
        ([3], "is not an element set; read the sets with Catalog, or give objects that answer states"),
        ({"x": 3}, "x: .* has no states; give a trajectory"),
        (pathlib.Path("none.oem"), "none.oem: no such file"),
    ],
)
def test_what_is_none_is_refused(source, message):
    with pytest.raises(CatalogError, match=message):
        collect_objects(source)


def test_encounters_of_trajectories_and_their_scenario():
    mate = ORBIT.replace(true_anomaly_deg=0.01)
    table = encounters({"mate": mate}, NamedTrajectory("me", ORBIT), within_m=5e3, start_utc=START, days=0.04)
    (row,) = table.rows
    assert (row.name, row.follower_name, row.norad_id) == ("mate", "me", 0)
    assert np.isnan(row.age_days) and row.found_probability == pytest.approx(1.0)
    assert row.detection_probability > 0.99 and row.photons > 100.0 and row.target_pixels > 1.0
    scenario = rl.Scenario.loads(scenario_text(table, 1))
    truth = rl.motion.truth(scenario.bodies, Epochs(row.closest_at(START), np.zeros(1))).states
    apart = truth["mate"].position_m - truth["follower"].position_m
    assert np.linalg.norm(apart) == pytest.approx(row.range_m, abs=0.1)
    assert "as good as what it came from" in table.table() and "kilometre" not in table.table()


def test_all_pairs_have_both_names_and_equal_those_in_turn():
    objects = [FLYBY, NamedTrajectory("mate", ORBIT.replace(true_anomaly_deg=0.01)), NamedTrajectory("me", ORBIT)]
    table = encounters(objects, within_m=20e3, start_utc=START, days=0.04, sort="time")
    names = {(row.follower_label, row.label) for row in table.rows}
    assert ("mate", "me") in names
    for lead in ("ROCKET BODY (SYNTHETIC)", "mate", "FOLLOWER (SYNTHETIC)"):
        turn = encounters(objects, lead, within_m=20e3, start_utc=START, days=0.04, sort="time")
        pairs = [row for row in table.rows if lead in (row.follower_label, row.label)]
        assert [row.range_m for row in turn.rows] == pytest.approx([row.range_m for row in pairs], abs=1e-3)
    heads, rows = table.cells()
    assert heads[1:3] == ["follower", "object"] and len(rows) == len(table.rows)
    assert "any two of 4 objects" in table.title


def test_one_object_has_no_pairs():
    with pytest.raises(CatalogError, match="no other object is there; all pairs need two or more objects, and 1 can"):
        encounters([ORBIT], within_m=1e3, start_utc=START, days=0.1)
    with pytest.raises(ScenarioError, match="is not an object; give its catalogue number or its name, or a trajectory"):
        encounters(FLYBY, 3.5, within_m=1e3, start_utc=START, days=0.1)


OPM = """CCSDS_OPM_VERS = 3.0
OBJECT_NAME = ONE
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
EPOCH = 2024-09-17T12:00:00
X = {} [km]
Y = 0 [km]
Z = 0 [km]
X_DOT = 0 [km/s]
Y_DOT = 7.5 [km/s]
Z_DOT = 0 [km/s]
"""


def test_states_of_orbit_parameter_messages_are_searched(tmp_path):
    for name, x_km in (("one.opm", 7000), ("two.txt", 7000.25)):
        (tmp_path / name).write_text(OPM.format(x_km))
    table = encounters([tmp_path / "one.opm", tmp_path / "two.txt"], within_m=1e3, start_utc=START, days=0.001)
    (row,) = table.rows
    assert (row.follower_label, row.label) == ("one", "two")
    assert row.range_m == pytest.approx(250.0, abs=1e-3)


def test_cause_why_no_pair_is_left_comes_first(tmp_path):
    (tmp_path / "mean.kvn").write_text("CCSDS_OMM_VERS = 2.0\nOBJECT_NAME = ONE\nMEAN_MOTION = 15\n")
    with pytest.raises(
        CatalogError, match=r"mean.kvn: line 1: NORAD_CAT_ID, .* missing.*; all pairs need two .* 0 can be used$"
    ):
        encounters(tmp_path / "mean.kvn", within_m=1e3, start_utc=START, days=0.1)


def test_equal_trajectories_are_one_object():
    table = encounters({"a": ORBIT, "b": ORBIT}, within_m=1e3, start_utc=START, days=0.04)
    (row,) = table.rows
    assert row.docked == "both have the same states" and np.isnan(row.photons)
