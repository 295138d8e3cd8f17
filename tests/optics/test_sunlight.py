"""The Sun's spectrum about the lasers' lines, against ASTM E490-00a and a black body."""

import numpy as np
import pytest

from rso_lidar.optics import sun_photons_per_s_m2
from rso_lidar.optics.sunlight import sun_irradiance_w_m2_um

# ASTM E490-00a (AM0), as instrument.md section 5 gives it [nm, W m-2 um-1].
E490 = {1060.0: 641.5, 1064.0: 645.9, 1550.0: 271.3, 1570.0: 264.5, 1572.0: 267.3}
H_C = 6.62607015e-34 * 299792458.0  # SI, exact


@pytest.mark.parametrize("nm", E490)
def test_the_table(nm):
    assert sun_irradiance_w_m2_um(nm * 1e-9) == pytest.approx(E490[nm], rel=1e-12)


def test_nothing_jumps_between_lines():
    nm = np.arange(400.0, 2500.0, 0.5)
    value = np.array([sun_irradiance_w_m2_um(at * 1e-9) for at in nm])
    assert np.all(value > 0) and np.abs(np.diff(np.log(value))).max() < 0.006  # E490 itself rises by 0.5 % a nm at 1571


@pytest.mark.parametrize(("nm", "w_m2_um"), [(1064.0, 645.9), (1570.0, 264.5)])
@pytest.mark.parametrize("width_nm", [0.1, 1.0, 10.0])
def test_photons_of_a_band(nm, w_m2_um, width_nm):
    by_hand = w_m2_um * width_nm * 1e-3 / (H_C / (nm * 1e-9))
    assert sun_photons_per_s_m2(nm * 1e-9, width_nm * 1e-9) == pytest.approx(by_hand, rel=1e-9)


def test_the_whole_sun_is_the_solar_constant():
    """Integrated over all wavelengths, the black body scaled to E490 stays within 10 % of 1366.1 W/m² (E490's integral)."""
    um = np.geomspace(0.2, 100, 4000)
    value = np.array([sun_irradiance_w_m2_um(at * 1e-6) for at in um])
    assert np.trapezoid(value, um) == pytest.approx(1366.1, rel=0.1)
