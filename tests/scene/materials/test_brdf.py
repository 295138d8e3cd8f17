import math

import numpy as np
import pytest
from pydantic import TypeAdapter

from rso_lidar.errors import ScenarioError
from rso_lidar.scene import AnyMaterial, ByWavelength, Ggx, Lambertian, OrenNayar, Phong, RetroReflector, TableBrdf

CUBES = RetroReflector(diameter_mm=12.7, reflectance=0.9, fill_fraction=0.5)


@pytest.mark.parametrize("reflectance", [0.0, 0.3, 1.0])
def test_lambertian_is_equally_bright_and_sends_back_its_reflectance(reflectance):
    """Fuller et al., eq. 9; integrated over the hemisphere, rho cos gives the reflectance."""
    brdf = Lambertian(reflectance=reflectance).brdf_per_sr(np.linspace(0, 1, 5))
    assert brdf.tolist() == [reflectance / math.pi] * 5


@pytest.mark.parametrize(
    ("kd", "ks", "n", "tilt_deg", "expected"),
    [
        # Fuller et al., eq. 10 by hand: kd/pi + ks (n + 2)/(2 pi) cos^n(2 alpha).
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
    with pytest.raises(ScenarioError, match="which is more than the incident light; keep the sum at or below 1"):
        Phong(diffuse=0.6, specular=0.41, exponent=10.0)


@pytest.mark.parametrize(
    "bad",
    [
        lambda: Lambertian(reflectance=1.2),
        lambda: Lambertian(reflectance=-0.1),
        lambda: Phong(diffuse=0.1, specular=0.1, exponent=-1.0),
        lambda: Phong(diffuse=-0.1, specular=0.1, exponent=1.0),
        lambda: Phong(diffuse=0.1, specular=0.1),
        lambda: OrenNayar(reflectance=1.1, roughness_deg=10.0),
        lambda: OrenNayar(reflectance=0.5, roughness_deg=-1.0),
        lambda: Ggx(diffuse=0.0, specular=0.5, roughness=0.0),
        lambda: Ggx(diffuse=0.0, specular=0.5, roughness=1.5),
        lambda: RetroReflector(diameter_mm=0.0, reflectance=0.9, fill_fraction=0.5),
        lambda: RetroReflector(diameter_mm=10.0, reflectance=0.9, fill_fraction=0.5, refractive_index=0.9),
        lambda: TableBrdf(incidence_deg=(0.0, 91.0), measured_per_sr=(0.1, 0.1)),
        lambda: TableBrdf(incidence_deg=(0.0, math.nan), measured_per_sr=(0.1, 0.1)),
        lambda: TableBrdf(incidence_deg=(0.0, 90.0), measured_per_sr=(0.1, math.nan)),
        lambda: TableBrdf(incidence_deg=(0.0, 90.0), measured_per_sr=(0.1, -0.1)),
        lambda: ByWavelength(wavelength_nm=(-5.0,), materials=(Lambertian(),)),
    ],
)
def test_materials_that_cannot_be(bad):
    with pytest.raises(ScenarioError):
        bad()


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (
            lambda: Ggx(diffuse=0.6, specular=0.5, roughness=0.3),
            "diffuse . specular is 1.1, which is more than the incident light; keep",
        ),
        (
            lambda: OrenNayar(reflectance=1.0, roughness_deg=11.0),
            "reflects more than the incident light at grazing incidence; keep reflectance at or below 0.98",
        ),
        (
            lambda: RetroReflector(diameter_mm=10.0, reflectance=0.9, fill_fraction=0.5, diffuse=0.6),
            "reflectance x fill_fraction . diffuse is 1.05, which is more than the incident light; keep the sum at",
        ),
        (
            lambda: TableBrdf(incidence_deg=(0.0, 90.0), measured_per_sr=(1.0, 1.0)),
            "the table reflects 3.14. of the light that is incident at .* deg; check its unit",
        ),
        (lambda: TableBrdf(incidence_deg=(0.0, 9.0, 3.0), measured_per_sr=(0.1, 0.1, 0.1)), "does not ascend; sort"),
        (lambda: TableBrdf(incidence_deg=(0.0, 9.0, 9.0), measured_per_sr=(0.1, 0.1, 0.1)), "does not ascend; sort"),
        (lambda: TableBrdf(incidence_deg=(0.0, 9.0), measured_per_sr=(0.1,)), "2 angles and 1 values; give"),
        (lambda: TableBrdf(incidence_deg=(), measured_per_sr=()), "at least two"),
        (lambda: ByWavelength(wavelength_nm=(1064.0, 1570.0), materials=(Lambertian(),)), "2 wavelengths and 1 mat"),
        (lambda: ByWavelength(wavelength_nm=(), materials=()), "at least one"),
        (lambda: ByWavelength(wavelength_nm=(532.0, 532.0), materials=(Lambertian(), CUBES)), "occurs twice"),
        (
            lambda: CUBES.brdf_per_sr(np.ones(1)),
            "retro_reflector: its lobe depends on the wavelength; set it by at",
        ),
        (
            lambda: ByWavelength(wavelength_nm=(532.0,), materials=(CUBES,)).brdf_per_sr(np.ones(1)),
            "by_wavelength: needs a wavelength for its BRDF; select",
        ),
    ],
)
def test_a_refusal_says_why_and_what_to_do(bad, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        bad()
    assert "\n" not in str(caught.value)


def test_phong_toward_the_mirror_s_direction():
    """Lafortune and Willems 1994: the lobe stands about the mirror's direction, wherever the viewer is."""
    shiny = Phong(diffuse=0.1, specular=0.5, exponent=40.0)
    tilt, off = 50 * math.pi / 180, np.array([0.0, 5.0, 20.0]) * math.pi / 180
    in_plane = shiny.brdf_per_sr(np.full(3, math.cos(tilt)), np.cos(tilt + off), np.cos(2 * tilt + off))
    assert in_plane == pytest.approx(0.1 / math.pi + 0.5 * 42 / (2 * math.pi) * np.cos(off) ** 40, rel=1e-9)


def test_a_table_gives_back_what_was_measured():
    """Monostatic, the table itself, linear between its angles; of two directions it is read at the half-way angle."""
    table = TableBrdf(incidence_deg=(10.0, 20.0, 60.0), measured_per_sr=(0.3, 0.2, 0.1))
    angle = np.array([0.0, 10.0, 15.0, 20.0, 30.0, 60.0, 80.0]) * math.pi / 180
    assert table.brdf_per_sr(np.cos(angle)) == pytest.approx([0.3, 0.3, 0.25, 0.2, 0.175, 0.1, 0.1], rel=1e-9)
    apart = 12 * math.pi / 180  # light at 15 + 12 degrees, viewer at 15 - 12
    both = table.brdf_per_sr(np.cos(angle[2] + apart), np.cos(angle[2] - apart), np.array(math.cos(2 * apart)))
    assert both == pytest.approx(0.25, rel=1e-9)


def test_the_laser_s_wavelength_chooses():
    chosen = ByWavelength(wavelength_nm=(1064.0, 1570.0), materials=(Lambertian(reflectance=0.2), CUBES))
    assert chosen.at(1064e-9) == Lambertian(reflectance=0.2)
    assert chosen.at(1030e-9) == Lambertian(reflectance=0.2)
    assert chosen.at(1550e-9) == CUBES.replace(wavelength_nm=1550.0)
    with pytest.raises(ScenarioError, match=r"no material within 5 % of 532 nm \(known: 1064, 1570\); add one for it"):
        chosen.at(532e-9)
    assert Lambertian().at(532e-9) == Lambertian()


def test_every_material_is_written_and_read_as_a_table():
    adapter = TypeAdapter(AnyMaterial)
    for material in (
        OrenNayar(reflectance=0.5, roughness_deg=20.0),
        Ggx(diffuse=0.1, specular=0.5, roughness=0.2),
        CUBES,
        TableBrdf(incidence_deg=(0.0, 90.0), measured_per_sr=(0.1, 0.2)),
        ByWavelength(wavelength_nm=(1064.0,), materials=(CUBES,)),
    ):
        table = material.model_dump(exclude_none=True)
        assert adapter.validate_python(table) == material
