"""Build every shape in a process of its own, with its numbers moved a little: `python -m tests.models.moved_builders`.

Moved are every float that stands in the builders' sources (in proportion) and every place, direction, angle and profile
that they hand to `solids` and `primitives`, zeros too (as it is). Whatever is chosen by a tie then falls to either side.
"""

import ast
import hashlib
import json
import sys
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader

import numpy as np

from tests.processor import dispatched

PLACES = ("rso_lidar.shapes", "models.build")  # where what builds shapes stands


def moved(values, chance, by: float):
    """Return numbers, each moved by up to `by`."""
    values = np.asarray(values, dtype=float)
    return values + by * chance.uniform(-1.0, 1.0, values.shape)


class Moving(ast.NodeTransformer):
    """Moves the floats of a source in proportion."""

    def __init__(self, chance, by: float) -> None:
        self.chance, self.by, self.floats, self.calls = chance, by, 0, 0

    def visit_Constant(self, node):
        if not isinstance(node.value, float):
            return node
        self.floats += 1
        return ast.copy_location(ast.Constant(node.value * (1.0 + float(moved(0.0, self.chance, self.by)))), node)


class Sources:
    """Finds the builders' modules, and loads them with their floats moved."""

    def __init__(self, moving: Moving) -> None:
        self.moving = moving

    def find_spec(self, name, path, target=None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name.startswith(PLACES) else None
        if spec is not None:
            moving = self.moving

            class Loader(SourceFileLoader):
                def get_code(self, name):
                    file = self.get_filename(name)
                    tree = ast.fix_missing_locations(moving.visit(ast.parse(self.get_data(file))))
                    return compile(tree, file, "exec", dont_inherit=True)

            spec.loader = Loader(name, spec.origin)
        return spec


def move(seed: int, by: float) -> Moving:
    """Have the builders' numbers moved from here on, in this process."""
    assert not [name for name in sys.modules if name.startswith(PLACES)], "they are imported already"
    chance = np.random.default_rng(seed)
    moving = Moving(chance, by)
    sys.meta_path.insert(0, Sources(moving))
    from rso_lidar.shapes import solids

    def shaken(function, *places):
        def call(*given, **named):
            moving.calls += 1
            given = list(given)
            for place in places:
                if place < len(given):
                    given[place] = moved(list(given[place]) if np.iterable(given[place]) else given[place], chance, by)
            return function(*given, **named)

        return call

    solids.pipe, solids.skin = shaken(solids.pipe, 0), shaken(solids.skin, 0)
    solids.Solid.facing = shaken(solids.Solid.facing, 1)
    solids.Solid.turn = shaken(solids.Solid.turn, 2)
    solids.Solid.move = shaken(solids.Solid.move, 1, 2, 3)
    from models.build import primitives  # only now: it takes `pipe` as it finds it

    primitives.revolve = shaken(primitives.revolve, 0)
    primitives.prism = shaken(primitives.prism, 0, 1, 2)
    return moving


def shapes() -> dict[str, np.ndarray]:
    """Return vertices and facets of all that a builder makes, by name: craft, fragments of seeds, ground with boulders."""
    from models.build.build import build, builders
    from rso_lidar.shapes import Abundance, build_ground, fragment

    solids = {f"{name}/{part}": solid for name in builders() for part, solid in build(name).parts.items()}
    for kind in ("plate", "shard", "panel", "foil"):
        for seed in (0, 1):
            parts = fragment(seed, 0.5, kind).parts
            solids |= {f"fragment {kind} {seed}/{part}": solid for part, solid in parts.items()}
    ground = build_ground(1, 20.0, 0.5, Abundance(1.0, 5.0, 0.3), Abundance(0.3, 2.0, 0.05))
    solids["ground/boulders"] = ground.boulders
    arrays = {"ground/heights": ground.heights_m}
    for name, solid in solids.items():
        arrays[f"{name}/vertices"], arrays[f"{name}/facets"] = solid
    return arrays


def main(seed: int, by: float, place: str) -> None:
    """Write the shapes, and print what was moved, what NumPy used, and the SHA-256 of the files that they would make."""
    moving = move(seed, by) if by else None
    np.savez(place, **shapes())
    report = {"dispatched": dispatched()}
    if moving:
        report |= {"floats": moving.floats, "calls": moving.calls}
    else:
        from models.build.build import build, builders
        from rso_lidar.shapes import glb

        report["sha256"] = {name: hashlib.sha256(glb(build(name))).hexdigest() for name in builders()}
    print(json.dumps(report))


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3])
