"""Light that meets two surfaces, pixel by pixel, and up to six, against mitransient: differences of paths of two depths."""

import math

import numpy as np
import pytest

from rso_lidar.optics import collect
from rso_lidar.scene import Lambertian, bounce
from tests.optics.bench_for_tests import place, see, surface, truth_of
from tests.peers.render import DEEPEST, KEPT
from tests.peers.scenes_for_tests import BOUNCES
from tests.peers.test_mitransient import parts

pytestmark = pytest.mark.slow
KEYS = (1, 2, 3, 4)
PATHS = 60_000
TOTAL = 0.01  # of the second bounce, which is itself 4 to 17 % of the light
EDGE = 0.003  # of the brightest pixel: a grid of 64 x 64 rays misjudges the area that an edge leaves of a pixel
WORST_SIGMA = 4.5  # of some 200 pixels: passed by chance once in a thousand runs


def ours(scene, most=2):
    """Return the photons of all bounces but the first (key, row, col), and the number of all those of the first."""
    receiver, laser = parts(scene)
    target = [surface("target", scene.triangles, Lambertian(reflectance=scene.reflectance))]
    truth = truth_of(target=place((0, 0, scene.distance_m)))
    hits = see(target, truth, receiver, laser).hits
    of_hits = collect(hits, laser, receiver)
    alone = np.bincount(of_hits.pixel, of_hits.photons, scene.n**2)
    images = []
    for k in KEYS:
        bounces = bounce(hits, target, truth, np.array([k, 16], np.uint32), 1, n_paths=PATHS, most=most)
        photons = collect(hits, laser, receiver, bounces=bounces)
        images.append(np.bincount(photons.pixel, photons.photons, scene.n**2) - alone)
    return np.array(images).reshape(-1, scene.n, scene.n), alone.sum()


def theirs(key, scene, *, deep=False):
    """Return the same photons as the renderer has them (seed, row, col): of two bounces, or of `DEEPEST`."""
    receiver, laser = parts(scene)
    side = receiver.pixel_tangent
    beam = laser.photons / (2.0 * math.tan(math.radians(scene.divergence_deg) / 2)) ** 2
    at = (np.arange(scene.n) + 0.5 - 0.5 * scene.n) * side
    per_radiance = beam * receiver.aperture_area_m2 * receiver.transmission * side**2
    with np.load(KEPT) as kept:
        first = kept[f"{key}_first"]
        both = kept[f"{key}_deep"] if deep else np.stack([kept[f"{key}_{seed}"].sum(axis=2) for seed in (1, 2)])
    return (both - first) * per_radiance * (1.0 + at[:, None] ** 2 + at**2) ** -2


@pytest.mark.parametrize("key", BOUNCES)
def test_second_bounce_of_every_pixel(validation, key):
    scene = BOUNCES[key]()
    (our, first), their = ours(scene), theirs(key, scene)
    total, mean = their.sum() / len(their), their.mean(axis=0)
    validation(
        case=f"{scene.name}: photons of the second bounce, {total / first:.1%} of those of the first",
        source="mitransient 1.3.1, paths of depth 3 less those of depth 2",
        expected=total,
        got=our.sum() / len(our),
        tolerance=TOTAL * total,
        unit="photons",
    )
    errors = [images.std(axis=0, ddof=1) / math.sqrt(len(images)) for images in (our, their)]
    joint = np.sqrt(sum(pooled(error, mean) ** 2 for error in errors) + (EDGE * mean.max()) ** 2)
    off = np.abs(our.mean(axis=0) - mean) / joint
    assert off.max() < WORST_SIGMA, f"pixel {np.unravel_index(off.argmax(), off.shape)} is off by {off.max():.3g} sigma"


@pytest.mark.parametrize("key", BOUNCES)
def test_light_of_six_bounces(validation, key):
    scene = BOUNCES[key]()
    (our, first), their = ours(scene, DEEPEST), theirs(key, scene, deep=True)
    total = their.sum() / len(their)
    validation(
        case=f"{scene.name}: photons of the second to the sixth bounce, {total / first:.1%} of those of the first",
        source="mitransient 1.3.1, paths of depth 7 less those of depth 2",
        expected=total,
        got=our.sum() / len(our),
        tolerance=TOTAL * total,
        unit="photons",
    )


def pooled(error, mean):
    """Return standard errors (row, col) that pixels share.

    A few images tell little of one pixel's error. That of Monte Carlo grows with the root of the light, so
    the greater of a pixel's own error and of that law's counts.
    """
    light = np.maximum(mean, 1e-3 * mean.max())
    shared = np.sqrt(np.mean(error**2 / light) * light)
    return np.maximum(error, shared)
