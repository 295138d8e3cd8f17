"""The pages by reader: their Python runs, their commands print what is shown, and their links lead somewhere."""

import contextlib
import io
import re
import shutil
from pathlib import Path

import pytest

from rso_lidar.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs" / "readers").glob("*.md"))
NAMES = [page.stem for page in PAGES]
# A line `<!-- not run: why -->` before a block says that it takes too long.
BLOCK = re.compile(
    r"(?P<why><!-- not run: [^\n]+ -->\n)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE
)
STARTS = {"approach": "tdrs_approach", "stage": "tumbling_inspection"}  # what `rso-lidar new` writes for these pages


def blocks(page, kind):
    """Return the blocks of one kind that are run."""
    text = page.read_text(encoding="utf-8")
    return [found["text"] for found in BLOCK.finditer(text) if found["kind"] == kind and not found["why"]]


def commands(page):
    """Return each command of a page with the lines that are shown below it."""
    parts = [part for text in blocks(page, "console") for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]]
    return [
        (lines[0], lines[1:]) for lines in (part.splitlines() for part in parts) if lines[0].startswith("rso-lidar")
    ]


def missing_line(shown, printed):
    """Return the first line shown that is not printed after the ones before it, or None; `…` stands for left out lines."""
    rest = iter([line.rstrip() for line in printed])
    return next((line for line in shown if line.strip() not in ("", "…") and line.rstrip() not in rest), None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the scenarios that the pages name."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    for name, example in STARTS.items():
        assert call(folder, f"rso-lidar new {name} --from {example}")[0] == 0
    return folder


def call(folder, command):
    """Run a command of the package in a folder; return its status and what it printed: output and errors.

    In this process, which spares each command the start and the imports of a new one.
    """
    printed, errors = io.StringIO(), io.StringIO()
    with contextlib.ExitStack() as around:
        around.enter_context(contextlib.chdir(folder))
        around.enter_context(contextlib.redirect_stdout(printed))
        around.enter_context(contextlib.redirect_stderr(errors))
        around.enter_context(pytest.MonkeyPatch.context()).setenv("COLUMNS", "110")
        left = around.enter_context(pytest.raises(SystemExit))
        main(command.split()[1:])
    return left.value.code or 0, printed.getvalue(), errors.getvalue()


def test_there_is_a_page_for_each_reader():
    assert NAMES == ["contributor", "flight_software", "learner", "mission_analyst", "tracking_engineer"]
    assert sum(len(commands(page)) for page in PAGES) >= 6


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=pytest.mark.slow if page.stem == "mission_analyst" else ()) for page in PAGES],
    ids=NAMES,
)
def test_commands_print_what_is_shown(page, folder):
    for command, shown in commands(page):
        status, output, errors = call(folder, command)
        assert status == (2 if shown[0].startswith("error:") else 0), errors
        printed = (errors if status else output).splitlines()
        assert missing_line(shown, printed) is None, f"{command} does not print: {missing_line(shown, printed)}"


def test_a_line_that_is_not_printed_is_seen():
    assert missing_line(["a", "…", "c"], ["a", "b", "c"]) is None
    assert missing_line(["a", "c", "b"], ["a", "b", "c"]) == "b"


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_code_runs_and_prints_what_is_shown(page, tmp_path, monkeypatch, capsys):
    shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "tle", tmp_path / "tle")
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "page"}
    for code in blocks(page, "python"):
        exec(compile(code, page.name, "exec"), namespace)
    printed = capsys.readouterr().out
    for shown in blocks(page, "text"):
        assert shown in printed


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)\s#]+)", text)
    assert links
    assert [link for link in links if not (page.parent / link).exists()] == []
