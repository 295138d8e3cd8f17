"""Errors of the thrust that holds a leg, to first order, beside a rotation of the thrust itself."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.rpo import HeldThrustErrors, Thrusters

STAGE_S = np.array([0.0, 40.0, 95.0])
AXES = Rotation.from_euler("zyx", [[20.0, -50.0, 130.0], [70.0, 15.0, -40.0], [-160.0, 33.0, 8.0]], degrees=True)
CONTROL = np.array([[2e-3, -1e-3, 3e-3], [0.5e-3, 4e-3, -2e-3], [-1e-3, 2e-3, 0.7e-3]])
THRUSTERS = Thrusters(magnitude_sigma_fraction=0.02, pointing_sigma_deg=0.3)


def make_errors():
    return HeldThrustErrors(STAGE_S, lambda _: (AXES.as_matrix(), np.zeros((3, 3))), lambda _: CONTROL, THRUSTERS)


@pytest.mark.parametrize("stage", [0, 1, 2])
def test_a_thrust_is_turned_about_the_axes_of_the_body_approached(stage):
    """The turn is a rotation vector in rtn axes, as that of a burn is; what is left is its square: 4e-5 of the thrust."""
    numbers = np.array([0.7, 1.1, -0.6, 0.4])
    turned = Rotation.from_rotvec(0.3 * units.DEG * numbers[1:]).apply(CONTROL[stage])
    expected = AXES[stage].apply(turned + 0.02 * 0.7 * CONTROL[stage] - CONTROL[stage])
    got = make_errors().make_push(numbers[:, None])(stage)[:, 0]
    assert got == pytest.approx(expected, abs=5e-5 * np.linalg.norm(CONTROL[stage]))


def test_without_thrust_all_of_it_is_missing():
    assert make_errors().stop()(1)[:, 0] == pytest.approx(-AXES[1].apply(CONTROL[1]), rel=1e-12)
