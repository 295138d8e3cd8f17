"""Processes of FMUs end with the test that starts them."""

import gc

import pytest

from rso_lidar.fmi.run import HostProcess
from rso_lidar.motion.dynamics import fmu_history


@pytest.fixture(scope="module", autouse=True)
def only_young_garbage():
    """Let searches for garbage skip what earlier tests left: late in a session each would take a second."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def hosts(monkeypatch):
    """Let no process of an FMU outlive its test: neither one that is cached, nor one that an error's traceback holds."""
    started, begin = [], HostProcess.__init__

    def watched(self, path):
        try:
            begin(self, path)
        finally:
            started.append(getattr(self, "_process", None))

    monkeypatch.setattr(HostProcess, "__init__", watched)
    yield
    fmu_history._find_history.cache_clear()
    if any(process is not None and process.poll() is None for process in started):
        gc.collect()
    assert all(process is None or process.poll() is not None for process in started)
