"""The Python in the README runs as it stands, in its order, where the README says that one is."""

import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# A line `<!-- not run: why -->` before a block says that it takes too long; it must still compile.
BLOCK = re.compile(
    r"(?:<!-- not run: (?P<why>[^\n]+?) -->\s*\n)?^```python\n(?P<code>.*?)^```$", re.DOTALL | re.MULTILINE
)


def blocks(text):
    """Return line number, code and the reason not to run it (or None), block by block."""
    return [
        (text.count("\n", 0, found.start("code")) + 1, found["code"], found["why"]) for found in BLOCK.finditer(text)
    ]


def run(text, name):
    """Run the blocks of a page one after another in one namespace; return how many ran."""
    namespace = {"__name__": "readme"}
    ran = 0
    for line, code, why in blocks(text):
        program = compile("\n" * (line - 1) + code, name, "exec")
        if why is None:
            exec(program, namespace)
            ran += 1
    return ran


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Stand in a folder that has the examples, and may be written to."""
    if (ROOT / "examples").is_dir():
        shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.chdir(tmp_path)


def test_readme_code_runs(checkout):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    ran = run(text, "README.md")
    if "```" in text:  # a README with any block at all shows Python that runs
        assert ran >= 1


def test_broken_code_fails():
    with pytest.raises(NameError):
        run("```python\nx = 1\n```\n\nand\n\n```python\nprint(x + y)\n```\n", "page")


def test_a_block_that_is_not_run_must_compile():
    assert run("<!-- not run: flies for an hour -->\n```python\nraise SystemExit\n```\n", "page") == 0
    with pytest.raises(SyntaxError):
        run("<!-- not run: flies for an hour -->\n```python\nfor\n```\n", "page")


def test_line_numbers_are_the_readers():
    with pytest.raises(ZeroDivisionError) as caught:
        run("Title\n\n```python\na = 0\nb = 1 / a\n```\n", "page")
    assert caught.traceback[-1].lineno + 1 == 5
