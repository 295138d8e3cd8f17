"""Maps of heights from frames, and of hazards."""

from types import SimpleNamespace

import numpy as np
import pytest

from rso_lidar.scene import build_height_field, build_surface
from rso_lidar.study import (
    HAZARD,
    SAFE,
    UNKNOWN,
    ElevationMap,
    build_elevation_map,
    build_true_elevation,
    compare_maps,
    find_hazards,
)

DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])  # site_from_lidar: columns east, rows south


def frame(points_site_m, height_m):
    """Return what is asked of a frame: points [m] that a lidar over the origin has seen."""
    points = (np.asarray(points_site_m, dtype=float) - [0.0, 0.0, height_m]) @ DOWN
    place = SimpleNamespace(place=lambda a, b: (np.array([0.0, 0.0, height_m]), DOWN))
    return SimpleNamespace(points_m=points, valid=np.ones(len(points), bool), truth=SimpleNamespace(poses=place))


def flat(n=40, cell_m=1.0, height_m=0.0):
    return ElevationMap(cell_m, np.full((n, n), height_m), np.ones((n, n), np.int32))


def test_points_fall_into_their_cells():
    made = build_elevation_map([frame([[-1.5, 1.5, 3.0], [1.5, -0.5, 4.0]], 100.0)], "site", 4.0, 1.0)
    assert made.height_m[0, 0] == pytest.approx(3.0, abs=1e-12)  # the north-west corner
    assert made.height_m[2, 3] == pytest.approx(4.0, abs=1e-12)
    assert np.isfinite(made.height_m).sum() == 2
    assert made.coverage == 2 / 16
    assert made.east_m.tolist() == [-1.5, -0.5, 0.5, 1.5]
    assert made.north_m.tolist() == [1.5, 0.5, -0.5, -1.5]


def test_what_was_seen_from_near_by_stands():
    points = [[0.5, 0.5, 0.0]]
    made = build_elevation_map([frame([[0.5, 0.5, 1.0]], 1001.0), frame(points, 100.0)], "site", 2.0, 1.0)
    far2, near2 = 1000.0**2 + 0.5, 100.0**2 + 0.5
    assert made.height_m[0, 1] == pytest.approx(near2 / (near2 + far2), rel=1e-12)


def test_a_point_from_nothing_is_dropped():
    points = np.column_stack([np.linspace(-3.9, 3.9, 50), np.zeros(50), np.zeros(50)])
    points[20, 2] = 60.0
    made = build_elevation_map([frame(points, 100.0)], "site", 8.0, 1.0)
    assert np.nanmax(made.height_m) == 0.0
    assert made.points.sum() == 49


def test_a_pose_that_is_believed_shifts_the_map():
    def higher(_, pose):
        return pose[0] + [0.0, 0.0, 2.0], pose[1]

    made = build_elevation_map([frame([[0.5, 0.5, 0.0]], 100.0)], "site", 2.0, 1.0, higher)
    assert np.nanmax(made.height_m) == pytest.approx(2.0, abs=1e-12)


def test_nothing_seen_is_nothing_known():
    made = build_elevation_map([], "site", 4.0, 1.0)
    assert made.coverage == 0.0
    assert (find_hazards(made, 3.0, 10.0, 0.3) == UNKNOWN).all()


def test_small_holes_are_mended_and_large_ones_are_not():
    ground = flat(9, height_m=5.0)
    ground.height_m[4, 4] = np.nan
    ground.height_m[:3, :3] = np.nan
    mended = ground.fill_holes().height_m
    assert mended[4, 4] == 5.0
    assert np.isnan(mended[0, 0])


def test_true_heights_are_those_of_the_mesh(tmp_path):
    at = np.arange(-20.0, 20.5, 1.0)
    plane = 0.1 * at[None, :] + 0.3 * at[::-1, None]  # rises to the east and to the north
    surface = build_surface("site", build_height_field(plane, 1.0, tmp_path / "plane", ""))
    found = flat(30)
    truth = build_true_elevation(surface, found)
    expected = 0.1 * found.east_m[None, :] + 0.3 * found.north_m[:, None]
    assert np.allclose(truth.height_m, expected, rtol=0.0, atol=1e-5)  # float32 of some 10 m
    assert np.allclose(truth.slope_deg, np.degrees(np.arctan(np.hypot(0.1, 0.3))), atol=1e-3)


def test_agreement_by_slope():
    truth, found = flat(), flat(height_m=0.2)
    truth.height_m[:, 20:] += np.arange(20)  # 45 degrees in the east
    found.height_m[:, 20:] += np.arange(20)
    found.height_m[0, 0] = np.nan
    whole, gentle, steep = compare_maps(found, truth, (0, 20, 90))
    assert whole.cells == 1600
    assert gentle.cells + steep.cells == 1600
    assert steep.cells == 40 * 20
    assert gentle.coverage == pytest.approx(1.0 - 1.0 / gentle.cells)
    for row in (whole, gentle, steep):
        assert row.bias_m == pytest.approx(0.2, abs=1e-12)
        assert row.rms_m == pytest.approx(0.2, abs=1e-12)


def test_hazards_are_slopes_and_stones():
    x = np.arange(60) - 30.0
    ground = flat(60)
    ground.height_m[:] = np.where(x > 0.0, np.tan(np.radians(12.0)) * x, 0.0)
    ground.height_m[30, 10] = 0.5
    state = find_hazards(ground, 5.0, 10.0, 0.3)
    assert state[30, 50] == HAZARD  # 12 degrees
    assert state[30, 22] == SAFE
    assert (state[28:33, 8:13] == HAZARD).all()  # a stone anywhere under the lander
    assert state[30, 7] == SAFE
    assert state[0, 0] == UNKNOWN  # beyond the edge
    gentle = find_hazards(ground, 5.0, 13.0, 0.6)
    assert (gentle[2:-2, 2:-2] == SAFE).all()


def test_a_hole_under_the_lander_is_not_known():
    ground = flat()
    ground.height_m[20, 20] = np.nan
    state = find_hazards(ground, 3.0, 10.0, 0.3)
    assert (state[19:22, 19:22] == UNKNOWN).all()
    assert state[20, 18] == SAFE


def test_no_cell_is_an_error():
    with pytest.raises(ValueError, match="make cell_m smaller"):
        build_elevation_map([], "site", 1.0, 10.0)
