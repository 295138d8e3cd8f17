"""Every test can fail by itself: it asserts, or uses a function or a fixture that does."""

import ast
import re
from functools import cache
from pathlib import PurePosixPath

import pytest

from tests.house.sources import parse, walk

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
CHECKS = {"raises", "warns", "fail", "check_call", "check_returncode"}  # of pytest and of a process
RUNS = {"exec"}  # other people's code, such as a page's: what it raises fails the test


@cache  # helpers are asked about once for each module that can use them
def asserts(function):
    """Return whether a function asserts, or one inside it does."""
    for node in ast.walk(function):
        match node:
            case ast.Assert() | ast.keyword(arg="check", value=ast.Constant(value=True)):
                return True
            case ast.Call(func=ast.Attribute(attr=name)) if name in CHECKS or name.startswith("assert_"):
                return True
            case ast.Call(func=ast.Name(id=name)) if name in RUNS or name.startswith("assert_"):
                return True
    return False


@cache
def functions_of(tree):
    """Return the functions and methods of a module by name."""
    return {node.name: node for node in walk(tree) if isinstance(node, FUNCTIONS)}


@cache
def names_in(function):
    """Return the names that a function uses; its arguments are fixtures."""
    arguments = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
    nodes = tuple(ast.walk(function))
    used = {node.id for node in nodes if isinstance(node, ast.Name)}
    used |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    return used | {argument.arg for argument in arguments}


def known_in(name, trees):
    """Return the functions that a test module can use by name: fixtures, imported ones and its own."""
    folders = list(PurePosixPath(name).parents)[::-1]
    sources = [
        "tests/ledger/recording.py",
        *(f"{folder}/conftest.py" for folder in folders),
    ]  # its fixture is everywhere
    for node in walk(trees[name]):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("tests"):
            modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            sources += [f"{module.replace('.', '/')}.py" for module in modules]
    found = {}
    for source in [*sources, name]:
        found |= functions_of(trees[source]) if source in trees else {}
    return found


def idle_tests(trees):
    """Return the tests of modules that assert nothing, neither themselves nor through what they use."""
    idle = []
    for name in trees:
        if not PurePosixPath(name).name.startswith("test_"):
            continue
        known = known_in(name, trees)
        checks = {word for word, function in known.items() if asserts(function)}
        users = {word: names_in(function) & set(known) for word, function in known.items()}
        while more := {word for word, used in users.items() if word not in checks and used & checks}:
            checks |= more
        own = [word for word in functions_of(trees[name]) if word.startswith("test_")]
        idle += [f"{name}::{word}" for word in own if word not in checks]
    return idle


def test_tests_hold_no_doctest():
    """pytest searches them in the package only."""
    assert not [name for name, tree in parse("tests").items() if has_doctest(tree)]


def has_doctest(tree):
    """Return whether a docstring of a module has an example with a prompt."""
    documented = [node for node in walk(tree) if isinstance(node, (ast.Module, ast.ClassDef, *FUNCTIONS))]
    return any(re.search(r"^\s*>>> ", ast.get_docstring(node, clean=False) or "", re.MULTILINE) for node in documented)


def test_a_doctest_is_seen():
    assert has_doctest(ast.parse('def add():\n    """Add.\n\n    >>> 1 + 1\n    2\n    """'))
    assert not has_doctest(ast.parse('def add():\n    """Add x >>> y."""'))


def test_every_test_asserts():
    trees = parse("tests")
    assert sum("/test_" in name for name in trees) > 200
    assert not idle_tests(trees), "assert what the test is about"


@pytest.mark.parametrize(
    ("code", "idle"),
    [
        ("def test_x(): scenario.load()", True),
        ("def made(): return 1\ndef test_x(): made()", True),
        ("class TestX:\n    def test_x(self): draw()", True),
        ("def test_x(): assert 1", False),
        ("def test_x(): np.testing.assert_allclose(a, b)", False),
        ("def test_x():\n    with pytest.raises(ValueError): f()", False),
        ("def same(a): assert a\ndef also(a): same(a)\ndef test_x(): also(1)", False),
        ("def run():\n    def call(): assert 1\n    return call\ndef test_x(run): run()", False),
        ("from tests.other import look\ndef test_x(): look()", False),
    ],
)
def test_a_test_without_an_assertion_is_seen(code, idle):
    trees = {"tests/room/test_it.py": ast.parse(code), "tests/other.py": ast.parse("def look(): assert 1")}
    assert idle_tests(trees) == ["tests/room/test_it.py::test_x"] * idle
