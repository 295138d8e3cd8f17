import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rso_lidar.optics import BrownConrady, Laser, Receiver, collect
from rso_lidar.records import Hits, Rays

C = 299_792_458.0
RECEIVER = Receiver(focal_length_mm=100, f_number=2, n_rows=4, n_cols=5, rays_per_pixel=1)


def hits_at(pixel, range_m, *, direction=None, cos_incidence=1.0, brdf_per_sr=0.1, weight=None, sunlight=None):
    """Return hits with these values, one for each pixel number given."""
    pixel = np.asarray(pixel, dtype=np.int32)
    n = len(pixel)
    full = lambda value: np.broadcast_to(np.asarray(value, dtype=float), n)  # noqa: E731
    direction = np.tile([0.0, 0.0, 1.0], (n, 1)) if direction is None else np.asarray(direction, dtype=float)
    weight = 1.0 / np.bincount(pixel, minlength=20)[pixel] if weight is None else full(weight)
    rays = Rays(RECEIVER.shape, direction.reshape(n, 3), pixel, weight)
    return Hits(
        rays=rays,
        ray=np.arange(n),
        pixel=pixel,
        weight=weight,
        target=np.zeros(n),
        facet=np.zeros(n),
        part=np.zeros(n),
        range_m=full(range_m),
        cos_incidence=full(cos_incidence),
        brdf_per_sr=full(brdf_per_sr),
        sunlight_per_sr=None if sunlight is None else full(sunlight),
    )


def test_each_letter_of_the_equation():
    """N = b w (p/f)^2 rho cos(alpha) A cos(theta) eta / R^2, off the axis, worked out by hand."""
    laser = Laser(divergence_deg=30, footprint="gaussian")
    toward = np.array([[0.05, -0.1, 1.0]])
    unit = toward / math.sqrt(1.0125)
    photons = collect(hits_at([7], 321.0, direction=unit, cos_incidence=0.4, weight=0.25), laser, RECEIVER)
    t = math.tan(math.radians(15))
    b = 2 * laser.photons / (math.pi * t**2) * math.exp(-2 * 0.0125 / t**2)
    by_hand = b * 0.25 * 1e-3**2 * 0.1 * 0.4 * math.pi * 0.025**2 / math.sqrt(1.0125) * 0.67 / 321.0**2
    assert photons.photons[0] == pytest.approx(by_hand, rel=1e-12)
    assert photons.delay_s[0] == pytest.approx(2 * 321.0 / C, rel=1e-15)
    assert photons.pulse_fwhm_s == pytest.approx(8e-9, rel=1e-15)


@pytest.mark.parametrize(
    "laser", [Laser(), Laser(divergence_deg=30, offset_m=(0.2, 0.0, 0.0))], ids=["inside", "beside"]
)
@pytest.mark.parametrize("alpha_deg", [0, 30, 60, 85])
def test_depth_of_what_a_ray_stands_for(alpha_deg, laser):
    """2 R delta tan(alpha) / c, delta the width of the ray's share of the pixel (house.md section 6)."""
    hits = hits_at([3] * 16, 1000.0, cos_incidence=math.cos(math.radians(alpha_deg)))
    spread_s = collect(hits, laser, RECEIVER).depth_spread_s
    delta = 1e-3 / 4
    assert spread_s == pytest.approx(2 * 1000 * delta * math.tan(math.radians(alpha_deg)) / C, rel=1e-6, abs=1e-20)


def test_no_hits_no_photons():
    photons = collect(hits_at([], []), Laser(), RECEIVER)
    assert len(photons.pixel) == 0 and len(photons.cluster_pixel) == 0


def by_hand(pixel, range_m, gap_m):
    """Return for each pixel its ranges in clusters, the slow way."""
    clusters = []
    for number in sorted(set(pixel)):
        ranges = sorted(r for p, r in zip(pixel, range_m, strict=True) if p == number)
        groups = [[ranges[0]]]
        for a, b in pairwise(ranges):
            if b - a > gap_m:
                groups.append([])
            groups[-1].append(b)
        clusters += [(number, group) for group in groups]
    return clusters


@settings(max_examples=150)
@given(st.lists(st.tuples(st.integers(0, 19), st.integers(0, 40)), max_size=60), st.sampled_from([6.0, 8.0, 10.0]))
def test_clusters_are_what_a_slow_loop_finds(returns, fwhm_ns):
    """Facing hits in steps of 0.25 m: neighbours more than c FWHM / 2 apart part."""
    returns = sorted(returns, key=lambda entry: entry[0])
    pixel = [p for p, _ in returns]
    range_m = [1000 + 0.25 * r for _, r in returns]
    photons = collect(hits_at(pixel, range_m), Laser(pulse_fwhm_ns=fwhm_ns), RECEIVER)
    expected = by_hand(pixel, range_m, 0.5 * C * fwhm_ns * 1e-9)
    assert photons.cluster_pixel.tolist() == [number for number, _ in expected]
    got = [sorted(photons.delay_s[photons.cluster == k] * C / 2) for k in range(len(expected))]
    for ranges, (_, group) in zip(got, expected, strict=True):
        assert ranges == pytest.approx(group, rel=1e-12)
    assert np.array_equal(photons.cluster_pixel[photons.cluster], photons.pixel)


# ------------------------------------------------------------------------------------------- a laser beside the lens

TOWARD = np.array([0.05, -0.1, 1.0])
UNIT = TOWARD / math.sqrt(1.0125)


@pytest.mark.parametrize("offset_m", [(0.4, 0.0, 0.0), (0.1, -0.3, 0.2), (-2.0, 1.0, -1.5)])
def test_each_letter_for_a_laser_beside_the_lens(offset_m):
    """Irradiance b cos(alpha) / (cos^3(theta') R'^2) from the laser, times rho, the pixel's solid angle and the aperture:

    b is per unit area of the plane at unit distance before the laser, which from its place is dOmega / cos^3(theta').
    """
    laser = Laser(divergence_deg=30, footprint="gaussian", offset_m=offset_m)
    photons = collect(hits_at([7], 12.0, direction=[UNIT], cos_incidence=0.4, weight=0.25), laser, RECEIVER)
    at = 12.0 * UNIT - np.array(offset_m)
    far = np.linalg.norm(at)
    t = math.tan(math.radians(15))
    b = 2 * laser.photons / (math.pi * t**2) * math.exp(-2 * ((at[0] / at[2]) ** 2 + (at[1] / at[2]) ** 2) / t**2)
    irradiance = b / (at[2] / far) ** 3 / far**2 * 0.4
    solid_angle = 0.25 * 1e-3**2 * UNIT[2] ** 3
    by_hand = irradiance * 0.1 * solid_angle * math.pi * 0.025**2 * UNIT[2] * 0.67
    assert photons.photons[0] == pytest.approx(by_hand, rel=1e-12)
    assert photons.delay_s[0] == pytest.approx((12.0 + far) / C, rel=1e-14)


def test_an_offset_that_goes_to_nothing():
    """Photons and delays go over into those of a laser in the lens, by the first power of the offset."""
    hits = hits_at([3, 7], 40.0, direction=[UNIT, [0.0, 0.0, 1.0]], cos_incidence=0.7)
    inside = collect(hits, Laser(divergence_deg=30, footprint="gaussian"), RECEIVER)
    for offset in (1e-2, 1e-5, 1e-9):
        beside = collect(hits, Laser(divergence_deg=30, footprint="gaussian", offset_m=(offset, 0, 0)), RECEIVER)
        assert beside.photons == pytest.approx(inside.photons, rel=2 * offset + 1e-14)
        assert beside.delay_s == pytest.approx(inside.delay_s, rel=2 * offset / 40 + 1e-15)


def test_what_lies_behind_the_laser_or_beside_its_beam_gets_no_light():
    toward = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]
    laser = Laser(divergence_deg=10, footprint="square", offset_m=(0.0, 0.5, 5.0))
    photons = collect(hits_at([2, 3, 4], [3.0, 8.0, 30.0], direction=toward), laser, RECEIVER)
    # Behind; 0.5 m aside at 3 m, 9.5 degrees; 0.5 m aside at 25 m, 1.1 degrees.
    assert photons.hit.tolist() == [2] and photons.photons[0] > 0
    assert photons.filled_fraction.ravel()[[2, 3, 4]] == pytest.approx([0.0, 0.0, photons.filled_fraction.max()])
    assert np.all(np.isfinite(photons.delay_s)) and np.all(np.isfinite(photons.photons))


# ------------------------------------------------------------------------------- distortion, sunlight, what goes along


@pytest.mark.parametrize("k1", [-0.8, 0.8])
def test_a_bent_pixel_sees_the_solid_angle_that_it_has(k1):
    lens = RECEIVER.replace(distortion=BrownConrady(k1=k1))
    hits = hits_at([7], 321.0, direction=[UNIT], weight=0.25)
    laser = Laser(divergence_deg=30, footprint="gaussian")
    r2 = 0.0125
    area = 1 / ((1 + k1 * r2) * (1 + 3 * k1 * r2))  # one over d(r_d²)/d(r²) of r (1 + k1 r²): tangential times radial
    bent, straight = (collect(hits, laser, receiver) for receiver in (lens, RECEIVER))
    assert bent.photons[0] / straight.photons[0] == pytest.approx(area, rel=1e-12)
    assert bent.coherence_cells[0] / straight.coherence_cells[0] == pytest.approx(area, rel=1e-12)


def test_each_letter_of_the_background():
    """E_sun dlambda / (hc/lambda) A eta, times BRDF and cosine, times the pixel's projected solid angle, on its pixel."""
    lens = RECEIVER.replace(filter_width_nm=2.0)
    hits = hits_at([7, 7, 9], 321.0, direction=[UNIT] * 3, weight=[0.25, 0.5, 0.125], sunlight=[0.08, 0.02, 0.0])
    photons = collect(hits, Laser(), lens)
    per_m2 = 645.9 * 2e-3 / (6.62607015e-34 * C / 1064e-9)  # ASTM E490 at 1064 nm, W m-2 um-1
    per_share = 1e-3**2 * UNIT[2] ** 4 * math.pi * 0.025**2 * 0.67
    by_hand = np.zeros((4, 5))
    by_hand[1, 2] = per_m2 * per_share * (0.25 * 0.08 + 0.5 * 0.02)
    assert photons.background_photons_per_s == pytest.approx(by_hand, rel=1e-9)


def test_no_filter_or_no_sunlight_no_background():
    assert collect(hits_at([7], 9.0, sunlight=0.1), Laser(), RECEIVER).background_photons_per_s is None
    lens = RECEIVER.replace(filter_width_nm=1.0)
    assert collect(hits_at([7], 9.0), Laser(), lens).background_photons_per_s is None
    dark = collect(hits_at([7], 9.0, sunlight=0.0), Laser(), lens).background_photons_per_s
    assert dark.shape == (4, 5) and np.all(dark == 0)


def test_sunlight_does_not_go_with_the_laser():
    hits = hits_at([7], 9.0, direction=[UNIT], sunlight=0.1)
    lens = RECEIVER.replace(filter_width_nm=1.0)
    one, other = (collect(hits, laser, lens) for laser in (Laser(), Laser(energy_mj=1.0, divergence_deg=0.1)))
    assert np.array_equal(one.background_photons_per_s, other.background_photons_per_s)
    assert len(other.photons) == 0 and other.filled_fraction.max() == 0


def test_a_late_pulse_shifts_no_delay():
    """`late_s` goes along to the detector's clock; delays and labels are those of the light itself."""
    hits = hits_at([7], 321.0)
    on_time, late = collect(hits, Laser(), RECEIVER), collect(hits, Laser(), RECEIVER, 2e-9)
    assert late.late_s == 2e-9 and on_time.late_s == 0.0
    assert np.array_equal(late.delay_s, on_time.delay_s)


def test_cells_of_coherence():
    """Aperture times solid angle over lambda squared: 884 in a filled pixel of Fuller et al. (instrument.md: 885)."""
    seed = Receiver(fov_deg=2.5, f_number=2.8, n_rows=4, n_cols=128)
    hits = hits_at([64] * 4, 1000.0)
    cells = collect(hits, Laser(), seed).coherence_cells.sum()
    assert cells == pytest.approx(885, rel=2e-3)
    assert collect(hits, Laser(wavelength_nm=1570), seed).coherence_cells.sum() == pytest.approx(406, rel=2e-3)
