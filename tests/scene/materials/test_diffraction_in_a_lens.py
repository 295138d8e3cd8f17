"""A cube corner's lobe in a lens: the mean of its pattern over the disc, wherever the laser stands and however near."""

import math

import numpy as np
import pytest
from scipy.special import j0, j1

from rso_lidar.scene import RetroReflector
from rso_lidar.scene.materials.diffraction import mean_irradiance, transfer

CUBES = RetroReflector(diameter_mm=10.0, reflectance=0.8, fill_fraction=0.5).at(1064e-9)
PEAK_PER_SR = float(CUBES.brdf_per_sr(np.array(1.0)))
APERTURE_M = 0.10475
ONE = np.ones(1)


def airy(v):
    x = np.maximum(np.abs(v), 1e-9)
    return (2.0 * j1(x) / x) ** 2


def average_over_lens(range_m, beside_m=0.0, aperture_m=APERTURE_M, cubes=CUBES):
    """Return the mean BRDF of cubes straight ahead, the laser `beside_m` to the right of the lens."""
    ahead, laser = np.array([[0.0, 0.0, 1.0]]), np.array([beside_m, 0.0, 0.0])
    return float(cubes.average_over_lens(cubes.brdf_per_sr(ONE), ahead, np.array([range_m]), laser, aperture_m)[0])


@pytest.mark.parametrize("range_m", [1.0, 5.0, 50.0, 400.0, 3000.0, 100_000.0])
def test_the_lens_gathers_no_more_than_the_lobe_holds(range_m):
    """Share of the light sent back that a lens of area A at R gathers: brdf A / R², at most rho F, all of it near by."""
    share = average_over_lens(range_m) * math.pi / 4 * APERTURE_M**2 / range_m**2
    assert share <= 0.4 * (1 + 1e-9)
    if range_m <= 5.0:  # the geometric spot is twice the cube, a fifth of the lens; what is left is diffracted past it
        assert share == pytest.approx(0.4, rel=6e-3)


@pytest.mark.parametrize("range_m", [3000.0, 100_000.0])
def test_in_the_far_field_the_lens_gathers_the_encircled_energy(range_m):
    """Rayleigh 1881: 1 − J₀² − J₁² within x. The defocus takes sin²(u/4)/(u/4)² of the middle: 1e-3 at 3 km."""
    x = math.pi * 0.010 / 1064e-9 * 0.5 * APERTURE_M / range_m
    share = average_over_lens(range_m) * math.pi / 4 * APERTURE_M**2 / range_m**2
    assert share == pytest.approx(0.4 * (1.0 - j0(x) ** 2 - j1(x) ** 2), rel=1e-3)


def test_a_point_of_a_lens_far_away_sees_the_lobe_itself():
    range_m, off_rad = 1e6, np.array([0.0, 4e-5, 1.1e-4, 3e-4])
    for off in off_rad:
        lobe = CUBES.brdf_per_sr(ONE, ONE, np.cos(np.array([off])))
        # 1e-6 of the peak: cos Δ keeps 1e-16, which is 1e-8 rad in Δ
        assert average_over_lens(range_m, off * range_m, 1e-3) == pytest.approx(
            float(lobe[0]), rel=1e-4, abs=1e-6 * PEAK_PER_SR
        )


@pytest.mark.parametrize("rim", [0.3, 2.0, 8.0, 25.0])
@pytest.mark.parametrize("offset_over_rim", [0.0, 0.4, 0.97, 1.0, 1.03, 1.6, 3.0])
def test_the_mean_of_a_shifted_airy_pattern(rim, offset_over_rim):
    """Against the disc summed point by point (a product rule of 200 radii and 400 angles, good to 1e-6)."""
    node, weight = np.polynomial.legendre.leggauss(200)
    radius, share = 0.5 * rim * (node + 1.0), 0.5 * rim * weight
    angle = (np.arange(400) + 0.5) * math.pi / 400
    offset = offset_over_rim * rim
    v = np.sqrt(offset**2 + radius[:, None] ** 2 + 2.0 * offset * radius[:, None] * np.cos(angle))
    mean = float((airy(v).mean(axis=1) * radius * share).sum() / (0.5 * rim**2))
    got = mean_irradiance(np.array([offset]), np.array([rim]), np.zeros(1))
    assert float(got[0]) == pytest.approx(mean, rel=1e-4)


@pytest.mark.parametrize("defocus", [0.5, 4.0, 12.0, 40.0, 300.0])
def test_the_middle_of_a_defocused_pattern(defocus):
    """Born and Wolf eq. 8.8.26: on the axis the irradiance is (sin(u/4) / (u/4))²."""
    got = float(mean_irradiance(np.zeros(1), np.zeros(1), np.array([defocus]))[0])
    assert got == pytest.approx((math.sin(defocus / 4) / (defocus / 4)) ** 2, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("defocus", [0.0, 3.0, 30.0])
def test_defocus_spreads_light_and_loses_none(defocus):
    """A lens of radius w, far beyond the pattern, holds all but 2/(π w) of it: w²/4 of the mean, 1 in all."""
    wide = np.array([1000.0])
    held = float((mean_irradiance(np.zeros(1), wide, np.array([defocus])) * wide**2 / 4)[0])
    assert held == pytest.approx(1.0 - 2.0 / (math.pi * 1000.0), abs=1e-5)


def test_the_transfer_function_without_defocus():
    """Goodman, Introduction to Fourier Optics, eq. 6-31: (2/π)(acos s − s √(1−s²)), s = δ/2."""
    shift = np.linspace(0.0, 2.0, 9)
    s = 0.5 * shift
    assert transfer(shift, 0.0) == pytest.approx(2 / math.pi * (np.arccos(s) - s * np.sqrt(1 - s**2)), abs=1e-12)


def test_many_hits_are_interpolated_to_a_thousandth():
    """A panel of cubes 4 m deep, 40 m away, the laser beside the lens: hit by hit, and all in one table."""
    rng = np.random.default_rng(3)
    direction = np.column_stack([rng.uniform(-0.02, 0.02, 5000), rng.uniform(-0.02, 0.02, 5000), np.ones(5000)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    range_m, laser = rng.uniform(38.0, 42.0, 5000), np.array([0.045, 0.03, 0.0])
    one = np.ones(5000)
    together = CUBES.average_over_lens(CUBES.brdf_per_sr(one), direction, range_m, laser, APERTURE_M)
    some = slice(0, 5000, 50)
    alone = [
        CUBES.average_over_lens(CUBES.brdf_per_sr(ONE), direction[k : k + 1], range_m[k : k + 1], laser, APERTURE_M)[0]
        for k in range(*some.indices(5000))
    ]
    assert together[some] == pytest.approx(np.array(alone), abs=1e-3 * max(alone))


def test_a_laser_behind_the_cubes_sends_nothing_back():
    ahead, laser = np.array([[0.0, 0.0, 1.0]]), np.array([0.0, 0.0, 200.0])
    assert CUBES.average_over_lens(np.array([PEAK_PER_SR]), ahead, np.array([100.0]), laser, APERTURE_M) == 0.0


@pytest.mark.parametrize("ahead_m", [-9.0, 8.0])
def test_the_defocus_is_by_the_ways_to_the_laser_and_to_the_lens_each(ahead_m):
    """Born and Wolf eq. 8.8.26 on the axis, the laser 9 m behind a small lens or 8 m before it. The matt rest stays."""
    cubes = RetroReflector(diameter_mm=10.0, reflectance=0.8, fill_fraction=0.5, diffuse=0.3).at(1064e-9)
    u = math.pi * 0.010**2 / (2.0 * 1064e-9) * (1.0 / 20.0 + 1.0 / (20.0 - ahead_m))
    axis, laser, peak = np.array([[0.0, 0.0, 1.0]]), np.array([0.0, 0.0, ahead_m]), np.array([1e6])
    got = cubes.average_over_lens(peak, axis, np.array([20.0]), laser, 1e-6)
    matt = 0.3 / math.pi
    assert got == pytest.approx([matt + (1e6 - matt) * (math.sin(u / 4.0) / (u / 4.0)) ** 2], rel=1e-6)
