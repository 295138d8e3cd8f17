"""What a module defines has a user: in the package, the builders, examples, pages or benchmarks; a test alone is none."""

import ast
import re
from collections import Counter

import pytest

from tests.house.sources import parse, walk

USERS = ("rso_lidar", "models", "examples", "docs", "benchmarks")


def definitions(tree):
    """Return the functions, classes and constants of a module by name, with the node of each."""
    found = {}
    for node in tree.body:
        match node:
            case ast.FunctionDef() | ast.ClassDef():
                found[node.name] = node
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                found[name] = node
            case ast.Assign(targets=[ast.Tuple(elts=elements)]):
                found |= {element.id: node for element in elements if isinstance(element, ast.Name)}
    return {name: node for name, node in found.items() if not name.startswith("__")}


def loads(node):
    """Count the names that a piece of code reads."""
    nodes = walk(node) if isinstance(node, ast.Module) else ast.walk(node)
    return Counter(inner.id for inner in nodes if isinstance(inner, ast.Name))


def mentions(trees):
    """Return the names that are imported from modules, read as attributes, or written in strings that are code."""
    found = set()
    for tree in trees:
        for node in walk(tree):
            match node:
                case ast.ImportFrom(names=names):
                    found |= {alias.name for alias in names}
                case ast.Attribute(attr=name):
                    found.add(name)
                case ast.Constant(value=str(text)) if re.fullmatch(
                    r"[\w.:]+|(import [^\n]+; )?from [\w.]+ import [^\n]+", text
                ):
                    found |= set(re.findall(r"\w+", text))
    return found


def unused(modules, users):
    """Return by module the names that nothing reads but their own definition."""
    named, found = mentions(users), {}
    for module, tree in modules.items():
        read = loads(tree)
        dead = [
            name
            for name, node in definitions(tree).items()
            if name not in named and read[name] - loads(node)[name] <= 0
        ]
        if dead:
            found[module] = dead
    return found


def test_every_definition_has_a_user():
    modules = {
        name: tree for name, tree in parse("rso_lidar", "models").items() if not name.startswith("rso_lidar/cli/")
    }
    assert len(modules) > 300
    assert not unused(modules, parse(*USERS).values()), "delete it with its tests, or move it to tests/reference"


@pytest.mark.parametrize(
    ("code", "dead"),
    [
        ("def used(): ...\ndef dead(): used()", ["dead"]),
        ("def dead(n): return dead(n - 1)", ["dead"]),
        ("_LEAST = 3", ["_LEAST"]),
        ("_LEAST, _MOST = 3, 4\nprint(_MOST)", ["_LEAST"]),
        ("_LEAST: int = 3\nprint(_LEAST)", []),
        ("def write(): ...\nFORMATS = ['module:write']\nprint(FORMATS)", []),
        ("def run(): ...\nprint('from module import run; run()')", []),
        ("def run(): ...\nprint('import sys; from module import run; run()')", []),
    ],
)
def test_what_has_no_user_is_found(code, dead):
    tree = ast.parse(code)
    assert unused({"module": tree}, [tree]) == ({"module": dead} if dead else {})
