"""Peaks and the parabolas through them against their oracle."""

import numpy as np
import pytest

from rso_lidar.detector.ranging import peaks
from tests.reference.detector import peaks as oracle


@pytest.mark.parametrize("levels", [3, 1000])  # with three levels most neighbours are equal
@pytest.mark.parametrize("name", ["raise_to_highest", "locate_vertices"])
def test_each_trace_is_as_by_the_oracle(name, levels):
    rng = np.random.default_rng(5)
    samples = rng.integers(0, levels, (2000, 7)).astype(np.float32)
    peak = rng.integers(0, 7, 2000)
    found, expected = (getattr(module, name)(samples, peak) for module in (peaks, oracle))
    np.testing.assert_array_equal(found, expected)
    assert len(np.unique(found)) > 2
