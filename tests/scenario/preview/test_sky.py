"""The lit side of the Earth in a field of view, and directions outside it."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import angle_rad
from rso_lidar.scenario.preview.sky import angle_outside_field_rad, is_earth_lit

EARTH, AU = units.EARTH_RADIUS_M, units.ASTRONOMICAL_UNIT_M


def row(*vector):
    return np.array([vector], dtype=float)


class TestEarth:
    position = row(EARTH + 400e3, 0, 0)

    @pytest.mark.parametrize(
        ("sun", "down", "ahead"),
        [((AU, 0, 0), True, True), ((-AU, 0, 0), False, False), ((0, AU, 0), None, True), ((0, -AU, 0), None, False)],
    )
    def test_which_side_of_it_is_seen(self, sun, down, ahead):
        """Straight down, and over the horizon toward +y, where the limb is 19.9 degrees along from the point below."""
        if down is not None:
            assert is_earth_lit(row(-1, 0, 0), self.position, row(*sun))[0] == down
        assert is_earth_lit(row(0, 1, 0), self.position, row(*sun))[0] == ahead
        assert is_earth_lit(row(-0.1, 1, 0), self.position, row(*sun))[0] == ahead

    def test_the_limb_that_it_takes_is_the_one_ahead(self):
        """The point below is 10 degrees on the night side: the limb 19.9 degrees toward the Sun lies in daylight."""
        sun = AU * row(-math.sin(10 * units.DEG), math.cos(10 * units.DEG), 0)
        assert not is_earth_lit(row(-1, 0, 0), self.position, sun)[0]
        assert not is_earth_lit(row(-1, 0.1, 0), self.position, sun)[
            0
        ]  # meets the ground 40 km toward it, still at night
        assert is_earth_lit(row(0, 1, 0), self.position, sun)[0]
        assert not is_earth_lit(row(0, -1, 0), self.position, sun)[0]


class TestField:
    half = np.array([math.tan(10 * units.DEG), math.tan(5 * units.DEG)])

    def outside_deg(self, *direction):
        return angle_outside_field_rad(row(*direction), self.half)[0] / units.DEG

    def test_inside(self):
        for x, y in ((0, 0), (0.17, 0), (-0.17, 0.08), (0.17, -0.08)):
            assert self.outside_deg(5 * x, 5 * y, 5) == 0.0

    @pytest.mark.parametrize("sign", [1, -1])
    def test_beside_its_edges(self, sign):
        for turn_deg in (11, 30, 89, 91):
            turn = turn_deg * units.DEG
            assert self.outside_deg(sign * math.sin(turn), 0, math.cos(turn)) == pytest.approx(turn_deg - 10, abs=1e-9)
            assert self.outside_deg(0, sign * math.sin(turn), math.cos(turn)) == pytest.approx(turn_deg - 5, abs=1e-9)

    def test_against_the_nearest_of_many_directions_inside(self):
        """The least angle to a grid of 400 x 400 in the field: never below, and above by at most half a grid cell."""
        directions = np.random.default_rng(1).normal(size=(60, 3))
        x, y = np.meshgrid(np.linspace(-1, 1, 400) * self.half[0], np.linspace(-1, 1, 400) * self.half[1])
        grid = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
        cell = math.hypot(self.half[0], self.half[1]) / 399
        for direction, got in zip(directions, angle_outside_field_rad(directions, self.half), strict=True):
            nearest = angle_rad(grid, direction[None]).min()
            assert -1e-12 <= nearest - got <= cell
