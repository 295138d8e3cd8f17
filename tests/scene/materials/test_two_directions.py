"""BRDFs between two directions, worked out from vectors; no two cosines are alike, so none can take the place of another."""

import math

import numpy as np
import pytest
from scipy.special import j1

from rso_lidar.scene import Ggx, OrenNayar, Phong, RetroReflector, TableBrdf

NORMAL = np.array([0.0, 0.0, 1.0])


def unit(zenith_deg, azimuth_deg):
    zenith, azimuth = math.radians(zenith_deg), math.radians(azimuth_deg)
    return np.array([math.sin(zenith) * math.cos(azimuth), math.sin(zenith) * math.sin(azimuth), math.cos(zenith)])


PAIRS = [
    (unit(20.0, 10.0), unit(50.0, 195.0)),  # near the mirror's side
    (unit(65.0, -30.0), unit(25.0, 15.0)),
    (unit(10.0, 0.0), unit(70.0, 120.0)),
    (unit(72.0, 5.0), unit(60.0, -20.0)),  # both slanting, on one side
]


def told(material, light, viewer):
    """Return the BRDF that a material says of two directions."""
    cosines = (np.array([light @ NORMAL]), np.array([viewer @ NORMAL]), np.array([light @ viewer]))
    return float(material.brdf_per_sr(*cosines)[0])


@pytest.mark.parametrize(("light", "viewer"), PAIRS)
def test_phong_is_bright_about_the_mirrors_direction(light, viewer):
    mirror = 2.0 * (light @ NORMAL) * NORMAL - light
    expected = 0.2 / math.pi + 0.6 * 8.0 / (2.0 * math.pi) * max(mirror @ viewer, 0.0) ** 6.0
    assert told(Phong(diffuse=0.2, specular=0.6, exponent=6.0), light, viewer) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("light", "viewer"), PAIRS)
def test_ggx_is_walters_and_schlicks(light, viewer):
    """D by eq. 33, G₁ by eq. 34 (Walter et al. 2007) in tangents, F at the facet (Schlick 1994), and the ground."""
    alpha, f0, ground = 0.45, 0.35, 0.4
    half = (light + viewer) / np.linalg.norm(light + viewer)

    def tangent2(direction):
        return 1.0 / (direction @ NORMAL) ** 2 - 1.0

    def shadowing(direction):
        return 2.0 / (1.0 + math.sqrt(1.0 + alpha**2 * tangent2(direction)))

    facets = alpha**2 / (math.pi * (half @ NORMAL) ** 4 * (alpha**2 + tangent2(half)) ** 2)
    fresnel = f0 + (1.0 - f0) * (1.0 - light @ half) ** 5
    cos_in, cos_out = light @ NORMAL, viewer @ NORMAL
    mirror = facets * fresnel * shadowing(light) * shadowing(viewer) / (4.0 * cos_in * cos_out)
    below = ground / math.pi * (1.0 - (1.0 - cos_in) ** 5) * (1.0 - (1.0 - cos_out) ** 5)
    assert told(Ggx(diffuse=ground, specular=f0, roughness=alpha), light, viewer) == pytest.approx(
        mirror + below, rel=1e-12
    )


@pytest.mark.parametrize(("light", "viewer"), PAIRS)
def test_oren_nayar_is_their_equation_30(light, viewer):
    """α the greater of the two zenith angles, β the smaller, Δφ the azimuth between them."""
    sigma2 = math.radians(25.0) ** 2
    a, b = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33), 0.45 * sigma2 / (sigma2 + 0.09)
    zenith = [math.acos(direction @ NORMAL) for direction in (light, viewer)]
    azimuth = [math.atan2(direction[1], direction[0]) for direction in (light, viewer)]
    toward = max(0.0, math.cos(azimuth[0] - azimuth[1])) * math.sin(max(zenith)) * math.tan(min(zenith))
    expected = 0.6 / math.pi * (a + b * toward)
    assert told(OrenNayar(reflectance=0.6, roughness_deg=25.0), light, viewer) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("light", "viewer"), PAIRS)
def test_a_table_is_read_half_way_between(light, viewer):
    half = (light + viewer) / np.linalg.norm(light + viewer)
    angles, values = (0.0, 20.0, 40.0, 90.0), (0.30, 0.12, 0.05, 0.01)
    expected = np.interp(math.degrees(math.acos(half @ NORMAL)), angles, values)
    assert told(TableBrdf(incidence_deg=angles, measured_per_sr=values), light, viewer) == pytest.approx(
        expected, rel=1e-9
    )


def test_a_cube_corner_is_an_airy_pattern_under_the_areas_of_both_ways():
    """ρ F A η(θᵢ) η(θₒ) / (λ² cos θᵢ cos θₒ) (2 J₁(x)/x)² + k_d/π, x = π D sin Δ / λ; η by Degnan, the glass's angles."""
    material = RetroReflector(
        diameter_mm=2.0, reflectance=0.8, fill_fraction=0.5, refractive_index=1.5, diffuse=0.1, wavelength_nm=1064.0
    )

    def share(direction):
        inside = math.asin(math.sin(math.acos(direction @ NORMAL)) / 1.5)
        mu = math.sqrt(1.0 - 2.0 * math.tan(inside) ** 2)
        return 2.0 / math.pi * (math.asin(mu) - math.sqrt(2.0) * mu * math.tan(inside))

    light, viewer = unit(20.0, 30.0), unit(20.0 + 4.8e-4 * 57.3, 30.0)
    apart = math.sqrt(1.0 - (light @ viewer) ** 2)
    x = math.pi * 2e-3 / 1.064e-6 * apart
    assert 1.0 < x < 3.0
    peak = math.pi / 4.0 * 4e-6 / 1.064e-6**2
    expected = 0.8 * 0.5 * peak * share(light) * share(viewer) * (2.0 * j1(x) / x) ** 2 + 0.1 / math.pi
    assert told(material, light, viewer) == pytest.approx(expected, rel=1e-5)  # sin Δ from a cosine near 1
    wide, narrow = unit(35.0, 0.0), unit(5.0, 0.0)
    part = material.sunlight_brdf_per_sr(*(np.array([c]) for c in (wide @ NORMAL, narrow @ NORMAL, 1.0)))
    disc_sr = 2.0 * math.pi * (1.0 - math.cos(math.asin(6.957e8 / 1.495978707e11)))
    assert float(part[0]) == pytest.approx(0.4 * share(wide) * share(narrow) / disc_sr + 0.1 / math.pi, rel=1e-4)
