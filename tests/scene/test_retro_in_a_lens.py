"""A cube corner's lobe in a lens that is wider than it: what arrives is never more than what was sent back."""

import math

import numpy as np
import pytest
from scipy.special import j0, j1

from rso_lidar.scene import RetroReflector

CUBES = RetroReflector(diameter_mm=10.0, reflectance=0.8, fill_fraction=0.5).at(1064e-9)
APERTURE_M = 0.10475


@pytest.mark.parametrize("range_m", [1.0, 50.0, 400.0, 3000.0, 100_000.0])
def test_the_lens_gathers_no_more_than_the_lobe_holds(range_m):
    """Share of the light sent back that a lens of area A at R gathers: brdf A cos / R² against rho F (1 − J₀² − J₁²)."""
    one = np.array([1.0])
    half = np.arctan(0.5 * APERTURE_M / np.array([range_m]))
    brdf = CUBES.gathered(CUBES.brdf_per_sr(one), np.zeros(1), half)
    share = float(brdf[0]) * math.pi / 4 * APERTURE_M**2 / range_m**2
    x = math.pi * 0.010 / 1064e-9 * float(np.sin(half)[0])
    encircled = 1.0 - j0(x) ** 2 - j1(x) ** 2
    # The tangent stands for the sine: near the lens that is 0.3 %.
    assert share == pytest.approx(0.8 * 0.5 * encircled, rel=5e-3)
    assert share <= 0.4 * (1 + 5e-3)


def test_far_away_nothing_changes():
    one = np.array([1.0])
    brdf = CUBES.brdf_per_sr(one)
    assert CUBES.gathered(brdf, np.zeros(1), np.array([1e-7])) == pytest.approx(brdf, rel=1e-3)


def test_a_lens_beside_the_lobe_sees_its_tail():
    one, sine = np.array([1.0]), np.array([5e-4])
    brdf = CUBES.brdf_per_sr(one, one, np.sqrt(1.0 - sine**2))
    assert CUBES.gathered(brdf, sine, np.array([1e-4])) == pytest.approx(brdf)
