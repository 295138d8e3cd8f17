"""How well the shipped craft cover NASA's models of them: ``python -m benchmarks.silhouettes`` prints a table.

Both stand at true scale in the axes of our model, each in its own coordinates but for the turn and shift that `PLACES`
states. For each of some directions, spread evenly over the sphere by a seeded generator, parallel rays on a square grid
tell which cells either craft covers; the figure is the cells that both cover over the cells that one covers at least
(intersection over union), averaged over the views, and the worst view beside it.

By part: NASA's meshes name no parts. Each facet, cut until no edge is longer than 0.15 m, belongs to the group (panels;
booms and antennas; body) of the nearest point of our model, wherever that lies: there is no tolerance that would drop a
part which stands elsewhere. Each group then stands alone before the rays, hidden by nothing.
"""

import argparse
import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import scenes
from benchmarks.report import Findings, table, write
from rso_lidar.scene import Mesh, load_mesh, models

SEED = 7
CELLS = 400  # along the longest side of a craft: 5 cm for 20 m
EDGE_M = 0.15
LOADS = 5

WHOLE, PANELS, BOOMS, BODY = "whole", "panels", "booms and antennas", "body"
GROUPS = (PANELS, BOOMS, BODY)
OF_PART = {
    PANELS: ("solar_array", "solar_substrate", "solar_yoke", "solar_struts"),
    BOOMS: ("antenna", "boom", "feed", "magnetometer", "gimbal"),
}
WANTED = {WHOLE: 0.70, PANELS: 0.50, BOOMS: 0.50}


@dataclass(frozen=True)
class Place:
    """How NASA's mesh comes to our axes.

    `axes` names the mesh's axis along our x, y and z; `origin_m` is where our origin lies in the mesh's coordinates [m],
    None to put the middles of the two bounding boxes together; `why` says by which feature.
    """

    axes: tuple[str, str, str] = ("+x", "+y", "+z")
    origin_m: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
    why: str = "drawn in the mesh's own axes about its origin"

    def move(self, vertices: np.ndarray, ours: np.ndarray) -> np.ndarray:
        """Return vertices of the mesh in our axes (n, 3) [m]."""
        turn = np.array([np.eye(3)["xyz".index(axis[1])] * (-1.0 if axis[0] == "-" else 1.0) for axis in self.axes])
        if not np.isclose(np.linalg.det(turn), 1.0):
            raise ValueError(f"axes {self.axes}: a mirror, not a turn: change a sign")
        there: np.ndarray = (vertices - (self.origin_m or (0.0, 0.0, 0.0))) @ turn.T
        if self.origin_m is None:
            there += 0.5 * (ours.min(axis=0) + ours.max(axis=0) - there.min(axis=0) - there.max(axis=0))
        return there


# Every craft that NASA's meshes show and the shipped models hold, by the name of both.
PLACES = {
    "dawn": Place(axes=("-y", "+x", "+z"), why="the mesh's origin, its axes turned to those of the mission"),
    "juno": Place(),
    "lro": Place(),
    "rosetta": Place(axes=("+z", "+x", "+y"), why="the mesh's origin, its axes turned to those of the mission"),
    "stardust": Place(axes=("-y", "+x", "+z"), why="the mesh's origin, +x turned to the flight past the comet"),
    "suomi_npp": Place(),
    "tdrs": Place(),
}


def views(number: int) -> np.ndarray:
    """Return unit vectors (view, xyz), spread evenly over the sphere by the seed."""
    drawn = np.random.default_rng(SEED).standard_normal((number, 3))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))


def overlap(ours: np.ndarray, theirs: np.ndarray, directions: np.ndarray, cells: int = CELLS) -> np.ndarray:
    """Return intersection over union (view) of the silhouettes of two sets of triangles (facet, corner, xyz) [m]."""
    from scipy.spatial import ConvexHull

    both = np.concatenate([ours, theirs]).reshape(-1, 3)
    both = both[ConvexHull(both).vertices]  # all that the grid must reach over
    step_m = float(np.ptp(both, axis=0).max()) / cells
    distance_m = 2.0 * float(np.linalg.norm(both, axis=1).max())
    casts = [_caster(triangles) for triangles in (ours, theirs)]
    shares = []
    for direction in directions:
        right = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        right /= np.linalg.norm(right)
        up = np.cross(direction, right)
        seen = both @ np.stack([right, up]).T
        low, high = seen.min(axis=0), seen.max(axis=0)
        x, y = (np.arange(low[k], high[k], step_m) + 0.5 * step_m for k in (0, 1))
        start = x[:, None, None] * right + y[None, :, None] * up - distance_m * direction
        covered = [cast(start.reshape(-1, 3), direction) for cast in casts]
        either = np.count_nonzero(covered[0] | covered[1])
        shares.append(np.count_nonzero(covered[0] & covered[1]) / max(either, 1))
    return np.array(shares)


def _caster(triangles: np.ndarray) -> Any:
    """Return a function of ray starts and one direction that tells which rays hit."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(triangles, dtype=np.float32))

    def hits(start: np.ndarray, direction: np.ndarray) -> np.ndarray:
        along = np.tile(direction.astype(np.float32), (len(start), 1))
        return np.asarray(scene.run(start.astype(np.float32), along, query="INTERSECT") >= 0)

    return hits


def group_of(part: str) -> str:
    """Return the group that a part belongs to by its name."""
    return next((group for group, names in OF_PART.items() if part.startswith(names)), BODY)


def grouped(mesh: Mesh, theirs: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return our triangles and theirs (facet, corner, xyz) [m] by group; theirs by the nearest point of ours."""
    from scipy.spatial import cKDTree

    ours = mesh.vertices[mesh.facets]
    group = np.array([GROUPS.index(group_of(mesh.part_names[part])) for part in mesh.part])
    points, of_point = _scattered(ours, group)
    pieces = _cut(theirs)
    _, nearest = cKDTree(points).query(pieces.mean(axis=1))
    belongs = of_point[nearest]
    return {name: (ours[group == k], pieces[belongs == k]) for k, name in enumerate(GROUPS)}


def _cut(triangles: np.ndarray) -> np.ndarray:
    """Return the triangles cut across their longest edges until none is longer than `EDGE_M`."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        long = edges.max(axis=1) > EDGE_M
        done.append(triangles[~long])
        first = np.argmax(edges[long], axis=1)[:, None]
        a, b, c = (np.take_along_axis(triangles[long], (first + k)[..., None] % 3, axis=1)[:, 0] for k in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)


def _scattered(triangles: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points on the triangles, closer than `EDGE_M`, and the group of each."""
    points, groups = [], []
    for k in range(len(GROUPS)):
        pieces = _cut(triangles[group == k])
        points.append(pieces.mean(axis=1))
        groups.append(np.full(len(pieces), k))
    return np.concatenate(points), np.concatenate(groups)


def load_ms(path: Path) -> float:
    """Return the CPU time that loading a model takes, the least of a few [ms]."""
    spent = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(LOADS):
            copy = Path(shutil.copy(path, Path(folder, f"{k}{path.suffix}")))  # a file that no cache knows
            start = time.thread_time()
            load_mesh(copy)
            spent.append(time.thread_time() - start)
    return 1e3 * min(spent)


def shares(name: str, number: int, cells: int = CELLS) -> dict[str, np.ndarray]:
    """Return intersection over union (view) of a craft and NASA's mesh of it: the whole, and each group of parts."""
    mesh = load_mesh(models()[name].path)
    nasa = load_mesh(scenes.NASA / f"{name}.stl")
    theirs = PLACES[name].move(nasa.vertices, mesh.vertices)[nasa.facets]
    pairs = {WHOLE: (mesh.vertices[mesh.facets], theirs), **grouped(mesh, theirs)}
    directions = views(number)
    return {
        group: overlap(mine, other, directions, cells) if len(mine) and len(other) else np.zeros(number)
        for group, (mine, other) in pairs.items()
    }


def row(name: str, number: int) -> tuple[str, ...]:
    """Return one line of the table."""
    entry = models()[name]
    seen = shares(name, number)
    means = [_told(float(seen[group].mean()), WANTED.get(group, 0.0)) for group in (WHOLE, *GROUPS)]
    worst = f"{100 * seen[WHOLE].min():.0f} %"
    nasa = len(load_mesh(scenes.NASA / f"{name}.stl").facets)
    sizes = f"{entry.facets:,}", f"{nasa:,}", f"{entry.size_bytes / 1e3:.0f}", f"{load_ms(entry.path):.0f}"
    return name, means[0], worst, *means[1:], *sizes


def _told(share: float, wanted: float) -> str:
    return f"{100 * share:.1f} %" if share >= wanted else f"**{100 * share:.1f} %**"


def run(names: Sequence[str], number: int) -> Findings:
    """Return the table for the craft of these names."""
    header = ("craft", WHOLE, "worst view", *GROUPS, "facets", "NASA's", "kB", "load, ms")
    note = f"Mean over {number} views, {CELLS} cells along the longest side; bold is below what was wanted."
    return Findings({"silhouettes": f"{table(header, [row(name, number) for name in names])}\n\n{note}"})


def main() -> None:
    """Measure what is asked for, and tell."""
    ready = [name for name in PLACES if name in models() and (scenes.NASA / f"{name}.stl").is_file()]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.silhouettes", description=__doc__.partition("\n")[0])
    parser.add_argument("--views", type=int, default=100, metavar="N", help="directions to look from (100 by default)")
    parser.add_argument("--only", nargs="+", choices=ready, default=ready, metavar="NAME", help="of these craft only")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the table between the markers of a page")
    if not ready:
        parser.exit(2, "benchmarks: no mesh of NASA's found: set RSO_LIDAR_SHARED to the folder that holds meshes/\n")
    chosen = parser.parse_args()
    found = run(chosen.only, chosen.views)
    print(found.blocks["silhouettes"])
    if chosen.write:
        write(chosen.write, "silhouettes", found)


if __name__ == "__main__":
    main()
