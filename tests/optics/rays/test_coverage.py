"""The rays against their oracle in NumPy, ray by ray."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import BrownConrady, Laser, Receiver, pixel_rays
from rso_lidar.optics.rays import coverage, ray_grid
from rso_lidar.records import Extent
from tests.optics.bench_for_tests import box, place, plate, sphere, surface, truth_of
from tests.reference.optics import pixel_rays as oracle

BENT = BrownConrady(k1=5.2)
WIDE = Laser(divergence_deg=4.0)
LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=48, n_cols=64)
HALF = math.tan(math.radians(1.25))


def assert_same(receiver, laser, extent):
    """The same rays in the same order; directions to the last bits."""
    made, reference = pixel_rays(receiver, laser, extent), oracle.pixel_rays(receiver, laser, extent)
    assert np.array_equal(made.pixel, reference.pixel) and np.array_equal(made.weight, reference.weight)
    assert np.allclose(made.direction, reference.direction, rtol=0, atol=2e-15)
    assert made.direction.flags.f_contiguous
    assert np.all(np.diff(made.pixel) >= 0)
    return made


def extent_of(rng, n_targets, range_m):
    """Return the extent of bodies of 2 to 30 m, about the field and beyond it, at a range [m]."""
    shapes = [
        np.concatenate([box(1, 1, 2), plate(12, 1, n=3), box(0.5, 0.5, 6) + np.array([4, 0, 2])]),
        plate(30, 20),
        sphere(1.0, 2),
    ]
    targets = [surface(f"t{k}", shapes[k % 3]) for k in range(n_targets)]
    at = rng.uniform(-1.2, 1.2, (n_targets, 3)) * [HALF * range_m, HALF * range_m, 0.2 * range_m] + [0, 0, range_m]
    poses = {t.name: place(p, Rotation.random(rng=rng)) for t, p in zip(targets, at, strict=True)}
    return scene.extent(targets, truth_of(**poses))


@pytest.mark.parametrize("distortion", [None, BENT], ids=["straight", "bent"])
@pytest.mark.parametrize(("n_targets", "range_m"), [(1, 300.0), (1, 5e3), (4, 2e3), (7, 30e3), (1, 500e3)])
def test_the_same_rays(distortion, n_targets, range_m):
    rng = np.random.default_rng(int(range_m))
    made = 0
    for _ in range(8):
        extent = extent_of(rng, n_targets, range_m)
        made += len(assert_same(LENS.replace(distortion=distortion), WIDE, extent).pixel)
    assert made > 1000


def test_bounds_without_outlines_beside_outlines():
    """A speck and a wall known by bounds alone, before a body with outlines."""
    body = extent_of(np.random.default_rng(1), 1, 900.0)
    low = np.concatenate([body.low, [[-0.3 * HALF, -0.2 * HALF], [0.1 * HALF, 0.1 * HALF]]])
    high = np.concatenate([body.high, [[0.4 * HALF, 0.3 * HALF], [0.101 * HALF, 0.1004 * HALF]]])
    for distortion in (None, BENT):
        assert_same(LENS.replace(distortion=distortion), WIDE, Extent(low, high, (*body.outlines, None, None)))


@pytest.mark.parametrize(
    "extent",
    [
        Extent(np.zeros((0, 2)), np.zeros((0, 2)), ()),
        Extent(np.full((1, 2), -np.inf), np.full((1, 2), np.inf), (None,)),
        Extent(np.full((1, 2), np.inf), np.full((1, 2), -np.inf), (None,)),
        Extent(np.full((1, 2), 2 * HALF), np.full((1, 2), 3 * HALF)),
    ],
    ids=["no targets", "everywhere", "behind", "beside the field"],
)
@pytest.mark.parametrize("shape", [(48, 64), (1, 1), (1, 9), (9, 1)])
@pytest.mark.parametrize("distortion", [None, BENT], ids=["straight", "bent"])
def test_all_nothing_and_narrow_focal_planes(extent, shape, distortion):
    receiver = LENS.replace(n_rows=shape[0], n_cols=shape[1], rays_per_pixel=1, distortion=distortion)
    made = assert_same(receiver, Laser(divergence_deg=60.0), extent)
    assert len(made.pixel) in (0, shape[0] * shape[1])


@pytest.mark.parametrize(
    "laser",
    [Laser(divergence_deg=0.8, footprint=f) for f in ("square", "circle", "gaussian")]
    + [Laser(divergence_deg=0.8, offset_m=(0.5, 0.0, 0.0))],
)
@pytest.mark.parametrize("filter_width_nm", [None, 1.0])
def test_narrow_beams_and_sunlight(laser, filter_width_nm):
    extent = extent_of(np.random.default_rng(8), 3, 700.0)
    assert_same(LENS.replace(filter_width_nm=filter_width_nm), laser, extent)


@pytest.mark.parametrize("grid", [1, 7, 64])
def test_covering_cells_agrees_for_any_polygon(grid):
    """Triangles, lines level and upright, points, and corners far outside, at any slack."""
    rng = np.random.default_rng(grid)
    polygons = [rng.uniform(-3, 12, (3, 2)) for _ in range(30)]
    polygons += [
        np.array([[2.5, 1], [2.5, 7]]),
        np.array([[1.0, 3.5], [8, 3.5]]),
        np.array([[4.5, 4.5]]),
        np.zeros((0, 2)),
    ]
    polygons += [np.array([[-1e9, 2], [5, 1e12], [6, -1e12]])]
    corners, starts = np.concatenate(polygons), np.cumsum([0] + [len(p) for p in polygons])
    off = rng.choice([0.0, 0.3], len(polygons))
    for p in range(len(polygons)):
        blocks = [np.zeros((9 * grid, 8 * grid), np.int16) for _ in range(2)]
        for block, cover in zip(blocks, (oracle.cover, coverage.cover), strict=True):
            cover(block, 1, (-1, 0), (0, 8 * grid), (1, 7 * grid), grid, corners, starts, off, p, p + 1)
        assert np.array_equal(*blocks)


def test_each_kernel_is_compiled_for_one_combination_of_types():
    rng = np.random.default_rng(0)
    for distortion in (None, BENT):
        for extent in (extent_of(rng, 3, 20e3), extent_of(rng, 1, 300.0)):
            pixel_rays(LENS.replace(distortion=distortion), WIDE, extent)
    kernels = coverage.find_fineness, coverage.find_owners, coverage.mark_parts, ray_grid.make_rays, ray_grid.normalise
    assert [len(kernel.dispatcher.signatures) for kernel in kernels] == [1] * 5
