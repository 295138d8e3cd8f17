"""Finding the data that travels with the package, and files that a user names."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import rso_lidar
from rso_lidar.scenario import read_toml
from rso_lidar.shipped import find, shipped


@pytest.mark.parametrize("folder", ["tle", "models", "gravity", "stars"])
def test_folders_of_data_have_an_index(folder):
    assert shipped(f"{folder}/index.toml").is_file()


def test_without_a_name_it_is_the_folder_that_holds_both():
    assert shipped("tle/index.toml") == shipped() / "tle" / "index.toml"


def test_a_path_need_not_exist():
    assert not shipped("models/no_such_model.glb").exists()


def test_in_a_wheel_the_data_lies_inside_the_package(tmp_path):
    """The same module, with the data beside it, finds that data."""
    package = tmp_path / "rso_lidar"
    shutil.copytree(shipped("models"), package / "models")
    shutil.copy(Path(rso_lidar.__file__).with_name("shipped.py"), package)
    (package / "__init__.py").touch()
    code = "from rso_lidar.shipped import shipped; print(shipped('models/index.toml'))"
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert Path(run.stdout.strip()) == (package / "models" / "index.toml").resolve()


def test_find_an_absolute_path(tmp_path):
    file = tmp_path / "a.tle"
    assert find(file) is None
    file.touch()
    assert find(str(file)) == file


def test_find_looks_beside_the_file_first_and_then_among_the_shipped(tmp_path):
    assert find("tle/index.toml", tmp_path) == shipped("tle/index.toml")
    (tmp_path / "tle").mkdir()
    (tmp_path / "tle" / "index.toml").touch()
    assert find("tle/index.toml", tmp_path) == tmp_path / "tle" / "index.toml"


def test_find_without_a_folder_means_the_working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.tle").touch()
    found = find("a.tle")
    assert found is not None
    assert found.resolve() == (tmp_path / "a.tle").resolve()


def test_find_knows_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    (tmp_path / "a.tle").touch()
    assert find("~/a.tle") == tmp_path / "a.tle"


def test_what_is_nowhere_is_none(tmp_path):
    assert find("tle/no_such_file.tle", tmp_path) is None


def test_scenarios_and_studies_are_found_among_the_shipped_data(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shipped_one = rso_lidar.Scenario.load("examples/bench_plate.toml")
    assert shipped_one.name == "Bench, plate at 3 km"
    assert read_toml(Path("examples/bench_plate.toml")).startswith(
        ("#", "version")
    )  # as `requirements` reads its subject
    assert rso_lidar.study.Study.load("examples/studies/trade_lens.toml").base().target[0].name == "tdrs"
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "bench_plate.toml").write_text(shipped_one.replace(name="mine").dumps(), encoding="utf-8")
    assert rso_lidar.Scenario.load("examples/bench_plate.toml").name == "mine"  # the working folder comes first
    with pytest.raises(rso_lidar.ScenarioError, match="no such file"):
        rso_lidar.Scenario.load("examples/bench.toml")


def test_nothing_is_found_beside_the_shipped_data(tmp_path, monkeypatch):
    """What a scenario names as code would run, so that a name must not lead to any file of the installation."""
    monkeypatch.chdir(tmp_path)
    home = shipped()
    for name in ("rso_lidar/units.py", f"../{home.name}/examples/bench_plate.toml", "examples/../tle/index.toml"):
        assert (home / name).is_file()
        assert find(name) is None, name
    assert find("tle/index.toml") == home / "tle" / "index.toml"
