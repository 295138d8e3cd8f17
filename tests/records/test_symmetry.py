"""Symmetry groups, and errors of rotation that respect them, against the least over all rotations of the group."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.records import Symmetry, rotation_error_rad

GROUPS = [
    Symmetry(fold=2),
    Symmetry(axis=(1.0, 2.0, 3.0), fold=3),
    Symmetry(axis=(2.0, 0.0, 2.0), fold=4, half_turn=(1.0, 1.0, -1.0)),
    Symmetry(fold=2, half_turn=(1.0, 1.0, 0.0)),
    Symmetry(fold=5, half_turn=(1.0, 1.0, 0.0)),
    Symmetry(axis=(0.0, 1.0, 1.0), fold=0),
    Symmetry(axis=(0.0, 1.0, 1.0), fold=0, half_turn=(1.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.in_words)
def test_error_is_the_least_over_the_group(group):
    a, b = Rotation.random(300, random_state=1), Rotation.random(300, random_state=2)
    step_deg = 0.5
    elements = Rotation.from_quat(group.rotations_xyzw(step_deg))
    brute = np.min([((a * one).inv() * b).magnitude() for one in elements], axis=0)
    made = rotation_error_rad(a.as_quat(), b.as_quat(), group)
    # The nearest sample of a continuous group is half a step off at most: that adds to small errors in quadrature.
    within = 1e-12 if group.fold else np.hypot(made, np.deg2rad(0.5 * step_deg)) - made + 1e-12
    assert np.all(made <= brute + 1e-12)
    assert np.all(brute - made <= within)


@pytest.mark.parametrize("group", [one for one in GROUPS if one.fold], ids=lambda group: group.in_words)
def test_elements_form_a_group(group):
    elements = Rotation.from_quat(group.rotations_xyzw())
    assert len(elements) == group.fold * (1 if group.half_turn is None else 2)
    for one in elements:
        products = (one * elements).as_quat()
        assert np.abs(products @ elements.as_quat().T).max(axis=1) == pytest.approx(1.0)
    assert elements[0].magnitude() == 0.0
    assert np.abs(elements.as_quat() @ elements.as_quat().T - np.eye(len(elements))).max() < 0.999  # no rotation twice


def test_without_symmetry_the_error_is_the_angle_between():
    a, b = Rotation.random(50, random_state=3), Rotation.random(50, random_state=4)
    assert rotation_error_rad(a.as_quat(), b.as_quat()) == pytest.approx((a.inv() * b).magnitude(), abs=1e-12)
    small = Rotation.from_rotvec([1e-9, 0.0, 0.0])
    assert rotation_error_rad(a.as_quat(), (a * small).as_quat()) == pytest.approx(1e-9, abs=1e-15)


def test_error_of_a_body_of_revolution_is_the_angle_between_axes():
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    a, b = Rotation.random(200, random_state=5), Rotation.random(200, random_state=6)
    cosine = np.einsum("ki,ki->k", a.apply(axis), b.apply(axis))
    for half_turn, wanted in ((None, np.arccos(cosine)), ((2.0, -1.0, 0.0), np.arccos(np.abs(cosine)))):
        group = Symmetry(axis=tuple(axis), fold=0, half_turn=half_turn)
        assert rotation_error_rad(a.as_quat(), b.as_quat(), group) == pytest.approx(wanted, abs=1e-7)


def test_a_sphere_has_no_error_of_rotation():
    a, b = Rotation.random(5, random_state=7), Rotation.random(5, random_state=8)
    assert rotation_error_rad(a.as_quat(), b.as_quat(), Symmetry(is_sphere=True)).tolist() == [0.0] * 5
    elements = Symmetry(is_sphere=True).rotations_xyzw()
    assert elements.shape == (60, 4)
    assert elements[0].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_the_axis_stays_where_it_is():
    group = Symmetry(axis=(0.0, 1.0, 1.0), fold=6, position_m=(1.0, 2.0, 3.0))
    rotations = group.rotations_xyzw()
    shift_m = group.translations_m(rotations)
    for along in (-2.0, 0.0, 5.0):
        point = np.array(group.position_m) + along * np.array(group.axis)
        assert Rotation.from_quat(rotations).apply(point) + shift_m == pytest.approx(np.tile(point, (6, 1)))


@pytest.mark.parametrize(
    ("wanted", "says"),
    [
        ({"fold": 1}, "fold = 1 has no rotation"),
        ({}, "fold = 1 has no rotation"),
        ({"fold": -2}, "fold"),
        ({"is_sphere": True, "fold": 2}, "leave out fold and half_turn"),
        ({"fold": 2, "half_turn": (0.0, 1.0, 1.0)}, "is not perpendicular to the axis"),
        ({"fold": 2, "axis": (0.0, 0.0, 0.0)}, "axis"),
    ],
)
def test_what_is_no_group_is_one_line(wanted, says):
    with pytest.raises(ScenarioError, match=says):
        Symmetry(**wanted)


def test_a_step_that_is_none():
    with pytest.raises(ScenarioError, match="step_deg: 0 is not a step"):
        Symmetry(fold=0).rotations_xyzw(0.0)
