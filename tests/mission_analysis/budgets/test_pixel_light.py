"""The closed form against the traced chain: one facet that faces the lidar and fills a pixel."""

import math

import pytest

from rso_lidar.mission_analysis.budgets.pixel_light import filled_pixel_photons
from rso_lidar.optics import Laser, Receiver
from tests.optics.bench_for_tests import look, place, plate


@pytest.mark.parametrize("footprint", ["square", "circle", "gaussian", "as_printed"])
@pytest.mark.parametrize("range_m", [100.0, 3000.0])
def test_a_filled_pixel_gets_what_the_rays_bring(footprint, range_m):
    receiver, laser = Receiver(fov_deg=2.5, f_number=2.8, n_rows=65, n_cols=65), Laser(footprint=footprint)
    traced = look(plate(0.2 * range_m), place((0, 0, range_m)), receiver, laser).by_pixel[32, 32]
    # Over the middle one of 65 pixels range and cosines vary by 1e-5, a Gaussian beam by 4 / (3 65²) = 3.2e-4.
    assert filled_pixel_photons(laser, receiver, 0.30 / math.pi, range_m) == pytest.approx(traced, rel=3.5e-4)
