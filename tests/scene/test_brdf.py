import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.scene import Lambertian, Phong


@pytest.mark.parametrize("reflectance", [0.0, 0.3, 1.0])
def test_lambertian_is_equally_bright_and_sends_back_its_reflectance(reflectance):
    """Seed eq. 9; integrated over the hemisphere, rho cos gives the reflectance."""
    brdf = Lambertian(reflectance=reflectance).brdf_per_sr(np.linspace(0, 1, 5))
    assert brdf.tolist() == [reflectance / math.pi] * 5


@pytest.mark.parametrize(
    ("kd", "ks", "n", "tilt_deg", "expected"),
    [
        # Seed eq. 10 by hand: kd/pi + ks (n + 2)/(2 pi) cos^n(2 alpha).
        (0.10, 0.50, 300.0, 0.0, 0.10 / math.pi + 0.50 * 302 / (2 * math.pi)),
        (0.10, 0.50, 2.0, 30.0, 0.10 / math.pi + 0.50 * 4 / (2 * math.pi) * 0.25),
        (0.30, 0.40, 1.0, 20.0, 0.30 / math.pi + 0.40 * 3 / (2 * math.pi) * math.cos(math.radians(40))),
        (0.30, 0.40, 7.0, 45.0, 0.30 / math.pi),  # the lobe points along the surface
        (0.30, 0.40, 6.0, 70.0, 0.30 / math.pi),  # cos(phi) < 0 counts nothing, though n is even
        (0.25, 0.00, 9.0, 10.0, 0.25 / math.pi),
    ],
)
def test_phong_is_equation_10(kd, ks, n, tilt_deg, expected):
    phong = Phong(diffuse=kd, specular=ks, exponent=n)
    assert phong.brdf_per_sr(np.cos(np.array([tilt_deg]) * math.pi / 180))[0] == pytest.approx(expected, rel=1e-9)


def test_a_shiny_facet_that_faces_the_lidar_is_24_per_sr():
    """instrument.md 4.1: (0.10, 0.50, 300) is as bright as a Lambertian reflectance of 76."""
    bright = float(Phong(diffuse=0.1, specular=0.5, exponent=300.0).brdf_per_sr(np.array(1.0)))
    assert bright == pytest.approx(24.06, abs=0.01)
    assert bright * math.pi == pytest.approx(76, abs=0.5)


@pytest.mark.parametrize(("n", "half_width_deg"), [(50, 4.8), (100, 3.4), (300, 1.95), (500, 1.5)])
def test_half_width_of_the_lobe_in_tilt(n, half_width_deg):
    """instrument.md 4.1: 0.5 acos(0.5^(1/n)), half because a tilt turns the mirror's direction by twice as much."""
    shiny = Phong(diffuse=0.0, specular=1.0, exponent=float(n))
    tilt = np.linspace(0, 10, 100_001)
    lobe = shiny.brdf_per_sr(np.cos(tilt * math.pi / 180))
    assert tilt[np.argmax(lobe < 0.5 * lobe[0])] == pytest.approx(half_width_deg, abs=0.06)


@pytest.mark.parametrize("n", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("tilt_deg", [0, 40, 80])
def test_phong_sends_back_no_more_than_it_gets(n, tilt_deg):
    """Hemispherical reflectance of eq. 10 for kd = 0, ks = 1 by summing over the hemisphere: at most 1 at any tilt.

    The class gives the monostatic direction only; its lobe is read off as a function of phi = 2 alpha, and summed about
    the mirror's direction.
    """
    shiny = Phong(diffuse=0.0, specular=1.0, exponent=n)
    theta = (np.arange(800) + 0.5) / 800 * math.pi / 2
    azimuth = (np.arange(400) + 0.5) / 400 * 2 * math.pi
    tilt = tilt_deg * math.pi / 180
    cos_phi = np.cos(theta)[:, None] * math.cos(tilt) + np.sin(theta)[:, None] * math.sin(tilt) * np.cos(azimuth)
    lobe = shiny.brdf_per_sr(np.sqrt(0.5 * (1 + np.clip(cos_phi, 0, 1))))
    cell = (math.pi / 2 / 800) * (2 * math.pi / 400)
    reflected = np.sum(lobe * (np.cos(theta) * np.sin(theta))[:, None]) * cell
    assert reflected <= 1.001  # the sum's own error
    if tilt_deg == 0:
        assert reflected == pytest.approx(1.0, abs=1e-3)


def test_more_light_than_comes_in_is_refused():
    Phong(diffuse=0.5, specular=0.5, exponent=10.0)
    Phong(diffuse=0.1, specular=0.9, exponent=10.0)  # 0.1 + 0.9 in floats
    with pytest.raises(ScenarioError, match="more light than comes in; keep the sum at or below 1"):
        Phong(diffuse=0.6, specular=0.41, exponent=10.0)


@pytest.mark.parametrize(
    "bad",
    [
        lambda: Lambertian(reflectance=1.2),
        lambda: Lambertian(reflectance=-0.1),
        lambda: Phong(diffuse=0.1, specular=0.1, exponent=-1.0),
        lambda: Phong(diffuse=-0.1, specular=0.1, exponent=1.0),
        lambda: Phong(diffuse=0.1, specular=0.1),
    ],
)
def test_materials_that_cannot_be(bad):
    with pytest.raises(ScenarioError):
        bad()
