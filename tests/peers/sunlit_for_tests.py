"""Scenes in sunlight that a camera of rso_lidar and another renderer both look at."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar import units
from rso_lidar.scene import load_mesh
from rso_lidar.shipped import shipped
from tests.optics.bench_for_tests import plate, sphere
from tests.peers.scenes_for_tests import REFLECTANCE, turned

SUN_RADIUS_RAD = math.asin(units.SUN_RADIUS_M / units.ASTRONOMICAL_UNIT_M)


@dataclass(frozen=True, eq=False)
class SunlitScene:
    """What is seen, Lambertian and two-sided, by n x n pixels.

    `triangles` (facet, corner, xyz) [m] are relative to a point `distance_m` ahead of the camera, in camera axes. `sun` is
    the vector (xyz) toward the Sun. `is_disc` tells whether the Sun is a disc or a point. `samples` is the number of rays
    that the other renderer sends through a pixel.
    """

    name: str
    triangles: np.ndarray
    distance_m: float
    fov_deg: float
    sun: tuple[float, float, float]
    n: int = 32
    samples: int = 16384
    is_disc: bool = False
    rays_per_pixel: int = 4096

    @property
    def sun_direction(self) -> np.ndarray:
        """Return the unit vector toward the Sun (xyz), in camera axes."""
        return np.array(self.sun) / np.linalg.norm(self.sun)

    @property
    def check(self) -> np.ndarray:
        """Return numbers that differ when the scene is not the one that was rendered."""
        flat = self.triangles.reshape(-1, 3)
        settings = [len(flat), self.distance_m, self.n, self.fov_deg, *self.sun, self.is_disc, REFLECTANCE]
        return np.concatenate([settings, flat.mean(axis=0), flat.std(axis=0), flat[0], flat[-1]])


def lit_plate(incidence_deg: float) -> SunlitScene:
    """Return a plate that fills the field, turned by 20 degrees, in sunlight at an angle from its normal."""
    angle = math.radians(incidence_deg - 20.0)
    triangles = turned(plate(10.0), "y", 20.0)  # its normal leans to -x
    name = f"plate, Sun {incidence_deg:g} deg from its normal"
    return SunlitScene(name, triangles, 100.0, 2.0, (math.sin(angle), 0.0, -math.cos(angle)), 4, 64)


def shaded_plate() -> SunlitScene:
    """Return a plate 100 m before a wall: its shadow has an edge as wide as the Sun's disc, 0.93 m or 13 pixels."""
    near = plate(10.0)
    near[..., 0] -= 5.0
    near = near + np.array([-9.0, 0.0, -100.0])
    wall = plate(60.0)
    name, sun = "shadow on a wall 100 m behind a plate", (-0.09, 0.0, -1.0)
    return SunlitScene(
        name, np.concatenate([near, wall]), 300.0, 0.45, sun, samples=4096, is_disc=True, rays_per_pixel=256
    )


def craft(path: Path, name: str, fov_deg: float, angles_deg: list[float], *, is_disc: bool = False) -> SunlitScene:
    """Return a craft at 100 m, whose bounds stand on the boresight, turned so that no side faces the camera."""
    mesh = load_mesh(path)
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    triangles = turned(mesh.vertices[mesh.facets] - middle, "xyz", angles_deg)
    return SunlitScene(name, triangles, 100.0, fov_deg, (0.7, -0.4, -0.6), is_disc=is_disc)


def load_scenes(meshes: Path | None) -> dict[str, SunlitScene]:
    """Return the scenes by key; those of NASA's own meshes only where their folder is given."""
    scenes = {f"plate_{angle}": lit_plate(angle) for angle in (0, 30, 60, 85)}
    ball, sun = sphere(5.0), (1.0, 0.3, -0.4)
    scenes["sphere"] = SunlitScene("sphere of 5,120 facets", ball, 100.0, 6.5, sun, rays_per_pixel=1024)
    scenes["shadow"] = shaded_plate()
    scenes["rosetta"] = craft(shipped("models/rosetta.glb"), "Rosetta, as shipped", 20.0, [35.0, -25.0, 40.0])
    if meshes is not None:
        scenes["aura"] = craft(meshes / "aura.stl", "NASA's Aura", 12.0, [200.0, -25.0, 40.0])
        scenes["cassini"] = craft(meshes / "cassini.stl", "NASA's Cassini", 10.0, [35.0, -25.0, 40.0], is_disc=True)
    return scenes
