"""Random errors: the oracle, addresses, and statistics of processes and outages."""

import numpy as np
import pytest

from rso_lidar import sensors
from rso_lidar.sensors.random_errors import NOISE, ErrorProcess, draw_errors, draw_sample, fill_normals, make_model
from tests.reference.sensors import random_errors as reference

KEY = sensors.make_key(7, "gyro")


def model_of_all(outage=(0.9, 0.05, 0.3)):
    """Return a model with processes of each kind, listed in mixed order."""
    processes = [
        ErrorProcess((-1, -1), 1.0, 0.0, 0.5),  # constants that the sensor applies itself
        ErrorProcess((0, 1, 2), 0.9, 0.2, 0.4),
        ErrorProcess((1,), 1.0, 0.0, 3.0),
        ErrorProcess((0, 2), 1.0, 0.1, 0.0),
    ]
    return make_model(np.array([1.0, 2.0, 3.0]), processes, outage)


def draw(model, first, skipped, count, values):
    errors, out = np.empty((count, len(model.white))), np.empty(count, bool)
    arrays = (model.white, model.process, model.channel, model.n_driven, model.outage)
    draw_errors(KEY, first, skipped, *arrays, values, errors, out)
    return errors, out


@pytest.mark.parametrize("width", [1, 2, 3, 4, 9])
def test_normals_are_what_the_oracle_says(width):
    first, count = 2**32 - 5, 20  # across the word of the sample's number
    normals = np.empty((count, width))
    fill_normals(KEY, first, NOISE, normals)
    np.testing.assert_allclose(normals, reference.fill_normals(KEY, first, NOISE, width, count), rtol=1e-13, atol=1e-15)
    np.testing.assert_array_equal(normals, sensors.draw_normals(KEY, first, count, width))


def test_normals_are_normal():
    from scipy.stats import kstest

    normals = sensors.draw_normals(KEY, 0, 50_000, 6)
    for column in normals.T:
        assert kstest(column, "norm").pvalue > 1e-4
    correlation = np.corrcoef(normals.T) - np.eye(6)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(50_000)
    following = np.mean(normals[1:] * normals[:-1], axis=0)
    assert np.abs(following).max() < 5.0 / np.sqrt(50_000)


def test_errors_are_what_the_oracle_says():
    model, count = model_of_all(), 300
    values = np.zeros(model.n_values)
    errors, out = draw(model, 0, 0, count, values)
    expected, expected_out, expected_values = reference.draw_errors(KEY, model, count)
    np.testing.assert_allclose(errors, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(out, expected_out)
    np.testing.assert_allclose(values, expected_values, rtol=1e-12, atol=1e-12)
    assert 0 < out.sum() < count


def test_skipped_samples_leave_the_bits_of_the_next():
    model = model_of_all()
    whole, out = draw(model, 0, 0, 100, values := np.zeros(model.n_values))
    late, late_out = draw(model, 0, 60, 40, other := np.zeros(model.n_values))
    np.testing.assert_array_equal(late, whole[60:])
    np.testing.assert_array_equal(late_out, out[60:])
    np.testing.assert_array_equal(values, other)


def test_processes_without_effect_are_left_out_and_constants_are_last():
    model = make_model(
        np.zeros(2),
        [
            ErrorProcess((-1,), 1.0, 0.0, 0.0),
            ErrorProcess((0,), 1.0, 0.0, 2.0),
            ErrorProcess((0, 1), 0.5, 1.0, 1.0),
            ErrorProcess((1,), 1.0, 0.0, 0.0),
        ],
        (0.0, 0.0, 0.0),
    )
    assert model.n_driven == 2
    assert model.channel.tolist() == [0, 1, -1, 0]
    assert model.process[:, 2].tolist() == [1.0, 1.0, 0.0, 2.0]


@pytest.mark.parametrize(
    "other", [sensors.make_key(8, "gyro"), sensors.make_key(7, "gyro2"), sensors.make_key(7, "oryg")]
)
def test_each_seed_and_each_name_has_numbers_of_its_own(other):
    one, two = sensors.draw_normals(KEY, 0, 4000, 3), sensors.draw_normals(other, 0, 4000, 3)
    assert abs(np.mean(one * two)) < 5.0 / np.sqrt(one.size)
    np.testing.assert_array_equal(KEY, sensors.make_key(7, "gyro"))


@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 8])
def test_a_sample_writes_its_own_numbers_and_no_more(width):
    """Blocks hold four numbers: the first ones do not depend on how many are asked for."""
    key = np.array([3, 5], dtype=np.uint32)
    whole, room = np.full(16, np.nan), np.full(16, np.nan)
    draw_sample(key, 7, 2, whole)
    draw_sample(key, 7, 2, room[:width])
    np.testing.assert_array_equal(room[:width], whole[:width])
    assert np.isnan(room[width:]).all() and np.isfinite(whole).all()
