"""The comparators and the converter against their references: the same latches, the same counts."""

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, Readout, detect
from rso_lidar.detector.chain import traces
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.chain.traces import arm_rows, latch_rows
from rso_lidar.detector.stages.comparator import (
    NEAR,
    NEVER,
    cross_edges,
    find_first_crossings,
    find_latches,
    refine_crossings,
)
from rso_lidar.detector.stages.sampling import sample_rows, store_samples
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import returns, simulate_rows
from tests.reference.detector import comparator as reference
from tests.reference.detector import sampling as sampling_reference

QUIET = {"hysteresis": 3.0, "step_s": 1e-9, "quiet_electrons": 0.5, "shot_electrons_rs": 0.0, "reach": 1.0}


def steps(n_rows, seed=3):
    """Return rows of noise about the threshold 10, with all kinds of watched parts and of arming."""
    rng = np.random.default_rng(seed)
    amplitude = (8.0 + 2.0 * rng.standard_normal((n_rows, 30))).astype(np.float32)
    threshold = np.full(n_rows, 10.0, np.float32)
    first, last = rng.integers(-3, 30, n_rows), rng.integers(-3, 34, n_rows)
    return amplitude, threshold, first, last, rng.random(n_rows) < 0.5


@pytest.mark.parametrize("n_rows", [0, 1, 4000])
def test_rows_latch_at_the_same_step(n_rows):
    amplitude, threshold, first, last, arming = steps(n_rows)
    crossing = reference.first_crossing(amplitude, threshold, first, last, hysteresis=3.0, arming=arming)
    nothing = np.zeros((n_rows, 30), np.float32), threshold, np.zeros(n_rows)
    latch = find_latches(amplitude, *nothing, first, last, arming, **QUIET)
    assert np.array_equal(latch, reference.find_latches(amplitude, *nothing, first, last, arming, **QUIET))
    assert np.array_equal(np.where(latch == NEAR, NEVER, latch), crossing)
    assert n_rows < 4000 or min(np.count_nonzero(latch == k) for k in (NEVER, NEAR, 5)) > 10
    # Near are the rows that were watched before, whose pairs of watched steps come within 0.5 of the threshold.
    step = np.arange(29)
    watched = (step >= first[:, None]) & (step + 1 < last[:, None])
    near = (np.maximum(amplitude[:, :-1], amplitude[:, 1:]) > 9.5) & watched
    assert np.array_equal(latch == NEAR, (crossing == NEVER) & ~arming & near.any(axis=1))


def test_edges_cross_at_the_same_place():
    """Noise of all steepness: float32's rounding of asinh, 2e-7 of some 4, over a slope of the straight line's fifth."""
    rng = np.random.default_rng(5)
    amplitude = (10.0 + np.cumsum(4.0 * rng.standard_normal((5000, 30)), axis=1)).astype(np.float32)
    threshold = rng.uniform(8.0, 12.0, 5000).astype(np.float32)
    latch = find_latches(
        amplitude, np.zeros_like(amplitude), threshold, np.zeros(5000), *steps(5000)[2:4], np.zeros(5000, bool), **QUIET
    )
    row = np.flatnonzero(latch > 0)
    assert len(row) > 1000
    given = amplitude, row, threshold[row], latch[row], np.maximum(latch[row] - 3, 0)
    place, expected = refine_crossings(*given), reference.refine_crossings(*given)
    assert np.quantile(np.abs(place - expected), 0.99) < 1e-5 and np.abs(place - expected).max() < 1e-3
    assert np.array_equal(place == np.floor(place), expected == np.floor(expected))
    assert len(cross_edges.dispatcher.signatures) == 1


def test_a_flash_latches_alike_and_no_draw_differs(monkeypatch):
    """The same rows are looked at between steps, with the same draws; sigma is float32 in one, which moves 1e-7 of it."""
    gsfl = Gsfl(armed_from_m=995.0)
    rng = np.random.default_rng(4)
    photons = returns(rng.uniform(990.0, 1010.0, 4096), rng.uniform(0.0, 1500.0, 4096))
    camera, plan = camera_of(gsfl, photons), plan_time(gsfl, 8e-9)
    comparators, pixels = camera.comparators, camera.front.pixels
    rows, arming = arm_rows(comparators, place_rows(photons, plan), plan.step_s)
    made = simulate_rows(gsfl, photons, rows, rng)
    threshold = (gsfl.trigger.threshold_electrons * pixels.threshold[rows.pixel]).astype(np.float32)
    base = pixels.dark_per_s[rows.pixel]
    found = []
    for function in (find_latches, reference.find_latches):
        monkeypatch.setattr(traces, "find_latches", function)
        before = gsfl.readout.pretrigger_samples * plan.steps_per_sample
        axis, drawn = camera.axis(rows.length), np.random.default_rng(5)
        found.append(latch_rows(comparators, axis, made, threshold, base, arming, before, drawn))
    assert 0.2 < (found[0] >= 0).mean() < 0.9
    assert np.array_equal(*found)


@pytest.mark.parametrize("quantised", [True, False])
@pytest.mark.parametrize("n", [0, 500])
def test_what_is_stored_is_the_same(n, quantised):
    """The same float32 sums in the same order: to the last bit."""
    readout, rng = Readout(quantised=quantised), np.random.default_rng(6)
    amplitude = rng.normal(300_000.0, 400_000.0, (300, 70)).astype(np.float32)
    arguments = rng.integers(0, 300, n), rng.integers(0, 30, n), 2, 20, rng.normal(0.0, 3.0, n)
    counts = [store(readout, amplitude, *arguments) for store in (store_samples, sampling_reference.store_samples)]
    assert counts[0].shape == (n, 20) and counts[0].dtype == counts[1].dtype == np.float32
    assert np.array_equal(*counts)
    assert n == 0 or (counts[0].min() == 0.0 and counts[0].max() == readout.full_scale_counts)


def test_what_lies_outside_its_row_is_not_read():
    amplitude, two = np.zeros((2, 70), np.float32), np.arange(2)
    for first in ([0, 33], [-1, 0]):
        with pytest.raises(AssertionError, match="outside their rows"):
            store_samples(Readout(), amplitude, two, np.array(first), 2, 20, np.zeros(2))


def test_each_loop_compiles_once():
    for shape in (returns([1000.0, 1000.0], 800.0), returns([1000.0], 0.0)):
        for gsfl in (Gsfl(), Gsfl(gate={"delay_ns": 6600.0, "pulses": 2})):
            detect(shape, gsfl, np.random.default_rng(1))
    assert len(find_first_crossings.dispatcher.signatures) == len(sample_rows.dispatcher.signatures) == 1
