"""A warning names standard deviations of a start that no mission has, and what they would be in the other unit."""

import warnings

import numpy as np
import pytest

from rso_lidar.errors import RsoLidarWarning
from rso_lidar.scenario import Dispersion, TargetErrors

# 20 m along the track and 15 mm/s across it, with a correlation of -0.6 between the first two
METRES = np.diag([4.0**2, 20.0**2, 5.0**2, 0.01**2, 0.004**2, 0.015**2])
METRES[0, 4] = METRES[4, 0] = -0.6 * 4.0 * 0.004


@pytest.mark.parametrize("part", [Dispersion, TargetErrors])
@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"velocity_sigma_m_s": (3, 20, 1)}, r"^velocity_sigma_m_s: a sigma of 20 m/s .* mm .* of 0\.02 m/s: .* by 1000"),
        ({"position_sigma_m": (0, 0, 3e5)}, r"^position_sigma_m: a sigma of 3e\+05 m .* mm .* of 300 m: .* by 1000"),
        ({"covariance": (METRES * 1e-6).tolist()}, r"^covariance: .* 0\.02 m and 1\.5e-05 m/s .* 20 m and 0\.015 m/s: "),
        ({"covariance": (METRES * 1e6).tolist()}, r"^covariance: a sigma of .* 15 m/s"),
    ],
)  # fmt: skip
def test_units_that_no_mission_has_are_asked_about(part, fields, words):
    with pytest.warns(RsoLidarWarning, match=words):
        part(**fields)


def test_what_missions_have_is_not_asked_about():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Dispersion()
        Dispersion(position_sigma_m=(0.01, 0.01, 0.01), velocity_sigma_m_s=(1e-5, 1e-5, 1e-5))  # not a covariance
        Dispersion(position_sigma_m=(1e4, 1e5, 1e3), velocity_sigma_m_s=(10.0, 1.0, 0.0))
        Dispersion(covariance=METRES.tolist())
        known = Dispersion(covariance=np.diag([1e-4, 0, 0, 0, 0, 0]).tolist())  # velocity known
    assert known.start_covariance[0, 0] == 1e-4
