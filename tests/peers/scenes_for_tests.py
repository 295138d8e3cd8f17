"""Scenes that rso_lidar and another renderer both look at: triangles in lidar axes, a square sensor, a square beam."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.scene import load_mesh
from rso_lidar.shipped import shipped
from tests.optics.bench_for_tests import plate

REFLECTANCE = 0.30


@dataclass(frozen=True, eq=False)
class Scene:
    """What is seen, Lambertian and two-sided, by n x n pixels; the beam leaves from the lens.

    `triangles` (facet, corner, xyz) [m] are relative to a point `distance_m` ahead of the lidar, in lidar axes. `samples`
    is the square root of how many rays the other renderer sends through a pixel, `bin_m` the width of its bins of path
    length: a plate that faces the lidar lies in one of them, and is off by up to half of it. With two `bounces`, light may
    meet two surfaces.
    """

    name: str
    triangles: np.ndarray
    distance_m: float
    n: int
    fov_deg: float
    divergence_deg: float
    samples: int
    bin_m: float
    rays_per_pixel: int = 4096
    reflectance: float = REFLECTANCE
    bounces: int = 1

    @property
    def path_m(self) -> tuple[float, int]:
        """Return where the histogram of path lengths begins [m], and its number of bins."""
        reach = float(np.abs(self.triangles[..., 2]).max())
        start = math.floor(2.0 * (self.distance_m - reach) - 1.0)
        aslant = 1.0 / math.cos(math.radians(self.fov_deg))
        # The longest further legs, as if straight across the sphere about everything.
        aslant += (self.bounces - 1) * float(np.linalg.norm(self.triangles, axis=2).max()) / self.distance_m
        return float(start), math.ceil((2.0 * (self.distance_m + reach) * aslant + 1.0 - start) / self.bin_m)

    @property
    def check(self) -> np.ndarray:
        """Return numbers that differ when the scene is not the one that was rendered."""
        flat = self.triangles.reshape(-1, 3)
        settings = [len(flat), self.distance_m, self.n, self.fov_deg, self.divergence_deg]
        settings += [self.reflectance, self.bounces] if self.bounces > 1 else []
        return np.concatenate([settings, flat.mean(axis=0), flat.std(axis=0), flat[0], flat[-1]])


def turned(triangles, axes, angles_deg):
    """Return triangles turned about the origin."""
    return Rotation.from_euler(axes, angles_deg, degrees=True).apply(triangles.reshape(-1, 3)).reshape(-1, 3, 3)


def tilted_plate() -> Scene:
    """Return a plate tilted by 60 degrees; the beam is narrower than the field, and its edge cuts pixels."""
    return Scene("plate tilted by 60 deg", turned(plate(16.0), "zx", [20.0, 60.0]), 100.0, 8, 2.5, 2.05, 256, 0.02)


def edge(gap_m: float) -> Scene:
    """Return a plate over half of the field and another `gap_m` behind it; the edge between them is slanted."""
    near = plate(20.0)
    near[..., 0] -= 10.0
    near = turned(near, "z", 17.0)
    near[..., 0] += 0.11
    far = plate(30.0)
    far[..., 2] += gap_m
    return Scene(f"edge {gap_m:g} m before a wall", np.concatenate([near, far]), 100.0, 8, 2.5, 2.5, 256, 0.005)


def spacecraft() -> Scene:
    """Return the catalogue's TDRS, 21 m long, turned so that no side faces the lidar."""
    mesh = load_mesh(shipped("models/tdrs.glb"))
    triangles = turned(mesh.vertices[mesh.facets], "xyz", [35.0, -25.0, 40.0])
    return Scene("TDRS at 300 m", triangles, 300.0, 32, 4.2, 4.2, 512, 0.02, 16384)


def corner() -> Scene:
    """Return two square plates at right angles that share an edge, turned by 10 and 15 degrees from the symmetric pose."""
    one = plate(3.0)
    one[..., 0] -= 1.5
    one = turned(one, "y", -45.0)
    triangles = np.concatenate([one, one * np.array([-1.0, 1.0, 1.0])]) + np.array([0.0, 0.0, 1.0])
    triangles = turned(triangles, "yx", [10.0, 15.0])
    return Scene("corner of two plates", triangles, 100.0, 8, 3.0, 3.0, 448, 0.05, 4096, 0.8, 2)


def cavity() -> Scene:
    """Return a box of 3 m without a lid, whose mouth is turned by 20 and 25 degrees from the lidar."""
    half, wall = 1.5, plate(3.0)
    floor = wall + np.array([0.0, 0.0, half])
    walls = [np.roll(wall, axis + 1, axis=2) + side * half * np.eye(3)[axis] for axis in (0, 1) for side in (-1.0, 1.0)]
    triangles = turned(np.concatenate([floor, *walls]), "xy", [20.0, 25.0])
    return Scene("box without a lid", triangles, 100.0, 8, 3.0, 3.0, 448, 0.05, 4096, 0.8, 2)


def bright_craft(model: str, fov_deg: float, angles_deg: list[float]) -> Scene:
    """Return a shipped model with all parts bright, before a field of `fov_deg` that it fills at 300 m."""
    mesh = load_mesh(shipped(f"models/{model}.glb"))
    triangles = turned(mesh.vertices[mesh.facets], "xyz", angles_deg)
    name = f"bright {model.upper()} at 300 m"
    return Scene(name, triangles, 300.0, 10, fov_deg, fov_deg, 512, 0.1, 4096, 0.8, 2)


BOUNCES = {
    "corner": corner,
    "cavity": cavity,
    "bright_tdrs": lambda: bright_craft("tdrs", 3.6, [200.0, -25.0, 40.0]),
    "bright_stardust": lambda: bright_craft("stardust", 1.2, [35.0, -25.0, 40.0]),
}
SCENES = {"plate": tilted_plate, "edge": lambda: edge(3.0), "blend": lambda: edge(0.6), "tdrs": spacecraft, **BOUNCES}
