"""Contours of surfaces against their oracle, and of shapes whose outline is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.scene import Phong
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene import contours as oracle


def as_sets(found):
    """Return contours in an order of their own, whichever end is first."""
    (x0, y0), (x1, y1) = np.round(found.ends, 9).T.reshape(2, 2, -1)
    is_turned = (x0 > x1) | ((x0 == x1) & (y0 > y1))
    ends = np.where(is_turned[:, None], found.ends[:, [2, 3, 0, 1]], found.ends)
    order = np.lexsort(np.round(ends, 9).T)
    return ends[order], found.step_per_sr_m2[order], found.surface[order]


@pytest.mark.parametrize("seed", range(3))
def test_contours_are_those_of_the_oracle(seed):
    rng = np.random.default_rng(seed)
    one = surface("one", np.concatenate([box(1.0, 1.0, 2.0), plate(4.0, 1.0, n=2)]))
    two = surface("two", sphere(1.0, 1), material=Phong(diffuse=0.1, specular=0.5, exponent=5.0))
    turns = Rotation.random(2, random_state=int(rng.integers(1000)))
    truth = truth_of(one=place((0.3, 0.1, 20.0), turns[0]), two=place((-1.0, 2.0, 30.0), turns[1]))
    found, expected = scene.contours([one, two], truth), oracle.contours([one, two], truth)
    assert len(expected.ends) > 20
    for made, wanted in zip(as_sets(found), as_sets(expected), strict=True):
        np.testing.assert_allclose(made, wanted, rtol=0.02, atol=1e-9)  # the table of angles is that coarse


def test_a_plate_has_its_rim_only():
    truth = truth_of(plate=place((0.0, 0.0, 10.0)))
    found = scene.contours([surface("plate", plate(2.0, n=3))], truth)
    assert len(found.ends) == 12  # three pieces on each of four sides; the inner edges are creases without a step
    assert np.abs(found.ends).max() == pytest.approx(0.1)


def test_a_target_behind_has_no_contours():
    truth = truth_of(plate=place((0.0, 0.0, -10.0)))
    assert len(scene.contours([surface("plate", plate(2.0))], truth).ends) == 0
    assert len(scene.contours([], truth).ends) == 0
