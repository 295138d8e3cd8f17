"""Colours, sizes of text, widths of lines and resolutions of pictures stand in rso_lidar/picture/style and nowhere else."""

import ast
import re

from tests.house.sources import ROOT

STYLE = ROOT / "rso_lidar" / "picture" / "style"
# Pages that a reader downloads write plain matplotlib.
OUTSIDE = tuple(ROOT / "docs" / name for name in ("gallery", "tutorial", "auto_gallery", "auto_tutorial"))
PLACES = ("rso_lidar", "docs", "benchmarks", "examples")
# Arguments of matplotlib and Pillow that the style decides.
STYLED = {
    "c", "color", "colors", "facecolor", "facecolors", "fc", "edgecolor", "edgecolors", "ec", "mfc", "mec", "labelcolor",
    "fill", "outline", "cmap", "fontsize", "labelsize", "dpi", "lw", "linewidth", "linewidths",
}  # fmt: skip
FREE = ("none", "face", None, 0, True, False)
COLOUR = re.compile(r"#[0-9a-fA-F]{6}")


def find_literals(text):
    """Return line and words of each literal colour, size or width of a program that draws."""
    if "matplotlib" not in text and "picture" not in text:
        return []
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            given = [(word.arg, word.value.value) for word in node.keywords if isinstance(word.value, ast.Constant)]
            found += [
                (node.lineno, f"{name}={value!r}") for name, value in given if name in STYLED and value not in FREE
            ]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and COLOUR.fullmatch(node.value):
            found.append((node.lineno, node.value))
        elif isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute | ast.Name):
            name = node.value.attr if isinstance(node.value, ast.Attribute) else node.value.id
            if name == "colormaps" and isinstance(node.slice, ast.Constant):
                found.append((node.lineno, f"colormaps[{node.slice.value!r}]"))
    return found


def test_literals_are_found():
    """Each way of writing a colour or a size past the style is noticed, and what is free is not."""
    head = "import matplotlib\n"
    for line in (
        'f(color="red")',
        "f(fontsize=8)",
        "f(lw=1.5)",
        'f(cmap="jet")',
        'a = "#ff0000"',
        'colormaps["jet"]',
        "f(dpi=90)",
    ):
        assert find_literals(head + line), line
    for line in ("f(color=INK)", 'f(fc="none")', "f(lw=0)", 'f(label="red")', "f(lw=LINE_PT)"):
        assert not find_literals(head + line), line


def test_the_style_is_stated_in_one_place():
    files = [file for place in PLACES for file in sorted((ROOT / place).rglob("*.py"))]
    files = [file for file in files if not {STYLE, *OUTSIDE} & {file, *file.parents}]
    assert len(files) > 100
    bad = [
        f"{file.relative_to(ROOT)}:{line}: {words}: take it from rso_lidar.picture.style"
        for file in files
        for line, words in find_literals(file.read_text(encoding="utf-8"))
    ]
    assert not bad, "\n".join(bad)
