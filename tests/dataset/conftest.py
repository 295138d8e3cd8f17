"""One dataset that several tests read."""

import pytest

import rso_lidar as rl
from tests.dataset.set_for_tests import make_spec


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Return a dataset, which no test may change, and its specification."""
    folder = tmp_path_factory.mktemp("spec")
    spec = make_spec(folder)
    return rl.dataset.make(spec, folder / "made", workers=1), spec
