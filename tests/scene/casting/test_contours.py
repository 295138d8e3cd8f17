"""Contours of surfaces against their oracle, and of shapes whose outline is known."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.scene import Phong
from tests.optics.bench_for_tests import box, corner, place, plate, sphere, surface, truth_of
from tests.reference.scene import contours as oracle

TURN = Rotation.from_euler("xyz", [10.0, 25.0, 5.0], degrees=True)


def assert_same(found, expected, rtol):
    """Assert that two sets of contours are the same in any order, whichever end is first."""
    assert len(found.ends) == len(expected.ends)
    scale = 1.0 + np.abs(expected.ends).max(axis=1, initial=0.0)
    both = [np.abs(expected.ends[:, None] - ends).max(axis=2) for ends in (found.ends, found.ends[:, [2, 3, 0, 1]])]
    off = np.minimum(*both) / scale[:, None]
    nearest = off.argmin(axis=1)
    assert sorted(nearest) == list(range(len(found.ends)))
    assert off.min(axis=1).max(initial=0.0) < 1e-9
    np.testing.assert_array_equal(found.surface[nearest], expected.surface)
    np.testing.assert_allclose(found.step_per_sr_m2[nearest], expected.step_per_sr_m2, rtol=rtol)
    is_turned = both[1][np.arange(len(nearest)), nearest] < both[0][np.arange(len(nearest)), nearest]
    depths = np.where(
        is_turned[:, None], found.inverse_depth_per_m[nearest][:, ::-1], found.inverse_depth_per_m[nearest]
    )
    np.testing.assert_allclose(depths, expected.inverse_depth_per_m, rtol=1e-9)


@pytest.mark.parametrize("least_crease", [1e-3, 0.1, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_contours_are_those_of_the_oracle(seed, least_crease):
    one = surface("one", np.concatenate([box(1.0, 1.0, 2.0), plate(4.0, 1.0, n=2)]))
    two = surface("two", sphere(1.0, 1))
    turns = Rotation.random(2, random_state=seed)
    truth = truth_of(one=place((0.3, 0.1, 20.0), turns[0]), two=place((-1.0, 2.0, 30.0), turns[1]))
    expected = oracle.contours([one, two], truth, least_crease)
    assert len(expected.ends) > 20
    assert_same(scene.contours([one, two], truth, least_crease), expected, rtol=1e-9)


def test_the_brightness_of_a_shiny_material_is_that_of_its_table():
    shiny = surface("shiny", sphere(1.0, 1), material=Phong(diffuse=0.1, specular=0.5, exponent=5.0))
    truth = truth_of(shiny=place((-1.0, 2.0, 30.0), TURN))
    expected = oracle.contours([shiny], truth, 2.0)  # folds alone, whose steps are not differences
    assert_same(scene.contours([shiny], truth, 2.0), expected, rtol=0.02)  # the table of angles is that coarse


@pytest.mark.parametrize("seed", range(6))
def test_edges_that_reach_behind_the_lidar_end_at_its_plane(seed):
    """The lidar is beside or inside a box and a net: what is left of each edge is in front of it."""
    rng = np.random.default_rng(seed)
    around = surface("around", np.concatenate([box(8.0, 6.0, 30.0), plate(40.0, 30.0, n=3)]))
    truth = truth_of(around=place(rng.uniform([-5.0, -5.0, -1.0], [5.0, 5.0, 9.0]), Rotation.random(random_state=seed)))
    expected = oracle.contours([around], truth, 0.1)
    assert np.abs(expected.ends).max() > 1e5
    assert_same(scene.contours([around], truth, 0.1), expected, rtol=1e-6)


def test_a_cut_edge_points_where_the_edge_goes():
    triangle = surface("triangle", [[[0.5, 1.0, 10.0], [3.0, 2.0, -10.0], [-1.0, -1.0, 20.0]]])
    found = scene.contours([triangle], truth_of(triangle=place()))
    assert len(found.ends) == 3
    ends = found.ends.reshape(-1, 2)
    # Halfway between its ends the first edge crosses the plane at (1.75, 1.5) m.
    assert np.linalg.norm(ends - [1.75e6, 1.5e6], axis=1).min() < 1.0


def test_a_plate_has_its_rim_only():
    truth = truth_of(plate=place((0.0, 0.0, 10.0)))
    found = scene.contours([surface("plate", plate(2.0, n=3))], truth)
    assert len(found.ends) == 12  # three pieces on each of four sides; the inner edges are creases without a step
    assert np.abs(found.ends).max() == pytest.approx(0.1)


def test_a_crease_counts_from_the_least_step_on():
    """Two plates at right angles: by symmetry of one brightness, until both are turned about their edge."""
    turn = math.radians(5.0)
    sides = surface("sides", corner(1.0))
    truth = truth_of(sides=place((0.0, 0.0, 1e4), Rotation.from_euler("y", turn)))
    step = 1.0 - math.tan(0.25 * math.pi - turn)  # cosines of incidence are sin and cos of 45 degrees less the turn
    counts = [len(scene.contours([sides], truth, least).ends) for least in (1e-3, 0.999 * step, 1.001 * step)]
    assert counts == [7, 7, 6]  # six on the rim, and the crease; the diagonals have no step


def test_targets_behind_and_none_have_no_contours():
    truth = truth_of(plate=place((0.0, 0.0, -10.0)))
    assert len(scene.contours([surface("plate", plate(2.0))], truth).ends) == 0
    assert len(scene.contours([], truth).ends) == 0
