import numpy as np
import pytest
from scipy import stats

from rso_lidar.dataset.metrics.resampling import EncounterIndex, effective_count, percentile_interval, wilson_interval


def test_wilson_is_scipys():
    for hits, trials in ((0, 12), (7, 12), (12, 12), (181, 240)):
        expected = stats.binomtest(hits, trials).proportion_ci(0.9, method="wilson")
        assert wilson_interval(hits / trials, trials, 0.9) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert np.isnan(wilson_interval(np.nan, 0, 0.95)).all()


def test_copies_of_a_frame_add_no_information():
    hits = np.array([1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0])
    alone = effective_count(hits, np.ones(8))
    assert effective_count(5.0 * hits, np.full(8, 5.0)) == pytest.approx(alone)
    assert alone == pytest.approx(7.0)  # n - 1: the variance is the unbiased one


def test_where_nothing_varies_each_encounter_counts_once():
    assert effective_count(np.full(6, 4.0), np.full(6, 4.0)) == 6.0
    assert effective_count(np.zeros(6), np.array([4.0, 4.0, 0.0, 4.0, 4.0, 4.0])) == 5.0
    assert effective_count(np.zeros(0), np.zeros(0)) == 0.0


def test_independent_frames_count_as_they_are():
    rng = np.random.default_rng(3)
    trials = np.full(400, 6.0)
    assert effective_count(rng.binomial(6, 0.7, 400).astype(float), trials) == pytest.approx(2400, rel=0.15)


def test_draws_keep_the_number_of_encounters_and_repeat():
    encounters = EncounterIndex(np.array([5, 5, 9, 2, 9]))
    assert encounters.count == 3 and encounters.index.tolist() == [1, 1, 2, 0, 2]
    assert encounters.sum_by(np.array([1.0, 2.0, 4.0, 8.0, 16.0])).tolist() == [8.0, 3.0, 20.0]
    weights = np.concatenate([*encounters.draw(500)])
    assert weights.shape == (500, 3) and (weights.sum(axis=1) == 3).all()
    assert weights.mean(axis=0) == pytest.approx(np.ones(3), abs=0.15)
    assert np.array_equal(weights, np.concatenate([*EncounterIndex(np.arange(3)).draw(500)]))
    assert not np.array_equal(weights, np.concatenate([*encounters.draw(500, stream=1)]))


def test_large_sets_are_drawn_in_blocks(monkeypatch):
    monkeypatch.setattr("rso_lidar.dataset.metrics.resampling._BLOCK", 40)
    blocks = [*EncounterIndex(np.arange(10)).draw(9)]
    assert [len(block) for block in blocks] == [4, 4, 1]
    assert len({row.tobytes() for block in blocks for row in block}) == 9


def test_percentiles_allow_for_failures():
    values = np.concatenate([np.linspace(0.0, 1.0, 96), np.full(4, np.inf)])
    low, high = percentile_interval(values, 0.9)
    assert low == pytest.approx(0.042, abs=0.01) and high == pytest.approx(0.989, abs=0.01)
    assert percentile_interval(values, 0.95)[1] == np.inf
    assert np.isnan(percentile_interval(np.full(10, np.nan), 0.9)).all()


def test_intervals_cover_as_often_as_they_say():
    """Frames of one encounter share its difficulty: an interval over frames would cover far less often."""
    rng, trials, encounters, frames = np.random.default_rng(8), 400, 60, 5
    covered = covered_by_frames = 0
    for _ in range(trials):
        difficulty = rng.beta(2.4, 0.6, encounters)  # mean 0.8
        hits = rng.binomial(frames, difficulty).astype(float)
        share = hits.sum() / (frames * encounters)
        low, high = wilson_interval(share, effective_count(hits, np.full(encounters, float(frames))), 0.95)
        covered += low <= 0.8 <= high
        low, high = wilson_interval(share, frames * encounters, 0.95)
        covered_by_frames += low <= 0.8 <= high
    assert 0.915 < covered / trials < 0.98  # 0.95, and three standard deviations of 400 trials
    assert covered_by_frames / trials < 0.85


def test_encounters_that_all_have_one_share_count_every_trial():
    assert effective_count(np.ones(3), np.full(3, 2.0)) == 6.0
