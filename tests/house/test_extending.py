"""The pages in docs/extending lead from a fresh clone to a new part that works: each page is followed as it is written.

A page gives each step as a sentence that ends in a colon, and a block with what to write or to run below it. `read_steps`
states the sentences that a page may use. A block without one of them is an error.
"""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.house.test_docs import broken_links

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs" / "extending").glob("*.md"))
MADE = shutil.ignore_patterns(".*", "out", "dist", "kernels", "*.tmp-*", "auto_*")  # by `make`; machine code
MADE_IN = {ROOT: {"build"}, ROOT / "docs": {"api", "files"}}  # in these folders only: others hold sources of that name


SENTENCES = {  # how the last sentence before a block says what to do with it
    "create": r"New file `(?P<file>[^`]+)`:",
    "after": r"In `(?P<file>[^`]+)`, after `(?P<line>[^`]+)`, add:",
    "before": r"In `(?P<file>[^`]+)`, before `(?P<line>[^`]+)`, add:",
    "append": r"At the end of `(?P<file>[^`]+)`, add:",
    "replace": r"In `(?P<file>[^`]+)`, replace `(?P<line>[^`]+)` by:",
    "run": r"Run:",
    "prints": r"It prints:",
}

# Commands of several pages that read the whole project.
CHECKS = ".venv/bin/ruff format --check .\n.venv/bin/ruff check .\n.venv/bin/lint-imports --no-logo\n"
GENERATE = ".venv/bin/python docs/generate.py scenario.md glossary.md\n"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the pages have commands of a Unix shell")


@dataclass(frozen=True)
class Step:
    """One step of a page: what to do, with which file and line of it, and the block."""

    deed: str
    block: str
    file: str = ""
    line: str = ""


def leave_out(folder, names):
    """Return what is not copied: all that `make` made."""
    return MADE(folder, names) | (MADE_IN.get(Path(folder), set()) & set(names))


def read_steps(text):
    """Return the steps of a page in its order."""
    steps = []
    for place in re.finditer(
        r"(?:^|\n)(?P<before>[^\n]*(?:\n[^\n]+)*)\n+```(?P<kind>\w+)\n(?P<block>.*?)\n?```", text, re.DOTALL
    ):
        said = " ".join(place["before"].split())
        found = [(deed, re.search(rf"(?:^|[.:] ){form}$", said)) for deed, form in SENTENCES.items()]
        fitting = [(deed, match) for deed, match in found if match]
        assert len(fitting) == 1, f"no sentence before a block says what to do with it: ...{said[-80:]}"
        ((deed, match),) = fitting
        steps.append(Step(deed, place["block"] + "\n", **match.groupdict()))
    assert len(steps) == len(re.findall(r"^```\w+$", text, re.MULTILINE)), "a block stands without a sentence before it"
    return steps


def edit(folder, step):
    """Create or change one file of a folder as a step says."""
    file = folder / step.file
    if step.deed == "create":
        assert not file.exists(), f"{step.file} is not new"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(step.block, encoding="utf-8")
        return
    if step.deed == "append":
        file.write_text(file.read_text(encoding="utf-8") + step.block, encoding="utf-8")
        return
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    places = [k for k, line in enumerate(lines) if line.strip() == step.line]
    assert len(places) == 1, f"{step.file}: {len(places)} lines are `{step.line}`; a page needs one to point at"
    first, last = {"after": (1, 1), "before": (0, 0), "replace": (0, 1)}[step.deed]
    lines[places[0] + first : places[0] + last] = [step.block]
    file.write_text("".join(lines), encoding="utf-8")


def check_printed(block, printed):
    """Check that the lines of a block were printed in their order; `...` in a line stands for any text."""
    lines = iter(line.strip() for line in printed.splitlines())
    for wanted in block.strip().splitlines():
        form = ".*".join(re.escape(piece) for piece in wanted.strip().split("..."))
        assert any(re.fullmatch(form, line) for line in lines), f"'{wanted}' was not printed, or not there:\n{printed}"


def copy_project(folder):
    """Copy the project, as a fresh clone has it, with the installation of these tests as its .venv."""
    folder.mkdir()
    for name in (place.name for place in ROOT.iterdir() if not leave_out(ROOT, [place.name])):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=leave_out)  # with byte code, which saves some seconds
        else:
            shutil.copy2(ROOT / name, folder / name)
    (folder / ".venv").symlink_to(sys.prefix, target_is_directory=True)


def run(folder, block):
    """Run a block of commands in a folder, with the package that is there; return what was printed."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    # Loops run as Python: for the few pixels of a page that is quicker than to compile them in each copy.
    environment |= {"PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1", "COLUMNS": "100"}
    done = subprocess.run(["sh", "-e", "-c", block], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{block}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def follow(folder, page, *, with_commands=True):
    """Take the steps of a page in a copy of the project, and return them.

    Commands that read the whole project are left out: they run once, after the steps of all pages.
    """
    steps, printed = read_steps(page.read_text(encoding="utf-8")), ""
    for step in steps:
        if step.block in (CHECKS, GENERATE):
            continue
        if step.deed == "run":
            printed = run(folder, step.block) if with_commands else ""
        elif step.deed != "prints":
            edit(folder, step)
        elif with_commands:
            check_printed(step.block, printed)
    return steps


def test_there_is_a_page_for_each_thing_to_add():
    assert [page.stem for page in PAGES] == ["command", "detector", "export", "material", "motion"]
    contributing = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert all(f"](docs/extending/{page.name})" in contributing for page in PAGES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_of_the_page_lead_somewhere(page):
    assert not broken_links(page, page.read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_leads_to_a_part_that_works(page, tmp_path):
    """Its commands check that: they run the new tests and use the new thing."""
    folder = tmp_path / "rso_lidar"
    copy_project(folder)
    steps = follow(folder, page)
    commands = [step.block for step in steps if step.deed == "run"]
    assert CHECKS in commands
    for command in ("bin/python -m pytest -q tests/", "bin/rso-lidar "):
        assert f".venv/{command}" in "".join(commands)
    touched = {step.file for step in steps}
    assert "CHANGELOG.md" in touched
    assert any(file.startswith("tests/") for file in touched)


@pytest.mark.slow
def test_all_pages_together_keep_the_rules_of_the_house(tmp_path):
    """In one copy, one page after the other: what a contributor finds in `make test`, beside the tests of the pages.

    That includes the commands of several pages that read the whole project: ruff, import contracts, generated pages.
    """
    folder = tmp_path / "rso_lidar"
    copy_project(folder)
    for page in PAGES:
        follow(folder, page, with_commands=False)
    run(folder, GENERATE)
    for name in ("photon_threshold", "lommel_seeliger", "exponential_braking"):
        assert name in (folder / "docs" / "scenario.md").read_text(encoding="utf-8")
    run(folder, CHECKS)
    rules = ("names", "docstrings", "part_fields", "dead_code", "modules")
    run(folder, f".venv/bin/python -m pytest -q {' '.join(f'tests/house/test_{rule}.py' for rule in rules)}")


@pytest.mark.parametrize(
    "text",
    [
        "Write this:\n\n```python\nx = 1\n```\n",
        "```sh\nls\n```\n",
        "In `a.py`, add:\n\n```python\nx = 1\n```\n",
    ],
)
def test_a_block_without_a_sentence_is_seen(text):
    with pytest.raises(AssertionError, match="block"):
        read_steps(text)


def test_steps_are_taken_as_they_are_written(tmp_path):
    text = (
        "A file. New file `a/b.py`:\n\n```python\none\ntwo\n```\n\n"
        "In `a/b.py`, after `one`, add:\n\n```python\n    1.5\n```\n\n"
        "Then two lines. In `a/b.py`,\nreplace `two` by:\n\n```python\n2\n3\n```\n\nIn `a/b.py`, before `one`, add:\n\n"
        "```python\n\n0\n```\n\nAt the end of `a/b.py`, add:\n\n```python\n4\n```\n\n"
        "Run:\n\n```sh\ncat a/b.py\n```\n\nIt prints:\n\n```text\n1.5\n...\n```\n"
    )
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    assert [step.deed for step in follow(tmp_path, page)] == [
        *("create", "after", "replace", "before", "append", "run", "prints")
    ]
    assert (tmp_path / "a" / "b.py").read_text(encoding="utf-8") == "\n0\none\n    1.5\n2\n3\n4\n"
    with pytest.raises(AssertionError, match="0 lines are `two`"):
        edit(tmp_path, Step("after", "x\n", "a/b.py", "two"))
    with pytest.raises(AssertionError, match="is not new"):
        edit(tmp_path, Step("create", "x\n", "a/b.py"))
    with pytest.raises(AssertionError, match="was not printed"):
        check_printed("3\n2\n", "2\n3\n")
    with pytest.raises(AssertionError, match="false"):
        run(tmp_path, "false\ntrue\n")
