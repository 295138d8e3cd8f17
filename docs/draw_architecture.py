"""Draw the picture of the package from its imports: ``python docs/draw_architecture.py`` (`make figures`).

Rooms and floors come from the import contract in pyproject.toml, arrows from the imports of all modules. What the rooms
stand on (records, parts, files, units and the like) is one slab, because nearly every room uses it. An arrow is left out
where other arrows already lead from the one room to the other. A PNG states in its metadata what it was drawn from, and a
test compares that with the imports of today.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import textwrap
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

from rso_lidar.picture import DARK, LIGHT, Scheme, figures, palette
from rso_lidar.picture.style.output import save_small_figure

ROOT = Path(__file__).resolve().parents[1]
PICTURES = {"architecture": LIGHT, "architecture_dark": DARK}  # schemes by name
WALK = (
    "scenario",
    "motion",
    "optics",
    "scene",
    "optics",
    "detector",
    "export",
)  # the way of the light, as docs/architecture.md says
BROAD, BROADEST = 5, 20  # imports from which an arrow is broader
SLAB_TOP = "records"  # the highest floor of the slab
COLUMNS = {  # where each room stands on its floor, so that few arrows cross
    "cli": 3.5, "studio": 4.6, "loop": 2.4, "dataset": 4.6, "study": 6.0, "evaluation": 6.0, "mission_analysis": 5.2,
    "simulation": 2.0, "scenario": 2.0, "track": 0.3, "imaging": 3.0, "sampling": 1.7, "sensors": 0.3, "motion": 0.0,
    "optics": 1.0, "scene": 2.0, "detector": 3.0, "shapes": 4.0, "export": 5.0, "picture": 6.0, "rpo": 0.0, "fmi": 1.2,
    "orbit": 0.0,
}  # fmt: skip
WIDTH_IN, ROW_IN, BOX_IN = 13.6, 1.16, 0.76  # of the picture, from floor to floor, and height of a box
PITCH_IN = (WIDTH_IN - 0.4) / 7.0  # from column to column


def list_floors() -> list[list[str]]:
    """Return the rooms and modules on each floor, top first, as the import contract states them."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    (floors,) = (contract["layers"] for contract in contracts if contract["id"] == "floors")
    named = [[name for name in floor.split(" | ") if not name.startswith("(")] for floor in floors]
    return [floor for floor in named if floor != ["__main__"]]


def count_imports() -> Counter[tuple[str, str]]:
    """Return the number of imports from each room of each other, by the two names."""
    import grimp

    graph = grimp.build_graph("rso_lidar", cache_dir=None)
    found: Counter[tuple[str, str]] = Counter()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            pair = tuple(name.split(".")[1] if "." in name else "" for name in (module, imported))
            if all(pair) and pair[0] != pair[1]:
                found[pair[0], pair[1]] += 1
    return found


def find_arrows(imports: Counter[tuple[str, str]], rooms: set[str]) -> dict[tuple[str, str], int]:
    """Return the arrows to draw between rooms: their breadth, 1 to 3, by the two names.

    Parameters
    ----------
    imports : as `count_imports` returns them.
    rooms : that are drawn as boxes.
    """
    below: dict[str, set[str]] = {room: {b for a, b in imports if a == room and b in rooms} for room in rooms}

    def reach(room: str) -> set[str]:
        return below[room].union(*map(reach, below[room]))

    return {
        (a, b): 1 + (count >= BROAD) + (count >= BROADEST)
        for (a, b), count in sorted(imports.items())
        if {a, b} <= rooms and not any(b in reach(other) for other in below[a] - {b})
    }


def describe_graph() -> dict[str, Any]:
    """Return what the picture shows: floors with their rooms, the slab, and arrows with their breadth."""
    floors = list_floors()
    cut = next(k for k, floor in enumerate(floors) if SLAB_TOP in floor)
    rooms = {room for floor in floors[:cut] for room in floor}
    arrows = find_arrows(count_imports(), rooms)
    ideas = {room: read_idea(room) for room in sorted(rooms)}
    return {
        "floors": floors[:cut],
        "slab": floors[cut:],
        "ideas": ideas,
        "arrows": [[*a, n] for a, n in arrows.items()],
    }


def digest_graph(graph: dict[str, Any]) -> str:
    """Return a digest of what the picture shows."""
    return hashlib.sha256(json.dumps(graph, sort_keys=True).encode()).hexdigest()[:16]


def read_idea(room: str) -> str:
    """Return the first words of a room's docstring, up to a colon or semicolon."""
    place = ROOT / "rso_lidar" / room
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    first = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]
    first, _, more = re.split("; |[.]$", first.replace("`", ""))[0].partition(": ")
    idea = more.partition(": ")[0].capitalize() if first.lower() == f"the {room}" else first
    return textwrap.shorten(idea, 72, placeholder=" ...")


def draw(graph: dict[str, Any], path: Path, scheme: Scheme) -> None:
    """Draw the picture and write it as PNG.

    Parameters
    ----------
    graph : as `describe_graph` returns it.
    path : of the PNG.
    scheme : `LIGHT` or `DARK`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

    floors = graph["floors"]
    foot_in, head_in = 1.75, 0.75
    height_in = head_in + foot_in + ROW_IN * len(floors)
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=figures.SCREEN_DPI, facecolor=palette.PAPER)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, WIDTH_IN), ylim=(0.0, height_in))
    axes.axis("off")

    def write(
        x: float, y: float, text: str, size: float = figures.SMALL_PT, colour: str = palette.INK, **more: Any
    ) -> None:
        axes.text(x, y, text, fontsize=size, color=colour, **{"ha": "center", "va": "center", **more})

    def box(x: float, y: float, width: float, height: float, edge: str, line: float) -> None:
        style = "round,pad=0,rounding_size=0.06"
        axes.add_patch(FancyBboxPatch((x, y), width, height, style, fc=palette.SHADE, ec=edge, lw=line, zorder=3))

    places, breadth_in = place_rooms(floors), PITCH_IN - 0.16
    for room, (x, floor) in places.items():
        y = foot_in + ROW_IN * (len(floors) - 1 - floor)
        step = ", ".join(str(k) for k, name in enumerate(WALK, 1) if name == room)
        box(
            x - breadth_in / 2,
            y,
            breadth_in,
            BOX_IN,
            palette.BLUE if step else palette.RULE,
            figures.THICK_PT if step else figures.THIN_PT,
        )
        write(
            x,
            y + BOX_IN - 0.14,
            f"{step}  {room}" if step else room,
            figures.HEADING_PT,
            palette.INK,
            weight="bold",
            zorder=4,
        )
        lines = textwrap.wrap(graph["ideas"][room], 26)[:3]
        write(x, y + (BOX_IN - 0.2) / 2, "\n".join(lines), figures.SMALL_PT, palette.QUIET, zorder=4, linespacing=1.15)
    ends = place_ends(places, graph["arrows"], breadth_in)
    for start, end, breadth in graph["arrows"]:
        (x0, x1) = ends[start, end]
        y0 = foot_in + ROW_IN * (len(floors) - 1 - places[start][1])
        y1 = foot_in + ROW_IN * (len(floors) - 1 - places[end][1]) + BOX_IN
        head = f"-|>,head_length={3 + breadth},head_width={1.5 + breadth / 2}"
        line = (figures.THIN_PT, figures.THICK_PT, figures.WIDE_PT)[breadth - 1]
        arrow = FancyArrowPatch((x0, y0), (x1, y1), arrowstyle=head, lw=line, shrinkA=0, shrinkB=0, zorder=1)
        arrow.set_color(palette.RULE)
        axes.add_patch(arrow)
    below = [name for floor in graph["slab"] for name in floor]
    box(0.2, 0.95, WIDTH_IN - 0.4, 0.55, palette.RULE, figures.THIN_PT)
    write(WIDTH_IN / 2, 1.34, "what every room stands on", figures.HEADING_PT, weight="bold", zorder=4)
    write(WIDTH_IN / 2, 1.1, ", ".join(below), figures.SMALL_PT, palette.QUIET, zorder=4)
    write(
        0.2, height_in - 0.25, "The rooms of rso_lidar, from their imports", figures.TITLE_PT, ha="left", weight="bold"
    )
    write(
        0.2, height_in - 0.52,
        "A room imports only from rooms below it. Blue, 1 to 7: the way of the light from the scenario to the file.",
        figures.TEXT_PT, palette.QUIET, ha="left",
    )  # fmt: skip
    write(
        0.2, 0.55,
        f"An arrow points from a room to one that it imports: thin up to {BROAD - 1} imports between modules, broad from "
        f"{BROADEST}. An arrow is left out where others already lead\nthere, and so are all arrows to the slab. The order "
        "of floors is a contract in pyproject.toml, which a test checks.",
        figures.SMALL_PT, palette.QUIET, ha="left", linespacing=1.4,
    )  # fmt: skip
    save_small_figure(figure, path, scheme, {"Description": digest_graph(graph)})


def place_rooms(floors: list[list[str]]) -> dict[str, tuple[float, int]]:
    """Return the place of each room: x [inches], and its floor counted from the top."""
    rooms = {room for floor in floors for room in floor}
    if rooms != set(COLUMNS):
        raise SystemExit(f"draw_architecture.py: COLUMNS must name the rooms; check {', '.join(rooms ^ set(COLUMNS))}")
    return {room: (0.2 + PITCH_IN * (COLUMNS[room] + 0.5), k) for k, floor in enumerate(floors) for room in floor}


def place_ends(
    places: dict[str, tuple[float, int]], arrows: list[list[Any]], breadth_in: float
) -> dict[tuple[str, str], tuple[float, float]]:
    """Return x [inches] where each arrow leaves its room and where it arrives; arrows of a side do not cross there."""
    ends: dict[tuple[str, str], list[float]] = {(a, b): [0.0, 0.0] for a, b, _ in arrows}
    for room, (x, _) in places.items():
        for side, other in ((0, 1), (1, 0)):
            mine = sorted((pair for pair in ends if pair[side] == room), key=lambda pair: places[pair[other]][0])
            for k, pair in enumerate(mine):
                ends[pair][side] = x + breadth_in * 0.8 * ((k + 1) / (len(mine) + 1) - 0.5)
    return {pair: (start, end) for pair, (start, end) in ends.items()}


def main() -> None:
    """Draw both pictures."""
    graph = describe_graph()
    for name, scheme in PICTURES.items():
        draw(graph, ROOT / "docs" / "pictures" / f"{name}.png", scheme)


if __name__ == "__main__":
    main()
