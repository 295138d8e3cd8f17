"""Anomalies of ellipses and hyperbolas by their definitions, on either side of perigee and turns away."""

import math

import numpy as np
import pytest

from rso_lidar.orbit.two_body import anomaly


@pytest.mark.parametrize("e", [1.05, 1.7, 6.0])
@pytest.mark.parametrize("h", [-1.3, -0.2, 0.4, 2.1])
def test_a_hyperbola_s(e, h):
    """cos nu = (e - cosh H) / (e cosh H - 1), sin nu = sqrt(e^2 - 1) sinh H / (e cosh H - 1), M = e sinh H - H."""
    below = e * math.cosh(h) - 1.0
    nu = math.atan2(math.sqrt(e**2 - 1.0) * math.sinh(h) / below, (e - math.cosh(h)) / below)
    mean = e * math.sinh(h) - h
    assert float(anomaly.true_from_eccentric(h, e)) == pytest.approx(nu, rel=1e-12)
    assert float(anomaly.eccentric_from_true(nu, e)) == pytest.approx(h, rel=1e-12)
    assert float(anomaly.mean_from_eccentric(h, e)) == pytest.approx(mean, rel=1e-12)
    assert float(anomaly.eccentric_from_mean(mean, e)) == pytest.approx(h, rel=1e-12)
    assert float(anomaly.true_from_mean(mean, e)) == pytest.approx(nu, rel=1e-12)


@pytest.mark.parametrize("e", [0.05, 0.4, 0.93])
@pytest.mark.parametrize("eccentric", [-2.0, 0.3, 1.9, 2.9])
@pytest.mark.parametrize("turns", [-3, 0, 5])
def test_an_ellipse_s(e, eccentric, turns):
    """cos nu = (cos E - e) / (1 - e cos E), sin nu = sqrt(1 - e^2) sin E / (1 - e cos E), M = E - e sin E."""
    around = math.tau * turns
    below = 1.0 - e * math.cos(eccentric)
    nu = math.atan2(math.sqrt(1.0 - e**2) * math.sin(eccentric) / below, (math.cos(eccentric) - e) / below)
    mean = eccentric - e * math.sin(eccentric)
    told = (
        anomaly.true_from_eccentric(eccentric + around, e) - nu,
        anomaly.eccentric_from_true(nu + around, e) - eccentric,
        anomaly.mean_from_eccentric(eccentric + around, e) - mean,
        anomaly.eccentric_from_mean(mean + around, e) - eccentric,
        anomaly.mean_from_true(nu + around, e) - mean,
    )
    np.testing.assert_allclose(told, around, atol=1e-13 * (1.0 + abs(around)) / (1.0 - e))
