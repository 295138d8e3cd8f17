"""Hits and light of several epochs, averaged over the pulses of a frame."""

from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import optics
from rso_lidar.errors import RecordError
from rso_lidar.optics import assign_pulses, average_pulses
from rso_lidar.records import Hits, Rays

LASER = rl.Laser(divergence_deg=2.0)
LENS = rl.Receiver(fov_deg=2.0, n_rows=2, n_cols=2, aperture_mm=50.0)


def see(pixel, range_m, weight=0.25, sun=None):
    """Return one hit for each pixel given, of rays that go through the middles of these pixels."""
    n = len(pixel)
    axes = LENS.line_of_sight.reshape(-1, 3)
    hits = Hits(
        rays=Rays(LENS.shape, axes[np.repeat(pixel, 2)], np.repeat(pixel, 2), np.full(2 * n, weight)),
        ray=2 * np.arange(n),  # every other ray meets nothing
        pixel=np.array(pixel),
        weight=np.full(n, weight),
        target=np.zeros(n, int),
        facet=np.arange(n),
        part=np.zeros(n, int),
        range_m=np.full(n, range_m),
        cos_incidence=np.ones(n),
        brdf_per_sr=np.full(n, 0.1),
        sunlight_per_sr=None if sun is None else np.full(n, sun),
    )
    return hits, optics.collect(hits, LASER, LENS)


@pytest.mark.parametrize(("pulses", "epochs"), [(1, 1), (7, 3), (100, 64), (64, 64)])
def test_pulses_are_assigned_in_even_runs(pulses, epochs):
    assigned = assign_pulses(pulses, epochs)
    counts = np.bincount(assigned)
    assert len(counts) == epochs and counts.sum() == pulses and np.ptp(counts) <= 1
    assert np.all(np.diff(assigned) >= 0)


def test_one_epoch_is_what_it_was():
    one = see([0, 2], 90.0)
    assert average_pulses([one], 5)[1] is one[1]


def test_the_mean_pulse_of_three():
    """Of three pulses the first two see pixels 0 and 2, the third pixels 2 and 3 from nearer."""
    seen = [see([0, 2], 90.0), see([2, 3], 80.0)]
    hits, light = average_pulses(seen, 3)
    (_, first), (_, last) = seen
    assert hits.rays.pixel.tolist() == [0, 0, 2, 2, 2, 2, 3, 3]
    assert np.array_equal(hits.rays.pixel[hits.ray], hits.pixel) and np.all(np.diff(hits.ray) > 0)
    assert hits.range_m.tolist() == [90.0, 90.0, 80.0, 80.0]
    np.testing.assert_allclose(hits.weight, np.array([2.0, 2.0, 1.0, 1.0]) / 3.0 * 0.25, rtol=1e-15)
    assert light.pixel.tolist() == [0, 2, 2, 3] and light.epoch.tolist() == [0, 0, 1, 1]
    assert light.pulse_epoch.tolist() == [0, 0, 1]
    np.testing.assert_allclose(hits.range_m[light.hit], light.delay_s * rl.units.RANGE_PER_DELAY_M_S, rtol=1e-15)
    expected = np.concatenate([first.photons * 2.0 / 3.0, last.photons / 3.0])
    np.testing.assert_allclose(light.photons, expected, rtol=1e-15)
    assert len(light.cluster_pixel) == 4 and light.cluster.tolist() == [0, 2, 1, 3]  # 80 m before 90 m


def test_each_pulse_sees_its_own_light():
    seen = [see([0, 2], 90.0), see([2, 3], 80.0)]
    _, light = average_pulses(seen, 3)
    pulses = list(light.split_pulses(3))
    for made, (_, given) in zip(pulses, (seen[0], seen[0], seen[1]), strict=True):
        assert made.epoch is None and made.pixel.tolist() == given.pixel.tolist()
        np.testing.assert_allclose(made.photons, given.photons, rtol=1e-14)
        assert np.array_equal(made.delay_s, given.delay_s)
    with pytest.raises(RecordError, match="is light of 3 pulses and the detector takes 5"):
        list(light.split_pulses(5))
    assert [one is seen[0][1] for one in seen[0][1].split_pulses(2)] == [True, True]


def test_sunlight_is_a_mean():
    hits, light = see([0, 2], 90.0, sun=0.1)
    images = [replace(light, background_photons_per_s=np.full((2, 2), rate)) for rate in (3.0, 9.0)]
    _, mean = average_pulses([(hits, images[0]), (hits, images[1])], 2)
    np.testing.assert_allclose(mean.background_photons_per_s, 6.0)


def test_variance_of_hits_and_light_is_that_of_a_mean():
    """Two of three pulses at one epoch: of n epochs √n have errors of their own, of the hits as of their light."""
    seen = []
    for pixel, variance in (([0, 2], 9.0), ([2, 3], 36.0)):
        hits, _ = see(pixel, 90.0)
        hits = replace(hits, photons_variance=np.full((2, 2), variance))
        seen.append((hits, optics.collect(hits, LASER, LENS)))
    hits, mean = average_pulses(seen, 3)
    for known in (hits.photons_variance, mean.photons_variance):
        independent = (2.0 / 3.0) ** 2 * 9.0 + (1.0 / 3.0) ** 2 * 36.0
        np.testing.assert_allclose(known, independent * np.sqrt(2.0), rtol=1e-14)
