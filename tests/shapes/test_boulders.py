"""Boulders: how many of which size, and their shape."""

import numpy as np
import pytest

from rso_lidar.shapes.boulders import boulder, rock_decay_per_m, rock_diameters


def test_decay_is_that_of_the_paper():
    # Golombek and Rapp 1997: q = 1.79 + 0.152 / k; 5 % of the ground under rocks.
    assert rock_decay_per_m(0.05) == pytest.approx(4.83)


def test_rocks_cover_the_share_that_the_law_says():
    area_m2, covered = 1e7, 0.1
    found = rock_diameters(area_m2, 0.5, 5.0, covered, np.random.default_rng(1))
    for diameter in (0.5, 1.0):
        larger = found[found >= diameter]
        law = covered * (np.exp(-rock_decay_per_m(covered) * diameter) - np.exp(-rock_decay_per_m(covered) * 5.0))
        areas = 0.25 * np.pi * larger**2
        # The scatter of a sum over a Poisson number of rocks; the bins add under 0.1 %.
        assert areas.sum() / area_m2 == pytest.approx(law, abs=5.0 * np.sqrt((areas**2).sum()) / area_m2 + 1e-3 * law)
    assert found.min() >= 0.5
    assert found.max() <= 5.0


def test_bare_ground_has_no_rocks():
    assert len(rock_diameters(1e6, 0.5, 5.0, 0.0, np.random.default_rng(1))) == 0


def test_a_boulder_is_closed_and_faces_out():
    solid = boulder(2.0, np.random.default_rng(4))
    edges = np.concatenate([solid.facets[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges)
    assert {(b, a) for a, b in there} == there
    # Half an ellipsoid of radius 1 m and height 0.7 to 1.3 m, 12 sides, rough by 10 %, on a skirt 0.3 m deep.
    assert 0.7 * 0.66 * np.pi * 0.7 + 0.5 < solid.volume_m3() < 1.3 * (0.66 * np.pi * 1.3 + 1.0)
    assert solid.vertices[:, 2].min() == pytest.approx(-0.3)


@pytest.mark.parametrize("seed", range(5))
def test_a_boulder_has_about_its_diameter(seed):
    solid = boulder(3.0, np.random.default_rng(seed))
    across = np.ptp(solid.vertices[:, :2], axis=0)
    assert np.all((across > 3.0 * 0.75) & (across < 3.0 * 1.25))
