"""The Python files of the project, parsed once for all rules that read them."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@cache
def parse(*folders: str) -> dict[str, ast.Module]:
    """Return the syntax trees of the Python files in folders of the project, by path from its root."""
    return {
        file.relative_to(ROOT).as_posix(): _tree(file)
        for folder in folders
        for file in sorted((ROOT / folder).rglob("*.py"))
    }


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))
