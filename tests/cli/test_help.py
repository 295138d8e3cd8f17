"""Help, usage errors and shell completion."""

import inspect
import json
import os
import subprocess
import sys
import typing

import pytest
import typer

from rso_lidar.cli.app import app
from tests.house.test_start import LATER


def names(application, before=()):
    """Return the words that call each command, with its function."""
    found = [((*before, one.name), one.callback) for one in application.registered_commands]
    for group in application.registered_groups:
        found += names(group.typer_instance, (*before, group.name))
    return found


COMMANDS = names(app)


@pytest.mark.parametrize(
    ("words", "function"), COMMANDS, ids=lambda value: " ".join(value) if isinstance(value, tuple) else ""
)
def test_help_says_every_word_as_it_is_written(rso_lidar, monkeypatch, words, function):
    """No part of a help text is markup ([m] is a unit) or an emoji (A:B:C is a span)."""
    monkeypatch.setenv("COLUMNS", "100")
    status, shown, errors = rso_lidar(*words, "--help")
    assert (status, errors) == (0, [])
    flat = " ".join(shown.split())
    assert shown.isascii()
    assert flat.startswith(f"Usage: rso-lidar {' '.join(words)} ")
    assert " ".join(inspect.getdoc(function).split()) in flat
    for hint in typing.get_type_hints(function, include_extras=True).values():
        for more in typing.get_args(hint):
            if isinstance(more, typer.models.ParameterInfo):
                assert " ".join(more.help.split()) in flat


def test_the_step_of_track_is_no_emoji(rso_lidar):
    assert "A:B:C" in rso_lidar("track", "--help")[1]
    assert "[m/s2/sqrt(Hz)]" in rso_lidar("track", "--help")[1]


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (("fly",), "rso-lidar"),
        (("--nope",), "rso-lidar"),
        (("run",), "rso-lidar run"),
        (("run", "x.toml", "-o", "x.h5", "--nope"), "rso-lidar run"),
        (("run", "x.toml", "-o", "x.h5", "--threads", "many"), "rso-lidar run"),
        (("export", "x.h5", "--frame", "3"), "rso-lidar export"),
        (("budget",), "rso-lidar budget"),
        (("trade", "x.toml", "--workers", "0"), "rso-lidar trade"),
        (("models", "add"), "rso-lidar models add"),
        (("models", "add", "x.stl", "--scal", "3"), "rso-lidar models add"),
        (("models", "tdrs", "--nope"), "rso-lidar models show"),
        (("models", "show"), "rso-lidar models show"),
    ],
)
def test_a_usage_error_points_at_the_help_of_its_command(rso_lidar, arguments, command):
    status, printed, errors = rso_lidar(*arguments)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert errors[0].startswith("error: ")
    assert errors[0].endswith(f"try '{command} --help'")
    assert rso_lidar(*command.split()[1:], "--help")[0] == 0


def completed(*words):
    """Return what bash is offered for the last of the words, and which heavy libraries it took."""
    line = " ".join(("rso-lidar", *words))
    told = {"_RSO_LIDAR_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words))}
    code = (
        "import atexit, json, sys\n"
        f"atexit.register(lambda: print('\\n' + json.dumps([name for name in {LATER} if name in sys.modules])))\n"
        "from rso_lidar.cli import main\n"
        "main([])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **told})
    assert (run.returncode, run.stderr) == (0, "")
    *offered, loaded = run.stdout.split("\n")[:-1]
    return [word for word in offered if word], json.loads(loaded)


def test_a_shell_is_offered_commands_and_loads_nothing_heavy():
    offered, loaded = completed("")
    assert {"new", "run", "budget", "models"} <= set(offered)
    assert set(loaded) <= {"rich", "typer"}


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["new", "x", "--from", "t"], ["tdrs_approach", "thrusters", "tle_flyby", "tumbling_inspection"]),
        (["budget", "gsfl"], ["gsfl_1064", "gsfl_1064_offset_limited"]),
        (["encounters", "--lidar", "prox"], ["proximity_1570"]),
        (["encounters", "--sort", "t"], ["time"]),
        (["models", "ca"], ["capsule"]),
        (["models", "show", "envi"], ["envisat"]),
        (["export", "a.h5", "--format", "ro"], ["rosbag2"]),
        (["truth", "a.toml", "--figure", "a"], ["angles"]),
        (["run", "a.toml", "--over"], ["--overwrite"]),
        (["run", "a"], []),  # the shell offers files
    ],
)
def test_a_shell_is_offered_names(rso_lidar, monkeypatch, words, offered):
    """In this process, which is cheap."""
    monkeypatch.setenv("_RSO_LIDAR_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(["rso-lidar", *words]))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    status, out, errors = rso_lidar()
    assert (status, out.split(), errors) == (0, offered, [])
