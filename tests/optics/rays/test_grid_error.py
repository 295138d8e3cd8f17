"""The error of a fixed grid against its oracle, and where there is none."""

import numpy as np
import pytest

from rso_lidar import optics, scene
from rso_lidar.optics import Receiver
from rso_lidar.optics.rays import grid_error
from tests.optics.bench_for_tests import PAPER_LASER, place, plate, surface, truth_of
from tests.reference.optics import grid_error as oracle

LENS = Receiver(fov_deg=2.5, f_number=2.8, n_rows=16, n_cols=16, rays_per_pixel=25)


def estimate(width_m, range_m, receiver=LENS):
    """Return hits of a plate across the boresight, with the variance of their pixels."""
    one, truth = surface("plate", plate(width_m)), truth_of(plate=place((0.0, 0.0, range_m)))
    rays = optics.pixel_rays(receiver, PAPER_LASER, scene.extent([one], truth))
    hits = scene.cast(rays, [one], truth, 1)
    return optics.estimate_grid_variance(hits, optics.pixel_photons(hits, PAPER_LASER, receiver), receiver)


def test_bends_are_those_of_the_oracle():
    rng = np.random.default_rng(1)
    pixel = np.repeat(np.arange(6, dtype=np.int32), [25, 9, 1, 3, 36, 2])
    side = np.repeat([5, 3, 1, 3, 6, 2], [25, 9, 1, 3, 36, 2])
    first = np.concatenate([np.arange(n) for n in (25, 9, 1, 3, 36, 2)])
    given = pixel, 1.0 / side**2.0, (first % side + 0.5) / side, (first // side + 0.5) / side, rng.uniform(0, 9, 76)
    made, expected = np.zeros(6), np.zeros(6)
    grid_error.sum_squared_bends(*given, made)
    oracle.sum_squared_bends(*given, expected)
    np.testing.assert_allclose(made, expected, rtol=1e-12)
    assert expected[2] == 0.0 < expected[0]


def test_a_plate_that_fills_pixels_is_known_inside_and_uncertain_at_its_rim():
    variance = estimate(12.3, 1000.0).photons_variance
    filled, rim = variance[7:9, 7:9], variance[variance > 0.1 * variance.max()]
    assert filled.max() < 1e-6 * variance.max()
    assert 12 <= len(rim) <= 24


def test_nothing_hit_is_known():
    assert estimate(1.0, -1000.0).photons_variance == pytest.approx(np.zeros((16, 16)))
