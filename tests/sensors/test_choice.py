"""The protocol of sensors: a user's own object and its answers, the field for any sensor, and exact epochs of samples."""

import dataclasses
import runpy
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rso_lidar import sensors
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part, python_objects
from rso_lidar.records import SensorSamples, SensorState
from tests.sensors.motion_for_tests import make_motion

EXAMPLE = runpy.run_path(str(Path(__file__).resolve().parents[2] / "examples" / "seams" / "own_sensor.py"))
KEY = sensors.make_key(7, "sun_sensor")


class Carrier(Part):
    """A part with sensors."""

    sensor: tuple[sensors.AnySensor, ...] = ()


def test_a_users_sensor_measures_and_its_samples_do_not_depend_on_how_they_are_divided():
    sensor = EXAMPLE["SunSensor"]()
    motion = EXAMPLE["spin"](sensors.read_schedule(sensor).time_samples(range(2000)))
    whole, _ = sensors.measure_samples(sensor, motion, KEY, 0, None)
    part, state = sensors.measure_samples(sensor, motion.some(np.arange(900, 950)), KEY, 900, None)
    np.testing.assert_array_equal(part.sun_direction, whole.sun_direction[900:950])
    assert state.next_sample == 950
    angle = -2.0 * np.pi / 60.0 * motion.time_s
    error = whole.sun_direction[:, :2] - np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert abs(np.sqrt(np.mean(error**2)) - 0.01 / np.sqrt(2.0)) < 2e-4  # only the error across the direction is left


def test_the_field_of_sensors_takes_tables_and_objects():
    own = EXAMPLE["SunSensor"]()
    carrier = Carrier(sensor=[{"type": "gyro", "name": "gyro", "rate_hz": 10.0}, own])
    assert isinstance(carrier.sensor[0], sensors.Gyro) and carrier.sensor[1] is own
    assert python_objects(carrier) == [own]
    with pytest.raises(ScenarioError, match="an object with measure, name, rate_hz"):
        Carrier(sensor=[object()])
    with pytest.raises(ScenarioError, match="'gyroscope'"):
        Carrier(sensor=[{"type": "gyroscope", "name": "gyro", "rate_hz": 10.0}])


def answer(change):
    """Return a sensor whose answer is changed."""

    class Changed(EXAMPLE["SunSensor"]):
        def measure(self, motion, key, first_sample, state=None):
            return change(*super().measure(motion, key, first_sample, state))

    return Changed()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda samples, state: samples, r"return \(SensorSamples, SensorState\)"),
        (lambda samples, state: (samples, state, 1), r"return \(SensorSamples, SensorState\)"),
        (lambda samples, state: (samples, None), r"return \(SensorSamples, SensorState\)"),
        (lambda samples, state: (samples, SensorState(3, np.empty(0))), "returned 3 in next_sample; .* follows, 14"),
        (
            lambda samples, state: (SensorSamples(samples.time_s + 1.0, samples.time_s, samples.valid), state),
            "in time_s; return one sample for each instant",
        ),
        (lambda samples, state: (samples, SensorState(14.0, np.empty(0))), r"returned 14\.0 in next_sample"),
        (
            lambda samples, state: (dataclasses.replace(samples, available_s=samples.time_s * np.nan), state),
            "in available_s; return time_s plus the sensor's latency_s",
        ),
        (
            lambda samples, state: (dataclasses.replace(samples, available_s=samples.time_s - 1.0), state),
            "in available_s; return time_s plus the sensor's latency_s",
        ),
        (
            lambda samples, state: (dataclasses.replace(samples, sun_direction=None), state),
            "returned None in sun_direction; return an array",
        ),
        (
            lambda samples, state: (dataclasses.replace(samples, valid=np.ones(9, bool)), state),
            "measure.. failed at sample 10 with RecordError: SunSamples.valid: sample is 9",
        ),
        (
            lambda samples, state: 1 / 0,
            r"measure.. failed at sample 10 with ZeroDivisionError: division by zero; correct",
        ),
        (lambda samples, state: sys.exit("a\nb"), "measure.. failed at sample 10 with SystemExit: a b; correct"),
        (lambda samples, state: None, r"returned None; return \(SensorSamples, SensorState\)"),
    ],
)
def test_a_wrong_answer_is_an_error(change, words):
    motion = make_motion(5.0 + np.arange(4) / 2.0, sun_direction=np.tile([1.0, 0.0, 0.0], (4, 1)))
    with pytest.raises(ScenarioError, match=words) as caught:
        sensors.measure_samples(answer(change), motion, KEY, 10, None)
    assert "sun_sensor" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("number", [np.int64, np.int32, np.float32, np.float64, int])
def test_numbers_of_numpy_are_numbers(number):
    sensor = EXAMPLE["SunSensor"](rate_hz=number(2))
    assert sensors.read_schedule(sensor).number_available(0.0, 2.0) == range(1, 5)
    np.testing.assert_array_equal(sensors.read_schedule(sensor).time_samples(range(1, 5)), [0.5, 1.0, 1.5, 2.0])


@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("rate_hz", 0.0),
        ("rate_hz", "fast"),
        ("rate_hz", True),
        ("rate_hz", np.nan),
        ("rate_hz", np.array([2.0])),
        ("latency_s", np.inf),
        ("phase_s", -1.0),
    ],
)
def test_a_wrong_schedule_is_an_error(member, value):
    sensor = EXAMPLE["SunSensor"]()
    object.__setattr__(sensor, member, value)
    with pytest.raises(ScenarioError, match=member):
        sensors.read_schedule(sensor).number_available(0.0, 1.0)


@pytest.mark.parametrize("rate_hz", [1.0, 3.0, 7.7, 100.0, 1000.0 / 3.0, 1e5])
@pytest.mark.parametrize("phase_s", [0.0, 0.1])
def test_intervals_divide_the_samples_exactly_and_without_drift(rate_hz, phase_s):
    gyro = sensors.Gyro(name="gyro", rate_hz=rate_hz, phase_s=phase_s)
    for origin in (0, 10**7, 10**9):
        ends = [phase_s + (origin - 0.5) / rate_hz]
        ends += [phase_s + n / rate_hz for n in (origin, origin + 1, origin + 4, origin + 4, origin + 11)]
        ends += [ends[-1] + 0.37 / rate_hz, phase_s + (origin + 13) / rate_hz]
        found = [sensors.read_schedule(gyro).number_available(*pair) for pair in pairwise(ends)]
        assert [n for numbers in found for n in numbers] == list(range(origin, origin + 14))
        assert list(found[0]) == [origin] and len(found[3]) == len(found[5]) == 0
    times = sensors.read_schedule(gyro).time_samples(range(10**7, 10**7 + 3))
    np.testing.assert_array_equal(times, phase_s + np.array([1e7, 1e7 + 1, 1e7 + 2]) / rate_hz)
    assert sensors.read_schedule(gyro).number_available(-5.0, -1.0) == range(0)


@pytest.mark.parametrize(
    ("rate_hz", "latency_s", "flash_hz"),
    [(10.0, 0.2, 5.0), (100.0, 0.0, 20.0), (100.0, 0.05, 20.0), (3.0, 1 / 3, 3.0)],
)
def test_a_sample_that_becomes_available_with_a_flash_is_in_its_observation(rate_hz, latency_s, flash_hz):
    """In binary fractions, 0.05 + 0.1 is after 3 / 20; the sample must not be delayed to the next flash by that."""
    gyro = sensors.Gyro(name="gyro", rate_hz=rate_hz, latency_s=latency_s)
    for k in range(1, 5000):
        found = sensors.read_schedule(gyro).number_available((k - 1) / flash_hz, k / flash_hz)
        last = round((k / flash_hz - latency_s) * rate_hz)
        assert found == range(max(0, last - round(rate_hz / flash_hz) + 1), last + 1)
