"""The labels as a loop against the NumPy that says the same: the very same labels, ties included."""

import dataclasses
from unittest import mock

import numpy as np
import pytest

from rso_lidar.records import Hits, Labels, Photons, Rays
from rso_lidar.scene import label, labels
from rso_lidar.units import RANGE_PER_DELAY_M_S
from tests.reference.scene.labels import label_pixels

SHAPE = (6, 5)


def flash(n, seed=1, pixels=30, shades=3, filled=False, spilt=False):
    """Return hits and photons with few different values, so that clusters, parts and returns tie often; some are black."""
    rng = np.random.default_rng(seed)
    pixel = np.sort(rng.integers(0, pixels, n)).astype(np.int32)
    weight = rng.choice([0.25, 0.125], n)
    hits = Hits(
        rays=Rays(SHAPE, np.tile([0.0, 0.0, 1.0], (n, 1)), pixel, weight),
        ray=np.arange(n),
        pixel=pixel,
        weight=weight,
        target=rng.integers(0, 3, n),
        facet=np.arange(n),
        part=rng.integers(0, 3, n),
        range_m=np.full(n, 300.0),
        cos_incidence=rng.random(n),
        brdf_per_sr=np.full(n, 0.1),
    )
    within = rng.integers(0, 4, n)  # clusters, in no order among the returns of a pixel
    key = pixel.astype(np.int64) * 4 + within
    known, cluster = np.unique(key, return_inverse=True)
    photons = rng.integers(0, shades, n).astype(float)
    photons[np.isin(pixel, [2, 3, 7])] = 0.0
    photons[(pixel == 4) & (within == 0)] = 0.0
    return hits, Photons(
        shape=SHAPE,
        pulse_fwhm_s=8e-9,
        pulse_step_s=1e-10,
        late_s=0.0,
        pulse_power_per_s=np.ones(3),
        pixel=pixel,
        delay_s=2e-6 + 1e-7 * within + rng.uniform(0, 1e-9, n),
        photons=photons,
        depth_spread_s=np.zeros(n),
        coherence_cells=np.ones(n),
        hit=rng.permutation(n) if spilt else np.arange(n),
        cluster=cluster,
        cluster_pixel=known // 4,
        filled_fraction=rng.random(SHAPE) if filled else None,
    )


def agree(hits, photons, max_returns=1):
    """Return the labels, the very same by both ways."""
    with mock.patch.object(labels, "_write_labels", label_pixels):
        reference = label(hits, photons, max_returns)
    ours = label(hits, photons, max_returns)
    for field in dataclasses.fields(Labels):
        mine, theirs = getattr(ours, field.name), getattr(reference, field.name)
        assert (mine is None) == (theirs is None), field.name
        assert mine is None or np.array_equal(mine, theirs, equal_nan=mine.dtype.kind == "f"), field.name
    return ours


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("shades", [2, 3, 1000])
@pytest.mark.parametrize("n", [40, 600])
def test_the_very_same_labels(n, shades, seed):
    made = agree(*flash(n, seed, shades=shades, filled=seed % 2 == 0, spilt=seed % 3 == 0), max_returns=1 + seed % 4)
    assert made.cluster_count.max() >= 2


def test_clusters_with_next_to_no_light_are_not_counted():
    """Three clusters in a pixel with 1998 photons: the nearest has a thousandth of the light or a little less."""
    hits, photons = flash(3, pixels=1)
    for faint, count in ((2.0, 3), (1.99, 2), (0.0, 2)):
        three = dataclasses.replace(
            photons,
            photons=np.array([faint, 998.0, 1000.0]),
            delay_s=2e-6 + 1e-7 * np.arange(3),
            cluster=np.arange(3),
            cluster_pixel=np.zeros(3, np.int32),
        )
        made = agree(hits, three, 3)
        assert made.cluster_count[0, 0] == count
        assert made.photons[0, 0] == pytest.approx(1998.0 + faint)
        kept = np.arange(3 - count, 3)
        range_m = three.delay_s[kept] * RANGE_PER_DELAY_M_S
        assert made.first_range_m[0, 0] == range_m[0]
        assert made.return_range_m[0, 0, :count] == pytest.approx(range_m, rel=1e-15)
        assert made.return_photons[0, 0].tolist() == [*three.photons[kept], *[0.0] * (3 - count)]


@pytest.mark.parametrize("seed", range(6))
def test_equal_returns_moved_by_rounding_leave_the_labels_alone(seed):
    """Clusters, parts and returns tie often. Light and area move by 1e-12, and the returns of a pixel are shuffled."""
    hits, photons = flash(600, seed, shades=2 + seed % 2, spilt=seed % 3 == 0)
    known = agree(hits, photons)
    rng = np.random.default_rng(seed)

    def moved(values):
        return values * (1.0 + 1e-12 * rng.uniform(-1.0, 1.0, len(values)))

    for _ in range(3):
        order = np.lexsort((rng.random(600), photons.pixel))
        others = {
            name: getattr(photons, name)[order] for name in ("pixel", "delay_s", "hit", "cluster", "depth_spread_s")
        }
        light = dataclasses.replace(photons, photons=moved(photons.photons[order]), **others)
        again = agree(dataclasses.replace(hits, weight=moved(hits.weight)), light)
        for name in ("target", "part", "facet", "cos_incidence", "cluster_count"):
            assert np.array_equal(getattr(again, name), getattr(known, name), equal_nan=True), name
        assert np.allclose(again.range_m, known.range_m, rtol=1e-11, equal_nan=True)


@pytest.mark.parametrize("n", [0, 1])
@pytest.mark.parametrize("max_returns", [1, 3])
def test_next_to_nothing(n, max_returns):
    made = agree(*flash(n), max_returns)
    assert np.sum(made.target >= 0) == n


def test_more_clusters_than_a_byte_counts():
    hits, photons = flash(300, pixels=1)
    many = dataclasses.replace(
        photons,
        photons=1.0 + np.arange(300) % 3,
        delay_s=2e-6 + 1e-7 * np.arange(300),
        cluster=np.arange(300),
        cluster_pixel=np.zeros(300, np.int32),
    )
    assert agree(hits, many).cluster_count[0, 0] == 255


def test_each_loop_is_compiled_for_one_combination_of_types():
    agree(*flash(50))
    agree(*flash(50, filled=True, spilt=True))
    for loop in (labels.sum_weights, labels.label_pixels):
        assert len(loop.dispatcher.signatures) == 1
