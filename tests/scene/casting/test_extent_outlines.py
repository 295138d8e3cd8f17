"""The compiled outlines against the same in NumPy."""

from unittest import mock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.scene.casting import extent
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.scene.extent import project_outlines


def signed_area(outline):
    """Return the area, positive where x rises along the side of small y."""
    x, y = outline.T
    return 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))


def both(surfaces, truth):
    with mock.patch.object(extent, "project_outlines", project_outlines):
        reference = scene.extent(surfaces, truth)
    return scene.extent(surfaces, truth), reference


def test_bounds_and_outlines_agree_to_rounding():
    rng = np.random.default_rng(6)
    cloud = np.concatenate([box(0.4, 0.3, 0.5) + p for p in rng.uniform(-5, 5, (40, 3))])
    targets = [surface("ball", sphere(3.0, 3)), surface("cloud", cloud), surface("flat", plate(4, 2, n=3))]
    for _ in range(20):
        poses = {t.name: place(rng.uniform([-5, -5, 12], [5, 5, 1000]), Rotation.random(rng=rng)) for t in targets}
        made, reference = both(targets, truth_of(**poses))
        assert np.allclose(made.low, reference.low, rtol=1e-12, atol=1e-15)
        assert np.allclose(made.high, reference.high, rtol=1e-12, atol=1e-15)
        for outlines, others in zip(made.outlines, reference.outlines, strict=True):
            assert len(outlines) == len(others)
            for outline, other in zip(outlines, others, strict=True):
                # Corners that hardly turn may stand in one and not in the other; the area tells what matters.
                assert signed_area(outline) == pytest.approx(abs(signed_area(other)), rel=1e-9, abs=1e-18)
                assert np.allclose(np.sort(outline[:, 0])[[0, -1]], np.sort(other[:, 0])[[0, -1]], rtol=1e-12)


def test_behind_beside_and_edge_on():
    targets = [
        surface(name, triangles) for name, triangles in (("a", box(1, 1, 1)), ("b", box(4, 4, 4)), ("c", plate(2)))
    ]
    truth = truth_of(
        a=place((0, 0, -10)), b=place((0, 1, 0)), c=place((0, 0, 10), Rotation.from_euler("x", 90, degrees=True))
    )
    made, reference = both(targets, truth)
    assert np.array_equal(made.low[:2], reference.low[:2]) and np.array_equal(made.high[:2], reference.high[:2])
    assert made.outlines[:2] == reference.outlines[:2] == (None, None)
    for seen in (made, reference):  # seen edge-on, to rounding a line of both its ends
        (outline,) = seen.outlines[2]
        assert np.ptp(outline[:, 0]) == pytest.approx(2 / 9, rel=1e-12) and np.ptp(outline[:, 1]) < 1e-15


@pytest.mark.parametrize(("ahead_m", "bounded"), [(1e-6, False), (1e-5, True)])
def test_what_all_but_touches_the_plane_of_the_lidar_has_no_bounds(ahead_m, bounded):
    """Nearer than 2e-6 of its size of 1 m, rounding decides where a corner is seen."""
    for seen in both([surface("a", box(2, 2, 2))], truth_of(a=place((0, 0, 1.0 + ahead_m)))):
        assert np.isfinite(seen.low).all() == np.isfinite(seen.high).all() == bounded
        assert (seen.outlines[0] is not None) == bounded


def test_no_targets():
    made, reference = both([], truth_of())
    assert made.low.shape == reference.low.shape == (0, 2) and made.outlines == ()


def test_the_loops_are_compiled_once():
    both([surface("a", box(1, 1, 1))], truth_of(a=place((0, 0, 10))))
    assert len(extent.project_outlines.dispatcher.signatures) == 1
