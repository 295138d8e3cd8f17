"""Every primitive is closed, wound outward, and encloses the volume that geometry says."""

import math

import numpy as np
import pytest
import trimesh

from models.build import primitives

L_SHAPE = primitives.lattice([0, 1, 2], [0, 1, 2], [(1, 1)], 0.5)


def polygon_area(sides):
    """Return the area of a regular polygon in the unit circle."""
    return 0.5 * sides * math.sin(2 * math.pi / sides)


SOLIDS = {
    "box": (primitives.box((1, 2, 3), (4, 5, 6)), 6.0),
    "prism": (primitives.prism([(0, 0), (1, 0), (0, 1)], -1, 2), 1.5),
    "cylinder": (primitives.cylinder(2.0, -1.0, 3.0, 24), 16 * polygon_area(24)),
    "cone": (primitives.frustum(1.0, 0.0, 0.0, 3.0, 16), polygon_area(16)),
    "funnel": (primitives.frustum(0.0, 1.0, 0.0, 3.0, 16), polygon_area(16)),
    "frustum": (primitives.frustum(1.0, 2.0, 0.0, 3.0, 16), 7 * polygon_area(16)),
    "ring": (primitives.ring(1.0, 2.0, 0.0, 0.5, 20), 1.5 * polygon_area(20)),
    "wall": (primitives.wall([(1.0, 0.0), (1.0, 2.0)], 0.5, 20), 2.5 * polygon_area(20)),
    "dish": (primitives.dish(2.0, 0.5, 0.1, 6, 20), 0.1 * polygon_area(20)),
    "bar": (primitives.tube((1, 1, 1), (1, 4, 5), 0.5, 12), 5 * 0.25 * polygon_area(12)),
    "lattice": (L_SHAPE, 1.5),
    "frame": (primitives.lattice([0, 1, 3, 4], [0, 1, 3, 4], [(1, 1)], 0.1), 1.2),
    "tiles": (primitives.tiles((3.2, 2.1, 0.5), (3, 2), 0.1), 3 * 2 * 1.0 * 1.0 * 0.5),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solid_is_closed_and_holds_its_volume(name):
    solid, volume_m3 = SOLIDS[name]
    mesh = trimesh.Trimesh(*solid, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert solid.volume_m3() == pytest.approx(volume_m3, rel=1e-12)  # sums of a few hundred float64 terms
    assert mesh.volume == pytest.approx(volume_m3, rel=1e-9)  # the same by another hand


def test_round_solids_approach_their_smooth_shape_from_inside():
    ball, dome, torus = (
        primitives.ball(1.0, splits=4),
        primitives.dome(1.0, 2.0, 64, 128),
        primitives.torus(2.0, 0.5, 256, 64),
    )
    assert np.linalg.norm(ball.vertices, axis=1) == pytest.approx(1.0, abs=1e-14)
    for solid, smooth_m3 in ((ball, 4 * math.pi / 3), (dome, 4 * math.pi / 3), (torus, math.pi**2)):
        assert trimesh.Trimesh(*solid, process=False).is_watertight
        # chords of n sides lose (2 pi / n)^2 / 6 of an area: below 1 % for 64 sides or for edges of 0.07
        assert 0.99 * smooth_m3 < solid.volume_m3() < smooth_m3


def test_dish_is_a_paraboloid():
    front = primitives.dish(4.0, 1.5, 0.01, 8, 32).vertices
    radius = np.hypot(front[:, 0], front[:, 1])
    on_front = np.isclose(front[:, 2], radius**2 / 6.0, atol=1e-12)
    on_back = np.isclose(front[:, 2], radius**2 / 6.0 - 0.01, atol=1e-12)
    assert np.all(on_front ^ on_back)
    assert radius.max() == pytest.approx(2.0)
