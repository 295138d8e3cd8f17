"""No module needs itself through others: not when it is imported, not in a function, not for its types alone."""

import ast
from pathlib import Path

from tests.house.sources import parse, walk


def dotted(name):
    """Return the name under which a file of the package is imported."""
    words = Path(name).with_suffix("").parts
    return ".".join(words[:-1] if words[-1] == "__init__" else words)


def graph_of(trees):
    """Return, for each module, the modules that it names in an import anywhere in its source."""
    graph = {}
    for module, tree in trees.items():
        named = set()
        for node in walk(tree):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                inner = {alias.name: f"{node.module}.{alias.name}" for alias in node.names}
                named |= {name if name in trees else node.module for name in inner.values()}
        graph[module] = sorted(named & set(trees))
    return graph


def circles(graph):
    """Return the circles of a graph, by Tarjan's strongly connected components."""
    number, low, path, found = {}, {}, [], []

    def visit(node):
        number[node] = low[node] = len(number)
        path.append(node)
        for needed in graph[node]:
            if needed not in number:
                visit(needed)
                low[node] = min(low[node], low[needed])
            elif needed in path:
                low[node] = min(low[node], number[needed])
        if low[node] == number[node]:
            component = path[path.index(node) :]
            del path[path.index(node) :]
            if len(component) > 1 or node in graph[node]:
                found.append(sorted(component))

    for node in graph:
        if node not in number:
            visit(node)
    return found


def test_no_module_needs_itself():
    graph = graph_of({dotted(name): tree for name, tree in parse("rso_lidar").items()})
    assert sum(map(len, graph.values())) > 1000
    assert not circles(graph), "move what both need down, or what needs both up"


def parsed(sources):
    return {module: ast.parse(source) for module, source in sources.items()}


def test_a_circle_is_seen_wherever_its_imports_stand():
    hidden = {
        "a": "from b import x",
        "b": "def f():\n    import c",
        "c": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from a import y",
        "d": "import a",
    }
    assert circles(graph_of(parsed(hidden))) == [["a", "b", "c"]]
    assert circles(graph_of(parsed({"a": "import a"}))) == [["a"]]
    assert circles(graph_of(parsed(hidden | {"c": ""}))) == []


def test_a_module_named_through_its_room_is_found():
    room = {"r": "from r.a import x", "r.a": "", "r.b": "from r import a", "r.c": "from r import x"}
    assert graph_of(parsed(room)) == {"r": ["r.a"], "r.a": [], "r.b": ["r.a"], "r.c": ["r"]}
