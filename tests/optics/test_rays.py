import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rso_lidar.optics import Laser, Receiver, pixel_rays
from rso_lidar.records import Extent
from tests.optics.bench_for_tests import SEED_LASER, SEED_RECEIVER

HALF = math.tan(math.radians(1.25))


def extent(*boxes):
    """Return the extent of targets with bounds ((x0, y0), (x1, y1)) in half fields of view."""
    low, high = np.array(boxes, dtype=float).reshape(-1, 2, 2).transpose(1, 0, 2) * HALF
    return Extent(low, high)


EVERYWHERE = Extent(np.full((1, 2), -np.inf), np.full((1, 2), np.inf))


def exact_sums(rays):
    """Return the weights of each pixel that has rays, summed without rounding."""
    ends = np.append(np.flatnonzero(np.diff(rays.pixel, prepend=-1)), len(rays.pixel))
    return np.array([math.fsum(rays.weight[a:b]) for a, b in pairwise(ends)])


def test_one_ray_a_pixel_goes_through_its_centre():
    receiver = Receiver(fov_deg=30, f_number=2, n_rows=6, n_cols=9, rays_per_pixel=1, min_rays_per_target=0)
    rays = pixel_rays(receiver, Laser(divergence_deg=60), EVERYWHERE)
    assert rays.pixel.tolist() == list(range(54))
    assert np.all(rays.weight == 1)
    assert np.allclose(rays.direction, receiver.line_of_sight.reshape(-1, 3), rtol=0, atol=1e-15)


def test_every_cell_of_the_grid_has_its_ray():
    rays = pixel_rays(SEED_RECEIVER, SEED_LASER, EVERYWHERE)
    assert np.bincount(rays.pixel).tolist() == [16] * 128 * 128
    assert np.allclose(np.linalg.norm(rays.direction, axis=1), 1, rtol=0, atol=1e-15)
    x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
    cells = np.stack([y, x]) / SEED_RECEIVER.pixel_tangent + 64
    assert np.array_equal(np.floor(cells[0]) * 128 + np.floor(cells[1]), rays.pixel)
    steps = np.unique(np.round(np.mod(cells, 1) * 8, 6))
    assert steps.tolist() == [1, 3, 5, 7]  # centres of quarters


@pytest.mark.parametrize(
    "box", [((-3, -3), (-2, -2)), ((1.001, 0), (1.2, 0.1)), ((np.inf, np.inf), (-np.inf, -np.inf))]
)
def test_nothing_in_the_field_no_rays(box):
    assert len(pixel_rays(SEED_RECEIVER, SEED_LASER, extent(box)).pixel) == 0


def test_no_targets_no_rays():
    assert len(pixel_rays(SEED_RECEIVER, SEED_LASER, Extent(np.zeros((0, 2)), np.zeros((0, 2)))).pixel) == 0


def test_a_target_half_out_of_the_field():
    rays = pixel_rays(SEED_RECEIVER, SEED_LASER, extent(((0.9, -0.1), (2, 0.1))))
    x, y = rays.direction[:, 0] / rays.direction[:, 2] / HALF, rays.direction[:, 1] / rays.direction[:, 2] / HALF
    cell = 2 / 512
    assert x.max() < 1 and x.min() > 0.9 - cell and np.abs(y).max() < 0.1 + cell
    assert np.ptp(x) > 0.1 - 2 * cell and np.ptp(y) > 0.2 - 2 * cell


@pytest.mark.parametrize("side", [0.3, 0.03, 3e-3, 3e-4, 3e-5])
def test_a_small_target_gets_enough_rays_inside_its_bounds(side):
    """`min_rays_per_target` is kept down to a target of 3e-5 half fields, 0.002 pixel across."""
    box = ((0.1234, -0.4321), (0.1234 + side, -0.4321 + side))
    rays = pixel_rays(SEED_RECEIVER, SEED_LASER, extent(box))
    x, y = rays.direction[:, 0] / rays.direction[:, 2] / HALF, rays.direction[:, 1] / rays.direction[:, 2] / HALF
    inside = (x >= box[0][0]) & (x <= box[1][0]) & (y >= box[0][1]) & (y <= box[1][1])
    assert 3800 <= inside.sum()  # whole rows and columns: one of 64 each may fall on the edge
    assert len(rays.pixel) <= 6 * 4096
    # Shares of area: what falls inside adds up to the box, to a row and a column of the finest grid.
    area = (side * 64) ** 2
    assert rays.weight[inside].sum() == pytest.approx(area, rel=4 / 64)


def test_min_rays_can_be_switched_off():
    receiver = SEED_RECEIVER.replace(min_rays_per_target=0)
    rays = pixel_rays(receiver, SEED_LASER, extent(((0.1234, -0.4321), (0.1235, -0.432))))
    assert len(rays.pixel) <= 4 and np.all(rays.weight == 1 / 16)


@pytest.mark.parametrize(("range_km", "small_m"), [(3, 0.2), (10, 0.2), (50, 0.2), (3, 0.02)])
def test_a_small_target_before_a_large_one_costs_no_second_frame(range_km, small_m):
    """A small box before one of 30 m: no more rays than two whole frames, at any range, or memory runs out."""
    field_m = 2 * HALF * range_km * 1e3
    small, large = 0.5 * small_m / field_m, 30 / field_m
    both = extent(((-large, -large), (large, large)), ((0.11 * large, 0.1 * large), (0.11 * large + 2 * small,) * 2))
    made = len(pixel_rays(SEED_RECEIVER, SEED_LASER, both).pixel)
    assert made <= 2 * 128 * 128 * 16, f"{made:,} rays"


bounds = st.tuples(*[st.floats(-1.2, 1.2)] * 2, *[st.floats(1e-3, 0.6)] * 2).map(
    lambda b: ((b[0], b[1]), (b[0] + b[2], b[1] + b[3]))
)


@settings(max_examples=40)
@given(st.lists(bounds, min_size=1, max_size=4), st.sampled_from([1, 4, 9]), st.integers(3, 17), st.integers(3, 17))
def test_shares_of_a_pixel_never_exceed_it_and_no_ray_is_made_twice(boxes, rays_per_pixel, n_rows, n_cols):
    receiver = Receiver(
        focal_length_mm=100,
        f_number=2,
        n_rows=n_rows,
        n_cols=n_cols,
        rays_per_pixel=rays_per_pixel,
        min_rays_per_target=256,
    )
    half = 0.5 * max(n_rows, n_cols) * receiver.pixel_tangent
    low, high = np.array(boxes).transpose(1, 0, 2) * half
    rays = pixel_rays(receiver, Laser(divergence_deg=170), Extent(low, high))
    assert np.all(np.diff(rays.pixel) >= 0)
    if len(rays.pixel):
        assert exact_sums(rays).max() <= 1 + 1e-12
        assert len(np.unique(rays.direction, axis=0)) == len(rays.pixel)
        x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
        row, col = np.floor(y / receiver.pixel_tangent + n_rows / 2), np.floor(x / receiver.pixel_tangent + n_cols / 2)
        assert np.array_equal(row * n_cols + col, rays.pixel)
        cells = np.sqrt(1 / rays.weight)
        assert np.allclose(cells, np.rint(cells), rtol=0, atol=1e-6)
    # What a box covers of the field is covered by rays, whole.
    for a, b in zip(low, high, strict=True):
        seen = np.clip(
            [a, b],
            [-0.5 * n_cols * receiver.pixel_tangent, -0.5 * n_rows * receiver.pixel_tangent],
            [0.5 * n_cols * receiver.pixel_tangent, 0.5 * n_rows * receiver.pixel_tangent],
        )
        sides = (seen[1] - seen[0]) / receiver.pixel_tangent
        if np.all(sides > 0):
            x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
            half_cell = 0.5 * np.sqrt(rays.weight) * receiver.pixel_tangent
            within = (x + half_cell > seen[0, 0]) & (x - half_cell < seen[1, 0])
            within &= (y + half_cell > seen[0, 1]) & (y - half_cell < seen[1, 1])
            width = np.minimum(x + half_cell, seen[1, 0]) - np.maximum(x - half_cell, seen[0, 0])
            height = np.minimum(y + half_cell, seen[1, 1]) - np.maximum(y - half_cell, seen[0, 1])
            covered = np.sum((width * height)[within]) / receiver.pixel_tangent**2
            # A ray stands for its cell; at most a border of half a finest cell has its centre outside the bounds.
            border = 2 * sides.sum() * np.sqrt(rays.weight.max()) + 4 * rays.weight.max()
            assert covered == pytest.approx(sides.prod(), abs=border) and covered <= sides.prod() * (1 + 1e-9)


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian", "as_printed"])
def test_only_what_is_lit_gets_rays(footprint):
    laser = Laser(divergence_deg=0.3, footprint=footprint)
    rays = pixel_rays(SEED_RECEIVER, laser, EVERYWHERE)
    x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
    assert np.all(laser.density(x, y) > 0) or footprint == "gaussian"
    assert exact_sums(rays).max() <= 1 + 1e-12
    if footprint != "gaussian":
        assert len(rays.pixel) < 0.02 * 128 * 128 * 16
