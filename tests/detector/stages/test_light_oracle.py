"""Rows, light and pulses by loops are those by NumPy: whole numbers exactly, light to float32's rounding."""

from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Gsfl
from rso_lidar.detector.chain import analog
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.convolution import convolve_light, convolve_rows
from rso_lidar.detector.stages.light import share_returns, spread_light
from rso_lidar.detector.stages.time_axis import find_rows, place_rows
from rso_lidar.kernels import packed
from tests.detector.returns_for_tests import nothing, returns, simulate_rows
from tests.reference.detector import convolution, light, time_axis

GSFL = Gsfl(preset="offset_limited")
PLAN = plan_time(GSFL, 8e-9)


def scattered(n_returns, n_pixels=60, seed=1):
    """Return photons of many pixels: near together and far apart, dim and bright, some dark, flat and deep."""
    rng = np.random.default_rng(seed)
    pixel = np.sort(rng.integers(0, n_pixels, n_returns))
    range_m = rng.choice([100.0, 1000.0, 4000.0], n_returns) + rng.choice([0.0, 5.0, 12.0], n_returns) * rng.random()
    bright = rng.choice([0.0, 1.0, 300.0, 1e5], n_returns) * rng.random(n_returns)
    photons = returns(range_m, bright, pixel, (4, n_pixels // 4), cluster=np.arange(n_returns))
    depth_s = rng.choice([0.0, 0.3e-9, 4e-9, 2e-7], n_returns, p=[0.4, 0.3, 0.2, 0.1])
    return replace(photons, depth_spread_s=depth_s, late_s=3.3e-10)


SCENES = {
    "many": scattered(800),
    "one": returns(np.array([1234.5]), 100.0),
    "dark": returns(np.array([1000.0, 1010.0]), 0.0),
    "none": nothing((4, 15)),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("least", "sure"), [(0.0, np.inf), (2.0, 1000.0)])
def test_rows_are_the_same(name, least, sure):
    photons = SCENES[name]
    by_numpy, by_loops = (one(photons, PLAN, least, sure) for one in (time_axis.place_rows, place_rows))
    for field in ("pixel", "start", "first", "last"):
        one, other = getattr(by_numpy, field), getattr(by_loops, field)
        assert one.dtype == other.dtype and np.array_equal(one, other), field
    assert (by_numpy.length, by_numpy.room) == (by_loops.length, by_loops.room)
    if name == "many":
        assert len(by_loops.pixel) > 80  # pixels have several


def test_a_row_that_is_sure_to_latch_is_the_last_and_each_row_counts_its_own_light():
    """Three surfaces of 60 photons far apart: none is sure by itself above 100; one of 120 is, and ends its pixel."""
    photons = returns(
        np.array([100.0, 400.0, 700.0, 100.0, 400.0, 700.0]),
        np.array([60.0, 60.0, 60.0, 60.0, 120.0, 60.0]),
        np.repeat([0, 1], 3),
        (1, 2),
    )
    for rows in (one(photons, PLAN, 1.0, 100.0) for one in (time_axis.place_rows, place_rows)):
        assert rows.pixel.tolist() == [0, 0, 0, 1, 1]
        seen_m = (rows.start + rows.first + PLAN.rise) * PLAN.step_s * 299_792_458.0 / 2.0
        # Rows begin on a sample, and are watched from the step before the pulse rises.
        assert seen_m == pytest.approx([100.0, 400.0, 700.0, 100.0, 400.0], abs=0.4)


@pytest.mark.parametrize("name", SCENES)
def test_light_is_the_same(name):
    """Sums of some 15 shares in float32: 1e-6 of the most light in a step of the row."""
    photons = SCENES[name]
    rows = place_rows(photons, PLAN)
    factors = np.linspace(0.5, 1.5, len(photons.pixel))
    for given in (None, factors):
        by_numpy, by_loops = (one(photons, rows, PLAN.step_s, given) for one in (light.spread_light, spread_light))
        assert by_numpy.shape == by_loops.shape and by_numpy.dtype == by_loops.dtype
        most = np.abs(by_numpy).max(axis=1, keepdims=True, initial=0.0)
        assert np.all(np.abs(by_numpy - by_loops) <= 1e-6 * most)


@pytest.mark.parametrize("name", SCENES)
def test_primaries_and_the_mean_amplitude_are_the_same(name, monkeypatch):
    """The transform rounds to 1e-6 of the highest step of a row; below 1e-4 primaries either may have cut."""
    photons = SCENES[name]
    rows, made = place_rows(photons, PLAN), []
    for function in (convolution.convolve_light, convolve_light):
        monkeypatch.setattr(analog, "convolve_light", function)
        made.append(simulate_rows(GSFL, photons, rows, None))
    by_numpy, by_loops = made
    for field, cut in (("primaries", 1.1e-4), ("amplitude", 1e-9)):
        one, other = getattr(by_numpy, field), getattr(by_loops, field)
        most = np.abs(one).max(axis=1, keepdims=True, initial=0.0)
        assert np.all(np.abs(one - other) <= 2e-6 * most + cut), field
    for made in (by_numpy, by_loops):
        assert not np.any((made.primaries != 0.0) & (made.primaries < np.float32(1e-4)))


def test_a_loop_writes_no_more_rows_than_there_is_room_for():
    photons = SCENES["many"]
    timing_s = 0.0, 8e-9, PLAN.rise * PLAN.step_s, PLAN.fall * PLAN.step_s, PLAN.step_s
    columns = (packed(getattr(photons, name)) for name in ("pixel", "delay_s", "photons", "depth_spread_s"))
    steps = PLAN.steps_per_sample, PLAN.before, PLAN.watched
    room = np.full(300, -7)
    assert find_rows(*columns, timing_s, steps, (0.0, np.inf), room[:30].reshape(3, 10)) == -1
    assert np.all(room[:30] != -7) and np.all(room[30:] == -7)


def test_each_loop_is_compiled_once():
    for photons in SCENES.values():
        store_waveforms(camera_of(GSFL, photons), photons, np.random.default_rng(1))[0]
    kernels = find_rows, share_returns, convolve_rows
    assert [len(one.dispatcher.signatures) for one in kernels] == [1, 1, 1]
