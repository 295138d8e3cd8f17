"""A small recording with star tracker and GNSS, flown once for all tests of orbit determination."""

import pytest

import rso_lidar as rl
from tests.evaluation.orbit_determination.scenario_for_tests import load_small


@pytest.fixture(scope="session")
def flown():
    """Return 20 frames, 2 s apart, of a spinning stage at 60 m."""
    return list(rl.simulate(load_small()))
