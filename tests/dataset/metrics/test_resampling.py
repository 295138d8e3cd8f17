import numpy as np
import pytest

from rso_lidar.dataset.metrics.resampling import EncounterIndex


def test_draws_keep_the_number_of_encounters_and_repeat():
    encounters = EncounterIndex(np.array([5, 5, 9, 2, 9]))
    assert encounters.count == 3 and encounters.index.tolist() == [1, 1, 2, 0, 2]
    assert encounters.sum_by(np.array([1.0, 2.0, 4.0, 8.0, 16.0])).tolist() == [8.0, 3.0, 20.0]
    weights = np.concatenate([*encounters.draw(500)])
    assert weights.shape == (500, 3) and (weights.sum(axis=1) == 3).all()
    assert weights.mean(axis=0) == pytest.approx(np.ones(3), abs=0.15)
    assert np.array_equal(weights, np.concatenate([*EncounterIndex(np.arange(3)).draw(500)]))


def test_large_sets_are_drawn_in_blocks(monkeypatch):
    monkeypatch.setattr("rso_lidar.dataset.metrics.resampling._BLOCK", 40)
    blocks = [*EncounterIndex(np.arange(10)).draw(9)]
    assert [len(block) for block in blocks] == [4, 4, 1]
    assert len({row.tobytes() for block in blocks for row in block}) == 9
