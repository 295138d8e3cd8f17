"""Fixed grids of rays: where rays go, which pixels get them, and what a beam's edge leaves of them."""

import math
import os
from dataclasses import replace
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
WIDE = Laser(divergence_deg=170.0)
EVERYWHERE = Extent(np.full((1, 2), -np.inf), np.full((1, 2), np.inf))


def extent(*boxes):
    """Return the extent of targets with bounds ((x0, y0), (x1, y1)) in half fields of view."""
    low, high = np.array(boxes, dtype=float).reshape(-1, 2, 2).transpose(1, 0, 2) * HALF
    return Extent(low, high)


def tangents(rays):
    """Return x and y of the rays in the tangent plane."""
    return rays.direction[:, 0] / rays.direction[:, 2], rays.direction[:, 1] / rays.direction[:, 2]


def cells_of(rays, receiver, side):
    """Return the cell of a pixel's side x side grid in which each ray is, after checking that it is in its pixel."""
    col, row = receiver.image_of(*tangents(rays))
    np.testing.assert_array_equal(np.floor(row) * receiver.n_cols + np.floor(col), rays.pixel)
    down, across = (np.floor(side * np.mod(at, 1.0) + 1e-9) for at in (row, col))  # a ray may be on a cell's first edge
    return down * side + across


def assert_grid(rays, receiver):
    """Assert that each pixel that has rays has one in each cell of its grid, of equal weights."""
    side = receiver.rays_per_side
    key = rays.pixel * side**2 + cells_of(rays, receiver, side)
    assert len(np.unique(key)) == len(key) == len(np.unique(rays.pixel)) * side**2
    np.testing.assert_allclose(rays.weight, 1.0 / side**2, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=1), 1.0, rtol=0, atol=1e-15)
    assert (np.diff(rays.pixel) >= 0).all()


def test_one_ray_a_pixel_goes_through_its_centre():
    receiver = Receiver(fov_deg=30, f_number=2, n_rows=6, n_cols=9, rays_per_pixel=1, min_rays_per_target=0)
    rays = pixel_rays(receiver, Laser(divergence_deg=60), EVERYWHERE)
    assert rays.pixel.tolist() == list(range(54))
    assert np.all(rays.weight == 1)
    assert np.allclose(rays.direction, receiver.line_of_sight.reshape(-1, 3), rtol=0, atol=1e-15)


@pytest.mark.parametrize("side", [2, 3, 4, None])
def test_every_cell_of_the_grid_has_its_ray(side):
    receiver = PAPER_RECEIVER.replace(n_rows=32, n_cols=40, rays_per_pixel=None if side is None else side**2)
    rays = pixel_rays(receiver, PAPER_LASER, EVERYWHERE)
    assert len(rays.pixel) == 32 * 40 * (side or 4) ** 2
    assert_grid(rays, receiver)


@pytest.mark.parametrize(
    "box", [((-3, -3), (-2, -2)), ((1.001, 0), (1.2, 0.1)), ((np.inf, np.inf), (-np.inf, -np.inf))]
)
def test_nothing_in_the_field_no_rays(box):
    assert len(pixel_rays(PAPER_RECEIVER, PAPER_LASER, extent(box)).pixel) == 0


def test_no_targets_no_rays():
    assert len(pixel_rays(PAPER_RECEIVER, PAPER_LASER, Extent(np.zeros((0, 2)), np.zeros((0, 2)))).pixel) == 0


bounds = st.tuples(*[st.floats(-1.2, 1.2)] * 2, *[st.floats(1e-3, 0.6)] * 2).map(
    lambda b: ((b[0], b[1]), (b[0] + b[2], b[1] + b[3]))
)


@settings(max_examples=40)
@given(st.lists(bounds, min_size=1, max_size=4), st.sampled_from([1, 4, 9]), st.integers(3, 17), st.integers(3, 17))
def test_whole_pixels_that_bounds_touch_get_a_grid(boxes, rays_per_pixel, n_rows, n_cols):
    receiver = Receiver(focal_length_mm=100, f_number=2, n_rows=n_rows, n_cols=n_cols, rays_per_pixel=rays_per_pixel)
    low, high = np.array(boxes).transpose(1, 0, 2) * 0.5 * max(n_rows, n_cols) * receiver.pixel_tangent
    ends = [np.stack(receiver.image_of(*corner.T), axis=1) for corner in (low, high)]
    least, most = np.zeros((2, n_rows, n_cols), bool)
    rows, cols = np.arange(n_rows)[:, None], np.arange(n_cols)
    for (x0, y0), (x1, y1) in zip(*ends, strict=True):
        for touched, margin in ((least, 0.0), (most, 1e-8)):
            reached = (y0 - margin < rows + 1) & (y1 + margin > rows)
            touched |= reached & (x0 - margin < cols + 1) & (x1 + margin > cols)
    if not least.any():
        return
    rays = pixel_rays(receiver, WIDE, Extent(low, high))
    assert_grid(rays, receiver)
    sampled = set(rays.pixel.tolist())
    assert set(np.flatnonzero(least)) <= sampled <= set(np.flatnonzero(most))


def test_rays_follow_from_what_is_seen_and_not_from_the_focal_plane():
    large = PAPER_RECEIVER.replace(n_rows=1024, n_cols=1024, rays_per_pixel=1)
    assert len(pixel_rays(large, PAPER_LASER, extent(((0.1, 0.1), (0.11, 0.11)))).pixel) <= 7**2


# ---------------------------------------------------------------------------------------------------- the beam's edge


@pytest.mark.parametrize("side", [1, 2, 4])
@pytest.mark.parametrize("divergence_deg", [0.7, 0.3, 0.05, 0.004])
@pytest.mark.parametrize("footprint", ["square", "circle", "as_printed", "gaussian"])
def test_a_narrow_beam_lights_its_area(footprint, divergence_deg, side):
    receiver = PAPER_RECEIVER.replace(n_rows=32, n_cols=32, rays_per_pixel=side**2)
    laser = Laser(divergence_deg=divergence_deg, footprint=footprint)
    rays = pixel_rays(receiver, laser, EVERYWHERE)
    np.testing.assert_allclose(np.bincount(rays.pixel, rays.weight)[np.unique(rays.pixel)], 1.0, rtol=0, atol=1e-5)
    half = laser.half_width_tangent / receiver.pixel_tangent
    col, row = receiver.image_of(*tangents(rays))
    reach = half * (3.5 if footprint == "gaussian" else 1.0)
    assert max(np.abs(np.floor(col) + 0.5 - 16.0).max(), np.abs(np.floor(row) + 0.5 - 16.0).max()) <= reach + 0.5
    lit = laser.density(*tangents(rays)) > 0
    if footprint == "circle":
        assert rays.weight[lit].sum() == pytest.approx(math.pi * half**2, rel=1e-3)
    elif footprint != "gaussian":
        assert rays.weight[lit].sum() == pytest.approx(4.0 * half**2, rel=1e-9)


@pytest.mark.parametrize("footprint", ["square", "circle"])
@pytest.mark.parametrize("distortion", [None, BrownConrady(k1=5.0)], ids=["straight", "bent"])
def test_for_sunlight_the_whole_field_has_rays_and_the_beam_its_share(footprint, distortion):
    """Under a narrow beam every pixel is covered whole, and what is lit is exactly what it is without sunlight."""
    laser = Laser(divergence_deg=0.7, footprint=footprint)
    receiver = PAPER_RECEIVER.replace(distortion=distortion)
    dark = pixel_rays(receiver, laser, EVERYWHERE)
    sunlit = pixel_rays(receiver.replace(filter_width_nm=1.0), laser, EVERYWHERE)
    assert np.all(np.diff(sunlit.pixel) >= 0)
    assert np.bincount(sunlit.pixel, sunlit.weight) == pytest.approx(1, rel=1e-5)
    lit, lit_dark = (laser.density(*tangents(rays)) > 0 for rays in (sunlit, dark))
    np.testing.assert_allclose(
        np.bincount(sunlit.pixel[lit], sunlit.weight[lit], 128**2),
        np.bincount(dark.pixel[lit_dark], dark.weight[lit_dark], 128**2),
        rtol=0,
        atol=1e-9,
    )
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


@pytest.mark.parametrize("name", BENT)
def test_bent_rays_fall_on_their_cells(name):
    receiver = bent(name)
    rays = pixel_rays(receiver, WIDE, EVERYWHERE)
    assert len(rays.pixel) == 4 * 48 * 64
    assert_grid(rays, receiver)


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
    every = pixel_rays(receiver, WIDE, EVERYWHERE)
    rng = np.random.default_rng(4)
    met = made = 0
    for _ in range(12):
        target, truth = random_scene(rng, math.tan(math.radians(BENT[name][0]) / 2))
        rays = pixel_rays(receiver, WIDE, scene.extent([target], truth))
        hits, all_hits = (scene.cast(r, [target], truth, 1) for r in (rays, every))
        assert np.array_equal(hits.pixel, all_hits.pixel)
        np.testing.assert_allclose(
            hits.rays.direction[hits.ray], all_hits.rays.direction[all_hits.ray], rtol=0, atol=1e-12
        )
        met, made = met + len(all_hits.ray), made + len(rays.pixel)
    assert met > 5000 and made < 1.4 * met


@pytest.mark.parametrize("name", BENT)
def test_nothing_in_a_bent_field_no_rays(name):
    receiver = bent(name)
    far = 1.2 * receiver.field_edge.max()
    for box in ([[far, -0.1], [far + 1, 0.1]], [[-0.1, -far - 1], [0.1, -far]], [[np.inf] * 2, [-np.inf] * 2]):
        low, high = np.array(box)[:, None]
        assert len(pixel_rays(receiver, WIDE, Extent(low, high)).pixel) == 0


@pytest.mark.parametrize("footprint", ["square", "circle"])
@pytest.mark.parametrize("name", BENT)
def test_a_narrow_beam_behind_a_bent_lens_lights_its_area(name, footprint):
    """Solid angles of lit rays sum to the footprint's."""
    receiver = bent(name, rays_per_pixel=16)
    laser = Laser(divergence_deg=0.55 * BENT[name][0], footprint=footprint)
    rays = pixel_rays(receiver, laser, EVERYWHERE)
    x, y = tangents(rays)
    shares = rays.weight * receiver.distortion.area_at_direction(x, y) * receiver.pixel_tangent**2
    t = laser.half_width_tangent
    area = shares[laser.density(x, y) > 0].sum()
    assert area == pytest.approx(math.pi * t * t if footprint == "circle" else 4 * t * t, rel=2e-3)


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
    assert hit > 10_000 and made < 1.6 * hit < 0.8 * before
