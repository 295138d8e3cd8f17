"""The compiled comparators and converter against NumPy's: the same latches, the same counts."""

import numpy as np
import pytest

from rso_lidar import arithmetic
from rso_lidar.detector.chain import analog, armed, latched
from rso_lidar.detector.gsfl import Gsfl
from rso_lidar.detector.readout import Readout
from rso_lidar.detector.trigger import NEAR, NEVER, first_crossing, first_or_near
from rso_lidar.detector.waveform import rows_about
from tests.detector.returns_for_tests import returns

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
    reference = first_crossing(amplitude, threshold, first, last, hysteresis=3.0, arming=arming)
    nothing = np.zeros((n_rows, 30), np.float32), threshold, np.zeros(n_rows)
    latches = []
    for path in ("numpy", "numba"):
        with arithmetic.using(path):
            latches.append(first_or_near(amplitude, *nothing, first, last, arming, **QUIET))
    assert np.array_equal(*latches)
    latch = latches[1]
    assert np.array_equal(np.where(latch == NEAR, NEVER, latch), reference)
    assert n_rows < 4000 or min(np.count_nonzero(latch == k) for k in (NEVER, NEAR, 5)) > 10
    # Near are the rows that were watched before, whose pairs of watched steps come within 0.5 of the threshold.
    step = np.arange(29)
    watched = (step >= first[:, None]) & (step + 1 < last[:, None])
    near = (np.maximum(amplitude[:, :-1], amplitude[:, 1:]) > 9.5) & watched
    assert np.array_equal(latch == NEAR, (reference == NEVER) & ~arming & near.any(axis=1))


def test_a_flash_latches_alike_and_no_draw_differs():
    """The same rows are looked at between steps, with the same draws; sigma is float32 in one, which moves 1e-7 of it."""
    gsfl = Gsfl(armed_from_m=995.0)
    rng = np.random.default_rng(4)
    photons = returns(rng.uniform(990.0, 1010.0, 4096), rng.uniform(0.0, 1500.0, 4096))
    plan, camera = gsfl.plan(8e-9), gsfl.camera(4096)
    rows, arming = armed(gsfl, rows_about(photons, plan, 4096), plan.step_s)
    made = analog(gsfl, photons, rows, plan, camera, rng)
    threshold = (gsfl.trigger.threshold_electrons * camera.threshold[rows.pixel]).astype(np.float32)
    base = gsfl.dark_per_s(camera)[rows.pixel]
    found = []
    for path in ("numpy", "numba"):
        with arithmetic.using(path):
            found.append(latched(gsfl, made, threshold, base, arming, plan.step_s, np.random.default_rng(5)))
    assert 0.2 < (found[0] >= 0).mean() < 0.9
    assert np.array_equal(*found)


@pytest.mark.parametrize("quantised", [True, False])
@pytest.mark.parametrize("n", [0, 500])
def test_what_is_stored_is_the_same(n, quantised):
    """The same float32 sums in the same order: to the last bit."""
    readout, rng = Readout(quantised=quantised), np.random.default_rng(6)
    amplitude = rng.normal(300_000.0, 400_000.0, (300, 70)).astype(np.float32)
    arguments = rng.integers(0, 300, n), rng.integers(0, 30, n), 2, 20, rng.normal(0.0, 3.0, n)
    counts = []
    for path in ("numpy", "numba"):
        with arithmetic.using(path):
            counts.append(readout.store(amplitude, *arguments))
    assert counts[0].shape == (n, 20) and counts[0].dtype == counts[1].dtype == np.float32
    assert np.array_equal(*counts)
    assert n == 0 or (counts[0].min() == 0.0 and counts[0].max() == readout.full_scale_counts)


def test_what_lies_outside_its_row_is_not_read():
    amplitude, two = np.zeros((2, 70), np.float32), np.arange(2)
    with arithmetic.using("numba"):
        for first in ([0, 33], [-1, 0]):
            with pytest.raises(AssertionError, match="outside their rows"):
                Readout().store(amplitude, two, np.array(first), 2, 20, np.zeros(2))


def test_each_loop_compiles_once():
    from rso_lidar.detector.readout_loops import store
    from rso_lidar.detector.trigger_loops import first_crossings

    with arithmetic.using("numba"):
        for shape in (returns([1000.0, 1000.0], 800.0), returns([1000.0], 0.0)):
            for gsfl in (Gsfl(), Gsfl(gate={"delay_ns": 6600.0, "pulses": 2})):
                gsfl.detect(shape, np.random.default_rng(1))
    assert len(first_crossings.signatures) == len(store.signatures) == 1
