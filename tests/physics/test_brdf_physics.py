"""Every material against the laws that all keep, and each against the closed forms of its source."""

import itertools
import math
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest
from scipy import integrate, special

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser, Receiver
from rso_lidar.scene import (
    AnyMaterial,
    ByWavelength,
    Crinkled,
    Ggx,
    Lambertian,
    Named,
    OrenNayar,
    Phong,
    RetroReflector,
    Scatterer,
    TableBrdf,
)
from rso_lidar.scene.materials.scatterer import SUN_RADIUS_RAD
from tests.optics.bench_for_tests import look, place, plate

DEG = math.pi / 180
NIR_M = 1064e-9

CUBES = RetroReflector(diameter_mm=12.7, reflectance=0.9, fill_fraction=0.8, diffuse=0.2)
PEAKED = TableBrdf(incidence_deg=(0.0, 1.0, 3.0, 30.0, 90.0), measured_per_sr=(30.0, 12.0, 0.5, 0.1, 0.05))

# Several of each type, at the ends of what its settings allow; a type without a case fails the test below.
CASES = {
    "lambertian": [Lambertian(reflectance=1.0)],
    "phong": [Phong(diffuse=0.4, specular=0.6, exponent=n) for n in (0.0, 3.0, 300.0, 1e5)],
    "crinkled": [
        Crinkled(diffuse=0.4, specular=0.6, exponent=300.0, tilt_deg=8.0)
    ],  # one flat cell; its mean: test_crinkle
    "named": [Named(name="mli_gold")],
    "oren_nayar": [OrenNayar(reflectance=0.985, roughness_deg=s) for s in (0.0, 11.0, 30.0, 90.0)],
    "ggx": [
        Ggx(diffuse=1.0 - f, specular=f, roughness=a)
        for f, a in itertools.product((0.0, 0.3, 1.0), (0.01, 0.1, 0.4, 1.0))
    ],
    "retro_reflector": [CUBES, CUBES.replace(refractive_index=1.0), CUBES.replace(diameter_mm=0.5)],
    "table": [TableBrdf(incidence_deg=(0.0, 90.0), measured_per_sr=(1 / math.pi, 1 / math.pi)), PEAKED],
    "by_wavelength": [ByWavelength(wavelength_nm=(1570.0, 1064.0), materials=(Lambertian(), CUBES))],
}
BOUND = [
    pytest.param(material.at(NIR_M), id=f"{name} {number}")
    for name, materials in CASES.items()
    for number, material in enumerate(materials)
]


def test_no_material_is_left_out():
    def types(annotation):
        if isinstance(annotation, type) and issubclass(annotation, Scatterer):
            return {annotation.model_fields["type"].default}
        return set().union(*(types(inner) for inner in get_args(annotation)))

    assert types(get_args(AnyMaterial)[0]) == set(CASES)


def around(axis, n_theta=500, n_azimuth=96):
    """Return unit vectors (direction, xyz) over the whole sphere on a polar grid about `axis`, log-spaced in the angle."""
    edge = np.concatenate([[0.0], np.geomspace(1e-6, math.pi, n_theta)])
    theta = 0.5 * (edge[1:] + edge[:-1])
    azimuth = (np.arange(n_azimuth) + 0.5) * 2 * math.pi / n_azimuth
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    round_it = np.outer(np.cos(azimuth), across) + np.outer(np.sin(azimuth), np.cross(axis, across))
    directions = np.cos(theta)[:, None, None] * axis + np.sin(theta)[:, None, None] * round_it
    solid_angle = np.repeat((np.cos(edge[:-1]) - np.cos(edge[1:])) * 2 * math.pi / n_azimuth, n_azimuth)
    return directions.reshape(-1, 3), solid_angle


def reflectance(material, incidence_deg):
    """Return the directional-hemispherical reflectance by a sum of grids about the light and about its mirror image.

    Each grid is fine near its axis, where retro-reflectors and mirrors shine; shared out by the balance heuristic (Veach and
    Guibas 1995), the two count every direction once.
    """
    angle = incidence_deg * DEG
    light = np.array([math.sin(angle), 0.0, math.cos(angle)])
    axes = np.array([light, light * [-1, 1, 1]])
    total = 0.0
    for number, axis in enumerate(axes):
        viewer, solid_angle = around(axis)
        above = viewer[:, 2] > 0
        viewer, solid_angle = viewer[above], solid_angle[above]
        apart = np.maximum(np.linalg.norm(viewer[:, None] - axes, axis=2), 1e-9)
        share = apart[:, number] ** -2 / np.sum(apart**-2, axis=1)
        cos_phase = 1 - 0.5 * apart[:, 0] ** 2
        cos_in = np.full(len(viewer), math.cos(angle))
        total += np.sum(material.brdf_per_sr(cos_in, viewer[:, 2], cos_phase) * viewer[:, 2] * solid_angle * share)
    return total


@pytest.mark.parametrize("material", BOUND)
def test_no_material_sends_back_more_than_it_gets(material):
    """Energy: the directional-hemispherical reflectance is at most 1 at any incidence; the sum is good to 1e-3."""
    returned = [reflectance(material, incidence) for incidence in (0.01, 45, 75, 89)]
    assert 0.0 <= min(returned) and max(returned) <= 1.0 + 1e-3


def test_the_sum_over_the_hemisphere_is_right():
    """A Lambertian surface returns ρ₀ (Fuller et al., eq. 9), a Phong lobe k_s at normal incidence, cubes ρ F."""
    for incidence in (0.01, 45, 85):
        assert reflectance(Lambertian(reflectance=0.8), incidence) == pytest.approx(0.8, rel=1e-3)
    for n in (3.0, 300.0, 1e5):
        assert reflectance(Phong(diffuse=0, specular=1, exponent=n), 0.01) == pytest.approx(1.0, rel=1e-3)
    # The circular aperture's Airy pattern holds what falls on it: ∫ (2 J1(x)/x)² dω = λ² / A.
    assert reflectance(CUBES.replace(diffuse=0).at(NIR_M), 0.01) == pytest.approx(0.72, rel=2e-3)


def pairs(n=1500, seed=5):
    """Return cosines of n pairs of directions at random, a third of them nearly one, a third nearly mirror images."""
    rng = np.random.default_rng(seed)
    one, other = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, n, 3)))
    one[:, 2], other[:, 2] = np.abs(one[:, 2]), np.abs(other[:, 2])
    near = one + rng.normal(size=(n, 3)) * 10 ** rng.uniform(-6, -1, size=(n, 1))
    other[: n // 3] = near[: n // 3]
    other[n // 3 : 2 * n // 3] = near[n // 3 : 2 * n // 3] * [-1, -1, 1]
    other[:, 2] = np.abs(other[:, 2])
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    return SimpleNamespace(one=one[:, 2], other=other[:, 2], phase=np.clip(np.sum(one * other, axis=1), -1, 1))


@pytest.mark.parametrize("material", BOUND)
def test_light_may_go_either_way(material):
    """Helmholtz reciprocity: light and viewer change places, and the BRDF is the same."""
    at = pairs()
    there, back = material.brdf_per_sr(at.one, at.other, at.phase), material.brdf_per_sr(at.other, at.one, at.phase)
    assert np.all(np.isfinite(there)) and np.all(there >= 0)
    assert back == pytest.approx(there, rel=1e-9, abs=1e-12)
    assert material.sunlight_brdf_per_sr(at.one, at.other, at.phase) == pytest.approx(
        material.sunlight_brdf_per_sr(at.other, at.one, at.phase), rel=1e-9
    )


@pytest.mark.parametrize("material", BOUND)
def test_left_out_the_viewer_is_where_the_light_is(material):
    cosine = np.linspace(0, 1, 201)
    alone = material.brdf_per_sr(cosine)
    assert alone.tobytes() == material.brdf_per_sr(cosine, cosine, np.ones(201)).tobytes()
    assert np.all(np.isfinite(alone))


# ------------------------------------------------------------------------------------------------------------- Phong


def test_a_shiny_plate_returns_what_a_mirror_does():
    """instrument.md 4.1: an infinite Phong plate of n = 3000 sums to the cap of a flat mirror by itself, ratio 1.0003.

    The mirror's is E A Rs / (4 (2R)² tan²(θ/2)), as if the lens were as far behind it. In the tangent plane the Phong sum
    is 2π b ks (n+2)/(2π) ∫ tan a cos² a cos^n(2a) da = (b ks / 4) (n+2)/(n+1). The rays' grid is good to 1e-4: 21 rays
    across the lobe's half width.
    """
    n, range_m = 3000.0, 3000.0
    shiny = Phong(diffuse=0.0, specular=0.9, exponent=n)
    laser = Laser(divergence_deg=6.0)
    lens = Receiver(fov_deg=6.0, f_number=2.8)
    seen = look(plate(1000.0), place((0, 0, range_m)), lens, laser, shiny)
    cap = laser.photons * lens.aperture_area_m2 * 0.9 * lens.transmission / (4 * math.tan(3 * DEG) ** 2)
    cap /= (2 * range_m) ** 2
    assert seen.by_pixel.sum() / cap == pytest.approx((n + 2) / (n + 1), abs=2e-4)
    assert (n + 2) / (n + 1) == pytest.approx(1.0003, abs=5e-5)


# -------------------------------------------------------------------------------------------------------- Oren-Nayar


def test_oren_nayar_without_roughness_is_lambertian():
    at = pairs()
    smooth = OrenNayar(reflectance=0.7, roughness_deg=0.0)
    assert smooth.brdf_per_sr(at.one, at.other, at.phase) == pytest.approx(0.7 / math.pi, rel=1e-12)


@pytest.mark.parametrize("roughness_deg", [10.0, 20.0, 40.0])
def test_oren_nayar_is_equation_30(roughness_deg):
    """Oren and Nayar 1994, eq. 30, written in angles: A + B max(0, cos(φr - φi)) sin α tan β, α and β the greater and
    the lesser of the two polar angles."""
    rng = np.random.default_rng(2)
    theta_i, theta_r = rng.uniform(0, 1.5, (2, 500))
    phi = rng.uniform(0, 2 * math.pi, 500)
    s2 = (roughness_deg * DEG) ** 2
    a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    alpha, beta = np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r)
    expected = 0.5 / math.pi * (a + b * np.maximum(0, np.cos(phi)) * np.sin(alpha) * np.tan(beta))
    phase = np.cos(theta_i) * np.cos(theta_r) + np.sin(theta_i) * np.sin(theta_r) * np.cos(phi)
    rough = OrenNayar(reflectance=0.5, roughness_deg=roughness_deg)
    assert rough.brdf_per_sr(np.cos(theta_i), np.cos(theta_r), phase) == pytest.approx(expected, rel=1e-9)


def test_oren_nayar_sends_back_most_at_grazing_incidence():
    """By integrating eq. 30 over the hemisphere at θi = 90 deg: ρ₀ (A + B/2), the limit that the part refuses beyond."""
    rough = OrenNayar(reflectance=0.9, roughness_deg=12.0)
    s2 = (12 * DEG) ** 2
    most = 0.9 * (1 - 0.5 * s2 / (s2 + 0.33) + 0.225 * s2 / (s2 + 0.09))
    # At 89.9 deg the sum is still below its limit by the order of cos 89.9 deg = 2e-3.
    assert reflectance(rough, 89.9) == pytest.approx(most, rel=4e-3)
    assert all(reflectance(rough, incidence) <= most * 1.001 for incidence in (0.1, 30, 60, 80, 88))


# --------------------------------------------------------------------------------------------------------------- GGX


@pytest.mark.parametrize("roughness", [0.01, 0.1, 0.5, 1.0])
def test_ggx_is_the_distribution_of_walter(roughness):
    """Walter et al. 2007, eq. 33: D = α²/(π cos⁴θ (α² + tan²θ)²); monostatic, where Schlick's F is F₀, D F₀ G1²/(4 cos²)."""
    theta = np.linspace(0, 85, 50) * DEG
    cosine, tangent = np.cos(theta), np.tan(theta)
    spread = roughness**2 / (math.pi * cosine**4 * (roughness**2 + tangent**2) ** 2)
    shadow = 2 / (1 + np.sqrt(1 + roughness**2 * tangent**2))  # eq. 34
    mirror = Ggx(diffuse=0.0, specular=0.6, roughness=roughness)
    assert mirror.brdf_per_sr(cosine) == pytest.approx(spread * 0.6 * shadow**2 / (4 * cosine**2), rel=1e-8)
    assert float(mirror.brdf_per_sr(np.array(1.0))) == pytest.approx(0.6 / (4 * math.pi * roughness**2), rel=1e-9)


def test_ggx_facets_cover_the_ground():
    """∫ D cos θ dω = 1: the facets project onto the surface that they make up; D read off at normal incidence."""
    for roughness in (0.05, 0.3, 1.0):
        mirror = Ggx(diffuse=0.0, specular=1.0, roughness=roughness)

        def projected(theta, mirror=mirror, roughness=roughness):
            shadow = 2 / (1 + math.sqrt(1 + (roughness * math.tan(theta)) ** 2))
            spread = float(mirror.brdf_per_sr(np.array(math.cos(theta)))) * 4 * math.cos(theta) ** 2 / shadow**2
            return spread * math.cos(theta) * 2 * math.pi * math.sin(theta)

        assert integrate.quad(projected, 0, math.pi / 2 - 1e-6, points=[roughness], limit=200)[0] == pytest.approx(
            1, abs=1e-6
        )


def test_a_polished_ggx_is_a_fresnel_mirror():
    """α = 0.01 and no ground: all of Schlick's F at the angle of incidence comes back, to the width of the lobe."""
    glass = Ggx(diffuse=0.0, specular=0.04, roughness=0.01)
    for incidence in (0.01, 45, 60, 70):
        fresnel = 0.04 + 0.96 * (1 - math.cos(incidence * DEG)) ** 5
        assert reflectance(glass, incidence) == pytest.approx(fresnel, rel=5e-3)


# ------------------------------------------------------------------------------------------------- retro-reflectors


@pytest.mark.parametrize(("diameter_mm", "sigma_m2"), [(12.7, 1.8e5), (25.4, 2.9e6)])
def test_cross_section_of_a_cube_corner(diameter_mm, sigma_m2):
    """instrument.md 4.3: σ = ρ π³ D⁴/(4 λ²), 1.8e5 and 2.9e6 m² at 1064 nm, ρ = 1, to the digits printed.

    A surface of area S with BRDF f has σ = 4π f cos² S; a cube of area π D²/4 that fills it is S itself.
    """
    cube = RetroReflector(diameter_mm=diameter_mm, reflectance=1.0, fill_fraction=1.0).at(NIR_M)
    area_m2 = math.pi * (diameter_mm * 1e-3) ** 2 / 4
    sigma = 4 * math.pi * float(cube.brdf_per_sr(np.array(1.0))) * area_m2
    assert sigma == pytest.approx(math.pi**3 * (diameter_mm * 1e-3) ** 4 / (4 * NIR_M**2), rel=1e-9)
    assert sigma == pytest.approx(sigma_m2, rel=0.02)


def test_the_spot_of_a_cube_corner_has_its_first_dark_ring_at_102_urad():
    """instrument.md 4.3: 1.22 λ/D = 102 µrad for 12.7 mm; half the peak at 0.514 λ/D (Born and Wolf 8.5.2)."""
    off = np.linspace(1e-6, 150e-6, 3000)
    cube = CUBES.replace(diffuse=0.0).at(NIR_M)
    spot = cube.brdf_per_sr(np.ones(3000), np.cos(off), np.cos(off))
    assert off[np.argmin(spot)] == pytest.approx(special.jn_zeros(1, 1)[0] / math.pi * NIR_M / 12.7e-3, abs=1e-7)
    assert off[np.argmin(spot)] == pytest.approx(102e-6, abs=0.5e-6)
    assert spot.min() < 1e-5 * spot.max()
    assert off[np.argmax(spot < 0.5 * spot[0])] == pytest.approx(0.514 * NIR_M / 12.7e-3, rel=2e-3)


def test_a_cube_corner_goes_blind_off_its_axis():
    """Degnan 1993: hollow, the last of the aperture closes where tan θ = 1/√2, 35.3 deg; in glass of 1.45, at 56.8 deg.

    Half way, at θ' = 15 deg in the glass: μ² = 1 - 2 tan² 15 = 0.8564, η = (2/π)(asin μ - √2 μ tan 15) cos θ.
    """
    for index, last_deg in ((1.0, 35.264), (1.45, 56.83)):
        cube = CUBES.replace(refractive_index=index, diffuse=0.0).at(NIR_M)
        brdf = cube.brdf_per_sr(np.cos(np.array([last_deg - 0.1, last_deg + 0.1]) * DEG))
        assert brdf[0] > 0 and brdf[1] == 0
        theta = math.asin(index * math.sin(15 * DEG))
        mu = math.sqrt(1 - 2 * math.tan(15 * DEG) ** 2)
        share = 2 / math.pi * (math.asin(mu) - math.sqrt(2) * mu * math.tan(15 * DEG))
        ratio = float(cube.brdf_per_sr(np.array(math.cos(theta))) / cube.brdf_per_sr(np.array(1.0)))
        assert ratio == pytest.approx(share**2, rel=1e-9)  # η²/cos²


def test_sunlight_on_cubes_comes_back_within_the_disc():
    """Of the Sun a cube returns ρ F of what falls on it, spread over the Sun's own 6.8e-5 sr (instrument.md 5)."""
    disc_sr = 2 * math.pi * (1 - math.cos(SUN_RADIUS_RAD))
    assert disc_sr == pytest.approx(6.8e-5, rel=5e-3)
    cube = CUBES.replace(diffuse=0.0).at(NIR_M)
    ones = np.ones(2)
    brdf = cube.sunlight_brdf_per_sr(ones, ones, np.cos(np.array([0.99, 1.01]) * SUN_RADIUS_RAD))
    assert brdf[0] * disc_sr == pytest.approx(0.72, rel=1e-9) and brdf[1] == 0


# -------------------------------------------------------------------------------------------------- measured tables


def test_a_table_is_refused_where_its_own_sum_passes_one():
    """The part sums over half-way directions, this file over the viewer's; they agree on the limit to 1 %."""
    table = {"incidence_deg": (0.0, 2.0, 10.0, 60.0, 90.0), "measured_per_sr": (20.0, 2.0, 0.2, 0.1, 0.1)}
    most = max(reflectance(TableBrdf(**table), incidence) for incidence in range(0, 90, 6))
    assert 0.1 < most < 1.0
    for factor, fits in ((0.99, True), (1.01, False)):
        scaled = {**table, "measured_per_sr": tuple(v * factor / most for v in table["measured_per_sr"])}
        if fits:
            TableBrdf(**scaled)
        else:
            with pytest.raises(ScenarioError, match="of the light that is incident at"):
                TableBrdf(**scaled)
