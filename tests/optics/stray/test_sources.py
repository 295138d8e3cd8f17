"""Elements of the bodies in the sky: what they add up to."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.optics.stray.sources import MOON, SUN, SkyBodies

TOWARD = np.array([0.3, -0.2, 1.0]) / math.sqrt(1.13)


def cap_sr(radius_m, distance_m):
    """Return the solid angle of a ball seen from a distance [sr]."""
    return 2.0 * math.pi * (1.0 - math.sqrt(1.0 - (radius_m / distance_m) ** 2))


def test_elements_of_the_sun_fill_its_disc_with_its_light():
    sky = SkyBodies(1.5e11 * TOWARD, None, None, 1.0, 0.3)
    direction, light, radius_rad = sky.elements(SUN, 0.1, 0.01)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0)
    assert light.sum() == pytest.approx(1.0, rel=1e-12)
    assert math.pi * np.sum(radius_rad**2) == pytest.approx(cap_sr(units.SUN_RADIUS_M, 1.5e11), rel=1e-9)
    assert np.arccos(direction @ TOWARD).max() < units.SUN_RADIUS_M / 1.5e11


def test_half_of_a_moon_in_quadrature_is_lit():
    across = np.array([1.0, 0.0, -0.3]) / math.sqrt(1.09)
    sky = SkyBodies(3.9e8 * TOWARD + 1.5e11 * across, None, 3.9e8 * TOWARD, 1.0, 0.3)
    direction, light, radius_rad = sky.elements(MOON, 0.1, 0.01)
    assert light.sum() == pytest.approx(sky.moon_irradiance, rel=1e-12)
    lit_sr = math.pi * np.sum(radius_rad**2)
    assert lit_sr == pytest.approx(0.5 * cap_sr(units.MOON_RADIUS_M, 3.9e8), rel=2.0 / 32)
    assert ((direction - TOWARD) @ across > -1e-4).all()
