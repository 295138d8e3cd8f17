"""Visibility by common part class: of parts that are free, behind another, and at the edge of the field."""

import numpy as np
import pytest

from rso_lidar.dataset.annotation.part_visibility import mark_silhouettes, measure_part_visibility
from rso_lidar.records import PART_CLASSES
from tests.dataset.annotation.test_frame_labels import CLASSES, fly
from tests.reference.dataset import silhouettes


def test_kernel_is_its_oracle():
    rng = np.random.default_rng(5)
    corners = rng.uniform(-4.0, 24.0, (60, 3, 2))
    corners[:20] *= 0.1  # small ones
    kind = rng.integers(0, 3, 60)
    made, wanted = np.zeros((2, 3, 17, 20), bool)
    mark_silhouettes(corners, kind, made)
    silhouettes.mark_silhouettes(corners, kind, wanted)
    assert wanted.any(axis=(1, 2)).all() and not wanted.all()
    assert np.array_equal(made, wanted)


def test_a_plate_alone_is_wholly_visible():
    scenario, frame = fly()
    found = measure_part_visibility(frame, scenario, 0)
    assert found[CLASSES.index("solar_array")] == 1.0
    assert np.isnan(np.delete(found, CLASSES.index("solar_array"))).all()
    assert np.isnan(measure_part_visibility(frame, scenario, None)).all()


def test_a_plate_at_the_edge_of_the_field_is_visible_in_part():
    # Its middle is at the edge of the field of 5 degrees, 100 m away.
    scenario, frame = fly(near_y_m=-100.0 * np.tan(np.deg2rad(2.5)))
    found = measure_part_visibility(frame, scenario, 0)
    assert found[CLASSES.index("solar_array")] == pytest.approx(0.5, abs=1.0 / 96)  # a cell
    outside, frame = fly(far_y_m=60.0)
    found = measure_part_visibility(frame, outside, 1)
    assert np.nanmax(found) == 0.0


def test_a_target_behind_a_plate_is_hidden_as_far_as_the_plate_reaches():
    scenario, frame = fly(near_m=20.0, far_y_m=0.0)  # 2 m at 20 m hides 20 m at 200 m
    assert np.nanmax(measure_part_visibility(frame, scenario, 1)) == 0.0
    # At 150 m the plate hides 2.7 m of 200 m: y and z from -1.33 to 1.33 m, in the middle of a craft of 7.7 m by 5.4 m.
    scenario, frame = fly(near_m=150.0, far_y_m=0.0)
    hidden = measure_part_visibility(frame, scenario, 1)
    free = measure_part_visibility(fly(near_m=150.0, far_y_m=-6.0)[1], scenario, 1)
    bus, cells = CLASSES.index("bus"), CLASSES.index("solar_array")
    assert hidden[bus] < 0.1 < free[bus]
    assert 0.3 < hidden[cells] < free[cells]


def test_silhouettes_agree_with_the_light_where_nothing_is_hidden():
    scenario, frame = fly()
    found = measure_part_visibility(frame, scenario, 1)
    assert found.shape == (len(PART_CLASSES),)
    assert found.dtype == np.float32
    there = {CLASSES.index(name) for name in scenario.source.targets[1].part_classes}
    assert set(np.flatnonzero(np.isfinite(found))) == there
    assert np.all(found[list(there)] <= 1.0)
