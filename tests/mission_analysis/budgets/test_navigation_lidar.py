"""A scenario's lidar as a sensor of navigation: what its budget says of noise and reach."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError

SCENARIO = rl.Scenario.load("examples/geo_servicer.toml")


@pytest.mark.slow
def test_noise_and_reach_are_those_of_the_budget():
    sensor = rl.study.find_navigation_lidar(SCENARIO, (10.0, 20_000.0), at_s=50_400.0, origin_sigma_m=0.1)
    lens = SCENARIO.instrument.at(50_400.0).replace(schedule=None)
    area = rl.study.budget(SCENARIO.replace(lidar=lens)).target_area_m2
    ranges = np.array([100.0, 1000.0, sensor.most_range_m])
    curve = rl.study.budget(SCENARIO.replace(lidar=lens), range_m=ranges, facet_m2=area).curves[0]
    noise = sensor.range_noise.find_sigma_m(ranges)
    np.testing.assert_allclose(noise, curve.range_precision_m, rtol=0.02)
    assert curve.detection_probability[-1] >= 0.95
    farther = rl.study.budget(SCENARIO.replace(lidar=lens), range_m=ranges * 1.3, facet_m2=area).curves[0]
    assert farther.detection_probability[-1] < 0.95
    assert sensor.origin_sigma_m == 0.1
    assert np.deg2rad(sensor.bearing_sigma_deg) == pytest.approx(lens.receiver.ifov_rad / np.sqrt(12.0), rel=0.01)


@pytest.mark.slow
def test_a_shorter_lens_reaches_less_far():
    long, short = (rl.study.find_navigation_lidar(SCENARIO, (10.0, 20_000.0), at_s=at_s) for at_s in (0.0, 82_700.0))
    assert short.most_range_m < 0.1 * long.most_range_m


@pytest.mark.parametrize("range_m", [(20.0, 10.0), (0.0, 10.0), (10.0, float("inf")), (float("nan"), 10.0)])
def test_what_is_no_interval_is_refused(range_m):
    with pytest.raises(ScenarioError, match="is no interval of ranges"):
        rl.study.find_navigation_lidar(SCENARIO, range_m)


def test_what_is_not_detected_is_refused(text):
    with pytest.raises(ScenarioError, match="begin nearer, or take more energy"):
        rl.study.find_navigation_lidar(rl.Scenario.loads(text), (10_000.0, 20_000.0))
