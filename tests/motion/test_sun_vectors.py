"""The share of the Sun that a body sees, beside the Earth and the Moon."""

import datetime

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.motion.sun_vectors import SunVectors
from rso_lidar.orbit import Epochs
from rso_lidar.records import BodyState


def hide(sun, sun_rad, toward, radius_rad, n=801):
    """Return which points of the Sun's disc (point) lie behind a disc of the sky, by a grid of points."""
    y, z = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, n) * sun_rad])
    on = y**2 + z**2 < sun_rad**2
    across, up = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    points = sun + np.tan(y[on])[:, None] * across + np.tan(z[on])[:, None] * up
    cosine = points @ toward / np.linalg.norm(points, axis=1)
    return np.arccos(cosine) < radius_rad


@pytest.mark.parametrize(("earth_depth", "moon_depth"), [(0.55, 0.3), (0.2, 0.65), (0.4, 0.0), (0.7, 0.75)])
def test_earth_and_moon_on_opposite_sides_of_the_sun_hide_the_sum_of_their_parts(earth_depth, moon_depth):
    """The two are counted point by point over the Sun's disc. Where they overlap, less than nothing is nothing."""
    epochs = Epochs(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), np.zeros(1))
    sun = SunVectors(epochs, local=False, given=None)
    to_sun = sun.direction[0]
    side = np.cross(to_sun, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    sun_rad = np.arcsin(units.SUN_RADIUS_M / np.linalg.norm(sun.position_m[0]))

    def place(radius_m, distance_m, depth, sign):
        """Return where a sphere reaches over the Sun's disc from one side, `depth` of the Sun's diameter."""
        apart = np.arcsin(radius_m / distance_m) + sun_rad * (1.0 - 2.0 * depth)
        return distance_m * (np.cos(apart) * to_sun + sign * np.sin(apart) * side)

    # The body sees the Earth from the distance of the Moon, and the Moon from 60,000 km.
    earth_m = place(units.EARTH_RADIUS_M, 4.1e8, earth_depth, 1.0)
    moon_m = place(units.MOON_RADIUS_M, 6.0e7, moon_depth, -1.0)
    body, moon = (BodyState(position_m=at[None], velocity_m_s=np.zeros((1, 3))) for at in (-earth_m, moon_m - earth_m))
    toward_sun = sun.position_m[0] + earth_m
    sun_rad = np.arcsin(units.SUN_RADIUS_M / np.linalg.norm(toward_sun))
    toward_sun /= np.linalg.norm(toward_sun)
    turn = np.stack([toward_sun, side, np.cross(toward_sun, side)])  # to axes of the grid: x toward the Sun
    behind = [
        hide(np.array([1.0, 0.0, 0.0]), sun_rad, turn @ at / np.linalg.norm(at), np.arcsin(radius / np.linalg.norm(at)))
        for at, radius in ((earth_m, units.EARTH_RADIUS_M), (moon_m, units.MOON_RADIUS_M))
    ]
    expected = max(1.0 - behind[0].mean() - behind[1].mean(), 0.0)
    assert sun.visible_fraction(body, moon)[0] == pytest.approx(
        expected, abs=0.003
    )  # two edges, each known to the width of a point, 1/801
    assert sun.visible_fraction(body)[0] == pytest.approx(1.0 - behind[0].mean(), abs=0.0015)
