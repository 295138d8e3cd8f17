import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rso_lidar.optics import Laser, Receiver, collect
from rso_lidar.records import Hits, Rays

C = 299_792_458.0
RECEIVER = Receiver(focal_length_mm=100, f_number=2, n_rows=4, n_cols=5, rays_per_pixel=1)


def hits_at(pixel, range_m, *, direction=None, cos_incidence=1.0, brdf_per_sr=0.1, weight=None):
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


@pytest.mark.parametrize("alpha_deg", [0, 30, 60, 85])
def test_depth_of_what_a_ray_stands_for(alpha_deg):
    """2 R delta tan(alpha) / c, delta the width of the ray's share of the pixel (house.md section 6)."""
    hits = hits_at([3] * 16, 1000.0, cos_incidence=math.cos(math.radians(alpha_deg)))
    spread_s = collect(hits, Laser(), RECEIVER).depth_spread_s
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
