"""Fronts: the planes of what rays meet, as they appear in the tangent plane."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import Laser, Receiver, pixel_rays
from rso_lidar.records import Rays
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene import fronts as oracle

LENS = Receiver(fov_deg=4, f_number=2.8, n_rows=64, n_cols=64, rays_per_pixel=4, min_rays_per_target=0)


def look(targets, truth):
    """Return rays over all targets, what they hit, and the fronts."""
    rays = pixel_rays(LENS, Laser(divergence_deg=60), scene.extent(targets, truth))
    return rays, scene.cast(rays, targets, truth, 1), scene.find_fronts(rays, targets, truth)


@pytest.mark.parametrize("seed", range(3))
def test_on_its_plane_a_front_is_as_far_as_what_the_ray_meets(seed):
    turns = Rotation.random(2, random_state=seed)
    targets = [surface("one", box(3.0, 2.0, 4.0)), surface("two", sphere(2.0, 2))]
    truth = truth_of(one=place((0.3, 0.1, 100.0), turns[0]), two=place((-1.0, 2.0, 110.0), turns[1]))
    rays, hits, fronts = look(targets, truth)
    x, y, z = rays.direction.T
    per_depth = fronts[0] * x / z + fronts[1] * y / z + fronts[2]
    met = np.zeros(len(z), bool)
    met[hits.ray] = True
    assert met.any() and not met.all()
    np.testing.assert_allclose(per_depth[hits.ray], 1.0 / (hits.range_m * z[hits.ray]), rtol=1e-9)
    assert not fronts[:, ~met].any()
    np.testing.assert_allclose(fronts, oracle.find_fronts(rays, targets, truth), rtol=1e-6, atol=1e-9)


def test_a_front_goes_on_as_its_plane():
    """A plate that leans by 60 degrees about y: z = 100 m + x tan 60, so that 1/z falls by tan 60 / 100 m per x/z."""
    turn = Rotation.from_euler("y", -60.0, degrees=True)
    truth = truth_of(plate=place((0.0, 0.0, 100.0), turn))
    _, hits, fronts = look([surface("plate", plate(4.0))], truth)
    lean = np.tan(np.radians(60.0))
    np.testing.assert_allclose(
        fronts[:, hits.ray].T, np.tile([-lean, 0.0, 1.0], (len(hits.ray), 1)) / 100.0, atol=1e-12
    )


def test_a_facet_seen_edge_on_faces_the_lidar():
    turn = Rotation.from_euler("y", 90.0 - 0.03, degrees=True)  # a cosine of 5e-4
    truth = truth_of(plate=place((0.0, 0.0, 10.0), turn))
    rays = Rays((1, 1), np.array([[0.0, 0.0, 1.0]]), np.zeros(1, np.int32), np.ones(1))
    fronts = scene.find_fronts(rays, [surface("plate", plate(1.0))], truth)
    np.testing.assert_allclose(fronts[:, 0], [0.0, 0.0, 0.1], atol=1e-9)


def test_threads_change_nothing():
    targets, truth = [surface("one", sphere(3.0, 3))], truth_of(one=place((0.0, 0.0, 60.0)))
    rays = pixel_rays(LENS.replace(rays_per_pixel=64), Laser(divergence_deg=60), scene.extent(targets, truth))
    assert len(rays.pixel) > 20_000  # several bands
    one, other = (scene.find_fronts(rays, targets, truth, threads) for threads in (1, 3))
    np.testing.assert_array_equal(one, other)
