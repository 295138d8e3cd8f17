"""The recursion of spherical harmonics against other ways to the same gradient."""

import math

import numpy as np
import pytest
from scipy.special import sph_harm_y

from rso_lidar.orbit.propagation.harmonics import Harmonics
from tests.reference.orbit.harmonics import attract, attract_points

GM, RADIUS_M = 3.986004415e14, 6_378_136.3


def coefficients(top, seed=1):
    """Return random coefficients (top + 1, top + 1) that fall by Kaula's rule, 1e-5 / n^2."""
    rng = np.random.default_rng(seed)
    n = np.maximum(np.arange(top + 1.0), 1.0)[:, None]
    cosine, sine = np.tril(rng.normal(size=(2, top + 1, top + 1)) * 1e-5 / n**2)
    cosine[:2] = sine[:2] = sine[:, 0] = 0.0
    return cosine, sine


@pytest.mark.parametrize("top", [2, 3, 20, 90])
def test_the_kernel_agrees_with_its_oracle(top):
    cosine, sine = coefficients(top)
    points = np.random.default_rng(2).normal(size=(6, 3)) * 5e6
    points *= np.maximum(6.6e6 / np.linalg.norm(points, axis=1), 1.0)[:, None]
    wanted = attract_points(points, GM, RADIUS_M, cosine, sine)
    field = Harmonics(GM, RADIUS_M, cosine, sine)
    np.testing.assert_allclose(field.perturb_points(points), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert field.perturb(*points[0]) == tuple(field.perturb_points(points)[0])
    np.testing.assert_allclose(field.perturb(*points[0]), attract(*points[0], GM, RADIUS_M, cosine, sine), rtol=1e-10)


def test_each_harmonic_is_the_gradient_of_its_potential():
    place, step = np.array([4.1e6, -3.2e6, 4.4e6]), 20.0

    def potential(r, n, m, part):
        radius = np.linalg.norm(r)
        # orthonormal over the sphere, with the phase of Condon and Shortley, which geodesy leaves out
        wave = sph_harm_y(n, m, math.acos(r[2] / radius), math.atan2(r[1], r[0]))
        scale = math.sqrt(4.0 * math.pi * (2.0 if m else 1.0)) * (-1) ** m
        return GM / radius * (RADIUS_M / radius) ** n * scale * getattr(wave, part)

    for n, m, part in [
        (2, 0, "real"),
        (2, 1, "imag"),
        (2, 2, "real"),
        (3, 1, "real"),
        (7, 4, "imag"),
        (20, 20, "real"),
    ]:
        cosine, sine = np.zeros((2, n + 1, n + 1))
        (cosine if part == "real" else sine)[n, m] = 1.0
        slope = [
            (potential(place + e, n, m, part) - potential(place - e, n, m, part)) / (2.0 * step)
            for e in np.eye(3) * step
        ]
        got = Harmonics(GM, RADIUS_M, cosine, sine).perturb(*place)
        # differences: (n step / r)^2 of the value, 4e-9, and EPS V / step
        np.testing.assert_allclose(got, slope, rtol=0, atol=1e-8 * np.linalg.norm(slope))


def test_there_is_no_singularity_at_the_poles():
    field = Harmonics(GM, RADIUS_M, *coefficients(20))
    above, beside = field.perturb(0.0, 0.0, 7e6), field.perturb(1.0, 1.0, 7e6)
    # a metre of 7,000 km turns a harmonic of degree 20 by 3e-6 of a radian
    np.testing.assert_allclose(above, beside, rtol=0, atol=1e-5 * np.linalg.norm(above))


def test_a_lower_order_leaves_out_only_higher_ones():
    cosine, sine = coefficients(8)
    low = np.arange(9) <= 3
    place = (4.1e6, -3.2e6, 4.4e6)
    parts = [Harmonics(GM, RADIUS_M, cosine * mask, sine * mask).perturb(*place) for mask in (low, ~low, low | True)]
    np.testing.assert_allclose(np.add(parts[0], parts[1]), parts[2], rtol=0, atol=1e-18)
