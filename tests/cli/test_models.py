"""`rso-lidar models` and its commands: what they print, and one line with status 2 for what cannot be."""

import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.cli.models import app
from rso_lidar.scene.library.adding import COMMANDS
from tests.scene.meshes.test_mesh import BOX, binary_stl


@pytest.fixture
def mesh(tmp_path):
    path = tmp_path / "sat.stl"
    path.write_bytes(binary_stl(np.concatenate([BOX * 1000, BOX[:1] * 0])))
    return path


def test_a_name_alone_shows_and_nothing_lists(rso_lidar, library):
    listed, shown = rso_lidar("models"), rso_lidar("models", "tdrs")
    assert listed == rso_lidar("models", "list") and "cubesat_3u" in listed[1]
    assert shown == rso_lidar("models", "show", "tdrs") and "solar_array_north" in shown[1]
    status, _, err = rso_lidar("models", "tdsr")
    assert status == 2 and len(err) == 1 and "did you mean 'tdrs'" in err[0]


def test_no_model_may_be_called_like_a_command():
    assert {command.name for command in app.registered_commands} == set(COMMANDS)


def test_a_mesh_is_added_listed_checked_shown_and_removed(rso_lidar, library, mesh):
    status, out, err = rso_lidar(
        "models",
        "add",
        mesh,
        "--name",
        "mine",
        "--material",
        "mli_gold",
        "--class",
        "debris",
        "--rate-deg-s",
        "0.5",
        "10",
        "--center-of-mass=0.5,1,1.5",
    )
    assert (status, err) == (0, [])
    assert "mine: 1 x 2 x 3 m, 12 facets, 1 part" in out
    assert "guessed    unit is millimetres" in out and "repaired   1 facet without area dropped" in out
    assert "three axis at 0.5 to 10 deg/s" in rso_lidar("models", "mine")[1]
    assert "mine" in rso_lidar("models")[1] and "yours" in rso_lidar("models")[1]
    assert "-1.000 to 0.000" in rso_lidar("models", "mine")[1] and "mli_gold" in rso_lidar("models", "mine")[1]
    status, out, _ = rso_lidar("models", "check", "mine")
    assert status == 0 and "1 without area dropped" in out and "size        1 x 2 x 3 m" in out
    assert rso_lidar("models", "remove", "mine")[0] == 0
    assert "mine" not in rso_lidar("models")[1]
    assert [file.name for file in library.iterdir()] == ["index.toml"]


@pytest.mark.parametrize("words", [(), ("materials",), ("tdrs",)], ids=" ".join)
@pytest.mark.parametrize("width", [80, 120])
def test_tables_fit_the_terminal_and_cut_no_description(rso_lidar, library, monkeypatch, words, width):
    monkeypatch.setenv("FORCE_COLOR", "1")  # which rich takes for a terminal
    monkeypatch.setenv("COLUMNS", str(width))
    shown = re.sub(r"\x1b\[[0-9;]*m", "", rso_lidar("models", *words)[1])
    table = shown.partition("\nA hinge:")[0]  # a line to copy is not folded
    assert max(len(line.rstrip()) for line in table.splitlines()) <= width
    assert "\u2026" not in table


def test_materials_are_listed_with_what_they_send_back(rso_lidar):
    status, out, err = rso_lidar("models", "materials")
    assert (status, err) == (0, [])
    lines = {line.split()[0]: line for line in out.splitlines() if line.strip()}
    assert lines["mli_gold"].split()[1:8] == ["phong", "0.0514", "0.22", "0.529", "0.623", "0.8", "0.87"]
    assert lines["mli_gold_crinkled"].split()[1] == "crinkled"
    assert lines["mli_gold_crinkled"].split()[5:8] == ["0.623", "0.8", "0.87"]
    assert lines["cube_corner"].split()[6] == "0.56"  # 0.85 x 0.6 + 0.05
    assert "crinkled" not in lines["mli_gold"].removeprefix("mli_gold ")


def test_nothing_is_cut_off_in_a_pipe(rso_lidar, library):
    out = rso_lidar("models")[1]
    assert "…" not in out
    assert "its wing and radar antenna deployed" in out


def test_a_joint_is_shown_as_it_would_be_written(rso_lidar, library, text):
    written = 'joint = [{ name = "solar_wing", angle = { type = "fixed", angle_deg = 30 } }]'
    assert f"A hinge: {written}\n" in rso_lidar("models", "envisat")[1]
    hinged = rl.Scenario.loads(text.replace('model    = "plate"', f'model = "envisat"\n{written}'))
    assert [joint.name for joint in hinged.target[0].joints] == ["solar_wing"]
    free = next(line for line in rso_lidar("models", "plate")[1].splitlines() if line.startswith("A part that turns: "))
    hinged = rl.Scenario.loads(text.replace("material =", free.removeprefix("A part that turns: ") + "\nmaterial ="))
    assert [joint.name for joint in hinged.target[0].joints] == ["hinge"]


def test_an_assumed_class_is_told_with_its_options(rso_lidar, library, mesh):
    out = rso_lidar("models", "add", mesh, "--name", "mine", "--class", "debris", "--material", "cfrp")[1]
    assert "assumed    spacecraft, irregular, three axis: correct with --subclass, --shape, --stabilisation" in out


def test_check_examines_a_file_and_changes_nothing(rso_lidar, library, mesh):
    before = mesh.read_bytes()
    status, out, _ = rso_lidar("models", "check", mesh)
    assert status == 0 and "perhaps millimetres (--scale 0.001)" in out
    status, out, _ = rso_lidar("models", "check", mesh, "--scale", "0.001")
    assert status == 0 and "size        1 x 2 x 3 m" in out and "doubtful" not in out
    assert mesh.read_bytes() == before and not library.exists()


def test_check_knows_nasa_s_files(rso_lidar, shared):
    status, out, _ = rso_lidar("models", "check", shared / "meshes" / "nasa_originals" / "Juno.stl")
    assert status == 0
    assert "known       Juno.stl of NASA's printable models: one unit is 0.166667 m" in out
    assert "cube        12 facets from facet 0 on, 1 m across, about (0.00, 0.00, 0.00) m" in out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["add", "MESH", "--scale", "1", "--size-m", "2"], "--scale and --size-m"),
        (["add", "MESH", "--scale", "0"], "--scale 0: is not a size"),
        (["add", "MESH", "--size-m", "nan"], "--size-m nan: is not a size"),
        (["add", "MESH", "--class", "sattelite"], "--class sattelite: unknown value"),
        (["add", "MESH", "--part-material", "gold"], "--part-material gold: is not PART=NAME"),
        (["add", "MESH", "--center-of-mass", "1,2"], "--center-of-mass 1,2: is not X,Y,Z"),
        (["add", "MESH", "--center-of-mass", "1,2,inf"], "not finite"),
        (["add", "MESH", "--material", "gold"], "material 'gold'"),
        (["add", "MESH", "--name", "tdrs"], "is a shipped model's"),
        (["add", "nowhere.stl"], "no such file"),
        (["add", "nowhere.step"], "no such file"),
        (["check", "nowhere.stl"], "no such file"),
        (["check", "nowhere"], "unknown model 'nowhere'"),
        (["check", "MESH", "--scale", "-1"], "--scale -1: is not a scale"),
        (["remove", "tdrs"], "is shipped with the package"),
        (["remove", "nobody"], "is not in your library"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, list) else "",
)
def test_what_cannot_be_is_one_line(rso_lidar, library, mesh, words, says):
    status, out, err = rso_lidar("models", *(mesh if word == "MESH" else word for word in words))
    assert status == 2 and out == "" and len(err) == 1 and says in err[0]
    assert not library.exists() or not list(library.iterdir())


@pytest.mark.parametrize("rates", [("5", "1"), ("-1", "1"), ("0", "inf"), ("nan", "1")])
def test_rates_that_are_no_span_are_refused(rso_lidar, library, mesh, rates):
    status, out, err = rso_lidar("models", "add", mesh, "--rate-deg-s", *rates)
    assert (status, out, len(err)) == (2, "", 1) and "--rate-deg-s" in err[0]
    assert not library.exists()
