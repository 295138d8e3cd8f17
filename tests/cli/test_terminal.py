"""What users and files name reaches the terminal as text: no control character, no markup."""

import os
import re
import subprocess
import sys
from contextlib import contextmanager

import pytest

import rso_lidar as rl
from rso_lidar.cli import progress
from rso_lidar.cli.console import make_console
from rso_lidar.cli.terminal import escape_controls, to_one_line

# Colours, a new title of the window, the end of the line, a C1 control sequence, a text turned about, a byte of no text.
STRANGE = "\x1b[31mred\x1b]0;title\x07\x08\x9b2J\u202eback\u2066[bold]x[/bold]:smile:"
RAW = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")


def test_controls_are_written_as_escapes():
    assert escape_controls("a\tb\nc\x1b[1m\x9b\u202e\udcff\r") == "a\tb\nc\\x1b[1m\\x9b\\u202e\\udcff\\r"
    assert escape_controls("µm – ⅓ 東 naïve") == "µm – ⅓ 東 naïve"
    assert escape_controls("a\u200bb\ufeff\xad\u2028") == "a\\u200bb\\ufeff\\xad\\u2028"
    assert escape_controls("نمی\u200cخواهم") == "نمی\u200cخواهم"  # Persian needs the joiner


def test_a_line_break_in_a_name_is_shown_and_spaces_stay():
    assert to_one_line(" a\n b\x1b ") == "a\\n b\\x1b"
    assert to_one_line("two  spaces\t.toml") == "two  spaces\\t.toml"


def test_a_long_message_keeps_its_place_cause_and_cure():
    names = ", ".join(f"model_{number:04}" for number in range(2000))
    line = to_one_line(
        f"a.toml: target {'t' * 5000}: unknown model '{'m m' * 900}' (known: {names}); add your own mesh"
    )
    assert line.startswith("a.toml: target ttt")
    assert "t ... (4,758 characters left out) ... t" in line  # 250 are kept of `target ttt...ttt:`
    assert ": unknown model 'm mm mm" in line
    assert "(known: model_0000, model_0001, " in line
    assert line.endswith("model_1999); add your own mesh")
    assert len(line) < 1000
    assert to_one_line("x: " + "y" * 997) == "x: " + "y" * 997
    assert len(to_one_line("; ".join(f"key_{number}: is missing" for number in range(900)))) < 1050


@pytest.mark.parametrize("options", [[], pytest.param(["-u"], marks=pytest.mark.slow)])
@pytest.mark.parametrize("words", [["--version"], ["models"], ["schema"], ["models", "materials"], ["check", "--help"]])
def test_a_reader_that_goes_away_ends_no_command_with_an_error(words, options):
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, *options, "-m", "rso_lidar", *words], stdout=writing, stderr=subprocess.PIPE, check=False
        )
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


def test_files_are_complete_and_the_status_is_true_where_nobody_reads(text, tmp_path):
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    for words, status in ((["new", "mine.toml"], 0), (["check", "none.toml"], 2)):
        reading, writing = os.pipe()
        os.close(reading)
        command = [sys.executable, "-m", "rso_lidar", *words]
        assert subprocess.run(command, stdout=writing, stderr=writing, cwd=tmp_path, check=False).returncode == status
        os.close(writing)
    assert rl.Scenario.load(tmp_path / "mine.toml").name


def test_a_console_of_tables_is_literal_too(capsys):
    from rich.table import Table

    table = Table(title=STRANGE)
    table.add_column(STRANGE)
    table.add_row(STRANGE)
    make_console(200).print(table)
    make_console().print(STRANGE)
    said = capsys.readouterr().out
    assert not RAW.search(said)
    assert said.count("\\x1b[31mred") == 4


def test_no_command_prints_what_a_scenario_or_recording_holds_raw(rso_lidar, text, tmp_path):
    path = tmp_path / "strange.toml"
    escaped = "".join(f"\\u{ord(letter):04x}" for letter in STRANGE)
    path.write_text(text.replace("a plate on a bench", escaped), encoding="utf-8")
    recording = tmp_path / "x.h5"
    said = []
    for words in (["check", path], ["run", path, "-o", recording, "--frames", "0:1"], ["info", recording]):
        status, out, errors = rso_lidar(*words)
        assert status == 0
        said += [out, *errors]
    assert not RAW.search("".join(said))
    assert "\\x1b[31mred" in said[0] and "\\x1b[31mred" in said[-1]


@pytest.mark.parametrize(
    "words",
    [
        [STRANGE],
        ["check", f"{STRANGE}.toml"],
        ["info", f"{STRANGE}.h5"],
        ["catalog", f"{STRANGE}.tle"],
        ["models", "show", STRANGE],
        ["budget", STRANGE],
        ["run", "examples/tdrs_approach.toml", "-o", f"{STRANGE}.h5", "--set", f"target.0.name={STRANGE}"],
        ["run", "examples/tdrs_approach.toml", "-o", f"none/{STRANGE}.h5", "--set", f"{STRANGE}=1"],
    ],
    ids=range(8),
)
def test_no_error_repeats_what_was_given_raw(rso_lidar, words):
    status, out, errors = rso_lidar(*words)
    assert (status, out, len(errors)) == (2, "", 1)
    assert not RAW.search(errors[0])


def test_a_warning_is_printable(rso_lidar, text, tmp_path):
    scenario = rl.Scenario.loads(text)
    path = rl.save(tmp_path / f"a{chr(27)}[31m.h5", rl.simulate(scenario, frames=[0]))
    status, out, errors = rso_lidar("info", path)
    assert status == 0 and not errors
    assert not RAW.search(out) and "\\x1b[31m.h5" in out


def test_steps_are_counted_on_one_bar_once_their_number_is_known(monkeypatch):
    begun = []

    class Bar:
        advanced = 0

        def advance(self):
            self.advanced += 1

    @contextmanager
    def show(total, done, doing, of):
        begun.append((total, done, doing, of, Bar()))
        yield begun[-1][-1]

    monkeypatch.setattr(progress, "show_progress", show)
    with progress.count_steps("trading", "run") as step:
        for done, total in ((0, 0), (2, 9), (3, 9), (7, 9)):
            step(done, total)
    ((*said, bar),) = begun
    assert said == [9, 2, "trading", "run"] and bar.advanced == 5
