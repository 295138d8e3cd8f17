import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser

# SI, 2019: h and c are exact. Written out here, so that a slip in units.py shows.
PHOTON_J = 6.62607015e-34 * 299792458.0 / 1064e-9


def test_photons_of_a_pulse():
    assert Laser().photons == pytest.approx(0.050 / PHOTON_J, rel=1e-12)
    assert Laser().photons == pytest.approx(2.678e17, rel=2e-4)  # four digits, as the design notes give it
    assert Laser(wavelength_nm=1570).photons / Laser().photons == pytest.approx(1570 / 1064, rel=1e-12)


@pytest.mark.parametrize("divergence_deg", [0.05, 2.5, 45.0, 120.0])
@pytest.mark.parametrize(("footprint", "sent"), [("square", 1), ("circle", 1), ("gaussian", 1), ("as_printed", 4)])
def test_density_integrates_to_the_energy_sent(footprint, sent, divergence_deg):
    """Summed in rings and squares by hand: what is printed in the seed sends four times the energy."""
    laser = Laser(divergence_deg=divergence_deg, footprint=footprint)
    t = math.tan(math.radians(divergence_deg) / 2)
    reach = 6 * t if footprint == "gaussian" else t  # a Gaussian has exp(-72) of itself left beyond
    n = 1000
    middle = (np.arange(n) + 0.5) / n
    if footprint in ("square", "as_printed"):
        x = (2 * middle - 1) * reach
        total = laser.density(x[:, None], x[None, :]).sum() * (2 * reach / n) ** 2
    else:
        r = middle * reach
        total = np.sum(laser.density(r * 0.6, r * 0.8) * 2 * math.pi * r) * reach / n
    assert total / laser.photons == pytest.approx(sent, rel=1e-5)


@pytest.mark.parametrize("footprint", ["square", "circle", "as_printed"])
def test_nothing_is_lit_beyond_the_edge(footprint):
    laser = Laser(footprint=footprint)
    t = math.tan(math.radians(1.25))
    x = np.array([0.0, 0.999 * t, -0.999 * t, 1.001 * t, 0.0, 0.999 * t])
    y = np.array([0.0, 0.0, 0.0, 0.0, -1.001 * t, 0.999 * t])
    lit = [True, True, True, False, False, footprint != "circle"]
    assert laser.lit(x, y).tolist() == lit
    assert (laser.density(x, y) > 0).tolist() == lit


def test_gaussian_falls_to_1_over_e2_at_half_the_divergence():
    laser = Laser(footprint="gaussian", divergence_deg=10)
    t = math.tan(math.radians(5))
    assert laser.density(0.6 * t, 0.8 * t) / laser.density(0.0, 0.0) == pytest.approx(math.exp(-2), rel=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        {"wavelength_nm": 0.0},
        {"energy_mj": -1.0},
        {"divergence_deg": 180.0},
        {"divergence_deg": 0.0},
        {"footprint": "ring"},
        {"pulse_fwhm_ns": float("nan")},
        {"energy_mj": float("inf")},
        {"energy_j": 0.05},
    ],
)
def test_a_laser_that_cannot_be(bad):
    with pytest.raises(ScenarioError) as caught:
        Laser(**bad)
    assert next(iter(bad)) in str(caught.value)
    assert "\n" not in str(caught.value)
