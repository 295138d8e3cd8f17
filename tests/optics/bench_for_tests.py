"""A bench for tests: tiny meshes from numpy, a tree of poses, and the walk from rays to labels without a scenario."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar import optics, sampling, scene
from rso_lidar.optics import Laser, Receiver
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import Truth
from rso_lidar.scene import Lambertian, Mesh, Surface, build_surface

PAPER_LASER = Laser()  # sec. 5 of Fuller et al.: 1064 nm, 50 mJ, 2.5 degrees, 8 ns
PAPER_RECEIVER = Receiver(fov_deg=2.5, f_number=2.8)


def plate(width_m, height_m=None, n=1):
    """Return the triangles (facet, corner, xyz) of a plate in the plane z = 0, n x n squares of two triangles each."""
    height_m = width_m if height_m is None else height_m
    x, y = np.linspace(-0.5, 0.5, n + 1) * width_m, np.linspace(-0.5, 0.5, n + 1) * height_m
    corner = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((n + 1, n + 1))], axis=-1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    return np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=2).reshape(-1, 3, 3)


def corner(size_m=3.0):
    """Return two square plates at right angles, symmetric about the boresight, their edge farthest."""
    one = plate(size_m)
    one[..., 0] -= 0.5 * size_m
    x, y, z = np.moveaxis(one, -1, 0)
    turned = np.stack([(x - z) / np.sqrt(2.0), y, (x + z) / np.sqrt(2.0)], axis=-1)
    return np.concatenate([turned, turned * np.array([-1.0, 1.0, 1.0])])


def box(x_m, y_m, z_m):
    """Return the triangles of a box about the origin."""
    faces = []
    for axis, (thick, u, v) in enumerate([(x_m, y_m, z_m), (y_m, z_m, x_m), (z_m, x_m, y_m)]):
        face = np.roll(plate(u, v), axis + 1, axis=2)
        offset = 0.5 * thick * np.eye(3)[axis]
        faces += [face - offset, face + offset]
    return np.concatenate(faces)


def sphere(radius_m, subdivisions=4):
    """Return the triangles of a sphere about the origin; their corners lie on it."""
    import trimesh

    return np.array(trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m).triangles)


def write_stl(path, triangles):
    """Write triangles as a binary STL."""
    records = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    records["corners"] = triangles
    path.write_bytes(b"made by a test".ljust(80) + np.uint32(len(triangles)).tobytes() + records.tobytes())


def surface(name, triangles, material=None, **settings):
    """Return the surface of some triangles (facet, corner, xyz) [m], Lambertian 0.30 by default."""
    triangles = np.asarray(triangles, dtype=float)
    number = np.arange(len(triangles), dtype=np.int32)
    mesh = Mesh(
        path=Path(f"{name}.stl"),
        sha256="0" * 64,
        vertices=triangles.reshape(-1, 3),
        facets=np.arange(3 * len(triangles)).reshape(-1, 3),
        part=settings.pop("part", np.zeros(len(triangles), dtype=np.int16)),
        part_names=settings.pop("part_names", ("body",)),
        source_facet=number,
        source_facets=len(number),
        degenerate=0,
    )
    return build_surface(name, mesh, material=material or Lambertian(), **settings)


def place(position_m=(0.0, 0.0, 0.0), rotation=None):
    """Return the pose lidar_from_target of a target at a place [m] in lidar axes, turned or not."""
    return RigidTransform.from_components(np.asarray(position_m, dtype=float), rotation or Rotation.identity())


def truth_of(inertial_from_lidar=None, **lidar_from_target):
    """Return the truth of one epoch: targets by name with their poses lidar_from_target."""
    parents = {"lidar": "inertial", **dict.fromkeys(lidar_from_target, "lidar")}
    links = {"lidar": Link.still(inertial_from_lidar), **{n: Link.still(p) for n, p in lidar_from_target.items()}}
    return Truth(0.0, PoseTree(parents, links), {}, np.full(3, np.nan))


def see(surfaces, truth, receiver=PAPER_RECEIVER, laser=PAPER_LASER, threads=1, paths=None, key=(16, 2)):
    """Return rays, hits, photons and labels of one flash, and photons pixel by pixel (row, col) in float64.

    With a number of `paths`, drawn by a `key`, light meets up to two surfaces.
    """
    surfaces = [surfaces] if isinstance(surfaces, Surface) else surfaces
    hits = sampling.cast_pixels(receiver, laser, surfaces, truth, threads)
    rays = hits.rays
    bounces = None
    if paths is not None:
        words = np.array(key, np.uint32)
        bounces = scene.bounce(hits, surfaces, truth, words, threads, laser_from_m=laser.offset, n_paths=paths)
    photons = optics.collect(hits, laser, receiver, bounces=bounces)
    n_pixels = receiver.n_rows * receiver.n_cols
    return SimpleNamespace(
        rays=rays,
        hits=hits,
        bounces=bounces,
        photons=photons,
        labels=scene.label(hits, photons),
        by_pixel=np.bincount(photons.pixel, photons.photons, n_pixels).reshape(receiver.shape),
        made=np.bincount(rays.pixel, rays.weight, n_pixels).reshape(receiver.shape),
    )


def look(triangles, lidar_from_target, receiver=PAPER_RECEIVER, laser=PAPER_LASER, material=None, **paths):
    """Return what `see` does, of one target."""
    return see(surface("target", triangles, material), truth_of(target=lidar_from_target), receiver, laser, **paths)
