"""Rows of a pixel that overlap in time: one record of noise, whichever row is looked at."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Gsfl
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.overlap import Overlap, copy_shared, split_rows
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import nothing, returns, simulate_rows
from tests.reference.detector import overlap as reference

GSFL = Gsfl()
PLAN = plan_time(GSFL, 8e-9)


def deep(n, photons=1.0, depth_s=10e-9):
    """Return n pixels with a return each, deep enough for two rows that go on from one another."""
    return replace(returns(np.full(n, 1000.0), photons), depth_spread_s=np.full(n, depth_s))


def several(n=40):
    """Return the rows of pixels with one return, with two far apart, and with two 4 m apart."""
    pixel = np.sort(np.concatenate([np.arange(n), np.arange(0, n, 2), np.arange(0, n, 3)]))
    again = np.diff(pixel, prepend=-1) == 0
    range_m = 1000.0 + np.where(again, np.where(pixel % 4 == 0, 3000.0, 4.0), 0.0)
    return place_rows(returns(range_m, 100.0, pixel, (1, n), cluster=np.arange(len(pixel))), PLAN)


def made(photons, seed=1):
    """Return rows, and amplitudes with noise."""
    rows = place_rows(photons, PLAN)
    return rows, simulate_rows(GSFL, photons, rows, np.random.default_rng(seed))


def test_rows_far_apart_share_nothing():
    rows = several()
    overlap = Overlap.of(rows)
    before = overlap.row - 1
    assert 0 < len(overlap.row) < np.count_nonzero(np.diff(rows.pixel) == 0)
    assert np.array_equal(rows.pixel[overlap.row], rows.pixel[before])
    assert np.all(overlap.lag < rows.length) and np.all(overlap.shared > 0)
    # They reach to one step after the last that was watched.
    assert np.array_equal(rows.start[overlap.row] + overlap.shared, rows.start[before] + rows.last[before] + 1)


def test_what_is_carried_is_what_the_reference_carries():
    overlap = Overlap.of(several())
    carried = [np.random.default_rng(2).standard_normal((80, PLAN.length), dtype=np.float32) for _ in range(2)]
    overlap.carry(carried[0])
    overlap.carry(carried[0].view(np.uint32))
    reference.copy_shared(carried[1], *overlap)
    assert np.array_equal(*carried)
    assert not np.array_equal(carried[0], np.random.default_rng(2).standard_normal(carried[0].shape, dtype=np.float32))
    assert len(copy_shared.dispatcher.signatures) == 1


@pytest.mark.parametrize("at_once", [1, 7, 1000])
def test_no_pixel_is_parted(at_once):
    rows = several()
    parts = split_rows(rows, at_once)
    assert [k for part in parts for k in range(part.start, part.stop)] == list(range(len(rows.pixel)))
    assert all(part.start == 0 or rows.pixel[part.start] != rows.pixel[part.start - 1] for part in parts)
    whole = Overlap.of(rows)
    assert np.array_equal(np.concatenate([whole.select(p).row + p.start for p in parts]), whole.row)
    assert split_rows(place_rows(nothing((2, 2)), PLAN), 10) == []


def test_what_two_rows_hold_of_one_moment_is_one_amplitude():
    """At the last step that the first row watches, where the second begins: to 1e-2 of the noise, more than what of it a
    row's circle forgets."""
    rows, out = made(deep(500))
    near, far = np.arange(0, 1000, 2), np.arange(1, 1000, 2)
    assert np.array_equal(rows.start[near] + rows.last[near] - 1, rows.start[far] + rows.first[far])
    here, there = out.amplitude[near, rows.last[near] - 1], out.amplitude[far, rows.first[far]]
    assert here.std() == pytest.approx(GSFL.noise_electrons, rel=0.15)
    assert np.abs(here - there).max() < 1e-2 * GSFL.noise_electrons
    # What comes later is new: nothing was decided on it.
    lag = rows.start[1] - rows.start[0]
    later = np.arange(rows.last[0] + 8, rows.length - 12)
    one, other = out.amplitude[near][:, later], out.amplitude[far][:, later - lag]
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.05


def test_noise_across_the_seam_has_the_amplifier_s_memory():
    """A step watched in the first row with steps watched in the second: (1 + x) exp(−x), 4.5 standard errors of 8000."""
    n = 8000
    rows, out = made(deep(n, 1e-3))
    first = out.amplitude[np.arange(0, 2 * n, 2), rows.last[0] - 2].astype(float) / GSFL.noise_electrons
    for after in (1, 2, 3, 4):  # steps after it: rows meet at the next
        second = out.amplitude[np.arange(1, 2 * n, 2), rows.first[1] + after - 1] / GSFL.noise_electrons
        x = after * PLAN.step_s / GSFL.amplifier.pole_s
        products = first * second
        assert abs(products.mean() - (1.0 + x) * math.exp(-x)) < 4.5 * products.std() / math.sqrt(n)
