"""The targets that missions meet: published dimensions, and the CubeSat family."""

import math

import numpy as np
import pytest

from models.build import comsat
from models.build.build import build
from models.build.cubesat import cubesat
from rso_lidar.errors import ScenarioError

INCH_M = 0.0254


@pytest.fixture(scope="module")
def envisat():
    return build("envisat")


def extent(model, *parts):
    """Return the extents along x, y, z of some parts [m]."""
    return np.ptp(np.concatenate([model.parts[part].vertices for part in parts]), axis=0)


def principal(vertices):
    """Return the extents of points along their principal axes, longest first [m]."""
    _, _, axes = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)
    return np.ptp(np.einsum("ij,kj->ik", vertices, axes), axis=0)


def test_envisat_has_the_size_that_esa_gives(envisat):
    assert envisat.size_m == pytest.approx([26.0, 10.0, 5.0], abs=0.5)  # 26 m x 10 m x 5 m, to the metre
    # the wing is of 14 panels of 1 m by 5 m: a quarter is for the edges without cells and the gaps
    wing = principal(envisat.parts["solar_array"].vertices)
    assert wing[:2] == pytest.approx([14.0, 5.0], abs=0.25)
    cant = math.radians(22.0)
    along = np.sort(envisat.parts["solar_array"].vertices @ [math.cos(cant), -math.sin(cant), 0.0])
    steps = np.diff(along)  # a cell is 0.30 m wide, between cells are 14 mm, between panels 75 mm
    assert np.count_nonzero((steps > 0.05) & (steps < 0.2)) == 13
    # the radar antenna is 10 m by 1.3 m, to half of the last digit
    assert extent(envisat, "antenna_asar", "antenna_asar_frame")[1] == pytest.approx(10.0, abs=0.05)
    assert principal(envisat.parts["antenna_asar"].vertices)[1] == pytest.approx(1.3, abs=0.05)
    # without the wing it is as long as at launch: 10.5 m
    platform = [name for name in envisat.parts if not name.startswith("solar_")]
    assert extent(envisat, *platform)[0] == pytest.approx(10.5, abs=0.1)


def test_envisat_weighs_what_is_published_where_it_is_published(envisat):
    # ESA: 2673 + 1021 + 2078 + 2118 kg without fuel, some of which was left; ILRS: (-3.86, -0.01, 0.00) m
    assert envisat.mass_kg == pytest.approx(2673 + 1021 + 2078 + 2118, rel=0.02)
    assert envisat.center_of_mass_m == pytest.approx([-3.86, -0.01, 0.00], abs=0.1)
    # the tensor that public simulations of its removal use; within a module we spread the mass by guess
    assert np.diag(envisat.inertia_kg_m2) == pytest.approx([17023.3, 124825.7, 129112.2], rel=0.10)


def test_envisat_carries_its_markers_where_they_are_published(envisat):
    # ILRS: the retroreflector's reference at (-4.920, 1.350, -1.180) m; the cubes sit on a cone of 0.09 m about it
    cubes = envisat.parts["retroreflector"].vertices
    assert np.linalg.norm(cubes - [-4.920, 1.350, -1.180], axis=1).max() < 0.09
    # IDS: reference of the DORIS antenna at a height of -1.725 m
    assert envisat.parts["antenna_doris"].vertices[:, 2].min() == pytest.approx(-1.725, abs=1e-9)


def test_zenit_stage_is_as_wide_as_a_zenit_and_as_heavy_as_people_say():
    stage = build("zenit_stage")
    assert stage.size_m[0] == pytest.approx(10.4, abs=0.01)
    across = 2 * np.hypot(*stage.parts["tank"].vertices[:, 1:].T).max()
    assert across == pytest.approx(3.9, abs=0.05)  # 3.9 m; frames stand out by 22 mm on both sides
    assert 8300.0 <= stage.mass_kg <= 9000.0


def test_capsule_has_the_size_that_nasa_gives():
    model = build("capsule")
    # 10 ft 7 in high and 12 ft 10 in across, given to the inch
    assert model.size_m[0] == pytest.approx((10 * 12 + 7) * INCH_M, abs=0.5 * INCH_M)
    shield = model.parts["heat_shield"].vertices
    assert 2 * np.hypot(*shield[:, 1:].T).max() == pytest.approx((12 * 12 + 10) * INCH_M, abs=0.5 * INCH_M)
    assert model.mass_kg == pytest.approx(12_800 * 0.45359237, rel=0.01)  # "about 12,800 lb"
    # the cone narrows by tan(33 deg), and the shield's middle is part of a sphere
    cone = model.parts["cabin"].vertices
    radius = np.hypot(*cone[:, 1:].T)
    slope = np.polyfit(cone[radius > 0.7, 0], radius[radius > 0.7], 1)[0]
    assert slope == pytest.approx(-math.tan(math.radians(33.0)), abs=0.02)  # a groove at its foot is part of the fit
    cap = shield[(np.hypot(*shield[:, 1:].T) < 1.7) & (shield[:, 0] < 0.0)]
    center = np.array([shield[:, 0].min() + 4.694, 0.0, 0.0])
    assert np.linalg.norm(cap - center, axis=1) == pytest.approx(4.694, abs=1e-9)


def test_reflectors_of_the_comsat_focus_where_their_feeds_are():
    model = build("comsat")
    assert model.size_m[0] == pytest.approx(36.0, abs=1e-9)
    points = model.parts["antenna_reflectors_east"].vertices
    points = points[points[:, 0] > 0.0]
    # light along -z from a plane comes to the focus by equal ways: |p - F| - z is the same all over the front
    way = np.linalg.norm(points - comsat.FEED_M, axis=1) - points[:, 2]
    expected = 2.0 * comsat.FOCAL_LENGTH_M - comsat.FEED_M[2]  # at the vertex of the paraboloid
    front = np.abs(way - expected) < 1e-9
    assert np.count_nonzero(front) == pytest.approx(0.5 * len(points), abs=1)
    horns = model.parts["feeds_east"].vertices
    assert np.linalg.norm(horns - comsat.FEED_M, axis=1).min() < 0.15


@pytest.mark.parametrize(
    ("units", "size_mm", "limit_kg"),
    [
        (1, (113.5, 100.0, 100.0), 2.0),
        (3, (340.5, 100.0, 100.0), 6.0),
        (6, (366.0, 226.3, 100.0), 12.0),
        (12, (366.0, 226.3, 226.3), 24.0),
    ],
)
def test_cubesats_are_the_standard_s(units, size_mm, limit_kg):
    """CubeSat Design Specification rev. 14.1: size over the rails and the most that it may weigh."""
    model = cubesat(units)
    rails = np.ptp(model.parts["rails"].vertices, axis=0)
    assert 1000 * rails == pytest.approx(size_mm, abs=1e-6)  # drawn, not made: the standard allows 0.1 mm
    assert 0.5 * limit_kg < model.mass_kg <= limit_kg
    for part in ("bus", "body_cells", "star_tracker", "antenna_patch", "telescope"):
        if part in model.parts:  # nothing on a side stands out of the rails by more than the standard's 6.5 mm
            out = np.abs(model.parts[part].vertices[:, 1:]).max(axis=0) - 0.5 * np.array(size_mm[1:]) / 1000
            assert out.max() <= 0.0065, part
    if units > 1:  # folded, the boards lie between the rails
        board = model.parts["solar_substrate_left"].vertices
        assert np.ptp(board[:, 0]) < size_mm[0] / 1000
    assert {hinge.name for hinge in model.hinges} == ({"solar_left", "solar_right"} if units > 3 else set())


def test_cubesat_of_other_units_is_one_line():
    with pytest.raises(ScenarioError, match=r"^cubesat: 2 units: there are CubeSats of 1, 3, 6, 12 here$"):
        cubesat(2)
