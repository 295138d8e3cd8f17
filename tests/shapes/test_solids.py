"""Every solid is closed, wound outward, and encloses the volume that geometry says."""

import numpy as np
import pytest
import trimesh

from rso_lidar.shapes import solids

BOX = solids.skin([[(0, 0, z), (1, 0, z), (1, 2, z), (0, 2, z)] for z in (0, 3)])
SOLIDS = {
    "skin": (solids.skin([[(0, 0, z), (w, 0, z), (w, w, z), (0, w, z)] for z, w in ((0, 1), (1, 2), (3, 2))]), 31 / 3),
    "skin, the other way round": (solids.skin([[(0, 0, z), (0, 2, z), (1, 0, z)] for z in (0, 3)]), 3.0),
    "pair": (solids.join(BOX, BOX.move(5, 0, 0)), 12.0),
    "turned": (BOX.turn("y", 30).turn("z", -70).move(1, 2, 3), 6.0),
    "facing": (BOX.facing((1, -2, 0.5)), 6.0),
    "mirrored": (BOX.move(5, 0, 0).mirror("x"), 6.0),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solid_is_closed_and_holds_its_volume(name):
    solid, volume_m3 = SOLIDS[name]
    mesh = trimesh.Trimesh(*solid, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert solid.volume_m3() == pytest.approx(volume_m3, rel=1e-12)  # sums of a few hundred float64 terms
    assert mesh.volume == pytest.approx(volume_m3, rel=1e-9)  # the same by another hand


def test_pipe_keeps_its_radius_round_a_bend():
    line = np.array([(0, 0, 0), (1, 0, 0), (2, 1, 0), (2, 2, 1)], dtype=float)
    pipe = solids.pipe(line, 0.1, 16)
    assert trimesh.Trimesh(*pipe, process=False).is_watertight
    around = np.linalg.norm(pipe.vertices.reshape(4, 16, 3) - line[:, None], axis=2)
    assert around == pytest.approx(0.1, abs=1e-12)


def test_facing_turns_z_to_the_direction():
    arrow = solids.Solid(np.array([[0.0, 0.0, 2.0]]), np.zeros((0, 3), dtype=int))
    for direction in ((1, 2, 3), (0, 1, 0), (0, -1, 0), (-1, 0, 0), (0, 0, -1)):
        expected = 2.0 * np.array(direction) / np.linalg.norm(direction)
        assert arrow.facing(direction).vertices[0] == pytest.approx(expected, abs=1e-12)


def test_turns_are_right_handed():
    point = solids.Solid(np.array([[1.0, 0.0, 0.0]]), np.zeros((0, 3), dtype=int))
    assert point.turn("z", 90).vertices[0] == pytest.approx([0, 1, 0], abs=1e-15)
    assert point.turn("y", 90).vertices[0] == pytest.approx([0, 0, -1], abs=1e-15)
    assert point.turn("x", 90).vertices[0] == pytest.approx([1, 0, 0], abs=1e-15)
