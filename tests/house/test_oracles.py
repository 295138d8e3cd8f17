"""Every kernel has a readable oracle under tests/reference, and a test that imports the oracle to compare the two.

A module of tests/reference says of what it is the oracle: "the oracle of `rso_lidar.<module>`" stands for the functions of
that module that it defines by the same names, "of `rso_lidar.<module>.<function>`" for that one. A kernel is covered where
such a function reaches it by calls, through other functions and kernels.
"""

import ast
import re
from functools import cache

from tests.house.sources import parse, walk

ORACLE = re.compile(r"\boracle of((?:(?:,| and)?\s+`rso_lidar\.[\w.]+`)+)", re.IGNORECASE)
NONE = {  # kernels without an oracle, by module, and what checks them instead
    "rso_lidar.dataset.drawing.sample_order": "places are a permutation, and ten samples of a class hold each split's share",
    "rso_lidar.export.layout.checksum": "h5py verifies the checksum that it computes itself",
    "rso_lidar.export.writer.chunks": "h5py verifies the checksums of the chunks as it reads them",
    "rso_lidar.scene.meshes.polygons": "triangles that wind alike and have the area of the shoelace formula cover it once",
    "rso_lidar.export.writer.deflate": "zlib inflates the result, and h5py reads it",
}


def dotted(name):
    """Return the name under which a file is imported."""
    return name.removesuffix(".py").replace("/", ".").removesuffix(".__init__")


@cache
def modules():
    """Return the syntax trees of the package by name of the module."""
    return {dotted(name): tree for name, tree in parse("rso_lidar").items()}


@cache
def definitions():
    """Return the functions and classes at the top of modules, by dotted name."""
    return {
        f"{module}.{node.name}": node
        for module, tree in modules().items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }


@cache
def scope(module):
    """Return what the names in a module stand for, by dotted name."""
    names = {}
    for node in walk(modules()[module]):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    own = (node.name for node in modules()[module].body if isinstance(node, ast.FunctionDef | ast.ClassDef))
    return names | {name: f"{module}.{name}" for name in own}


def resolve(name):
    """Follow a name through the modules that import it to where it is defined; None outside the package."""
    while name not in definitions():
        module, _, word = name.rpartition(".")
        if module not in modules() or scope(module).get(word, name) == name:
            return None
        name = scope(module)[word]
    return name


@cache
def used_by(name):
    """Return the functions and classes that the body of one names."""
    node, names = definitions()[name], scope(name.rpartition(".")[0])
    found = set()
    for inner in (inner for statement in node.body for inner in ast.walk(statement)):
        match inner:
            case ast.Name(id=word) if word in names:
                found.add(resolve(names[word]))
            case ast.Attribute(value=ast.Name(id=word), attr=attribute) if word in names:
                found.add(resolve(f"{names[word]}.{attribute}"))
    return found - {None}


def reached_from(names):
    """Return what functions reach by calls, themselves included."""
    reached, waiting = set(), list(names)
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += used_by(name)
    return reached


def kernels():
    """Return the functions of the package that are kernels."""
    marks = {name: {ast.unparse(mark) for mark in node.decorator_list} for name, node in definitions().items()}
    return {name for name, found in marks.items() if found & {"kernel", "kernels.kernel"}}


def compared():
    """Return, for each oracle module, the functions of the package that it is the oracle of."""
    found = {}
    for file, tree in parse("tests/reference").items():
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name[0] != "_"}
        names = re.findall(r"`(.+?)`", " ".join(ORACLE.findall(ast.get_docstring(tree) or "")))
        unknown = [name for name in names if name not in modules() and name not in definitions()]
        assert not unknown, f"{file}: the package has no such function"
        stated = {name for name in names if name in definitions()}
        stated |= {f"{name}.{word}" for name in names for word in own if f"{name}.{word}" in definitions()}
        if names:
            found[file] = stated
    return found


def imports_of(tree, folder):
    """Return the modules of a folder that a module imports."""
    names = set()
    for node in walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in names if name.startswith(folder)}


def test_every_kernel_has_an_oracle_or_a_reason():
    found = kernels()
    assert len(found) > 60
    reached = reached_from(name for names in compared().values() for name in names)
    without = {name for name in found - reached if name.rpartition(".")[0] not in NONE}
    assert not without, "write its oracle in tests/reference, and compare the two"


def test_every_oracle_is_an_oracle_of_something():
    empty = {file for file, names in compared().items() if not reached_from(names) & kernels()}
    assert not empty, "nothing that it names is a kernel or calls one"


def test_a_test_imports_every_oracle():
    trees = {dotted(name): tree for name, tree in parse("tests").items()}
    imported = {name: imports_of(tree, "tests.reference") for name, tree in trees.items()}
    asked = set().union(*(names for name, names in imported.items() if ".test_" in name))
    while more := set().union(*(imported.get(name, set()) for name in asked)) - asked:
        asked |= more
    assert not {dotted(file) for file in compared()} - asked


def test_the_list_of_kernels_without_an_oracle_is_up_to_date():
    reached = reached_from(name for names in compared().values() for name in names)
    needed = {name.rpartition(".")[0] for name in kernels() - reached}
    assert needed == set(NONE)
