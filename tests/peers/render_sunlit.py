"""Renders scenes in sunlight with Mitsuba 3: ``python -m tests.peers.render_sunlit`` with the group `peers`.

The Sun is a directional light, or a disc whose radiance gives the same irradiance. What is kept beside this file is the
radiance of each pixel, of a Sun of irradiance 1, and the share of each pixel that targets cover. Scenes of NASA's meshes
need the folder that RSO_LIDAR_SHARED names; only their renderings are kept.
"""

import importlib.metadata
import math
import os
import sys
from pathlib import Path

import numpy as np

from tests.peers.scenes_for_tests import REFLECTANCE
from tests.peers.sunlit_for_tests import SUN_RADIUS_RAD, SunlitScene, load_scenes

KEPT = Path(__file__).with_name("sunlit.npz")
SUN_M = 1e5  # distance of the disc: far enough for parallel light, near enough for float32


def render(scene: SunlitScene) -> tuple[np.ndarray, np.ndarray]:
    """Return the radiance over the Sun's irradiance [1/sr], and the share that targets cover, of each pixel (row, col)."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    to_sun = scene.sun_direction
    # Mitsuba looks along +z with +x to the left and +y up: half a turn about z from the camera's axes.
    pose = mi.ScalarTransform4f().look_at(origin=[0, 0, -scene.distance_m], target=[0, 0, 0], up=[0, -1, 0])
    film = {
        "type": "hdrfilm",
        "width": scene.n,
        "height": scene.n,
        "pixel_format": "luminance_alpha",
        "rfilter": {"type": "box"},
    }
    sensor = {"type": "perspective", "fov": scene.fov_deg, "fov_axis": "x", "to_world": pose, "near_clip": 0.1}
    sensor |= {"far_clip": 1e4, "film": film, "sampler": {"type": "multijitter", "sample_count": scene.samples}}
    sun = {"type": "directional", "direction": (-to_sun).tolist(), "irradiance": {"type": "rgb", "value": 1.0}}
    if scene.is_disc:
        radius_m = SUN_M * math.tan(SUN_RADIUS_RAD)
        place = (SUN_M * to_sun).tolist()
        facing = mi.ScalarTransform4f().look_at(origin=place, target=[0, 0, 0], up=[0.0, 1.0, 0.0])
        radiance = 1.0 / (math.pi * math.sin(SUN_RADIUS_RAD) ** 2)
        light = {"type": "area", "radiance": {"type": "rgb", "value": radiance}}
        sun = {"type": "disk", "to_world": facing @ mi.ScalarTransform4f().scale(radius_m), "emitter": light}
    properties = mi.Properties()
    grey = {"type": "rgb", "value": REFLECTANCE}
    properties["bsdf"] = mi.load_dict({"type": "twosided", "side": {"type": "diffuse", "reflectance": grey}})
    properties["face_normals"] = True
    corners = scene.triangles.reshape(-1, 3)
    mesh = mi.Mesh("target", len(corners), len(scene.triangles), props=properties)
    shape = mi.traverse(mesh)
    shape["vertex_positions"] = corners.ravel().astype(np.float32)
    shape["faces"] = np.arange(len(corners), dtype=np.uint32)
    shape.update()
    lighting = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0, "hide_emitters": True}
    world = {"type": "scene", "sensor": sensor, "target": mesh, "integrator": lighting, "sun": sun}
    image = np.array(mi.render(mi.load_dict(world), seed=1))
    return image[..., 0], image[..., 1]


def main(path: Path, keys: list[str]) -> None:
    """Render scenes and write them with what made them and with the other scenes of the kept file."""
    kept: dict[str, np.ndarray] = {}
    if keys:
        with np.load(KEPT) as others:
            kept |= {name: others[name] for name in others.files if name != "made_by"}
    shared = os.environ.get("RSO_LIDAR_SHARED")
    scenes = load_scenes(Path(shared, "meshes") if shared else None)
    for key in keys or scenes:
        radiance, covered = render(scenes[key])
        kept |= {f"{key}_radiance": radiance, f"{key}_covered": covered, f"{key}_check": scenes[key].check}
    versions = [f"{name} {importlib.metadata.version(name)}" for name in ("mitsuba", "drjit")]
    np.savez_compressed(path, made_by=np.array(versions), **kept)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else KEPT, sys.argv[2:])
