"""`rso-lidar new`: a scenario to start from, from each example, that flies as it is."""

import shutil
import tomllib
from functools import partial
from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar.shipped import shipped

EXAMPLES = sorted(file.stem for file in shipped("examples").glob("*.toml"))


@pytest.fixture
def call(rso_lidar, tmp_path, monkeypatch):
    """Return a function that calls `new` in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return partial(rso_lidar, "new")


def test_without_a_name_the_examples_are_listed(call, tmp_path):
    status, out, err = call()
    assert (status, err) == (0, [])
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[: len(EXAMPLES)]] == EXAMPLES
    assert all(len(line.split()) > 5 for line in lines[: len(EXAMPLES)])  # what each flies
    assert "rso-lidar new NAME --from EXAMPLE" in lines[-1]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("example", EXAMPLES)
def test_it_is_the_example_under_another_name_and_needs_nothing_else(call, tmp_path, example):
    """Loading reads every file that a scenario names; tests of the wheel fly two frames of each."""
    status, out, _ = call("mine", "--from", example)
    assert status == 0
    assert out.splitlines()[0] == "mine.toml"
    made = rl.Scenario.load("mine.toml")
    like = rl.Scenario.load(shipped(f"examples/{example}.toml"))
    assert made.name == "mine"
    assert made.replace(name=like.name) == like
    text, original = (
        Path("mine.toml").read_text(encoding="utf-8"),
        shipped(f"examples/{example}.toml").read_text("utf-8"),
    )
    assert "rso-lidar check mine.toml" in text
    assert text.count("#") > original.count("#")  # all comments of the example, and what to do with the file


def test_left_out_it_is_the_example_of_the_readme(call):
    assert call("approach")[0] == 0
    assert tomllib.loads(Path("approach.toml").read_text())["target"][0]["name"] == "tdrs"


def test_what_it_needs_comes_along_and_stays_if_it_is_the_same(call, tmp_path):
    assert call("one", "--from", "thrusters")[1].splitlines()[:2] == ["one.toml", "thrusters.py"]
    assert call("two", "--from", "thrusters")[1].splitlines()[0] == "two.toml"
    Path("thrusters.py").write_text("# mine\n")
    status, out, err = call("three", "--from", "thrusters")
    assert (status, out, len(err)) == (2, "", 1)
    assert "thrusters.py: exists already; give --overwrite" in err[0]
    assert Path("thrusters.py").read_text() == "# mine\n"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["one.toml", "thrusters.py", "two.toml"]


def test_a_path_and_a_suffix_may_be_given(call, tmp_path):
    (tmp_path / "there").mkdir()
    assert call(tmp_path / "there" / "x")[0] == 0
    assert call("there/y.toml")[0] == 0
    assert sorted(file.name for file in (tmp_path / "there").iterdir()) == ["x.toml", "y.toml"]


def test_any_printable_name_is_valid_toml(call):
    assert call('a "b" c\\d é')[0] == 0
    assert rl.Scenario.load('a "b" c\\d é.toml').name == 'a "b" c\\d é'


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["x", "--from", "tdrs_aproach"], "did you mean 'tdrs_approach'? (known: bench_plate,"),
        (["x", "--from", "../tdrs"], "no example of that name"),
        (["x", "--from", ""], "no example of that name"),
        (["--from", "nothing"], "no example of that name"),
        (["x.yaml"], "unknown suffix '.yaml'"),
        (["x.tml"], "did you mean '.toml'?"),
        (["none/x"], "there is no folder none"),
        ([""], "is not a file name"),
        ([".."], "is not a file name"),
        (["a\tb"], "is not a file name"),
        (["x" * 300], "File name too long"),
        (["taken"], "exists already; give --overwrite"),
        (["x", "y"], "try 'rso-lidar new --help'"),
    ],
)
def test_refused_in_one_line(call, tmp_path, arguments, said):
    (tmp_path / "taken.toml").write_text("mine")
    status, out, err = call(*arguments)
    assert (status, out, len(err)) == (2, "", 1)
    assert said in err[0]
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("taken.toml", "mine")]


def test_dynamics_leave_no_compiled_file_beside_them(call, tmp_path):
    """So that nothing lands among shipped examples, and an edit within the same second counts."""
    shutil.copy(shipped("examples/thrusters.py"), tmp_path)
    call("mine", "--from", "thrusters")
    next(rl.simulate(rl.Scenario.load("mine.toml", trust_code=True), frames=[0]))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["mine.toml", "thrusters.py"]


def test_a_home_of_nobody_is_one_line(call, tmp_path):
    status, out, err = call("~no_such_user/mine")
    assert (status, out) == (2, "")
    assert len(err) == 1
    assert "~no_such_user/mine.toml: cannot be written here" in err[0]
    assert list(tmp_path.iterdir()) == []
