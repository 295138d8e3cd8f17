"""The histograms of a Geiger-mode array against their NumPy oracle, and in bands."""

from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector.geiger import histogram
from rso_lidar.detector.geiger.histogram import count_photons
from rso_lidar.philox import draw_key
from tests.detector.returns_for_tests import nothing, returns
from tests.reference.detector import histogram as reference

LOUD = rl.GeigerArray(
    pulses=12,
    gate_from_m=20.0,
    gate_to_m=80.0,
    dark_count_rate_hz=2e6,
    hold_off_ns=60.0,
    afterpulse_probability=0.2,
    afterpulse_time_ns=50.0,
    jitter_ns=0.4,
)
ARRAYS = {
    "everything": LOUD,
    "no noise": LOUD.replace(dark_count_rate_hz=0.0, afterpulse_probability=0.0, jitter_ns=0.0),
    "one avalanche in a pulse": LOUD.replace(hold_off_ns=3400.0),
    "a peak of one bin": LOUD.replace(peak_ns=0.25),
    "coarse bins": LOUD.replace(bin_ns=4.0, peak_ns=8.0),
}


def light(seed=5, n_pixels=60):
    """Return pixels with none to four returns, some stretched, some cut by the gate, some outside of it."""
    rng = np.random.default_rng(seed)
    pixel = np.sort(rng.integers(0, n_pixels, 2 * n_pixels))
    found = returns(rng.uniform(15.0, 85.0, len(pixel)), rng.uniform(0.0, 3.0, len(pixel)), pixel, (5, n_pixels // 5))
    depth_s = np.where(rng.random(len(pixel)) < 0.5, 0.0, rng.uniform(0.0, 30e-9, len(pixel)))
    dark = np.where(rng.random(len(pixel)) < 0.1, 0.0, found.photons)
    return replace(
        found,
        depth_spread_s=depth_s,
        photons=dark,
        late_s=0.4e-9,
        background_photons_per_s=rng.uniform(0.0, 2e6, found.shape),
    )


@pytest.mark.parametrize("name", ARRAYS)
def test_the_kernel_draws_what_its_oracle_draws(name):
    array, photons = ARRAYS[name], light()
    got = count_photons(array, photons, np.random.default_rng(8))
    delay_s, counts, total = reference.count_photons(array, photons, draw_key(np.random.default_rng(8)))
    np.testing.assert_array_equal(got.total_counts, total)
    np.testing.assert_array_equal(got.counts, counts)
    np.testing.assert_allclose(got.delay_s, delay_s, rtol=1e-13)
    assert total.sum() > 100


def moving_light():
    """Return light whose returns come at three epochs, of three, four and five pulses."""
    photons = light()
    epoch = np.random.default_rng(3).integers(0, 3, len(photons.pixel))
    order = np.lexsort((epoch, photons.pixel))
    names = ("delay_s", "photons", "depth_spread_s")
    chosen = {name: getattr(photons, name)[order] for name in names}
    return replace(photons, **chosen, epoch=epoch[order], pulse_epoch=np.repeat([0, 1, 2], [3, 4, 5]))


def jittering_light():
    """Return the same light, with an energy and a delay of each pulse."""
    rng = np.random.default_rng(4)
    jitter = {"pulse_energy_fraction": rng.uniform(0.5, 1.5, 12), "pulse_late_s": rng.uniform(-2e-9, 2e-9, 12)}
    return replace(moving_light(), **jitter)


@pytest.mark.parametrize("make", [moving_light, jittering_light])
@pytest.mark.parametrize("name", ["everything", "no noise"])
def test_each_pulse_counts_its_own_light(name, make):
    array, photons = ARRAYS[name], make()
    got = count_photons(array, photons, np.random.default_rng(8))
    delay_s, counts, total = reference.count_photons(array, photons, draw_key(np.random.default_rng(8)))
    np.testing.assert_array_equal(got.total_counts, total)
    np.testing.assert_array_equal(got.counts, counts)
    np.testing.assert_allclose(got.delay_s, delay_s, rtol=1e-13)
    still = count_photons(array, light(), np.random.default_rng(8))
    assert np.any(got.total_counts != still.total_counts)


def test_the_light_of_a_gate_is_what_comes_while_it_is_open():
    """The oracle's own integral: all photons of a return inside, half of one that the gate cuts in its middle."""
    inside, cut = (returns([range_m], 2.0) for range_m in (50.0, 80.0))
    assert reference.integrate_light(LOUD, inside, 0)[1][-1] == pytest.approx(0.8, rel=1e-12)
    assert reference.integrate_light(LOUD, cut, 0)[1][-1] == pytest.approx(0.4, rel=0.05)
    assert reference.integrate_light(LOUD, returns([95.0], 2.0), 0)[1][-1] == 0.0


@pytest.mark.parametrize("threads", [2, 3, None])
@pytest.mark.parametrize("band", [1, 7, 128])
def test_bands_and_threads_change_no_bit(monkeypatch, threads, band):
    whole = count_photons(LOUD, light(), np.random.default_rng(8))
    monkeypatch.setattr(histogram, "_BAND", band)
    banded = count_photons(LOUD, light(), np.random.default_rng(8), threads)
    for name in ("delay_s", "counts", "total_counts"):
        np.testing.assert_array_equal(getattr(banded, name), getattr(whole, name))


def test_dark_pixels_without_dark_counts_count_nothing():
    found = count_photons(ARRAYS["no noise"], nothing((3, 4)), np.random.default_rng(1))
    assert np.isnan(found.delay_s).all() and not found.total_counts.any()


@pytest.mark.parametrize(
    ("counts", "touched", "expected"),
    [
        ({9: 2, 5: 2}, (9, 5), (5.0, 2)),  # the nearer of equals, in whatever order they came
        ({5: 2, 9: 3}, (5, 9), (9.0, 3)),
        ({5: 1, 6: 1, 7: 1, 9: 2}, (9, 7, 6, 5), (6.0, 3)),
        ({11: 1, 10: 3}, (11, 10), (10.25, 4)),  # the window ends with the gate
        ({}, (), (np.nan, 0)),
    ],
)
def test_the_peak_is_the_window_with_most_counts(counts, touched, expected):
    bins = np.zeros(12, np.int64)
    for place, number in counts.items():
        bins[place] = number
    array = LOUD.replace(bin_ns=1.0, peak_ns=3.0)
    centre, most = histogram._peak(bins, np.array(touched, np.int64), array.peak_bins)
    assert most == expected[1] and centre == pytest.approx(expected[0], nan_ok=True)
    delay_s, told = reference.find_peak(bins, array)
    assert told == most and delay_s == pytest.approx(array.opens_s + (centre + 0.5) * array.bin_s, nan_ok=True)


def test_the_kernel_compiles_once():
    for array in (LOUD, rl.GeigerArray()):
        count_photons(array, light(), np.random.default_rng(1))
        count_photons(array, nothing((1, 1)), np.random.default_rng(1), 2)
    assert len(histogram._count.dispatcher.signatures) == 1
