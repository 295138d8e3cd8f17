"""Datasets that several tests read: two that are simulated, and one that is written without a simulator."""

import shutil

import pytest

import rso_lidar as rl
from rso_lidar.dataset import open as open_dataset
from tests.dataset.bench_for_tests import CAMERA, EYE, SUN, make_spec
from tests.dataset.written_for_tests import make_dataset


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """Return a dataset, which no test may change, and its specification."""
    folder = tmp_path_factory.mktemp("spec")
    spec = make_spec(folder)
    return rl.dataset.make(spec, folder / "made", workers=1), spec


@pytest.fixture(scope="session")
def paired(tmp_path_factory):
    """Return a dataset with a grey camera and one of three bands, which no test may change, and its specification."""
    folder = tmp_path_factory.mktemp("paired")
    spec = make_spec(folder, set=(f"{CAMERA[:-1]},{EYE}]", SUN), draws=1, seed=2**60 + 1, shard_frames=4)
    return rl.dataset.make(spec, folder / "made", workers=1), spec


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("dataset") / "original")


@pytest.fixture
def folder(original, tmp_path):
    """Return a small dataset that a test has for itself."""
    return shutil.copytree(original, tmp_path / "two_craft")


@pytest.fixture
def data(folder):
    return open_dataset(folder)
