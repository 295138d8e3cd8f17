"""Light of second bounces on the focal plane: where it lands, in which order, and what it leaves as it was."""

from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.optics import BrownConrady, GaussianPsf, Laser, Receiver, collect
from rso_lidar.optics.returns.bounced import find_near_hits
from rso_lidar.records import specs
from rso_lidar.scene import label
from tests.optics.bench_for_tests import corner, look, place
from tests.reference.optics import bounced as reference

LENS = Receiver(fov_deg=3.0, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=16)
LASER = Laser(divergence_deg=3.0)


def seen(receiver=LENS, laser=LASER, paths=20_000):
    return look(corner(), place((0, 0, 100.0)), receiver, laser, paths=paths)


def test_near_hits_are_those_of_python():
    rng = np.random.default_rng(4)
    hit_pixel = np.sort(rng.integers(0, 12, 60))
    begins = np.searchsorted(hit_pixel, np.arange(14))
    ray, along = rng.permutation(60), rng.normal(size=(3, 60))
    pixel, direction = rng.integers(-1, 13, 200), rng.normal(size=(3, 200))
    got = find_near_hits(pixel, direction, begins, ray, along)
    np.testing.assert_array_equal(got, reference.find_near_hits(pixel, direction, begins, ray, along))
    assert (got == -1).any()


def test_light_of_the_hits_stays_as_it_is():
    once, twice = seen(paths=None), seen()
    photons = twice.photons
    assert len(photons.pixel) > len(once.photons.pixel) and (np.diff(photons.pixel) >= 0).all()
    # In each pixel the returns of the hits come first, unchanged and in their order.
    rank = np.arange(len(photons.pixel)) - np.searchsorted(photons.pixel, photons.pixel)
    count = np.bincount(once.photons.pixel, minlength=256)
    first = rank < count[photons.pixel]
    for name in ("pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells", "hit"):
        np.testing.assert_array_equal(getattr(photons, name)[first], getattr(once.photons, name))
    added = ~first
    assert (photons.photons[added] > 0.0).all()
    np.testing.assert_array_equal(photons.pixel[added], twice.hits.pixel[photons.hit[added]])
    assert np.nansum(twice.labels.filled_fraction) == np.nansum(once.labels.filled_fraction)


def test_light_is_late_by_the_way_between_the_surfaces():
    """The inner walls of a right angle send light back as if from the edge: no path is longer than the longest by it."""
    made = seen()
    bounces = made.bounces
    first_m = made.hits.range_m[bounces.hit]
    point = made.rays.direction[made.hits.ray[bounces.hit]] * first_m[:, None]
    there = bounces.direction * bounces.range_m[:, None]
    np.testing.assert_allclose(bounces.between_m, np.linalg.norm(there - point, axis=1), atol=1e-9)
    half_m = 0.5 * (first_m + bounces.between_m + bounces.range_m)
    delay_m = made.photons.delay_s * 149_896_229.0
    assert delay_m.max() <= half_m.max() + 1e-9
    assert half_m.min() > made.hits.range_m.min()


def test_speckle_of_bright_surfaces_is_hardly_smoother():
    """Two patterns add cells in proportion to their light, so that the contrast is that of the brighter one."""
    once, twice = seen(paths=None), seen()
    more = twice.photons.coherence_cells.sum() / once.photons.coherence_cells.sum() - 1.0
    light = twice.by_pixel.sum() / once.by_pixel.sum() - 1.0
    assert 0.3 * light < more < 1.5 * light


def test_a_dark_facet_shows_the_light_of_its_neighbour():
    """A narrow beam lights one plate; the other sends on what it gets, into pixels without rays of their own."""
    narrow = LASER.replace(divergence_deg=0.8, offset_m=(0.0, 0.0, 0.0))
    at = look(corner() + np.array([0.75, 0.0, 0.0]), place((0, 0, 100.0)), LENS, narrow, paths=40_000)
    lit = np.bincount(at.hits.pixel, minlength=256) > 0
    by_pixel = at.by_pixel.ravel()
    assert not lit.all() and (by_pixel[~lit] > 0.0).sum() > 20
    labels = label(at.hits, at.photons)
    assert (labels.target.ravel()[by_pixel > 0.0] == 0).all()


def test_a_lens_spreads_the_light_of_both_bounces():
    sharp, blurred = seen(), seen(LENS.replace(psf=GaussianPsf(sigma_um=60.0)))
    assert blurred.by_pixel.sum() == pytest.approx(sharp.by_pixel.sum(), rel=2e-3)
    assert len(np.unique(blurred.photons.pixel)) > len(np.unique(sharp.photons.pixel))


def test_a_lens_that_distorts_finds_the_pixel():
    bent = LENS.replace(distortion=BrownConrady(k1=-50.0))
    straight, curved = (seen(receiver, paths=60_000) for receiver in (LENS, bent))
    once = [seen(receiver, paths=None) for receiver in (LENS, bent)]
    share = [two.by_pixel.sum() / one.by_pixel.sum() for one, two in zip(once, (straight, curved), strict=True)]
    assert share[1] == pytest.approx(share[0], rel=5e-3)


def test_no_paths_change_nothing():
    made = seen(paths=10)
    none = replace(made.bounces, **{name: getattr(made.bounces, name)[:0] for name in specs(type(made.bounces))})
    some, off = collect(made.hits, LASER, LENS, bounces=none), collect(made.hits, LASER, LENS)
    np.testing.assert_array_equal(some.photons, off.photons)


def test_a_scene_of_half_the_size_at_half_the_range_sends_the_same_share_of_its_light_twice():
    """Both bounces fall off with the square of what is halved, also nearer than a metre to the lens."""
    centred = LASER.replace(offset_m=(0.0, 0.0, 0.0))
    shares = []
    for range_m in (1.5, 0.75):
        at = [look(corner(0.03 * range_m), place((0, 0, range_m)), LENS, centred, paths=n) for n in (None, 20_000)]
        shares.append(at[1].by_pixel.sum() / at[0].by_pixel.sum())
    assert shares[0] > 1.05
    assert shares[1] == pytest.approx(shares[0], rel=1e-9)
