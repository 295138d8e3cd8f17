"""The low-gain channel: one linear scale, noise with an address, and what the settings refuse."""

import numpy as np
import pytest

from rso_lidar.detector import Gate, Gsfl, LowGain, Readout, Timing, detect
from rso_lidar.detector.stages.sampling import merge_low_gain, store_samples
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import returns
from tests.reference.detector import sampling as oracle

N = 50


def rows_for_tests(rng):
    pixel = np.sort(rng.choice(10_000, N, replace=False))
    return Rows(pixel, rng.integers(0, 5000, N), np.zeros(N, int), np.full(N, 90), 90)


@pytest.mark.parametrize("samples", [20, 22])
@pytest.mark.parametrize("quantised", [True, False])
def test_the_kernel_is_its_oracle(samples, quantised):
    rng = np.random.default_rng(3)
    readout = Readout(samples=samples, quantised=quantised, low_gain=LowGain(ratio=50.0, noise_counts=1.5))
    rows = rows_for_tests(rng)
    amplitude = (rng.standard_exponential((N, 90)) * np.geomspace(1e3, 1e8, N)[:, None]).astype(np.float32)
    row, first = np.arange(0, N, 2), rng.integers(0, 20, N // 2)
    offset = rng.normal(0.0, 30.0, N // 2)
    counts = store_samples(readout, amplitude, row, first, 2, samples, offset)
    expected, expected_clipped = oracle.merge_low_gain(
        readout, amplitude, rows, row, first, 2, offset, counts.copy(), np.random.default_rng(4)
    )
    clipped = merge_low_gain(readout, amplitude, rows, row, first, 2, offset, counts, np.random.default_rng(4))
    assert 0 < clipped.sum() < clipped.size
    # A value close to a half may be rounded the other way in single precision.
    assert np.mean(np.abs(counts - expected) > 1e-5 * np.abs(expected) + 1e-3) < 2e-3
    assert np.mean(clipped != expected_clipped) < 2e-3


def test_scale_is_linear_over_both_channels_and_saturates_where_both_clip():
    photons = np.geomspace(2e4, 5e7, 300)
    part = Gsfl(timing=Timing(pixel_jitter_ns=0.0), readout=Readout(low_gain=LowGain()))
    one = Gsfl(timing=Timing(pixel_jitter_ns=0.0))
    reading = detect(returns(np.full(300, 500.0), photons), part, np.random.default_rng(1))[0]
    counts, saturated = reading.intensity_counts.ravel().astype(float), reading.saturated.ravel().astype(bool)
    # 12 bits and a ratio of 64 make 257,984 counts of the first channel: four of them are one count of intensity.
    assert part.readout.clip_counts == 64.0 * 4031.0 and part.readout.counts_per_intensity == 4
    assert part.full_scale_counts == 64_496 and part.saturation_photons == pytest.approx(64 * one.saturation_photons)
    # A pulse peaks below the amplitude of its charge, since the amplifier broadens it.
    linear = photons < 0.98 * part.saturation_photons
    assert not saturated[linear].any() and saturated[photons > 1.15 * part.saturation_photons].all()
    share = counts[linear] / part.counts(photons[linear])
    assert np.ptp(share[photons[linear] > 2e5]) < 0.03 * share.mean()
    assert counts.max() == part.full_scale_counts


def test_the_first_channel_is_untouched_where_it_does_not_clip():
    light = returns(np.full(400, 500.0), 50_000.0)
    one, two = (
        detect(light, part, np.random.default_rng(2))[1].samples_counts
        for part in (Gsfl(), Gsfl(readout=Readout(low_gain=LowGain())))
    )
    assert one.tobytes() == two.tobytes()


def test_a_gate_averages_both_channels():
    gate = Gate(delay_ns=3320.0, width_ns=60.0, pulses=4)
    light = returns(np.full(64, 501.0), 1e6)
    part = Gsfl(gate=gate, timing=Timing(pixel_jitter_ns=0.0), readout=Readout(low_gain=LowGain()))
    reading = detect(light, part, np.random.default_rng(5))[0]
    assert not reading.saturated.any() and np.abs(reading.range_m - 501.0).max() < 0.02
    assert detect(light, Gsfl(gate=gate), np.random.default_rng(5))[0].saturated.all()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"low_gain": {"ratio": 1.0}}, "ratio"),
        ({"low_gain": {"ratio": 2.0, "adc_bits": 8}}, "low_gain clips at 382 counts of the first channel"),
        ({"low_gain": {"adc_bits": 4}}, "more than half of the 15 counts of low_gain"),
        ({"low_gain": {"noise_counts": -1.0}}, "noise_counts"),
        ({"low_gain": {"gain": 2.0}}, "gain"),
    ],
)
def test_what_cannot_be_is_one_line(settings, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Readout(**settings)
    assert "\n" not in str(caught.value)
