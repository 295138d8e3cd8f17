"""Assessments: a valid text, the place and the line of a problem, and what no text may name."""

import os
import shutil

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError, collect_warnings
from rso_lidar.scenario import SHORTEST_EXAMPLE, find_examples
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.studio.model.text_assessment import (
    assess,
    check_file,
    check_study,
    describe,
    list_warnings,
)
from tests.scene.meshes.test_mesh import BOX, binary_stl

EXAMPLES = find_examples()
APPROACH = EXAMPLES["tdrs_approach"].text
OBJECT = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def folder(tmp_path):
    """Return a folder beside another one with a mesh and an element set."""
    (tmp_path / "other").mkdir()
    (tmp_path / "work").mkdir()
    (tmp_path / "other" / "secret.obj").write_text(OBJECT, encoding="utf-8")
    shutil.copyfile(shipped("tle/tdrs.tle"), tmp_path / "other" / "secret.tle")
    return Folder(tmp_path / "work")


@pytest.mark.parametrize("name", EXAMPLES)
def test_shipped_examples_are_ready_or_refused_for_their_code(folder, name):
    text = EXAMPLES[name].text
    companions = EXAMPLES[name].companions
    for path in companions:
        shutil.copyfile(path, folder.path / path.name)
    found = assess(text, folder, f"{name}.toml")
    assert (found.text, found.problem, found.place, found.line) == (text, "", "", None)
    assert found.scenario.time.n_frames > 0
    assert bool(found.refusal) == any(path.suffix == ".py" for path in companions)


@pytest.mark.parametrize(
    ("old", "new", "place", "line_has"),
    [
        ("energy_mj      = 50", "energy_mj      = -3", "lidar.laser.energy_mj", "energy_mj"),
        ("energy_mj      = 50", 'energy_mj      = "50"', "lidar.laser.energy_mj", "energy_mj"),
        ("energy_mj      = 50", "energi_mj      = 50", "lidar.laser.energi_mj", "energi_mj"),
        ("seed    = 20240917", "seed    = 1.5", "seed", "seed"),
        ("[0, -3000, 0]", "[0, -3000]", "follower.motion.position_m[2]", "motion"),
        ('model    = "tdrs"', 'model    = "no_such_model"', "target[0].model", "no_such_model"),
        ("tle/tdrs.tle", "tle/no_such.tle", "target[0].motion.file", "no_such.tle"),
        ("reflectance = 0.30", "reflectance = 3.0", "target[0].material.reflectance", "reflectance = 3.0"),
        ("duration_s    = 2700", "duration_s    = 0", "time.duration_s", "duration_s"),
    ],
)
def test_a_problem_names_its_place_and_its_line(folder, old, new, place, line_has):
    assert APPROACH.count(old) == 1
    text = APPROACH.replace(old, new)
    found = assess(text, folder, "a.toml")
    assert found.scenario is None
    assert found.problem.startswith("a.toml: ")
    assert "\n" not in found.problem
    assert found.place == place
    assert any(part in text.splitlines()[found.line - 1] for part in line_has.split("|"))


@pytest.mark.parametrize("text", ["a = ", "[time", "\0", "a = 1\na = 2", "x = " + "[" * 900, "[[target]]\n[target]"])
def test_text_that_is_no_toml_names_a_line(folder, text):
    found = assess(text, folder, "a.toml")
    assert found.scenario is None
    assert found.problem.startswith("a.toml")
    assert found.line in (None, 1, 2, 3)


def test_an_untouched_text_is_no_error(folder):
    blank = assess("\n", folder, "a.toml")
    assert blank.is_blank and not blank.is_ready
    assert (blank.place, blank.line) == ("", None)
    assert blank.tell(None).startswith("No scenario yet.")


@pytest.mark.parametrize("text", ["version = 1", "target = 3", "target = [3]", "[target]\nmodel = 3", "time = []"])
def test_unfinished_texts_have_a_problem_and_raise_nothing(folder, text):
    found = assess(text, folder, "a.toml")
    assert found.scenario is None
    assert found.problem.startswith("a.toml")


def list_ways_out(folder):
    outside = folder.path.parent / "other"
    return {
        "absolute": str(outside / "secret"),
        "up": "../other/secret",
        "down_and_up": "sub/../../other/secret",
        "home": f"~/../..{outside}/secret",
        "link": "link",
        "linked_folder": "linked/secret",
    }


@pytest.mark.parametrize("way", ["absolute", "up", "down_and_up", "home", "link", "linked_folder"])
@pytest.mark.parametrize(("key", "suffix"), [("motion", ".tle"), ("model", ".obj")])
def test_files_outside_the_folder_are_refused_unread(folder, way, key, suffix, monkeypatch):
    outside = folder.path.parent / "other"
    (folder.path / "sub").mkdir()
    try:
        (folder.path / f"link{suffix}").symlink_to(outside / f"secret{suffix}")
        (folder.path / "linked").symlink_to(outside)
    except OSError:
        pytest.skip("this account of Windows may not make symbolic links")
    name = f"{list_ways_out(folder)[way]}{suffix}".replace("\\", "/")
    old, new = ('"tle/tdrs.tle"', f'"{name}"') if key == "motion" else ('model    = "tdrs"', f'model    = "{name}"')
    text = APPROACH.replace(old, new)
    assert text != APPROACH
    for secret in outside.iterdir():
        secret.write_bytes(b"nobody reads this")
    found = assess(text, folder, "a.toml")
    assert found.scenario is None
    assert "outside the folder work" in found.problem or "no file" in found.problem
    assert "nobody reads" not in found.problem
    assert found.place == ("target[0].motion.file" if key == "motion" else "target[0].model")


def test_files_of_the_folder_and_shipped_files_are_taken(folder):
    shutil.copyfile(shipped("tle/tdrs.tle"), folder.path / "own.tle")
    (folder.path / "sub").mkdir()
    shutil.copyfile(shipped("tle/tdrs.tle"), folder.path / "sub" / "own.tle")
    for name in ("own.tle", "sub/own.tle", "sub/../own.tle", "tle/tdrs.tle", str(folder.path / "own.tle")):
        assert assess(APPROACH.replace("tle/tdrs.tle", name.replace("\\", "/")), folder, "a.toml").problem == ""
        assert check_file(name, folder, "here").is_file()


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "loop.tle", ".", "/", "//", "", "/dev/zero", "/proc/self/mem"])
@pytest.mark.skipif(os.name != "posix", reason="names of POSIX")
def test_names_that_no_file_can_have_are_refused_in_one_short_line(folder, name):
    (folder.path / "loop.tle").symlink_to("loop.tle")
    with pytest.raises(ScenarioError) as caught:
        check_file(name, folder, "here")
    assert len(str(caught.value)) < 250


@pytest.mark.parametrize("where", ["target", "follower", "ptu"])
def test_code_is_refused_and_never_run(folder, where):
    (folder.path / "own.py").write_text("raise SystemExit('it ran')\n", encoding="utf-8")
    law = '{ type = "state_space", dynamics = "own.py:law", initial_state = [1, 0, 0, 0, 0, 0] }'
    turn = '{ type = "state_space", dynamics = "own.py:law", initial_state = [0, 0, 0, 1, 0, 0, 0] }'
    drive = '{ type = "state_space", dynamics = "own.py:law" }'
    old, new = {
        "target": ('motion   = { type = "tle", file = "tle/tdrs.tle" } ', f"motion   = {law} "),
        "follower": ('attitude = { type = "rtn", euler_zyx_deg = [90, 0, 0] }', f"attitude = {turn}"),
        "ptu": (
            'response = { type = "second_order", natural_hz = 4.0, damping = 0.7, max_rate_deg_s = 30 }',
            f"response = {drive}",
        ),
    }[where]
    assert APPROACH.count(old) == 1
    found = assess(APPROACH.replace(old, new), folder, "a.toml")
    assert found.scenario is None or "own.py" in found.refusal
    assert "it ran" not in found.problem
    assert found.refusal or found.problem


def test_a_description_names_what_the_scenario_has(folder, text):
    said = describe(assess(text, folder, "a.toml").scenario)
    assert said.startswith("a plate on a bench\n")
    assert "10 frames at 5 Hz" in said
    assert "warnings" in said


def test_an_assessed_scenario_flies_as_the_file_does(folder, text):
    (mine,) = rl.simulate(assess(text, folder, "a.toml").scenario, frames=[0])
    (other,) = rl.simulate(rl.Scenario.loads(text), frames=[0])
    np.testing.assert_array_equal(mine.range_m, other.range_m)


@pytest.fixture
def in_millimetres(folder):
    """Return the text of a scenario whose target is a mesh in millimetres, 1 to 3 m, read as metres."""
    (folder.path / "probe.stl").write_bytes(binary_stl(BOX * 1000.0))
    return SHORTEST_EXAMPLE.replace('model = "plate"', 'model = "probe.stl"')


def list_printed(scenario):
    """Return the warnings that `check` prints of a scenario."""
    lines = scenario.describe().splitlines()
    return [line.removeprefix("warning").strip() for line in lines if line.startswith("warning ")]


def test_the_warnings_are_those_that_check_prints(folder, in_millimetres):
    made = assess(in_millimetres, folder, "a.toml")
    found = list_warnings(made, folder, "a.toml")
    assert found[1] == (
        "target plate: probe.stl is 3000 m across; it may be in millimetres or centimetres or inches (scale = 0.001); "
        "give scale or size_m"
    )
    assert found == list_printed(rl.Scenario.loads(in_millimetres, folder=folder.path))
    assert len(found) == 4  # centre of mass, size, part outside the field, lidar within
    assert made.tell(None) == "Ready to fly: 10 frames, looking for warnings"
    assert made.tell(found) == "Ready to fly: 10 frames, 4 warnings"


def test_what_is_warned_of_where_files_are_read_is_told_each_time(folder):
    """A message of an orbit with gaps is read at once; `check` prints its warning first, on the error stream."""
    rows = "".join(f"2024-09-17T{hour:02d}:00:00 42164 0 0 0 3.0747 0\n" for hour in (12, 13, 14, 15, 16, 17))
    head = (
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = A\nOBJECT_ID = A\nCENTER_NAME = EARTH\nREF_FRAME = EME2000\n"
    )
    times = "TIME_SYSTEM = UTC\nSTART_TIME = 2024-09-17T12:00:00\nSTOP_TIME = 2024-09-17T17:00:00\nMETA_STOP\n"
    (folder.path / "a.oem").write_text(head + times + rows, encoding="utf-8")
    text = APPROACH.replace('{ type = "tle", file = "tle/tdrs.tle" }', '{ type = "ephemeris", file = "a.oem" }')
    made = assess(text, folder, "a.toml")
    first = [line for line in list_warnings(made, folder, "a.toml") if "a.oem" in line]
    assert len(first) == 1
    assert first == [line for line in list_warnings(made, folder, "a.toml") if "a.oem" in line]


def test_a_flown_scenario_is_described_with_its_warnings(folder, in_millimetres):
    scenario = assess(in_millimetres, folder, "a.toml").scenario
    with collect_warnings():
        _ = scenario.surfaces
    assert any("probe.stl is 3000 m across" in line for line in list_printed(scenario))


STUDY = """version = 1
name = "Energy: 5 or 50 mJ, n/a"
scenario = "approach.toml"
set = ["lidar.receiver.rays_per_pixel=1"]
frames = "0:1"
merits = ["detection_fraction"]

[[axis]]
field = "lidar.laser.energy_mj"
values = [5, 50]
"""


@pytest.fixture
def study(folder):
    """Return the path of a study in the folder, beside its scenario."""
    (folder.path / "approach.toml").write_text(APPROACH, encoding="utf-8")
    path = folder.path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def test_studies_of_the_folder_are_allowed(folder, study):
    shown = [study, *shipped("examples/studies").glob("trade_*.toml"), *shipped("examples/datasets").glob("*.toml")]
    texts = [path.read_text(encoding="utf-8").replace("../tdrs_approach.toml", "approach.toml") for path in shown]
    allowed = [text for text in texts if "../" not in text and "scenario =" in text]
    assert len(allowed) > 1
    for text in allowed:
        assert "a trade study or a dataset" in assess(text, folder, "study.toml").refusal
        study.write_text(text, encoding="utf-8")
        assert check_study(study, folder) is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"approach.toml"', '"../other/secret.toml"', "outside the folder"),
        ('"approach.toml"', '"~/secret.toml"', "outside the folder"),
        ("lidar.receiver.rays_per_pixel=1", "target[0].motion.file=../other/secret.tle", "outside the folder"),
        (
            '"lidar.receiver.rays_per_pixel=1"',
            '\'target[0].motion={type="tle", file="/etc/passwd"}\'',
            "outside the folder",
        ),
        ('"lidar.receiver.rays_per_pixel=1"', "'follower.motion.dynamics=\"a.py:fly\"'", "names code"),
        ("[5, 50]", '["/etc/passwd", "../other/secret.obj"]', "outside the folder"),
        ('"lidar.receiver.rays_per_pixel=1"', '\'ptu.response={type="fmu", file="a"}\'', "names code"),
        ("version = 1", "version = ", "not valid TOML"),
    ],
)
def test_a_study_that_names_code_or_files_outside_is_refused(folder, study, old, new, words):
    assert STUDY.count(old) == 1
    study.write_text(STUDY.replace(old, new), encoding="utf-8")
    with pytest.raises(ScenarioError, match=words):
        check_study(study, folder)


def test_the_scenario_of_a_study_is_assessed(folder, study):
    (folder.path / "approach.toml").write_text(
        APPROACH.replace("tle/tdrs.tle", "../other/secret.tle"), encoding="utf-8"
    )
    with pytest.raises(ScenarioError, match="outside the folder"):
        check_study(study, folder)
