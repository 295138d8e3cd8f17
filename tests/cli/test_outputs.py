"""What commands write: an output that exists stays without --overwrite, with the same words everywhere."""

import inspect
import typing
from pathlib import Path

import pytest
import typer

import rso_lidar as rl
from rso_lidar.cli import dataset_make
from rso_lidar.cli.app import COMMANDS, load_command
from rso_lidar.shipped import shipped

FLYBY = ["encounters", shipped("tle/flyby.tle"), "--follower", 99003, "--within", "20km"]
FLYBY += ["--start", "2024-09-17T11:00:00Z", "--days", 0.125]
# Options that name what is read.
READS = [
    ("check", "files"),
    ("score", "dataset"),
    ("fit", "data"),
    ("fit", "own"),
    ("waveforms", "data"),
    ("parameters", "requirements"),
    *((name, "facet_parts") for name in ("add", "show")),
    *(("serve", name) for name in ("token_file", "curve_key", "curve_clients")),
]
WRITES = (
    "output",
    "to",
    "csv",
    "plot",
    "tubes",
    "target_orbit",
    "hidden_labels",
)  # parameters that name a file to write


def commands():
    """Return the functions of all commands, those of groups among them."""
    made = [load_command(name) for name in COMMANDS]
    groups = [one for one in made if isinstance(one, typer.Typer)]
    inner = [command.callback for group in groups for command in group.registered_commands]
    return [one for one in made if one not in groups] + inner


def test_every_command_that_writes_has_overwrite():
    writing = [function for function in commands() if set(inspect.signature(function).parameters) & set(WRITES)]
    writing.remove(dataset_make.make)  # a folder is continued with --resume; frames of hours are never replaced
    assert len(writing) >= 12
    assert [
        function.__name__ for function in writing if "overwrite" not in inspect.signature(function).parameters
    ] == []


def test_no_parameter_that_names_an_output_is_overlooked():
    """A path that is an option is an output; what is read is an argument."""
    options = [
        (function.__name__, name)
        for function in commands()
        for name, hint in typing.get_type_hints(function, include_extras=True).items()
        if any(isinstance(more, typer.models.OptionInfo) for more in typing.get_args(hint)[1:])
        and Path in (typing.get_args(hint)[0], *typing.get_args(typing.get_args(hint)[0]))
    ]
    assert options
    assert [one for one in options if one not in READS and one[1] not in WRITES] == []


@pytest.fixture(scope="module")
def recording(tmp_path_factory, text):
    scenario = rl.Scenario.loads(text)
    return rl.save(tmp_path_factory.mktemp("recorded") / "bench.h5", rl.simulate(scenario, frames=range(2)))


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["run", "{scenario}", "-o"], "x.h5"),
        (["truth", "{scenario}", "-o"], "x.csv"),
        (["truth", "{scenario}", "-o"], "x.png"),
        (["timeline", "{scenario}", "-o"], "x.csv"),
        (["parameters", "{scenario}", "-o"], "x.sysml"),
        (["disperse", "{scenario}", "-o"], "x.csv"),
        (["disperse", "{scenario}", "--tubes"], "x.csv"),
        (["timeline", "{scenario}"], "bench_timeline.png"),
        (["budget", "gsfl_1064", "-o"], "x.csv"),
        (["export", "{recording}", "--to"], "x.npz"),
        (["export", "{recording}", "--to"], "x.czml"),
        (["export", "{recording}", "--to"], "x.csv"),
        (["plot", "{recording}", "-o"], "x.png"),
        (["plot", "{recording}", "--curves", "-o"], "x.svg"),
        (["plot", "{recording}", "--path"], "bench_path.png"),
        (["plot", "{recording}", "--frame", "1"], "bench_frame1.png"),
        (["animate", "{recording}"], "x.gif"),
        (["track", "{recording}", "-o"], "x.csv"),
        (["view", "{recording}", "-o"], "x.png"),
        (["view", "{recording}", "--with", "files"], "bench_view.png"),
        (["models", "show", "plate", "-o"], "x.png"),
        (["catalog", shipped("tle/flyby.tle"), "-o"], "x.json"),
        ([*FLYBY, "--csv"], "x.csv"),
        ([*FLYBY, "--plot"], "x.png"),
        ([*FLYBY, "--scenario", 1, "-o"], "x.toml"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(str(word) for word in value[:1]),
)
def test_an_output_that_exists_stays(rso_lidar, bench, recording, tmp_path, monkeypatch, arguments, output):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    (here / "bench.h5").symlink_to(recording)
    (here / output).write_bytes(b"precious")
    words = [str(word).format(scenario=bench, recording="bench.h5") for word in arguments]
    named = not output.startswith("bench")
    status, printed, errors = rso_lidar(*words, *[output] * named)
    assert (status, printed) == (2, "")
    assert len(errors) == 1
    assert errors[0].endswith(f"{output}: exists already; give --overwrite (overwrite=True) or another name")
    assert sorted(file.name for file in here.iterdir()) == sorted({output, "bench.h5"})
    assert (here / output).read_bytes() == b"precious"


def test_with_overwrite_they_are_replaced(rso_lidar, recording, tmp_path):
    for arguments in (["plot", recording, "-o", tmp_path / "x.png"], ["animate", recording, tmp_path / "x.gif"]):
        place = arguments[-1]
        place.write_bytes(b"old")
        assert rso_lidar(*arguments)[0] == 2
        assert rso_lidar(*arguments, "--overwrite")[0] == 0
        assert place.read_bytes()[:4] in (b"\x89PNG", b"GIF8")


def test_an_unknown_suffix_is_told_before_anything_is_read(rso_lidar, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for arguments in (
        ["plot", "none.h5", "-o", "x.foo"],
        ["animate", "none.h5", "x.foo"],
        ["plot", "none.h5", "-o", "x"],
    ):
        status, _, (error,) = rso_lidar(*arguments)
        assert status == 2
        assert "suffix" in error and "known: " in error and "did you mean" not in error


@pytest.mark.parametrize(
    "arguments",
    [
        ("truth", "{bench}", "-o", "{out}.csv"),
        ("truth", "{bench}", "-o", "{out}.czml"),
        ("timeline", "{bench}", "-o", "{out}.csv"),
        ("budget", "{bench}", "-o", "{out}.csv"),
        ("budget", "{bench}"),
        ("track", "{recorded}", "-o", "{out}.csv"),
        ("track", "{recorded}"),
        ("models", "show", "cubesat_3u"),
    ],
)
def test_a_dark_background_without_a_picture_is_refused(rso_lidar, bench, recorded, tmp_path, arguments):
    before = sorted(tmp_path.iterdir())
    names = {"bench": bench, "recorded": recorded, "out": tmp_path / "out"}
    status, said, errors = rso_lidar(*(argument.format(**names) for argument in arguments), "--dark")
    assert (status, said) == (2, "")
    assert errors == ["error: --dark: is for pictures; end the output with .png, or leave --dark out"]
    assert sorted(tmp_path.iterdir()) == before
