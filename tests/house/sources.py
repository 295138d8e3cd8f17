"""The Python files of the project, parsed once for all rules that read them."""

import ast
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@cache
def parse(*folders: str) -> dict[str, ast.Module]:
    """Return the syntax trees of the Python files in folders of the project, by path from its root."""
    with without_garbage_collection():
        return {
            file.relative_to(ROOT).as_posix(): _tree(file)
            for folder in folders
            for file in sorted((ROOT / folder).rglob("*.py"))
        }


@contextmanager
def without_garbage_collection() -> Iterator[None]:
    """Keep the garbage collector from searching millions of nodes, while they are made and for the rest of the session.

    One full collection would take 2 s, and tests that ask for one later in the session, such as NiceGUI's, ask for dozens.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@cache
def walk(tree: ast.AST) -> tuple[ast.AST, ...]:
    """Return all nodes of a module's tree. Many rules read the same one, and finding its nodes takes longest."""
    return tuple(ast.walk(tree))


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))
