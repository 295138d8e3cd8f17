"""A small dataset in a folder that every test has for itself."""

import shutil

import pytest

from rso_lidar.dataset.reading.random_access import open_dataset
from tests.dataset.dataset_for_tests import make_dataset


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("dataset") / "original")


@pytest.fixture
def folder(original, tmp_path):
    return shutil.copytree(original, tmp_path / "two_craft")


@pytest.fixture
def data(folder):
    return open_dataset(folder)
