"""Renders the scenes with mitransient: ``python -m tests.peers.render`` in an environment that has the group `peers`.

With a path, the renderings are written there. Names of scenes behind it render only those; the others are kept.

mitransient (Royo, Crespo, Garcia-Tejedor, Marco, Gutierrez) is a transient path tracer on Mitsuba 3: a histogram of
radiance over optical path length for each pixel. It needs LLVM: 19 works (Debian: libllvm19), 16 and older abort;
DRJIT_LIBLLVM_PATH names the library where it is not found. What was rendered is kept beside this file, so that every run of
the tests compares with it. The projector's beam is even over the tangent plane: its irradiance 1/pi is a beam of one unit
per unit of that area.
"""

import importlib.metadata
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.peers.scenes_for_tests import SCENES, Scene

KEPT = Path(__file__).with_name("mitransient.npz")
NEAR_M = 0.01  # the renderer counts a path from the near plane, not from the lens
DEEPEST = 6  # bounces, which the renderer calls paths of depth 7
SEEDS = (1, 2)  # rendered twice: how much the two differ is the renderer's noise


def rendered(scene: Scene, seed: int, bounces: int | None = None) -> np.ndarray:
    """Return the radiance (row, col, bin), float32, of a beam of one unit per unit area of the tangent plane.

    `bounces` are those of the scene, or fewer.
    """
    import mitsuba as mi

    mi.set_variant("llvm_ad_mono")
    import mitransient  # noqa: F401  # registers its plugins

    start_m, bins = scene.path_m
    # Mitsuba looks along +z with +x to the left and +y up: half a turn about z from the lidar's axes.
    # The target stands at the origin, so that its rays begin close to it: Mitsuba lifts them by 1e-4 of their coordinates.
    lens = mi.ScalarTransform4f().look_at(origin=[0, 0, -scene.distance_m], target=[0, 0, 0], up=[0, -1, 0])
    properties = mi.Properties()
    grey = {"type": "uniform", "value": scene.reflectance}
    properties["bsdf"] = mi.load_dict({"type": "twosided", "side": {"type": "diffuse", "reflectance": grey}})
    properties["face_normals"] = True
    corners = scene.triangles.reshape(-1, 3)
    mesh = mi.Mesh("target", len(corners), len(scene.triangles), props=properties)
    shape = mi.traverse(mesh)
    shape["vertex_positions"] = corners.ravel().astype(np.float32)
    shape["faces"] = np.arange(len(corners), dtype=np.uint32)
    shape.update()
    film = {
        "type": "transient_hdr_film",
        "width": scene.n,
        "height": scene.n,
        "start_opl": start_m - NEAR_M,
        "bin_width_opl": scene.bin_m,
        "temporal_bins": bins,
        "rfilter": {"type": "box"},
    }
    sensor = {
        "type": "perspective",
        "fov": scene.fov_deg,
        "fov_axis": "x",
        "to_world": lens,
        "near_clip": NEAR_M,
        "far_clip": 2.0 * scene.distance_m,
        "film": film,
        "sampler": {"type": "multijitter", "sample_count": scene.samples**2},
    }
    beam = {"type": "uniform", "value": 1.0 / math.pi}
    laser = {"type": "projector", "fov": scene.divergence_deg, "to_world": lens, "irradiance": beam}
    integrator = {
        "type": "transient_path",
        "max_depth": (bounces or scene.bounces) + 1,
    }  # from the laser to so many facets to the lens
    world = mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, "laser": laser, "target": mesh})
    _, histogram = mi.render(world, seed=seed)
    return np.array(histogram)[..., 0]


def main(path: Path, keys: list[str]) -> None:
    """Render scenes, twice each, and write them with what made them and with the other scenes of the kept file."""
    kept: dict[str, np.ndarray] = {}
    if keys:
        with np.load(KEPT) as others:
            kept |= {name: others[name] for name in others.files if name != "made_by"}
    for key in keys or SCENES:
        scene = SCENES[key]()
        kept |= {f"{key}_{seed}": rendered(scene, seed) for seed in SEEDS} | {f"{key}_check": scene.check}
        if scene.bounces > 1:  # the light of the first bounce alone, without its delay, seed by seed
            kept[f"{key}_first"] = np.stack([rendered(scene, seed, 1).sum(axis=2) for seed in SEEDS])
            deep = replace(scene, bounces=DEEPEST)
            kept[f"{key}_deep"] = np.stack([rendered(deep, seed).sum(axis=2) for seed in SEEDS])
    versions = [f"{name} {importlib.metadata.version(name)}" for name in ("mitransient", "mitsuba", "drjit")]
    np.savez_compressed(path, made_by=np.array(versions), **kept)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else KEPT, sys.argv[2:])
