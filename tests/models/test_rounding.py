"""No builder's choice hangs on the last bit: inputs moved by 1e-12, or another processor, move no vertex by 1e-9 m."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from rso_lidar.scene import models
from tests.models.moved_builders import shapes
from tests.processor import other_processor

NM = 1e-9  # [m]; sizes to 20 m in double precision, moved by 1e-12 of themselves some dozen times on the way


def run(*arguments, **variables):
    command = [sys.executable, "-W", "error", "-m", "tests.models.moved_builders", *map(str, arguments)]
    done = subprocess.run(command, env=os.environ | variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def made():
    return shapes()


def apart(made, file):
    """Return how far vertices lie apart at most [m], once it is sure that facets are the same."""
    with np.load(file) as other:
        assert set(other.files) == set(made)
        worst = {}
        for name, ours in made.items():
            assert ours.shape == other[name].shape, name
            if name.endswith("/facets"):
                assert np.array_equal(ours, other[name]), name
            else:
                worst[name] = float(np.abs(ours - other[name]).max())
    off = {name: far for name, far in worst.items() if far >= NM}
    assert not off, off
    return max(worst.values())


def test_inputs_moved_by_1e_12_move_no_vertex(made, tmp_path):
    report = run(1, 1e-12, tmp_path / "moved.npz")
    assert report["floats"] > 2000 and report["calls"] > 5000, "hardly anything was moved"
    assert apart(made, tmp_path / "moved.npz") > 1e-13, "nothing was moved"


def test_another_processor_builds_the_same(made, tmp_path):
    """Vertices to a nanometre, and the files to the byte: their SHA-256 stands in the index."""
    report = run(0, 0, tmp_path / "other.npz", **other_processor())
    assert not report["dispatched"], "NumPy still uses what this processor has beyond the oldest"
    apart(made, tmp_path / "other.npz")
    assert report["sha256"] == {name: entry.sha256 for name, entry in models().items() if name in report["sha256"]}
    assert len(report["sha256"]) >= 20
