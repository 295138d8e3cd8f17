"""Frames made by hand for the tests of pictures: a satellite of rectangles, met by rays in closed form, with noise."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.pose import Link, PoseTree, pose
from rso_lidar.records import (
    CameraImage,
    CameraLabels,
    Frame,
    Labels,
    Observation,
    Reading,
    Source,
    TargetEntry,
    Truth,
)

SOURCE = Source(
    scenario='version = 1\nname = "TDRS hop"\n',
    title="TDRS hop, 3 km to 300 m",
    start_utc="2024-09-17T12:00:00Z",
    seed=7,
    versions={"rso_lidar": "0.1.0"},
    targets=(TargetEntry("tdrs", "tdrs", "0" * 64, ("bus", "solar_array", "antenna"), ("Lambertian 0.3",) * 3, 10),),
)


def _rectangles() -> list[tuple[np.ndarray, np.ndarray, np.ndarray, int]]:
    """Return centre, two half edges (body axes, m) and part of each rectangle: a bus, two wings and two dishes."""
    x, y, z = np.eye(3)
    faces = [(s * 1.2 * a, 1.2 * b, 1.2 * c, 0) for a, b, c in ((x, y, z), (y, z, x), (z, x, y)) for s in (-1, 1)]
    tilt = Rotation.from_euler("y", 25, degrees=True)
    wings = [(s * 4.3 * y, 2.2 * y, tilt.apply(1.6 * x), 1) for s in (-1, 1)]
    dishes = [(2.2 * x + s * 1.8 * z, 1.1 * y, 1.1 * z + 0.3 * x, 2) for s in (-1, 1)]
    return faces + wings + dishes


def pixel_rays(n: int, fov_deg: float) -> np.ndarray:
    """Return the unit vectors (row, col, xyz) of pixel centres in lidar axes."""
    tangent = (2 * (np.arange(n) + 0.5) / n - 1) * np.tan(0.5 * fov_deg * units.DEG)
    right, down = np.meshgrid(tangent, tangent)
    rays = np.stack([right, down, np.ones_like(right)], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def make_truth(time_s, position_m: np.ndarray, turn: Rotation, off_deg: tuple[float, float] = (0.05, 0.08)) -> Truth:
    """Return a truth with the lidar at `position_m` in the target's rtn axes, looking at it but for `off_deg`."""
    forward = -position_m / np.linalg.norm(position_m)
    down = np.cross(forward, np.cross([0.0, 0.0, -1.0], forward))
    down /= np.linalg.norm(down)
    looking = Rotation.from_matrix(np.stack([np.cross(down, forward), down, forward], axis=-1))
    lidar = looking * Rotation.from_euler("xy", off_deg, degrees=True)
    rtn = Link(pose(np.array([42_164e3, 0.0, 0.0])), np.array([0.0, 3074.66, 0.0]), np.array([0.0, 0.0, 7.29e-5]))
    poses = PoseTree(
        {"tdrs.rtn": "inertial", "tdrs": "tdrs.rtn", "lidar": "tdrs.rtn"},
        {
            "tdrs.rtn": rtn,
            "tdrs": Link(pose(rotation=turn), np.zeros(3), np.array([0.0, 0.0, 0.01])),
            "lidar": Link(pose(position_m, lidar), np.array([0.0, 0.99, 0.0]), np.zeros(3)),
        },
    )
    return Truth(time_s, poses, {}, np.array([1.0, 0.0, 0.0]))


def make_frame(
    time_s: float = 0.0,
    range_m: float = 1000.0,
    n: int = 128,
    fov_deg: float = 2.5,
    index: int = 0,
    false_returns: int = 3,
    labelled: bool = True,
    photons_at_km: float = 9000.0,
) -> Frame:
    """Return a noisy frame of the satellite at about `range_m`, which turns half a degree in a second."""
    rng = np.random.default_rng([7, index])
    position_m = np.array([-0.12 * range_m * np.sin(range_m / 900.0), -range_m, 0.02 * range_m])
    turn = Rotation.from_euler("zyx", [0.5 * time_s + 20.0, 30.0, 15.0], degrees=True)
    truth = make_truth(time_s, position_m, turn)
    lidar_from_body = truth.pose("lidar", "tdrs")
    rays = pixel_rays(n, fov_deg)
    true_m, part = np.full((n, n), np.inf), np.full((n, n), -1)
    cosine, facet = np.full((n, n), np.nan), np.full((n, n), -1)
    for k, (centre, u, v, which) in enumerate(_rectangles()):
        c = lidar_from_body.apply(centre)
        u, v = (lidar_from_body.rotation.apply(edge) for edge in (u, v))
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        across = rays @ normal
        along_m = (c @ normal) / np.where(np.abs(across) < 1e-9, np.nan, across)
        q = along_m[..., None] * rays - c
        met = (np.abs(q @ u) <= u @ u) & (np.abs(q @ v) <= v @ v) & (along_m < true_m)
        true_m[met], part[met], cosine[met], facet[met] = along_m[met], which, np.abs(across[met]), k
    hit = np.isfinite(true_m)
    reflectance = np.array([0.45, 0.25, 0.6])[part]
    photons = np.where(hit, photons_at_km * reflectance * np.nan_to_num(cosine) * (1000.0 / range_m) ** 2, 0.0)
    seen = (photons > 0) & (rng.random((n, n)) < 1 / (1 + np.exp(-(photons - 350.0) / 120.0)))
    measured_m = np.where(
        seen, true_m + rng.normal(0, 0.05, (n, n)) * np.sqrt(1 + 800 / np.maximum(photons, 1)), np.nan
    )
    counts = np.where(
        seen, np.clip(0.12 * photons * rng.normal(1, 0.06, (n, n)) + rng.normal(0, 6, (n, n)), 1, 4095), 0
    )
    for row, col in rng.integers(0, n, (false_returns, 2)):
        measured_m[row, col], counts[row, col] = range_m * rng.uniform(0.6, 1.4), rng.integers(20, 60)
    label = hit & labelled
    true_m = np.where(label, true_m, np.nan)
    labels = Labels(
        range_m=true_m,
        first_range_m=true_m,
        cluster_count=label,
        target=np.where(label, 0, -1),
        part=np.where(label, part, -1),
        facet=np.where(label, facet, -1),
        cos_incidence=np.where(label, cosine, np.nan),
        photons=photons * label,
        filled_fraction=label,
    )
    reading = Reading(range_m=measured_m, intensity_counts=np.trunc(counts), saturated=counts >= 4095)
    observation = Observation(time_s, reading, {"focal_length_m": 0.2933}, rays, np.array([0.012, -0.034]))
    return Frame(index, observation, labels, truth, SOURCE)


def approach(count: int = 16, n: int = 128, **options) -> list[Frame]:
    """Return frames of an approach from 3 km to 300 m."""
    return [
        make_frame(2700.0 * k / count, 3000.0 * 0.1 ** (k / max(count - 1, 1)), n, index=k, **options)
        for k in range(count)
    ]


def add_camera(frame: Frame) -> Frame:
    """Return a frame with an image of the colour camera "nav": an orange square of 4 by 4 pixels in 20 by 20."""
    counts = np.full((20, 20, 3), 8, np.uint16)
    counts[5:9, 6:10] = [900, 600, 300]
    on = counts[..., 0] > 8
    target = np.where(on, 0, -1)
    labels = CameraLabels(counts, target, target, np.where(on, 100.0, np.nan), on)
    observation = dataclasses.replace(frame.observation, camera={"nav": CameraImage(counts, 0.02)})
    return dataclasses.replace(frame, observation=observation, camera_labels={"nav": labels})
