"""Outlines of bodies whose shadow is known."""

import numpy as np
import pytest

from rso_lidar.scene import render_portrait, viewer_axes
from tests.optics.bench_for_tests import box, sphere, surface

BOX = surface("box", box(1.0, 2.0, 3.0) + np.array([5.0, -2.0, 1.0]))


@pytest.mark.parametrize(
    ("toward", "up", "area_m2"),
    [
        ((1, 0, 0), (0, 0, 1), 6.0),
        ((0, -1, 0), (0, 0, 1), 3.0),
        ((0, 0, 1), (1, 0, 0), 2.0),
        ((1, 1, 1), (0, 0, 1), (6.0 + 3.0 + 2.0) / np.sqrt(3.0)),  # faces by the cosines to the viewer
    ],
)
def test_a_box_covers_what_its_faces_show(toward, up, area_m2):
    seen = render_portrait(BOX, toward, up, cells=500)
    assert seen.area_m2 == pytest.approx(area_m2, abs=0.5 * 10.0 * seen.cell_m)  # half a cell along 10 m of outline


def test_right_is_right_and_down_is_down():
    """From +x with z up: +y is to the right of the picture, and +z above."""
    triangles = [sphere(1.0, 3), sphere(0.2, 3) + np.array([0.0, 2.0, 0.0]), sphere(0.2, 3) + np.array([0.0, 0.0, 3.0])]
    seen = render_portrait(surface("balls", np.concatenate(triangles)), (1, 0, 0), (0, 0, 1), side_m=8.0, cells=200)
    large, small = len(triangles[0]), len(triangles[1])
    row, col = np.nonzero((seen.facet >= 0) & (seen.facet < large))
    rows, cols = np.nonzero(seen.facet >= large)
    aside = seen.facet[rows, cols] < large + small
    assert np.all(cols[aside] > col.max())
    assert np.all(rows[~aside] < row.min())


def test_a_sphere_is_brightest_in_its_middle():
    seen = render_portrait(surface("ball", sphere(1.0, 5)), (0.3, 0.2, 0.9), (0, 0, 1), cells=200)
    assert seen.cosine.max() == pytest.approx(1.0, abs=1e-3)
    row, col = np.unravel_index(np.argmax(seen.cosine), seen.cosine.shape)
    assert abs(row - 99.5) < 6
    assert abs(col - 99.5) < 6
    assert np.all(seen.cosine[~seen.covered] == 0.0)


def test_a_viewer_s_axes_are_right_handed_and_look_back():
    right, down, ahead = viewer_axes((1.0, 0.8, 0.7), (0.0, 0.0, 1.0))
    assert np.allclose(np.cross(right, down), ahead, rtol=0, atol=1e-15)
    assert ahead == pytest.approx(-np.array([1.0, 0.8, 0.7]) / np.linalg.norm([1.0, 0.8, 0.7]), abs=1e-15)
    assert down[2] < 0.0 and right[2] == 0.0
