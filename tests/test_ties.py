"""Choices between equal numbers: moved by 1e-12 to either side, what is chosen stays."""

import numpy as np
import pytest

from rso_lidar.optics import GaussianPsf, Receiver
from rso_lidar.scene import Crinkled
from rso_lidar.scene.casting.cast import _disc
from rso_lidar.scene.surfaces.examination import _median
from tests.optics.bench_for_tests import PAPER_LASER, place, plate, see, surface, truth_of

DIRECTIONS = [(0, 0, 1), (1, 0, 0), (0, -1, 0), (1, 1, 0), (1, -1, 1), (0, 1, 1)]  # of which two components are equal


def moved(values, seed):
    return np.asarray(values, dtype=float) + 1e-12 * np.random.default_rng(seed).uniform(-1.0, 1.0, np.shape(values))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_crinkled_facet_tilts_alike(direction):
    normal = np.repeat(np.array(direction, dtype=float)[:, None] / np.linalg.norm(direction), 50, axis=1)
    point = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 50))
    foil = Crinkled(diffuse=0.1, specular=0.7, exponent=40.0, tilt_deg=8.0, cell_mm=20.0)
    first = foil.tilt_normals(normal, point)
    assert np.abs(first - normal).max() > 0.05
    for seed in range(8):
        assert np.abs(foil.tilt_normals(moved(normal, seed), point) - first).max() < 1e-10


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_points_on_the_sun_s_disc_stay(direction):
    to_sun = np.array(direction, dtype=float) / np.linalg.norm(direction)
    for seed in range(8):
        assert np.abs(_disc(moved(to_sun, seed)) - _disc(to_sun)).max() < 1e-10


def test_the_middle_of_a_symmetric_mesh_stays():
    """Half the weight lies on either side: rounding says which side the median falls to."""
    rising, weight = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([0.1, 0.3, 0.3, 0.1])
    for seed in range(8):
        assert _median(rising, moved(weight, seed)) == -1.0
    assert _median(rising, np.array([0.1, 0.1, 0.3, 0.1])) == 1.0


@pytest.mark.parametrize("psf", [None, GaussianPsf(sigma_um=20.0)], ids=["sharp", "lens"])
def test_a_symmetric_craft_shows_the_same_facets(psf):
    """Four equal panels about the boresight lie in one pixel: rounding does not choose which one its label names."""
    # a pixel is 0.33 m wide
    lens = Receiver(focal_length_mm=300, f_number=2.8, n_rows=3, n_cols=3, rays_per_pixel=256, psf=psf)
    quarter = plate(0.077, 0.041) + np.array([0.063, 0.037, 0.0])
    four = np.concatenate([quarter * [x, y, 1.0] for x in (1.0, -1.0) for y in (1.0, -1.0)])
    part = np.repeat(np.arange(4, dtype=np.int16), 2)

    def labels(craft):
        target = surface("craft", craft, part=part, part_names=("a", "b", "c", "d"))
        return see(target, truth_of(craft=place((0.0, 0.0, 1000.0))), lens, PAPER_LASER).labels

    first = labels(four)
    assert first.photons[1, 1] > 0.0 and np.sum(first.part >= 0) >= 1
    for seed in range(4):
        again = labels(moved(four, seed))
        for name in ("target", "part", "facet"):
            assert np.array_equal(getattr(again, name), getattr(first, name)), name
        assert np.allclose(again.cos_incidence, first.cos_incidence, rtol=0.0, atol=1e-6, equal_nan=True)
