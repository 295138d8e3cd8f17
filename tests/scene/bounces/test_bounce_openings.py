"""Openings: a facet of a convex body sees nothing, one of a corner sees the other."""

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.scene.bounces.bounce import find_openings, mark_open
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene import openings as reference


def outward(shell):
    """Return the openings (facet) outside and inside a body about the origin."""
    openings = find_openings([shell], 0, truth_of(**{shell.name: place()}))
    side = np.where(shell.planes[3] > 0.0, 0, 1)  # the side of the normal is outside
    facet = np.arange(len(side))
    return openings[side, facet], openings[1 - side, facet]


def test_convex_bodies_see_nothing_outside_and_themselves_inside():
    for shell in (surface("box", box(1.0, 2.0, 3.0)), surface("ball", sphere(1.0, 2))):
        outside, inside = outward(shell)
        assert not outside.any() and inside.all()


def test_plates_at_an_angle_see_each_other_on_one_side():
    one = plate(2.0)
    one[..., 0] += 1.0
    openings = find_openings(
        [surface("corner", np.concatenate([one, one[..., [2, 1, 0]]]))], 0, truth_of(corner=place())
    )
    assert (openings.sum(axis=0) == 1).all()


def test_another_surface_is_seen_on_its_side():
    targets = [surface("wall", plate(2.0)), surface("ball", sphere(0.5, 2))]
    for z in (-3.0, 3.0):
        openings = find_openings(targets, 0, truth_of(wall=place(), ball=place((0.0, 0.0, z))))
        above = np.sign(targets[0].planes[2]) == np.sign(z)
        np.testing.assert_array_equal(openings[0], above)
        np.testing.assert_array_equal(openings[1], ~above)


def test_the_side_that_a_ray_meets_is_that_of_numpy():
    rng = np.random.default_rng(6)
    planes, direction = rng.normal(size=(4, 50)), rng.normal(size=(3, 400))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    facet, openings = rng.integers(0, 50, 400), rng.random((2, 50)) < 0.5
    got = mark_open(direction, facet, packed(turn), planes, openings)
    np.testing.assert_array_equal(got, reference.mark_open(direction, facet, turn, planes, openings))
    assert got.any() and not got.all()
