"""Detection of a target over dispersed ranges and energies."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.study.dispersions.outcomes import make_detection


@pytest.mark.parametrize("energy", [1.0, 1.6])
def test_detection_is_that_of_the_budget_where_the_detector_is_armed(energy):
    def bench(energy_mj):
        settings = ('lidar.detector={type="empirical", armed_to_m=500}', f"lidar.laser.energy_mj={energy_mj}")
        return rl.Scenario.load("examples/bench_plate.toml", settings)

    at_m = np.array([120.0, 250.0, 330.0, 470.0, 520.0, 1500.0])
    probability = make_detection(bench(0.4), np.array([0.0]), (50.0, 2000.0))(0, at_m, np.full(6, energy))
    scenario = bench(0.4 * energy)
    (curve,) = rl.budget(scenario, range_m=at_m, facet_m2=rl.budget(scenario).target_area_m2).curves
    np.testing.assert_allclose(probability, curve.detection_probability, atol=0.02)
    assert ((probability > 0.05) & (probability < 0.95)).any() and probability[4:].tolist() == [0.0, 0.0]
