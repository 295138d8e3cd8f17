"""The settings of a Geiger-mode array: what is refused, what follows from them, and its gate."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.errors import ScenarioError

PER_M = units.RANGE_PER_DELAY_M_S


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"detection_efficiency": 0.0}, "detection_efficiency: .*greater than 0"),
        ({"detection_efficiency": 1.5}, "detection_efficiency: .*less than or equal to 1"),
        ({"dark_count_rate_hz": -1.0}, "dark_count_rate_hz: .*greater than or equal to 0"),
        ({"dark_count_rate_hz": math.nan}, "dark_count_rate_hz: .*finite"),
        ({"afterpulse_probability": 1.0}, "afterpulse_probability: .*less than 1"),
        ({"pulses": 0}, "pulses: .*greater than or equal to 1"),
        ({"pulses": 2.5}, "pulses: .*integer"),
        ({"gate_from_m": 300.0}, r"gate_to_m \(300\) must be beyond gate_from_m \(300\)"),
        ({"bin_ns": 1e-6}, "bins of bin_ns = 1e-06, not 2 to 131,072; change bin_ns or the gate"),
        ({"bin_ns": 2500.0, "peak_ns": 1.0}, "a gate of 2001 ns has 1 bins of bin_ns = 2500, not 2 to 131,072"),
        ({"peak_ns": 5000.0}, r"peak_ns \(5000\) is longer than the gate; shorten it"),
        ({"hold_off_ns": 0.1}, r"hold_off_ns \(0\.1\) must not be shorter than bin_ns \(0\.25\)"),
        ({"pulses": 1}, r"a peak needs 2 counts, but 1 pulse\(s\) give 1 at most; raise pulses"),
        ({"least_counts": 101}, r"a peak needs 101 counts, but 100 pulse\(s\) give 100 at most"),
        ({"afterpulse_probability": "0.1"}, "afterpulse_probability: .*number"),
        ({"gate_too_m": 3.0}, "unknown key 'gate_too_m'; did you mean 'gate_to_m'"),
    ],
)
def test_what_no_array_has_is_refused_in_one_line(changes, words):
    with pytest.raises(ScenarioError, match=words) as error:
        rl.GeigerArray(**changes)
    assert "\n" not in str(error.value)


def test_what_follows_from_the_settings():
    array = rl.GeigerArray(gate_from_m=150.0, gate_to_m=300.0, bin_ns=0.5, peak_ns=1.8, hold_off_ns=1.0, pulses=7)
    assert array.opens_s == pytest.approx(2 * 150.0 / 299_792_458.0)
    assert array.gate_s == pytest.approx(array.opens_s)
    assert array.n_bins == math.ceil(array.gate_s / 0.5e-9) == 2002
    assert array.peak_bins == 4 and array.peak_s == pytest.approx(2e-9)
    assert array.most_counts == 7 * 3  # an avalanche at 0, 1 and 2 ns of each pulse


def test_a_gate_of_whole_bins_has_no_bin_more():
    for bins in (3, 7, 1001):
        array = rl.GeigerArray(gate_from_m=10.0, gate_to_m=10.0 + bins * 0.25e-9 * PER_M, peak_ns=0.5, least_counts=1)
        assert array.n_bins == bins


def test_sunlight_raises_noise_and_the_least_counts():
    array = rl.GeigerArray(afterpulse_probability=0.2)
    assert array.noise_per_s(np.array([0.0, 1e6])) == pytest.approx([20e3, 420e3])
    least = array.find_least_counts(np.array([[0.0, 1e6], [1e7, 0.0]]))
    assert least.shape == (2, 2) and least[0, 0] == least[1, 1] == array.dark_least_counts
    assert least[0, 0] < least[0, 1] < least[1, 0]
    assert (array.false_peak_probability(np.array([0.0, 1e6, 1e7])) <= array.false_alarm_probability).all()
    assert (array.replace(least_counts=5).find_least_counts(np.zeros(3)) == 5).all()


def test_each_avalanche_brings_a_chain_of_afterpulses():
    """One count makes a peak, so the probability is that of any count: 0.4 a gate, and 1/(1 - p) times as many in all."""
    gate_m = 2e-6 * PER_M
    array = rl.GeigerArray(
        gate_to_m=gate_m, dark_count_rate_hz=1e5, afterpulse_probability=0.36, pulses=2, least_counts=1
    )
    noise = 2 * 1e5 * 2e-6 / (1.0 - 0.36)
    assert array.false_peak_probability(np.zeros(1)) == pytest.approx([-math.expm1(-noise)], rel=1e-12)


def test_its_traits():
    array = rl.GeigerArray(gate_from_m=40.0, gate_to_m=100.0, pulses=50, least_counts=3)
    traits = array.traits
    assert (traits.sees_from_m, traits.sees_to_m, traits.returns, traits.pulses) == (40.0, 100.0, "strongest", 50)
    assert traits.is_gated and not traits.has_waveforms and not traits.has_taps
    assert traits.clock_s == 0.25e-9
    assert traits.settings == pytest.approx({"gate_delay_s": 40.0 / PER_M, "gate_width_s": 60.0 / PER_M})
    dark = array.dark_count_rate_hz * array.peak_s  # counts that fall into the peak without light
    fired = -math.expm1(-array.detection_efficiency * traits.threshold_photons - dark)
    at_least_3 = 1.0 - sum(math.comb(50, k) * fired**k * (1.0 - fired) ** (50 - k) for k in range(3))
    assert at_least_3 == pytest.approx(0.5, abs=1e-9)
    # From these photons on, half of all frames have a count in every pulse.
    assert (-math.expm1(-array.detection_efficiency * traits.saturation_photons)) ** 50 == pytest.approx(0.6, abs=0.05)


def test_the_gate_moves_and_stays_as_long():
    array = rl.GeigerArray(gate_from_m=0.0, gate_to_m=123.4, pulses=40)
    for delay_ns in (0.0, 333.3, 2e6):
        moved = array.with_gate_delay(delay_ns)
        assert moved.opens_s == pytest.approx(delay_ns * 1e-9, rel=1e-14)
        assert moved.gate_s == pytest.approx(array.gate_s, rel=1e-9)
        assert moved.n_bins == array.n_bins and moved.dark_least_counts == array.dark_least_counts
        assert moved.pulses == 40
    for delay_ns in (-1.0, math.nan):
        with pytest.raises(
            ScenarioError, match=rf"^delay_ns: {delay_ns:g} is not a time after emission; give a number"
        ):
            array.with_gate_delay(delay_ns)
