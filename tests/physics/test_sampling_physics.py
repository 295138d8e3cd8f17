"""Sampling of pixels against 4,096 rays per pixel: eight spacecraft of NASA from 0.3 to 3 km, in random attitudes"""

import functools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import optics, sampling
from rso_lidar.scene import build_surface, load_mesh
from tests.optics.bench_for_tests import PAPER_LASER, PAPER_RECEIVER, place, truth_of

CRAFT = {
    "tdrs": 300,
    "cassini": 420,
    "lro": 590,
    "juno": 820,
    "hubble": 1150,
    "kepler": 1600,
    "suomi_npp": 2250,
    "rosetta": 3000,
}
SOURCE = "the same walk with 64 x 64 rays in each pixel"


def pixels_of(shared, name, range_m, receiver):
    """Return the photons of all pixels, and the variance that is said of them."""
    surface = build_surface(name, load_mesh(shared / "meshes" / f"{name}.stl"))
    truth = truth_of(**{name: place((0.0, 0.0, range_m), Rotation.random(random_state=range_m))})
    hits = sampling.cast_pixels(receiver, PAPER_LASER, [surface], truth)
    light = optics.collect(hits, PAPER_LASER, receiver)
    photons = np.bincount(light.pixel, light.photons, receiver.n_rows * receiver.n_cols)
    return photons, hits.photons_variance.ravel()


@functools.cache
def compare(shared, name):
    """Return the light of a craft's pixels, the variance that is said of it, and the true light."""
    got, variance = pixels_of(shared, name, CRAFT[name], PAPER_RECEIVER)
    finest = PAPER_RECEIVER.replace(rays_per_pixel=4096, min_rays_per_target=0)
    return got, variance, pixels_of(shared, name, CRAFT[name], finest)[0]


def squares(got, variance, true):
    """Return the squared error of pixels weighted by light, the true one and the one that is said."""
    lit, total = true > 0.0, true.sum()
    return float(((got - true)[lit] ** 2 / true[lit]).sum() / total), float((variance[lit] / true[lit]).sum() / total)


@pytest.mark.parametrize("name", [pytest.param("tdrs", marks=pytest.mark.slow), *list(CRAFT)[1:]])
def test_the_light_of_pixels_is_known_as_well_as_was_asked_for(name, shared, validation):
    got, variance, true = compare(shared, name)
    lit, total = true > 0.0, true.sum()
    missed = lit & (got == 0.0)
    error = 100.0 * math.sqrt(squares(got, variance, true)[0])
    # Four standard errors of the sum, if pixels are independent with 2 % each, and the bias that docs/physics.md states.
    spread = 800.0 * 0.02 * 0.5 * math.sqrt(float((true**2).sum())) / total + 0.2
    rows = (
        # Twice the error asked for: dim pixels may have a third of their noise, and the number of rays is bounded.
        ("error of a pixel's photons, weighted by light", 0.0, error, 4.0),
        ("light of pixels that no ray meets", 0.0, 100.0 * true[missed].sum() / total, 1.0),
        ("lit pixels that no ray meets", 0.0, 100.0 * missed.sum() / lit.sum(), 5.0),
        ("light of all pixels", 100.0, 100.0 * got.sum() / total, spread),
    )
    for what, expected, found, tolerance in rows:
        numbers = {"expected": expected, "got": found, "tolerance": tolerance, "unit": "%"}
        validation(case=f"{name} at {CRAFT[name]} m: {what}", source=SOURCE, **numbers)


@pytest.mark.slow
def test_the_error_that_labels_say_is_the_true_one(shared, validation):
    true_2, said_2 = np.transpose([squares(*compare(shared, name)) for name in CRAFT])
    ratio = math.sqrt(said_2.sum() / true_2.sum())
    validation(
        case="error that labels say over the true one, all eight",
        source=SOURCE,
        expected=1.0,
        got=ratio,
        tolerance=0.75,  # the label may be too great: contours that other facets hide count as well
        unit="",
    )
    assert ratio > 1.0 / 1.5
