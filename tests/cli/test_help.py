"""Help, usage errors and shell completion."""

import inspect
import json
import os
import re
import shlex
import subprocess
import sys
import typing
from pathlib import Path

import pytest
import typer

from rso_lidar.cli.app import COMMANDS, GROUPS, app, load_command
from rso_lidar.export.registry import FORMAT_SUFFIXES
from tests.house.test_start import LATER

ROOT = Path(__file__).resolve().parents[2]


def names():
    """Return the words that call each command, with its function."""
    found = []
    for name, made in ((name, load_command(name)) for name in COMMANDS):
        if isinstance(made, typer.Typer):
            found += [((name, one.name), one.callback) for one in made.registered_commands]
        else:
            found.append(((name,), made))
    return found


CALLS = names()


def test_the_list_of_commands_is_made_of_their_first_sentences():
    for name, sentence in COMMANDS.items():
        made = load_command(name)
        told = made.registered_callback.callback if isinstance(made, typer.Typer) else made
        assert inspect.getdoc(told).replace("\n", " ").startswith(sentence)
        assert len(sentence) <= 62  # one line of 80 columns


@pytest.mark.parametrize(
    ("words", "function"), CALLS, ids=lambda value: " ".join(value) if isinstance(value, tuple) else ""
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


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_prints_the_first_sentence_of_each_command_whole(rso_lidar, group):
    _, shown, _ = rso_lidar(group, "--help")
    commands = shown[shown.index("Commands:") :]
    flat = " ".join(commands.split())
    assert "..." not in flat
    for command in load_command(group).registered_commands:
        sentence = " ".join(inspect.getdoc(command.callback).split("\n\n")[0].split())
        assert f"{command.name} {sentence.split('. ')[0]}" in flat


@pytest.mark.parametrize(
    "words",
    [
        ("encounters", "tle/flyby.tle", "--within", "1km", "--start", "2024-09-17T11:00:00Z", "--follower", "99003"),
        ("dataset", "make", "none.toml"),
    ],
    ids=lambda words: words[0],
)
def test_a_second_output_is_refused_where_a_command_writes_one(rso_lidar, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    status, printed, errors = rso_lidar(*words, "-o", "a.csv", "--output", "a.png")
    assert (status, printed) == (2, "")
    assert errors == ["error: -o: is given twice, and this command takes one; give it once"]
    assert not list(tmp_path.iterdir())


def test_without_words_it_prints_its_help(rso_lidar):
    _, asked, _ = rso_lidar("--help")
    status, printed, told = rso_lidar()
    assert (status, printed) == (2, "")
    assert told == asked.rstrip("\n").rstrip(".").splitlines()


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


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]


def documented():
    """Return every command of the README and the docs as words, with the page that gives it."""
    for page in PAGES:
        for block in re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE):
            for line in block.replace("\\\n", " ").splitlines():
                words = shlex.split(line, comments=True)
                if words[:1] == ["rso-lidar"]:
                    yield page.name, words[1:]


def test_every_command_of_the_docs_is_one():
    """Its options exist and take such values; nothing is run."""
    group = typer.main.get_command(app)
    found = list(documented())
    assert len(found) > 50
    for page, words in found:
        command, rest, where = group, words, None
        while hasattr(command, "resolve_command"):
            where = command.make_context("rso-lidar", [], parent=where, resilient_parsing=True)
            if not rest:
                break
            name, command, rest = command.resolve_command(where, rest)
        else:
            try:
                command.make_context(name, list(rest), parent=where)
            except Exception as error:
                raise AssertionError(f"{page}: rso-lidar {' '.join(words)}: {error}") from error


def test_no_command_of_the_docs_writes_among_the_examples():
    """Neither an output that it names, nor one that it leaves out: those go where one works, or beside a recording."""
    for page, words in documented():
        outputs = [
            words[k + 1] for k, word in enumerate(words[:-1]) if word in ("-o", "--output", "--to", "--csv", "--plot")
        ]
        assert not [output for output in outputs if output.startswith("examples")], f"{page}: {words}"


def test_documented_exports_that_need_an_extra_name_it():
    """A newcomer who installed the package alone is told beforehand."""
    needs = {suffix: made.extra for suffix, made in FORMAT_SUFFIXES.items() if made.extra} | {
        ".mp4": "mp4",
        ".rrd": "view",
    }
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for line in re.findall(r"^rso-lidar .*$", text, re.MULTILINE):
            for suffix, extra in needs.items():
                if re.search(rf"(--to|-o) \S+{re.escape(suffix)}\b|animate \S+ \S+{re.escape(suffix)}\b", line):
                    told = line.partition("#")[2]
                    assert "extra" in told or f"[{extra}]" in told, f"{page.name}: {line}"
