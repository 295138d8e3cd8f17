"""Estimated mass properties against closed forms."""

import numpy as np
import pytest

from models.build.primitives import ball, box
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart


def craft(**pieces):
    kind = Taxonomy(
        object_class="payload", subclass="test", shape_family="box", size_class="medium", stabilisation="fixed"
    )
    return CraftModel("craft", "a craft", "this test", "exact", "any", pieces, kind)


def test_box_has_the_inertia_of_a_box():
    model = craft(body=CraftPart(box((1, 2, 3), (5, -6, 7)), "aluminium", 12.0))
    assert model.mass_kg == 12.0
    assert model.center_of_mass_m == pytest.approx([5, -6, 7])
    expected = np.diag([12 / 12 * (4 + 9), 12 / 12 * (1 + 9), 12 / 12 * (1 + 4)])  # m/12 (b^2 + c^2)
    assert model.inertia_kg_m2 == pytest.approx(expected, abs=1e-9)


def test_hollow_cube_has_the_inertia_of_six_plates():
    model = craft(shell=CraftPart(box((2, 2, 2)), "aluminium", 6.0, hollow=True))
    # two plates across the axis, m/12 (a^2 + a^2) each; four beside it, m a^2 / 12 + m (a/2)^2 each; m = 1, a = 2
    expected = 2 * (8 / 12) + 4 * (4 / 12 + 1)
    assert model.inertia_kg_m2 == pytest.approx(expected * np.eye(3), abs=1e-12)


def test_hollow_sphere_approaches_two_thirds():
    model = craft(shell=CraftPart(ball(1.0, splits=5), "aluminium", 3.0, hollow=True))
    # facets lie up to 0.3 mm inside, so the moment is short by less than twice that
    assert np.diag(model.inertia_kg_m2) == pytest.approx(2.0, rel=6e-4)


def test_two_pieces_obey_the_parallel_axis_theorem():
    left, right = box((1, 1, 1), (-2, 0, 0)), box((1, 1, 1), (4, 0, 0))
    model = craft(left=CraftPart(left, "aluminium", 2.0), right=CraftPart(right, "aluminium", 1.0))
    assert model.center_of_mass_m == pytest.approx([0, 0, 0])
    own = 3.0 / 6.0
    assert np.diag(model.inertia_kg_m2) == pytest.approx([own, own + 2 * 4 + 16, own + 2 * 4 + 16])
    assert model.size_m == pytest.approx([7, 1, 1])
    assert model.facet_count == 24


def test_a_part_without_a_class_names_the_table():
    model = craft(bus=CraftPart(box((1, 1, 1)), "aluminium", 1.0), flag=CraftPart(box((1, 1, 1)), "aluminium", 1.0))
    with pytest.raises(ScenarioError, match="part 'flag': has no common part class; add it to"):
        print(model.part_classes)
