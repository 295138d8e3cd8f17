import math
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rso_lidar import scene
from rso_lidar.optics import BrownConrady, Laser, Receiver, pixel_rays
from rso_lidar.records import Extent
from tests.optics.bench_for_tests import PAPER_LASER, PAPER_RECEIVER, place, plate, surface, truth_of

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
    rays = pixel_rays(PAPER_RECEIVER, PAPER_LASER, EVERYWHERE)
    assert np.bincount(rays.pixel).tolist() == [16] * 128 * 128
    assert np.allclose(np.linalg.norm(rays.direction, axis=1), 1, rtol=0, atol=1e-15)
    x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
    cells = np.stack([y, x]) / PAPER_RECEIVER.pixel_tangent + 64
    assert np.array_equal(np.floor(cells[0]) * 128 + np.floor(cells[1]), rays.pixel)
    steps = np.unique(np.round(np.mod(cells, 1) * 8, 6))
    assert steps.tolist() == [1, 3, 5, 7]  # centres of quarters


@pytest.mark.parametrize(
    "box", [((-3, -3), (-2, -2)), ((1.001, 0), (1.2, 0.1)), ((np.inf, np.inf), (-np.inf, -np.inf))]
)
def test_nothing_in_the_field_no_rays(box):
    assert len(pixel_rays(PAPER_RECEIVER, PAPER_LASER, extent(box)).pixel) == 0


def test_no_targets_no_rays():
    assert len(pixel_rays(PAPER_RECEIVER, PAPER_LASER, Extent(np.zeros((0, 2)), np.zeros((0, 2)))).pixel) == 0


def test_a_target_half_out_of_the_field():
    rays = pixel_rays(PAPER_RECEIVER, PAPER_LASER, extent(((0.9, -0.1), (2, 0.1))))
    x, y = rays.direction[:, 0] / rays.direction[:, 2] / HALF, rays.direction[:, 1] / rays.direction[:, 2] / HALF
    cell = 2 / 512
    assert x.max() < 1 and x.min() > 0.9 - cell and np.abs(y).max() < 0.1 + cell
    assert np.ptp(x) > 0.1 - 2 * cell and np.ptp(y) > 0.2 - 2 * cell


@pytest.mark.parametrize("side", [0.3, 0.03, 3e-3, 3e-4, 3e-5])
def test_a_small_target_gets_enough_rays_inside_its_bounds(side):
    """`min_rays_per_target` is kept down to a target of 3e-5 half fields, 0.002 pixel across."""
    box = ((0.1234, -0.4321), (0.1234 + side, -0.4321 + side))
    rays = pixel_rays(PAPER_RECEIVER, PAPER_LASER, extent(box))
    x, y = rays.direction[:, 0] / rays.direction[:, 2] / HALF, rays.direction[:, 1] / rays.direction[:, 2] / HALF
    inside = (x >= box[0][0]) & (x <= box[1][0]) & (y >= box[0][1]) & (y <= box[1][1])
    assert 3800 <= inside.sum()  # whole rows and columns: one of 64 each may fall on the edge
    assert len(rays.pixel) <= 6 * 4096
    # Shares of area: what falls inside adds up to the box, to a row and a column of the finest grid.
    area = (side * 64) ** 2
    assert rays.weight[inside].sum() == pytest.approx(area, rel=4 / 64)


def test_min_rays_can_be_switched_off():
    receiver = PAPER_RECEIVER.replace(min_rays_per_target=0)
    rays = pixel_rays(receiver, PAPER_LASER, extent(((0.1234, -0.4321), (0.1235, -0.432))))
    assert len(rays.pixel) <= 4 and np.all(rays.weight == 1 / 16)


@pytest.mark.parametrize(("range_km", "small_m"), [(3, 0.2), (10, 0.2), (50, 0.2), (3, 0.02)])
def test_a_small_target_before_a_large_one_costs_no_second_frame(range_km, small_m):
    """A small box before one of 30 m: no more rays than two whole frames, at any range, or memory runs out."""
    field_m = 2 * HALF * range_km * 1e3
    small, large = 0.5 * small_m / field_m, 30 / field_m
    both = extent(((-large, -large), (large, large)), ((0.11 * large, 0.1 * large), (0.11 * large + 2 * small,) * 2))
    made = len(pixel_rays(PAPER_RECEIVER, PAPER_LASER, both).pixel)
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
            # A ray stands for its cell; at most a border of half a cell, of 1/16 of the grid's beside a finer target, has
            # its centre outside the bounds.
            widest = max(np.sqrt(rays.weight.max(initial=0.0)), 1 / (16 * receiver.rays_per_side))
            border = 2 * sides.sum() * widest + 4 * widest**2
            assert covered == pytest.approx(sides.prod(), abs=border) and covered <= sides.prod() * (1 + 1e-9)


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian", "as_printed"])
def test_only_what_is_lit_gets_rays(footprint):
    laser = Laser(divergence_deg=0.3, footprint=footprint)
    rays = pixel_rays(PAPER_RECEIVER, laser, EVERYWHERE)
    x, y = rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]
    assert np.all(laser.density(x, y) > 0) or footprint == "gaussian"
    assert exact_sums(rays).max() <= 1 + 1e-12
    if footprint != "gaussian":
        assert len(rays.pixel) < 0.02 * 128 * 128 * 16


# ---------------------------------------------------------------------------------------------- a lens that bends rays

BENT = {
    "barrel": (30.0, BrownConrady(k1=-0.5)),
    "pincushion": (30.0, BrownConrady(k1=0.5)),
    "aside": (30.0, BrownConrady(k1=-0.2, p1=0.02, p2=-0.03)),
    "narrow": (2.5, BrownConrady(k1=5.2)),
    "wide": (90.0, BrownConrady(k1=-0.05)),
}


def bent(name, **settings):
    fov_deg, distortion = BENT[name]
    settings = {"n_rows": 48, "n_cols": 64, "rays_per_pixel": 4, **settings}
    return Receiver(fov_deg=fov_deg, f_number=2.8, distortion=distortion, **settings)


def cells_of(rays, receiver):
    """Return where rays fall on the focal plane: column and row in pixels."""
    return receiver.image_of(*(rays.direction[:, axis] / rays.direction[:, 2] for axis in (0, 1)))


@pytest.mark.parametrize("name", BENT)
def test_bent_rays_fall_on_the_middles_of_their_cells(name):
    receiver = bent(name)
    rays = pixel_rays(receiver, Laser(divergence_deg=170.0), EVERYWHERE)
    assert np.all(np.bincount(rays.pixel, minlength=48 * 64) == 4)
    col, row = cells_of(rays, receiver)
    assert np.array_equal(np.floor(row) * 64 + np.floor(col), rays.pixel)
    assert np.abs(np.mod(2 * np.stack([col, row]), 1) - 0.5).max() < 1e-8


def random_scene(rng, half):
    """Return a plate of any size, turned, in and about a field of half a width `half` at 100 m."""
    side = 100.0 * half * rng.uniform(0.1, 4.0, 2)
    turn = Rotation.from_euler("zyx", [rng.uniform(0, 6), *rng.uniform(-0.5, 0.5, 2)])
    return surface("target", plate(*side)), truth_of(
        target=place([*100.0 * half * rng.uniform(-1.2, 1.2, 2), 100.0], turn)
    )


@pytest.mark.parametrize("rays_per_pixel", [4, 36])
@pytest.mark.parametrize("name", BENT)
def test_culling_behind_a_bent_lens_loses_no_ray_that_hits(name, rays_per_pixel):
    """Against all rays of the field, cast one and all: the same hits, and few rays made in vain."""
    receiver = bent(name, min_rays_per_target=0, rays_per_pixel=rays_per_pixel)
    laser = Laser(divergence_deg=170.0)
    every = pixel_rays(receiver, laser, EVERYWHERE)
    rng = np.random.default_rng(4)
    met = made = 0
    for _ in range(12):
        target, truth = random_scene(rng, math.tan(math.radians(BENT[name][0]) / 2))
        rays = pixel_rays(receiver, laser, scene.extent([target], truth))
        hits, all_hits = (scene.cast(r, [target], truth, 1) for r in (rays, every))
        assert np.array_equal(hits.pixel, all_hits.pixel)
        assert np.array_equal(hits.rays.direction[hits.ray], all_hits.rays.direction[all_hits.ray])
        met, made = met + len(all_hits.ray), made + len(rays.pixel)
    assert met > 5000 and made < 1.3 * met


@pytest.mark.parametrize("name", BENT)
@pytest.mark.parametrize("side_pixels", [0.5, 0.05, 0.005])
def test_a_small_target_behind_a_bent_lens_gets_enough_rays(name, side_pixels):
    """As without distortion: `min_rays_per_target` of them within its bounds, whose weights are its share of the image."""
    receiver = bent(name)
    x, y = receiver.tangents_at(np.array([9.3, 9.3 + side_pixels]), np.array([40.2, 40.2 + side_pixels]))
    low, high = np.array([[x.min(), y.min()]]), np.array([[x.max(), y.max()]])
    rays = pixel_rays(receiver, Laser(divergence_deg=170.0), Extent(low, high))
    across, down = (rays.direction[:, axis] / rays.direction[:, 2] for axis in (0, 1))
    inside = (across >= low[0, 0]) & (across <= high[0, 0]) & (down >= low[0, 1]) & (down <= high[0, 1])
    assert 3000 <= inside.sum() and len(rays.pixel) <= 8 * 4096
    seen = (
        (high - low).prod()
        / receiver.distortion.area_at_direction(across.mean(), down.mean())
        / receiver.pixel_tangent**2
    )
    assert rays.weight[inside].sum() == pytest.approx(seen, rel=0.07)  # a row and a column of 64 each


@pytest.mark.parametrize("name", BENT)
def test_nothing_in_a_bent_field_no_rays(name):
    receiver = bent(name)
    far = 1.2 * receiver.field_edge.max()
    for box in ([[far, -0.1], [far + 1, 0.1]], [[-0.1, -far - 1], [0.1, -far]], [[np.inf] * 2, [-np.inf] * 2]):
        low, high = np.array(box)[:, None]
        assert len(pixel_rays(receiver, Laser(divergence_deg=170.0), Extent(low, high)).pixel) == 0


@pytest.mark.parametrize("footprint", ["square", "circle"])
@pytest.mark.parametrize("name", BENT)
def test_a_narrow_beam_behind_a_bent_lens_lights_its_area(name, footprint):
    """Solid angles of lit cells sum to the footprint's: what the edge leaves dark is not counted, nor lost.

    A cell's edges are taken as straight and its area as that in its middle, so edge cells are good to some per cent.
    """
    receiver = bent(name, rays_per_pixel=16)
    laser = Laser(divergence_deg=0.55 * BENT[name][0], footprint=footprint)
    rays = pixel_rays(receiver, laser, EVERYWHERE)
    x, y = (rays.direction[:, axis] / rays.direction[:, 2] for axis in (0, 1))
    assert np.all(laser.density(x, y) > 0)
    area = np.sum(rays.weight * receiver.distortion.area_at_direction(x, y)) * receiver.pixel_tangent**2
    t = laser.half_width_tangent
    assert area == pytest.approx(math.pi * t * t if footprint == "circle" else 4 * t * t, rel=2e-3)


# ------------------------------------------------------------------------------------------- rays that only the Sun lights


@pytest.mark.parametrize("footprint", ["square", "circle"])
@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=5.0)], ids=["straight", "bent"])
def test_for_sunlight_the_whole_field_has_rays_and_the_beam_its_share(footprint, distortion):
    """Under a narrow beam every pixel is covered whole, and what is lit is exactly what it is without sunlight."""
    laser = Laser(divergence_deg=0.7, footprint=footprint)
    receiver = PAPER_RECEIVER.replace(distortion=distortion)
    dark = pixel_rays(receiver, laser, EVERYWHERE)
    sunlit = pixel_rays(receiver.replace(filter_width_nm=1.0), laser, EVERYWHERE)
    assert np.all(np.diff(sunlit.pixel) >= 0)
    assert np.bincount(sunlit.pixel, sunlit.weight) == pytest.approx(1, rel=1e-12)
    x, y = (sunlit.direction[:, axis] / sunlit.direction[:, 2] for axis in (0, 1))
    lit = laser.density(x, y) > 0
    assert np.bincount(sunlit.pixel[lit], sunlit.weight[lit], 128**2) == pytest.approx(
        np.bincount(dark.pixel, dark.weight, 128**2), abs=1e-9
    )
    assert np.allclose(np.linalg.norm(sunlit.direction, axis=1), 1, rtol=0, atol=1e-12)
    cells = np.floor(np.stack(receiver.image_of(x, y))[::-1]).astype(int)
    if distortion is None:
        assert np.array_equal(cells[0] * 128 + cells[1], sunlit.pixel)
    assert len(sunlit.pixel) < 1.02 * 128**2 * 16


def test_a_beam_wider_than_the_field_makes_no_more_rays_for_sunlight():
    for receiver in (PAPER_RECEIVER, PAPER_RECEIVER.replace(distortion=BrownConrady(k1=2.0))):
        laser = Laser(divergence_deg=4.0)
        with_sun = pixel_rays(receiver.replace(filter_width_nm=1.0), laser, EVERYWHERE)
        without = pixel_rays(receiver, laser, EVERYWHERE)
        assert with_sun.direction.tobytes() == without.direction.tobytes()
        assert with_sun.weight.tobytes() == without.weight.tobytes()


def test_a_laser_beside_the_lens_gets_the_whole_field():
    """Where its light falls depends on the range: every cell that may hit has its ray."""
    rays = pixel_rays(PAPER_RECEIVER, Laser(divergence_deg=0.3, offset_m=(0.5, 0.0, 0.0)), EVERYWHERE)
    assert np.bincount(rays.pixel).tolist() == [16] * 128 * 128


# ------------------------------------------------------------------------------------------ rays that cannot hit vanish


def crafts():
    """Return the surfaces of shipped models, and of some real spacecraft where there are any."""
    here = Path(__file__).parents[3] / "models"
    found = [here / name for name in ("juno.glb", "rocket_body.glb", "sphere.glb", "cubesat_3u.glb")]
    shared = Path(os.environ.get("RSO_LIDAR_SHARED", ""), "meshes")
    found += [shared / f"{name}.stl" for name in ("tdrs", "mro", "voyager") if (shared / f"{name}.stl").is_file()]
    return [scene.build_surface("target", scene.load_mesh(path)) for path in found]


@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=5.2)], ids=["straight", "bent"])
def test_outlines_lose_no_ray_that_hits(distortion):
    """Against all rays within the bounds, from filling the field down to a tenth of a pixel: the same rays hit."""
    rng = np.random.default_rng(9)
    receiver = PAPER_RECEIVER.replace(n_rows=64, n_cols=64, distortion=distortion)
    laser, hit, made, before = Laser(divergence_deg=4.0), 0, 0, 0
    for target in crafts():
        size = 2 * target.sphere[1]
        for _ in range(6):
            range_m = size * math.exp(rng.uniform(math.log(10), math.log(20_000)))
            beside = rng.uniform(-HALF, HALF, 2) * range_m
            truth = truth_of(target=place([*beside, range_m], Rotation.random(rng=rng)))
            seen = scene.extent([target], truth)
            some, every = (pixel_rays(receiver, laser, e) for e in (seen, replace(seen, outlines=None)))
            hits, all_hits = (scene.cast(rays, [target], truth, 1) for rays in (some, every))
            assert np.array_equal(hits.pixel, all_hits.pixel) and np.array_equal(hits.weight, all_hits.weight)
            assert np.allclose(some.direction[hits.ray], every.direction[all_hits.ray], rtol=0, atol=1e-12)
            hit, made, before = hit + len(hits.ray), made + len(some.pixel), before + len(every.pixel)
    assert hit > 10_000 and made < 1.35 * hit < 0.7 * before


def test_a_small_target_on_a_large_focal_plane_and_many_of_them():
    """Rays follow from what is seen, not from the number of pixels or of other targets."""
    large = PAPER_RECEIVER.replace(n_rows=1024, n_cols=1024, rays_per_pixel=1)
    assert len(pixel_rays(large, PAPER_LASER, extent(((0.1, 0.1), (0.11, 0.11)))).pixel) < 6 * 4096
    corner = np.random.default_rng(4).uniform(-0.9, 0.9, (50, 2))
    boxes = [((x, y), (x + 0.002, y + 0.002)) for x, y in corner]
    rays = pixel_rays(PAPER_RECEIVER, PAPER_LASER, extent(*boxes))
    assert 40 * 4096 < len(rays.pixel) < 50 * 6 * 4096 and exact_sums(rays).max() <= 1 + 1e-12
