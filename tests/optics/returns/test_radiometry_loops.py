"""The loops over hits and over pixels against the NumPy that says the same."""

import numpy as np
import pytest

from rso_lidar import arithmetic
from rso_lidar.optics import BrownConrady, Laser, Receiver, collect
from rso_lidar.records import Hits, Rays

LENS = Receiver(focal_length_mm=100, f_number=2, n_rows=6, n_cols=5, rays_per_pixel=1)
ARRAYS = ("pixel", "hit", "cluster", "cluster_pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells")

pytestmark = pytest.mark.skipif(not arithmetic.compiled(), reason="numba does not run here")


def some_hits(n, seed=1, pixels=30, apart_m=2.0, sunlight=False):
    """Return hits on facets that face, lean, lie edge-on or in shadow, at a few depths with gaps between."""
    rng = np.random.default_rng(seed)
    pixel = np.sort(rng.integers(0, pixels, n)).astype(np.int32)
    toward = np.stack([rng.uniform(-0.05, 0.05, n), rng.uniform(-0.05, 0.05, n), np.ones(n)], axis=1)
    cosine = rng.choice([1.0, 0.7, 0.3, 1e-5, 0.0], n) * rng.uniform(0.9, 1.0, n)
    weight = rng.choice([1 / 4, 1 / 16, 1 / 64], n)
    rays = Rays(LENS.shape, toward / np.linalg.norm(toward, axis=1, keepdims=True), pixel, weight)
    return Hits(
        rays=rays,
        ray=np.arange(n),
        pixel=pixel,
        weight=weight,
        target=rng.integers(0, 3, n),
        facet=rng.integers(0, 99, n),
        part=rng.integers(0, 2, n),
        range_m=300.0 + apart_m * rng.integers(0, 4, n) + rng.uniform(0.0, 0.5, n),
        cos_incidence=cosine,
        brdf_per_sr=rng.choice([0.0, 0.1, 0.3], n),
        sunlight_per_sr=rng.uniform(0.0, 0.2, n) if sunlight else None,
    )


def both(hits, laser, lens):
    """Return the photons by loops and by NumPy."""
    with arithmetic.using("numpy"):
        reference = collect(hits, laser, lens)
    return collect(hits, laser, lens), reference


def agree(ours, reference):
    """Whole numbers exactly, the rest to rounding: some ten operations of 2e-16 each."""
    for name in ARRAYS:
        mine, theirs = getattr(ours, name), getattr(reference, name)
        assert mine.dtype == theirs.dtype
        if mine.dtype.kind == "i":
            assert np.array_equal(mine, theirs), name
        else:
            assert mine == pytest.approx(theirs, rel=1e-14, abs=0.0), name
    for name in ("filled_fraction", "background_photons_per_s"):
        mine, theirs = getattr(ours, name), getattr(reference, name)
        assert (mine is None) == (theirs is None)
        assert mine is None or mine == pytest.approx(theirs, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian", "as_printed"])
@pytest.mark.parametrize("divergence_deg", [3.0, 12.0])  # of 5.7 x 6.9 degrees: some hits lie beside the narrow beam
@pytest.mark.parametrize("lens", [{}, {"distortion": BrownConrady(k1=5.0)}, {"filter_width_nm": 1.0}], ids=str)
def test_light_of_hits(footprint, divergence_deg, lens):
    hits = some_hits(700, sunlight=True)
    laser = Laser(footprint=footprint, divergence_deg=divergence_deg)
    ours, reference = both(hits, laser, LENS.replace(**lens))
    agree(ours, reference)
    beside = np.mean(reference.photons == 0.0) - np.mean(hits.brdf_per_sr * hits.cos_incidence == 0.0)
    if footprint in ("square", "circle") and not lens:
        assert (beside > 0.3) == (divergence_deg == 3.0)


def test_a_laser_beside_the_lens_goes_the_numpy_way():
    agree(*both(some_hits(300), Laser(divergence_deg=12.0, offset_m=(0.3, 0.0, 0.0)), LENS))


@pytest.mark.parametrize("n", [0, 1, 2])
def test_next_to_no_hits(n):
    agree(*both(some_hits(n), Laser(), LENS))


@pytest.mark.parametrize(("n", "pixels"), [(2000, 30), (2000, 1), (33, 1), (300, 2)])
def test_clusters_of_pixels_that_hold_much(n, pixels):
    """One pixel with thousands of returns at four depths, too: a small target far away."""
    ours, reference = both(some_hits(n, seed=n, pixels=pixels, apart_m=40.0), Laser(), LENS)
    agree(ours, reference)
    assert len(reference.cluster_pixel) >= 3 * len(np.unique(reference.pixel)) - 1


def test_returns_at_equal_depths_keep_their_order():
    hits = some_hits(400, pixels=3, apart_m=0.0)
    equal = Hits(**{**vars(hits), "range_m": np.repeat([300.0, 340.0], 200), "cos_incidence": np.ones(400)})
    ours, reference = both(equal, Laser(), LENS)
    agree(ours, reference)


def test_each_loop_is_compiled_for_one_combination_of_types():
    from rso_lidar.optics.returns import radiometry_loops as loops

    agree(*both(some_hits(50, sunlight=True), Laser(), LENS.replace(filter_width_nm=1.0)))
    agree(*both(some_hits(50), Laser(footprint="circle"), LENS.replace(distortion=BrownConrady(k1=5.0))))
    for loop in (loops.returned, loops.clusters):
        assert len(loop.signatures) == 1
