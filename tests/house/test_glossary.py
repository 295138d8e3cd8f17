"""The glossary has every public class of the package once, and every term in one line."""

import ast
import re
from collections import Counter
from pathlib import Path

from tests.house.sources import parse

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS, CLASSES = TEXT.split("\n## Classes\n")
ROW = re.compile(r"^\| (.+?) \| (.+) \|$", re.MULTILINE)


def rows(text):
    """Return the first cell and the rest of each row of the tables of a text."""
    found = [row.groups() for row in ROW.finditer(text)]
    return [(first, rest) for first, rest in found if not first.startswith("---") and rest.split(" | ")[0] != "---"]


def test_every_public_class_is_there_once():
    trees = parse("rso_lidar").values()
    classes = Counter(f"`{node.name}`" for tree in trees for node in tree.body if isinstance(node, ast.ClassDef))
    public = {name: count for name, count in classes.items() if not name.startswith("`_")}
    listed = Counter(first for first, _ in rows(CLASSES) if first != "class")
    assert len(public) > 200
    assert listed == public


def test_terms_are_said_once_in_one_sentence_or_two():
    terms = [(first, meaning) for first, meaning in rows(TERMS) if first != "term"]
    names = [name.strip().lower() for first, _ in terms for name in first.split(",")]
    assert len(terms) > 80
    assert not [name for name, count in Counter(names).items() if count > 1]
    assert not [first for first, meaning in terms if not re.fullmatch(r"[A-Z`].{10,120}[.]", meaning)]
