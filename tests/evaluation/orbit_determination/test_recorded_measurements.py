"""Measurements of a recording: the antenna beside the origin, sensors by name, and fixes of the target."""

import dataclasses

import numpy as np
import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.evaluation.orbit_determination.attitude_history import take_known_attitude
from rso_lidar.evaluation.orbit_determination.recorded_measurements import (
    find_sensor,
    join_observed,
    measure_target,
    read_gnss,
    read_gnss_errors,
)
from rso_lidar.pose import ROOT
from rso_lidar.records import GnssSamples
from rso_lidar.sensors import Gnss
from tests.evaluation.orbit_determination.scenario_for_tests import load_small


def test_the_antenna_is_taken_to_the_origin(flown):
    attitude = take_known_attitude(flown)
    time_s = attitude.time_s[2:5]
    arm, part = np.array([1.0, 2.0, -0.5]), Gnss(name="gnss", rate_hz=1.0, antenna_m=(1.0, 2.0, -0.5))
    turned = np.array([frame.truth.pose(ROOT, "follower").rotation.as_matrix() for frame in flown[2:5]])
    rates = np.array([frame.truth.rates(ROOT, "follower")[1] for frame in flown[2:5]])
    own = [frame.truth.states["follower"] for frame in flown[2:5]]
    position, velocity = (np.array([getattr(one, name) for one in own]) for name in ("position_m", "velocity_m_s"))
    seen = GnssSamples(
        time_s,
        time_s,
        np.array([True, False, True]),
        position + turned @ arm,
        velocity + np.einsum("nij,nj->ni", turned, np.cross(rates, arm)),
    )
    at_s, there, moving = read_gnss(seen, part, attitude)
    assert at_s.tolist() == time_s[[0, 2]].tolist()
    assert np.allclose(there, position[[0, 2]], atol=1e-7)
    assert np.allclose(moving, velocity[[0, 2]], atol=1e-5)  # the rate between two frames is constant
    with pytest.raises(RecordingError, match="antenna_m beside the origin, and the recording no star tracker"):
        read_gnss(seen, part, None)
    assert read_gnss_errors(part.replace(position_noise_m=2.0)).position_m == 2.0


def test_sensors_are_found_by_kind_and_name(flown):
    scenario = load_small()
    assert find_sensor(scenario, Gnss, None).name == "gnss"
    assert find_sensor(scenario.replace(sensor=()), Gnss, None) is None
    observations = [frame.observation for frame in flown]
    assert len(join_observed(observations, "gnss").time_s) == sum(
        len(one.sensors["gnss"].time_s) for one in observations
    )
    with pytest.raises(RecordingError, match="frames without samples of sensor 'horizon'"):
        join_observed(observations, "horizon")


def test_fixes_are_of_the_target_in_inertial_axes(flown):
    scenario = load_small()
    fixes = measure_target(
        scenario, flown, take_known_attitude(flown), size_m=14.0, range_noise_m=0.05, wander_m=(0.5, 0.1)
    )
    for k in (0, 7):
        true = flown[k].truth.states["stage"].position_m - flown[k].truth.states["follower"].position_m
        assert np.linalg.norm(fixes.position_m[k] - true) < 3.0  # of a stage that is 13.6 m long
        toward = true / np.linalg.norm(true)
        assert toward @ fixes.covariance_m2[k] @ toward == pytest.approx(0.25, rel=0.1)
    assert fixes.time_s.tolist() == [frame.time_s for frame in flown]


def test_a_target_that_the_field_cuts_is_no_measurement(flown):
    scenario = load_small()
    reading = flown[3].observation.reading
    row, col = np.argwhere(np.isfinite(reading.range_m))[0]
    half = dataclasses.replace(
        reading,
        range_m=np.roll(reading.range_m, (-row, -col), (0, 1)),
        intensity_counts=np.roll(reading.intensity_counts, (-row, -col), (0, 1)),
    )
    cut = dataclasses.replace(flown[3], observation=dataclasses.replace(flown[3].observation, reading=half))
    known = {"size_m": 14.0, "range_noise_m": 0.05, "wander_m": (0.5, 0.1)}
    fixes = measure_target(scenario, [flown[2], cut], take_known_attitude(flown), **known)
    assert np.isfinite(fixes.position_m).all(axis=1).tolist() == [True, False]
