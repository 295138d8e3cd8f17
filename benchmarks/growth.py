"""How cost grows: with facets, rays per pixel, pixels, targets and frames; a table and a figure, each with its exponents."""

import os
import resource
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import fresh, seconds
from benchmarks.report import Findings, table
from benchmarks.stages import ROWS, flash_s, medians, warm
from rso_lidar.picture import DARK, LIGHT, figures, palette
from rso_lidar.picture.style.output import save_small_figure

FIGURE = "growth.png"
FACETS = (3_000, 12_000, 47_000, 187_000, 500_000)
RAYS_PER_PIXEL = (1, 4, 9, 16, 25, 36, 64)
SIDES = (64, 128, 256, 512)
TARGETS = (1, 2, 5, 10, 20, 50)
FRAMES = 4_000
LEAST_SHARE = 0.05  # of a flash: a smaller stage says nothing of its growth


@dataclass(frozen=True)
class Axis:
    """The cost along one axis: `size` against seconds, or megabytes, with the stages where there are any."""

    name: str
    size: np.ndarray
    cost: np.ndarray
    unit: str
    note: str
    stages: Sequence[dict[str, float]] = ()

    @property
    def exponent(self) -> float:
        """Return the slope of the cost over the size, both logarithmic, by least squares over all points."""
        return float(np.polyfit(np.log(self.size), np.log(self.cost), 1)[0])

    @property
    def at_the_end(self) -> float:
        """Return that slope between the last two points, where fixed costs matter least."""
        return _slope(self.size, self.cost)

    @property
    def steepest(self) -> str:
        """Return the stage that grows fastest between the last two points, of those that matter there."""
        if not self.stages:
            return ""
        last = self.stages[-1]
        whole = flash_s(last)
        slopes = {
            stage: _slope(self.size, np.array([spans[stage] for spans in self.stages]))
            for stage in ROWS
            if stage != "write" and last[stage] > LEAST_SHARE * whole
        }
        stage = max(slopes, key=lambda name: slopes[name])
        return f"{stage} {slopes[stage]:.2f}"


def _slope(size: np.ndarray, cost: np.ndarray) -> float:
    return float(np.log(cost[-1] / cost[-2]) / np.log(size[-1] / size[-2]))


def measured(name: str, note: str, sizes: Sequence[int], make: Callable[[int], rl.Scenario], budget_s: float) -> Axis:
    """Return the cost of a flash, on one thread, for the scenarios that `make` makes of each size."""
    stages = []
    for size in sizes:
        print(f"growth: {name}, {size:,}", file=sys.stderr)
        scenario = make(size)
        spent = seconds(lambda: next(rl.simulate(scenario, frames=[0])))
        repeats = int(np.clip(budget_s / spent, 3, 25))
        spans, _ = warm(scenario, repeats, {"one": 1})
        stages.append(medians(spans["one"]))
    return Axis(name, np.array(sizes), np.array([flash_s(spans) * 1e3 for spans in stages]), "ms a flash", note, stages)


def subdivided(folder: Path) -> Callable[[int], rl.Scenario]:
    """Return what makes a scenario of one craft whose facets are cut finer, to about a number; its shape stays."""
    import trimesh

    name = "tdrs_gen1" if scenes.has("tdrs_gen1") else "cubesat_3u"
    model = scenes.single(name, 1.0).surfaces[0]
    meshes = [trimesh.Trimesh(model.vertices, model.facets, process=False)]

    def make(wanted: int) -> rl.Scenario:
        mesh = meshes[-1]
        while len(mesh.faces) < 0.9 * wanted:
            few = min(len(mesh.faces), (wanted - len(mesh.faces)) // 3)  # each becomes four
            mesh = mesh.subdivide(face_index=np.linspace(0, len(mesh.faces) - 1, few).astype(int))
        meshes.append(mesh)
        file = folder / f"{wanted}.stl"
        mesh.export(file)
        return scenes.single(str(file), 300.0)

    return make


def resident_mb() -> float:
    """Return the memory this process holds now [MB]."""
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def resident(frames: int) -> tuple[list[int], list[float]]:
    """Return frame numbers and the memory [MB] held as they come, of a walk over so many frames."""
    wanted = sorted({int(k) for k in np.geomspace(min(100, frames), frames, 7)})
    held = []
    for made, _ in enumerate(rl.simulate(scenes.single("tdrs", 3000.0, frames), threads=2), start=1):
        if made in wanted:
            held.append(resident_mb())
    return wanted, held


def axes(frames: int, budget_s: float) -> list[Axis]:
    """Return the five axes of growth."""
    small = "lro" if scenes.has("lro") else "cubesat_3u"
    with tempfile.TemporaryDirectory() as folder:
        found = [
            measured("facets", "one craft at 300 m, cut finer", FACETS, subdivided(Path(folder)), budget_s),
            measured(
                "rays per pixel",
                "TDRS at 300 m",
                RAYS_PER_PIXEL,
                lambda n: scenes.single("tdrs", 300.0, lidar=scenes.instrument(rays_per_pixel=n)),
                budget_s,
            ),
            measured(
                "pixels",
                "TDRS at 300 m, 16 rays per pixel",
                [side * side for side in SIDES],
                lambda n: scenes.single("tdrs", 300.0, lidar=scenes.instrument(side=round(n**0.5))),
                budget_s,
            ),
            measured(
                "targets",
                "a grid of equal craft at 3 km",
                TARGETS,
                lambda n: scenes.fleet(small, n, columns=8, spacing_m=16.0),
                budget_s,
            ),
        ]
    print(f"growth: memory over {frames:,} frames", file=sys.stderr)
    made, held = fresh(resident, frames)
    found.append(Axis("frames", np.array(made), np.array(held), "MB resident", "TDRS at 3 km, two threads"))
    return found


def drawn(found: Sequence[Axis]) -> Any:
    """Return the figure: one panel for each axis, both scales logarithmic, with a line that grows in proportion."""
    figure = figures.new_figure(
        11.0, 6.4, "How cost grows", "one flash on one thread, all stages but the file; last: memory of the whole walk"
    )
    panels = figure.subplots(2, 3).ravel()
    panels[-1].set_axis_off()
    for panel, axis, colour in zip(panels, found, palette.LINES, strict=False):
        panel.loglog(axis.size, axis.cost, "o-", color=colour, ms=4, lw=figures.THICK_PT)
        panel.loglog(axis.size, axis.cost[-1] * axis.size / axis.size[-1], ":", color=palette.RULE, lw=figures.LINE_PT)
        decades = np.floor(np.log10(axis.cost.min())), np.ceil(np.log10(axis.cost.max()))
        panel.set_ylim(*np.power(10.0, decades))
        figures.style_axes(
            panel, axis.name, axis.note, axis.unit, f"exponent {axis.exponent:.2f}, end {axis.at_the_end:.2f}"
        )
        figures.format_thousands(panel.xaxis, panel.yaxis)
        panel.minorticks_off()
    return figure


def run(*, quick: bool, frames: int | None = None, pictures: Path | None = None) -> Findings:
    """Return the tables of growth; the figure is drawn where a folder for pictures is given."""
    found = axes(frames or (1_000 if quick else FRAMES), 0.5 if quick else 2.0)
    rows = [
        (
            axis.name,
            axis.note,
            " · ".join(f"{size:,}" for size in axis.size),
            " · ".join(f"{cost:.3g}" for cost in axis.cost),
            axis.unit,
            f"{axis.exponent:.2f}",
            f"{axis.at_the_end:.2f}",
            axis.steepest,
        )
        for axis in found
    ]
    header = ("axis", "scene", "sizes", "cost", "unit", "exponent", "at the end", "steepest stage at the end")
    if pictures is not None:
        figure = drawn(found)
        for scheme, ending in ((LIGHT, ""), (DARK, "_dark")):
            save_small_figure(figure, pictures / f"growth{ending}.png", scheme)
    return Findings({"growth": table(header, rows, left=5)})
