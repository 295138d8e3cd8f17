"""The rtn axes of a body: about a centre that moves itself."""

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.motion.bodies.orbital_axes import find_turning_rad_s
from rso_lidar.motion.motions.placement import Place
from rso_lidar.orbit.central_body import MOON
from rso_lidar.pose import Link
from rso_lidar.records import BodyState

GM = MOON.gm_m3_s2


def pull(position_m):
    return -GM * position_m / np.linalg.norm(position_m) ** 3


def test_the_axes_of_a_body_about_the_moon_turn_with_its_own_orbit_and_not_with_the_moons():
    """Body and chief are in free fall, so that the body's plane is fixed and its axes turn by |r x v| / r² about z."""
    moon = BodyState(np.array([[3.1e8, -2.2e8, 0.9e8]]), np.array([[600.0, 750.0, -310.0]]))
    chief_m, chief_m_s = np.array([1.9e6, 0.3e6, -0.2e6]), np.array([-200.0, 1500.0, 420.0])
    body_m, body_m_s = chief_m + np.array([4e4, -9e4, 6e4]), chief_m_s + np.array([30.0, -70.0, 110.0])
    momentum, radius = np.cross(chief_m, chief_m_s), np.linalg.norm(chief_m)
    x, z = chief_m / radius, momentum / np.linalg.norm(momentum)
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    around = np.array([0.0, 0.0, np.linalg.norm(momentum) / radius**2])
    faster = np.array([0.0, 0.0, -2.0 * around[2] * (chief_m @ chief_m_s) / radius**2])
    rho = axes.T @ (body_m - chief_m)
    moved = axes.T @ (body_m_s - chief_m_s) - np.cross(around, rho)
    inertial = axes.T @ (pull(body_m) - pull(chief_m))
    pushed = inertial - 2.0 * np.cross(around, moved) - np.cross(around, np.cross(around, rho)) - np.cross(faster, rho)
    there = Link((moon.position_m + chief_m, axes[None]), moon.velocity_m_s + chief_m_s, around[None])
    place = Place(rho[None], moved[None], (moved[None], pushed[None]))
    body, chief = (BodyState(r[None], v[None]) for r, v in ((body_m, body_m_s), (chief_m, chief_m_s)))
    got = find_turning_rad_s(body, place, there, chief, moon, MOON)
    own = np.linalg.norm(np.cross(body_m, body_m_s)) / (body_m @ body_m)
    np.testing.assert_allclose(got, [[0.0, 0.0, own]], rtol=1e-12, atol=1e-12 * own)
    assert Rotation.from_matrix(axes).magnitude() > 0.1  # nothing above stands along an axis of the root
