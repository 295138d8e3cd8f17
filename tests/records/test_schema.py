"""Records: checked against their statements, locked, and honest about absence."""

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform

from rso_lidar.errors import RecordError
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    BodyState,
    Command,
    Frame,
    Labels,
    Observation,
    PtuAngles,
    Rays,
    Reading,
    Record,
    Source,
    Truth,
    array,
    specs,
)


@dataclass(frozen=True, eq=False)
class Sample(Record):
    """A record with two arrays that share a dimension, and one that may be left out."""

    name: str
    range_m: np.ndarray = array("hit", "f8", "m", "slant range")
    direction: np.ndarray = array("hit xyz", "f4", "1", "unit vector")
    extra_m: np.ndarray | None = array("hit", "f8", "m", "what may be left out", optional=True)


def reading(shape=(2, 3)):
    range_m = np.full(shape, np.nan)
    range_m[0, 1] = 1000.5
    counts = np.zeros(shape, dtype=int)
    counts[0, 1] = 700
    return Reading(range_m=range_m, intensity_counts=counts, saturated=np.zeros(shape, dtype=bool))


def frame(shape=(2, 3)):
    line_of_sight = np.zeros((*shape, 3))
    line_of_sight[..., 2] = 1.0
    observation = Observation(2.5, reading(shape), {}, line_of_sight)
    sky = np.full(shape, -1)
    nothing = np.zeros(shape)
    nan = np.full(shape, np.nan)
    labels = Labels(nan, nan, nothing, sky, sky, sky, nan, nothing, nothing)
    truth = Truth(2.5, PoseTree({}, {}), {}, np.full(3, np.nan))
    return Frame(5, observation, labels, truth, Source("", "", "", 1, {}, ()))


def test_a_statement_is_kept_in_order():
    assert list(specs(Sample)) == ["range_m", "direction", "extra_m"]
    spec = specs(Sample)["direction"]
    assert (spec.dims, spec.dtype, spec.unit, spec.meaning) == (("hit", "xyz"), np.dtype("f4"), "1", "unit vector")


def test_arrays_get_their_dtype_and_are_locked():
    given_m = np.array([1.0, 2.0])
    record = Sample("a", given_m, [[0, 0, 1], [1, 0, 0]])
    assert record.direction.dtype == np.float32
    with pytest.raises(ValueError, match="read-only"):
        record.range_m[0] = 3.0
    given_m[0] = 9.0  # the caller's own array stays writable
    assert record.extra_m is None


def test_a_record_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        reading().range_m = np.zeros((2, 3))


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ((np.zeros((2, 2)), np.zeros((2, 3))), r"Sample\.range_m: needs dims \(hit\), got \(2, 2\)"),
        ((np.zeros(3), np.zeros((2, 3))), r"Sample\.direction: hit is 2 here and 3 elsewhere"),
        ((np.zeros(2), np.zeros((2, 4))), r"Sample\.direction: xyz is 4 here and 3 elsewhere"),
        ((np.zeros(2), np.zeros((2, 3)), np.zeros(5)), r"Sample\.extra_m: hit is 5 here and 2 elsewhere"),
    ],
)
def test_dims_are_checked(fields, complaint):
    with pytest.raises(TypeError, match=complaint):
        Sample("a", *fields)


@given(rows=st.integers(0, 5), cols=st.integers(0, 5))
def test_any_size_will_do_where_all_agree(rows, cols):
    blank = np.zeros((rows, cols))
    assert Reading(blank, blank, blank).range_m.shape == (rows, cols)
    with pytest.raises(TypeError, match="row is"):
        Reading(blank, np.zeros((rows + 1, cols)), blank)


def test_empty_rays_are_rays():
    rays = Rays((128, 128), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    assert rays.pixel.dtype == np.int32
    assert len(rays.direction) == 0


def test_valid_is_where_a_range_was_reported():
    one = frame()
    assert one.time_s == 2.5
    assert one.valid.sum() == 1
    assert one.valid[0, 1]
    np.testing.assert_array_equal(one.intensity_counts > 0, one.valid)
    assert one.intensity_counts.dtype == np.uint16
    assert one.saturated.dtype == bool


def test_points_are_range_times_line_of_sight():
    points = frame().points_m
    assert points.shape == (2, 3, 3)
    np.testing.assert_array_equal(points[0, 1], [0.0, 0.0, 1000.5])
    assert np.isnan(np.delete(points.reshape(6, 3), 1, axis=0)).all()


def test_an_observation_holds_no_truth():
    """A controller gets what the spacecraft could know."""
    names = {field.name for field in dataclasses.fields(Observation)}
    assert names == {"time_s", "reading", "settings", "line_of_sight", "pan_tilt_rad", "sensors", "camera"}


def test_a_command_asks_for_nothing_by_default():
    assert (Command().pan_rad, Command().tilt_rad) == (None, None)


def batch():
    """A target that drifts away from the root along x at 2 m/s, at epochs 0, 10 and 20 s."""
    time_s = np.array([0.0, 10.0, 20.0])
    position = np.stack([2.0 * time_s, np.zeros(3), np.zeros(3)], axis=-1)
    velocity = np.tile([2.0, 0.0, 0.0], (3, 1))
    link = Link(RigidTransform.from_translation(position), velocity, np.zeros((3, 3)))
    return Truth(
        time_s,
        PoseTree({"target": "inertial"}, {"target": link}),
        {"target": BodyState(position, velocity)},
        np.tile([0.0, 0.0, 1.0], (3, 1)),
        None,
    )


def test_truth_of_a_batch_is_cut_into_epochs():
    truth = batch().at(2)
    assert truth.time_s == 20.0
    np.testing.assert_allclose(truth.pose("inertial", "target").translation, [40.0, 0.0, 0.0])
    np.testing.assert_allclose(truth.states["target"].position_m, [40.0, 0.0, 0.0])
    np.testing.assert_allclose(truth.rates("inertial", "target")[0], [2.0, 0.0, 0.0])
    assert truth.sun_direction.shape == (3,)


def test_truth_keeps_the_whole_batch_too():
    assert batch().pose("target", "inertial").translation.shape == (3, 3)


def test_pointing_is_one_flash():
    zero = np.zeros(2)
    assert PtuAngles(zero, zero, zero, zero).measured_rad.shape == (2,)
    with pytest.raises(TypeError, match=r"PtuAngles\.actual_rad: pan_tilt is 3 here and 2 elsewhere"):
        PtuAngles(zero, np.zeros(3), zero, zero)


def test_body_state_is_locked():
    with pytest.raises(ValueError, match="read-only"):
        BodyState(np.zeros(3), np.zeros(3)).position_m[0] = 1.0


@pytest.mark.parametrize(
    "values", [[[-1.0]], [[70_000.0]], [[12.7]], [[np.nan]], [[np.inf]], [[-1]], [[70_000]], [[1.0 + 2.0j]]]
)
def test_numbers_that_a_field_does_not_hold_are_refused(values):
    for found in (values, np.array(values)):
        with pytest.raises(
            RecordError, match=r"Reading\.intensity_counts: needs an array of uint16, not .*; convert it"
        ) as told:
            Reading([[1.0]], found, [[0]])
        assert "\n" not in str(told.value)


def test_numbers_that_a_field_holds_are_converted():
    for found in ([[7]], [[7.0]], np.array([[7]], np.int64), np.array([[7]], np.uint8), [[True]]):
        assert Reading([[1.0]], found, [[False]]).intensity_counts.dtype == np.uint16
    assert Reading(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))).intensity_counts.shape == (0, 3)
