"""The zero-crossing discriminator: its kernels beside an oracle, threads, and what the settings refuse."""

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, LowGain, Readout, ZeroCrossing, detect
from rso_lidar.detector.ranging.bipolar_pulse import differentiate, find_zero_crossings
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import returns
from tests.reference.detector import bipolar_pulse as oracle

STEP_S = 0.5e-9


def pulses(heights, n=100):
    """Return pulses of sigma 3.4 ns with slow noise of 300 electrons (row, step), at different phases."""
    rng = np.random.default_rng(6)
    time = np.arange(n) * STEP_S - 22e-9 - np.arange(len(heights))[:, None] * 0.13e-9
    noise = np.apply_along_axis(np.convolve, 1, rng.normal(0.0, 150.0, (len(heights), n)), np.ones(4), "same")
    return (heights[:, None] * np.exp(-0.5 * (time / 3.4e-9) ** 2) + noise).astype(np.float32)


def test_the_differentiator_is_its_oracle():
    signal = pulses(np.geomspace(1e4, 1e6, 3), 60)
    got, expected = differentiate(signal, 4e-9, STEP_S), oracle.differentiate(signal, 4e-9, STEP_S)
    assert np.abs(got - expected).max(axis=1) == pytest.approx(0.0, abs=1e-5 * 1e6)
    assert (np.abs(got - expected).max(axis=1) < 2e-5 * signal.max(axis=1)).all()


@pytest.mark.parametrize("recovery_ns", [0.0, 0.4, 3.0])
def test_crossings_are_those_of_the_oracle(recovery_ns):
    settings = ZeroCrossing(recovery_ns=recovery_ns)
    bipolar = differentiate(pulses(np.geomspace(3e3, 1e9, 12)), 4e-9, STEP_S)
    earliest = np.where(np.arange(12) % 2, 0.0, 30.0)
    got = find_zero_crossings(settings, bipolar, earliest, STEP_S)
    expected = oracle.find_zero_crossings(settings, bipolar, earliest, STEP_S)
    assert np.isnan(got[0]) and np.isfinite(got).sum() >= 10  # the weakest does not arm the channel
    # Pieces of the oracle are 1/256 of a step; those of the kernel, 1/8, follow the charge to second order.
    assert got == pytest.approx(expected, abs=0.012, nan_ok=True)


def test_a_crossing_before_the_pixel_looks_does_not_count():
    bipolar = differentiate(pulses(np.array([1e5, 1e5])), 4e-9, STEP_S)
    first, second = find_zero_crossings(ZeroCrossing(), bipolar, np.array([0.0, 90.0]), STEP_S)
    assert 40.0 < first < 60.0 and np.isnan(second)


@pytest.mark.parametrize(
    "part", [Gsfl(zero_crossing=ZeroCrossing()), Gsfl(readout=Readout(low_gain=LowGain()))], ids=["timing", "low gain"]
)
def test_threads_do_not_change_a_bit(part):
    n = 3000
    light = returns(500.0 + np.arange(n) % 200, np.geomspace(100.0, 1e9, n))
    one, several = (detect(light, part, np.random.default_rng(1), threads) for threads in (1, 3))
    assert one[0].range_m.tobytes() == several[0].range_m.tobytes()
    assert one[1].samples_counts.tobytes() == several[1].samples_counts.tobytes()
    if part.zero_crossing is not None:
        assert one[1].zero_crossing_s.tobytes() == several[1].zero_crossing_s.tobytes()
        assert np.isfinite(one[1].zero_crossing_s).sum() > 1000


def test_the_samples_give_the_range_where_the_channel_does_not_arm():
    light = returns(np.full(2000, 500.0), 850.0)
    part = Gsfl(zero_crossing=ZeroCrossing())
    reading, waveforms = detect(light, part, np.random.default_rng(3))
    timed = np.isfinite(waveforms.zero_crossing_s)
    assert 50 < timed.sum() < len(timed) - 50
    error = reading.range_m.ravel()[waveforms.pixel] - 500.0
    assert np.abs(np.median(error[timed])) < 0.05 and np.abs(np.median(error[~timed])) < 0.05


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"zero_crossing": {}, "gate": {"delay_ns": 100.0}}, "a gate has no trigger; leave one out"),
        ({"zero_crossing": {}, "returns": "last"}, "times the first return of a pixel alone"),
        ({"zero_crossing": {}, "max_returns": 2}, "times the first return of a pixel alone"),
        ({"zero_crossing": {"rail_electrons": 4000.0}}, "raise the rail"),
        ({"zero_crossing": {"arming_electrons": 2000.0}}, "below 3 times the noise of the channel"),
        (
            {"zero_crossing": {"arming_electrons": 100.0, "noise_electrons": 0.0}},
            "below 3 times the noise of the channel",
        ),
        ({"zero_crossing": {"differentiator_ns": 1000.0}}, "differentiator_ns"),
        ({"zero_crossing": {"recovery_ns": 1e3}}, "recovery_ns"),
        ({"zero_crossing": {"differentiator_ns": 0.0}}, "differentiator_ns"),
        ({"zero_crossing": {"recovery_ns": -0.1}}, "recovery_ns"),
        ({"zero_crossing": {"tau_ns": 1.0}}, "tau_ns"),
    ],
)
def test_what_cannot_be_is_one_line(settings, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Gsfl(**settings)
    assert "\n" not in str(caught.value)
