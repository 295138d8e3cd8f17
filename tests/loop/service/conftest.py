"""A small closed loop, which all tests of the service fly."""

import pytest

import rso_lidar as rl
from tests.loop.service.serving import EXAMPLES, SMALL


@pytest.fixture(scope="session")
def scenario():
    """Eight flashes past a stage, with a PTU."""
    return rl.Scenario.load(EXAMPLES / "closed_loop.toml", settings=SMALL)
