"""The integral over the disc, against closed forms and another quadrature."""

import math

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import ncx2

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import UncertainState, foster_probability
from rso_lidar.orbit.collision.foster import disc_probability


@pytest.mark.parametrize("radius", [0.01, 1.0, 30.0, 1000.0])
def test_a_centred_round_density_is_rayleighs(radius):
    """Pc = 1 - exp(-R^2 / 2 sigma^2)."""
    expected = -math.expm1(-0.5 * (radius / 20.0) ** 2)
    assert disc_probability(np.zeros(2), np.eye(2) * 400.0, radius) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("miss", [0.0, 5.0, 60.0, 200.0, 600.0])
@pytest.mark.parametrize("radius", [0.5, 10.0, 100.0])
def test_an_offset_round_density_is_a_noncentral_chi_square(miss, radius):
    """|x|^2 / sigma^2 has two degrees of freedom and the noncentrality (d / sigma)^2 (Chan 2008)."""
    sigma = 25.0
    mean = miss * np.array([0.6, 0.8])
    expected = (
        ncx2.cdf((radius / sigma) ** 2, 2, (miss / sigma) ** 2) if miss else -math.expm1(-0.5 * (radius / sigma) ** 2)
    )
    assert disc_probability(mean, np.eye(2) * sigma**2, radius) == pytest.approx(expected, rel=1e-7, abs=1e-60)


@pytest.mark.parametrize(
    ("sigmas", "turn", "mean", "radius"),
    [
        ((300.0, 12.0), 0.4, (150.0, 60.0), 10.0),
        ((40.0, 8.0), 1.1, (10.0, -6.0), 30.0),
        ((5.0, 0.2), 0.7, (1.0, 2.0), 3.0),
    ],
)
def test_a_long_density_against_another_quadrature(sigmas, turn, mean, radius):
    c, s = math.cos(turn), math.sin(turn)
    axes = np.array([[c, -s], [s, c]])
    covariance = axes @ np.diag(np.square(sigmas)) @ axes.T
    inverse, scale = np.linalg.inv(covariance), 2.0 * math.pi * math.sqrt(np.linalg.det(covariance))

    def density(along, far):  # in polar coordinates, turned so that the density's ridge is an axis
        offset = axes @ (far * np.array([math.cos(along), math.sin(along)])) - mean
        return far * math.exp(-0.5 * offset @ inverse @ offset) / scale

    expected, _ = dblquad(density, 0.0, radius, 0.0, 2.0 * math.pi, epsabs=1e-11, epsrel=1e-9)
    assert disc_probability(np.array(mean), covariance, radius) == pytest.approx(expected, rel=1e-6)


def test_a_needle_is_the_chord_it_cuts():
    """With a short axis of a tenth of a millimetre the disc is a chord: the probability of one normal number."""
    covariance = np.diag([100.0**2, 1e-4**2])
    half = math.sqrt(10.0**2 - 6.0**2)
    expected = math.erf(half / (100.0 * math.sqrt(2.0)))
    assert disc_probability(np.array([0.0, 6.0]), covariance, 10.0) == pytest.approx(expected, rel=1e-9)


def test_a_singular_covariance_and_equal_velocities_are_refused():
    with pytest.raises(ScenarioError, match=r"^covariance: is singular in the encounter plane"):
        disc_probability(np.zeros(2), np.diag([1.0, 0.0]), 1.0)
    one = UncertainState([7e6, 0.0, 0.0], [0.0, 7.5e3, 0.0], np.eye(3))
    with pytest.raises(ScenarioError, match=r"^encounter: has no relative velocity"):
        foster_probability(one, one, 10.0)


def test_order_of_the_objects_and_axes_do_not_matter():
    rng = np.random.default_rng(8)
    roots = rng.normal(size=(2, 3, 3)) * 40.0
    first = UncertainState([7e6, 0.0, 0.0], [0.0, 7.5e3, 0.0], roots[0] @ roots[0].T)
    second = UncertainState([7e6 + 30.0, 20.0, 10.0], [100.0, 0.0, 7.4e3], roots[1] @ roots[1].T)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turned = [
        UncertainState(turn @ one.position_m, turn @ one.velocity_m_s, turn @ one.covariance[:3, :3] @ turn.T)
        for one in (second, first)
    ]
    assert foster_probability(*turned, 10.0) == pytest.approx(foster_probability(first, second, 10.0), rel=1e-9)
