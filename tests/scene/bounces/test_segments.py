"""Segments in packets against the reference in NumPy, which asks embree for one ray after another."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.optics import Laser, Receiver, pixel_rays
from rso_lidar.scene import cast, extent
from rso_lidar.scene.bounces.path_starts import number_facets
from rso_lidar.scene.bounces.scattering import localize_points
from rso_lidar.scene.bounces.segments import find_segments
from rso_lidar.scene.embree.ray_by_ray import RayByRay
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene import segments as reference

LENS = Receiver(fov_deg=6, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=16, min_rays_per_target=0)


def some_starts():
    """Return points on the first of two surfaces, and directions from them."""
    open_box = surface("box", box(2.0, 2.0, 2.0)[2:])
    ball = surface("ball", sphere(0.3))
    targets = (open_box, ball)
    truth = truth_of(
        box=place((0, 0, 30), Rotation.from_euler("yx", [-75, 8], degrees=True)), ball=place((0.3, 0.1, 29))
    )
    rays = pixel_rays(LENS, Laser(divergence_deg=60), extent(targets, truth))
    hits = cast(rays, targets, truth, 1)
    number, facet = number_facets(hits, targets)
    on = np.flatnonzero(number == 0)
    starts = localize_points(targets, 0, truth, rays.direction[hits.ray[on]], facet[on], hits.range_m[on])
    toward = np.random.default_rng(5).normal(size=(3, len(on)))
    toward /= np.linalg.norm(toward, axis=0)
    toward *= np.sign((toward * starts.facing).sum(axis=0))
    return starts, toward


@pytest.mark.parametrize("stand_in", [False, True], ids=["packets", "ray by ray"])
def test_segments_are_those_of_numpy(monkeypatch, stand_in):
    if stand_in:
        one = RayByRay()
        monkeypatch.setattr("rso_lidar.scene.bounces.segments.engine", lambda: one)
    starts, toward = some_starts()
    asked = np.arange(len(starts.facet)) % 3 > 0
    got, expected = find_segments(starts, toward, asked), reference.find_segments(starts, toward, asked)
    assert {-1, 0, 1} == set(expected.number.tolist()), "paths that meet nothing, their own surface, and another"
    assert (got.number[~asked] == -1).all()
    np.testing.assert_array_equal(got.number, expected.number)
    met = expected.number >= 0
    np.testing.assert_array_equal(got.facet[met], expected.facet[met])
    np.testing.assert_allclose(got.length_m[met], expected.length_m[met], rtol=1e-9)


def test_a_segment_has_the_length_of_its_plane():
    """Two plates face each other at 3 m; a path at 60 degrees is 6 m long, to float64 even 50 km away."""
    upright = Rotation.from_euler("y", 90, degrees=True)
    truth = truth_of(near=place((0, 0, 50_000.0), upright), far=place((3, 0, 50_000.0), upright))
    targets = surface("near", plate(40.0)), surface("far", plate(40.0))
    point = np.array([1e-9, 0.0, 50_000.0])
    range_m = np.linalg.norm(point)
    starts = localize_points(targets, 0, truth, (point / range_m)[None], np.zeros(1, np.int32), np.array([range_m]))
    away = np.array([[0.0], [np.sqrt(0.75)], [0.5]])
    away[2] *= np.sign(truth.poses.place("near", "far")[0][2])
    starts.facing[:] = np.sign((starts.facing * away).sum(axis=0)) * starts.facing
    found = find_segments(starts, away, np.ones(1, bool))
    assert found.number[0] == 1
    assert found.length_m[0] == pytest.approx(6.0, abs=1e-7)
