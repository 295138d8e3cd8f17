"""Light of hits and clusters of returns against their oracle in NumPy."""

import numpy as np
import pytest

from rso_lidar.optics import BrownConrady, Laser, Receiver, collect
from rso_lidar.optics.returns.clusters import find_clusters
from rso_lidar.optics.returns.radiometry import return_light
from rso_lidar.records import Hits, Rays
from tests.reference.optics import radiometry as oracle

LENS = Receiver(focal_length_mm=100, f_number=2, n_rows=6, n_cols=5, rays_per_pixel=1)
ARRAYS = ("pixel", "hit", "cluster", "cluster_pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells")


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
    """Return the photons by kernels and by their oracle."""
    return collect(hits, laser, lens), oracle.collect(hits, laser, lens)


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


def test_a_laser_beside_the_lens_agrees_where_it_comes_near():
    """1 nm beside the lens at 300 m nothing changes but rounding."""
    hits, laser = some_hits(300), Laser(divergence_deg=12.0)
    ours = collect(hits, laser.replace(offset_m=(1e-9, 0.0, 0.0)), LENS)
    reference = oracle.collect(hits, laser, LENS)
    lit = reference.photons[ours.hit]
    assert ours.photons == pytest.approx(lit, rel=1e-9)
    assert ours.delay_s == pytest.approx(reference.delay_s[ours.hit], rel=1e-12)
    assert reference.photons.sum() == pytest.approx(ours.photons.sum(), rel=1e-9)


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


def test_each_kernel_is_compiled_for_one_combination_of_types():
    agree(*both(some_hits(50, sunlight=True), Laser(), LENS.replace(filter_width_nm=1.0)))
    agree(*both(some_hits(50), Laser(footprint="circle"), LENS.replace(distortion=BrownConrady(k1=5.0))))
    for kernel in (return_light, find_clusters):
        assert len(kernel.dispatcher.signatures) == 1
