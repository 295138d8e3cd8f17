"""Facets are split alike by the loop and by NumPy."""

from unittest import mock

import numpy as np
import pytest

from rso_lidar.kernels import packed
from rso_lidar.scene.surfaces import pieces as module
from rso_lidar.scene.surfaces.pieces import find_cut
from tests.optics.bench_for_tests import box, plate, sphere, surface
from tests.reference.scene import pieces as reference

SHAPES = {
    "sphere": sphere(2.0, 4),
    "flat": plate(6, n=8),
    "boxes": np.concatenate([box(0.4, 0.3, 0.5) + p for p in np.random.default_rng(2).uniform(-5, 5, (24, 3))]),
    "same": np.repeat(box(1, 1, 1)[:1], 5, axis=0),
}


@pytest.mark.parametrize("name", SHAPES)
def test_the_cut_is_that_of_numpy(name):
    corners = SHAPES[name]
    low, high = corners.min(axis=1), corners.max(axis=1)
    rng = np.random.default_rng(1)
    for share in (1.0, 0.5, 0.1):
        facets = np.flatnonzero(rng.random(len(corners)) < share)
        if not len(facets):
            continue
        beyond, *areas = find_cut(*(packed(values) for values in (low, high, facets)))
        expected, *expected_areas = reference.find_cut(low, high, facets)
        assert np.array_equal(beyond, expected)
        assert areas == expected_areas  # to the last bit, so that pieces are the very same
        assert name == "same" or 0 < beyond.sum() < len(facets)


@pytest.mark.parametrize("name", SHAPES)
def test_pieces_are_the_same_by_either(name):
    made = module._split(surface("target", SHAPES[name]))
    with mock.patch.object(module, "find_cut", reference.find_cut):
        same = module._split(surface("target", SHAPES[name]))
    assert np.array_equal(made.points, same.points)
    assert np.array_equal(made.starts, same.starts)
