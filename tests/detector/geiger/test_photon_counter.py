"""What a Geiger-mode array answers, by itself and in a scenario."""

import math
from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import detector
from rso_lidar.detector import LaserPulse
from rso_lidar.detector.geiger import photon_counter
from tests.detector.returns_for_tests import bell, nothing, returns

ARRAY = rl.GeigerArray()
PER_M = rl.units.RANGE_PER_DELAY_M_S
BENCH = "examples/geiger_bench.toml"
FEW = 'lidar.detector={type="geiger", gate_from_m=120, gate_to_m=180, pulses=20}'


def rng(seed=2):
    return np.random.default_rng(seed)


def test_a_reading_has_counts_where_it_has_a_range():
    photons = returns(np.full(3000, 150.0), np.linspace(0.0, 0.3, 3000), pulse_fwhm_s=1e-9, shape=(60, 50))
    reading, waveforms = detector.detect(photons, ARRAY, rng())
    valid = np.isfinite(reading.range_m)
    assert waveforms is None and reading.range_m.shape == (60, 50)
    assert 0.3 < valid.mean() < 0.95
    assert np.array_equal(reading.intensity_counts > 0, valid)
    assert reading.intensity_counts[valid].min() == ARRAY.dark_least_counts
    assert not reading.saturated.any()


def test_bright_pixels_count_every_pulse_and_say_so():
    quiet = ARRAY.replace(dark_count_rate_hz=0.0)  # a dark count would keep a pulse from being counted
    reading, _ = detector.detect(returns([150.0, 150.0], [1e4, 0.2], pulse_fwhm_s=1e-9), quiet, rng())
    assert reading.saturated.ravel().tolist() == [True, False]
    assert reading.intensity_counts[0, 0] == quiet.pulses > reading.intensity_counts[0, 1] > 0


def test_sunlight_raises_what_a_pixel_must_count():
    sun = np.full((1, 2000), 3e7)
    dim = replace(nothing((1, 2000)), background_photons_per_s=sun)
    reading, _ = detector.detect(dim, ARRAY, rng())
    stated = float(ARRAY.false_peak_probability(sun[0, :1])[0])
    assert np.isfinite(reading.range_m).mean() <= stated + 4 * math.sqrt(stated / 2000)
    assert ARRAY.find_least_counts(sun[0, :1])[0] > ARRAY.dark_least_counts


def test_a_range_is_never_negative():
    """Jitter moves times before the emission, where the gate opens with it."""
    part = ARRAY.replace(jitter_ns=3.0, least_counts=1, pulses=3)
    reading, _ = detector.detect(returns(np.full(500, 0.05), 50.0, pulse_fwhm_s=1e-9), part, rng())
    assert np.nanmin(reading.range_m) >= 0.0


def test_it_is_described_in_two_lines():
    first, second = detector.describe(ARRAY, 1024)
    assert "PDE 0.4, dark 20 kHz, hold-off 3400 ns, bins of 0.25 ns, jitter" in first
    assert "0 to 300 m, 100 pulses a frame, peaks of 3 counts in 2 ns" in second
    false = float(ARRAY.false_peak_probability(np.zeros(1))[0])
    assert f"{false * 1024:.2g} false alarms a frame" in second
    assert "1 pulse a frame" in detector.describe(ARRAY.replace(pulses=1, least_counts=1), 4)[1]
    assert detector.describe_window(ARRAY) == "a gate of 300 m about the target"
    long = ARRAY.replace(gate_to_m=1234.0)
    assert detector.describe_window(long) == "a gate of 1234 m about the target"
    assert detector.describe_storage(ARRAY) == []


@pytest.mark.parametrize(
    ("changes", "fwhm_s", "words"),
    [
        ({}, 8e-9, "spreads its counts over more than one peak of 2 ns; lengthen lidar.detector.peak_ns"),
        ({"dark_count_rate_hz": 1e6}, 1e-9, "dark counts leave 63% of the pulses without a live pixel"),
        ({"least_counts": 1}, 1e-9, "noise alone makes 98.2% of the pixels report in every frame"),
    ],
)
def test_what_is_doubtful_gets_a_line(changes, fwhm_s, words):
    lines = detector.advise(ARRAY.replace(**changes), fwhm_s)
    assert len([line for line in lines if words in line]) == 1, lines
    assert detector.advise(ARRAY, 1e-9) == []


def test_closed_forms_of_noise():
    assert detector.list_neglected_effects(ARRAY) == []
    assert detector.list_neglected_effects(ARRAY.replace(afterpulse_probability=0.1)) == ["afterpulse_probability"]
    alarms = detector.false_alarm_probability(ARRAY, np.array([1.0, 1e5]))
    assert alarms.shape == (2,) and alarms[0] == alarms[1] <= ARRAY.false_alarm_probability
    assert detector.noise_growth(ARRAY, 1.5e5) == pytest.approx(2.0)  # 20 kHz in the dark, 60 kHz more in the sun
    quiet = ARRAY.replace(dark_count_rate_hz=0.0)
    assert detector.noise_growth(quiet, 0.0) == 1.0 and detector.noise_growth(quiet, 1.0) == math.inf


def test_predictions_keep_their_shape_and_their_order():
    shape = bell(1e-9)
    pulse = LaserPulse(shape["pulse_step_s"], shape["pulse_power_per_s"], 1e-9)
    photons = np.array([[0.0, 0.05], [0.2, 20.0]])
    told = detector.predict(ARRAY, pulse, photons, 0.0)
    assert told.probability.shape == photons.shape and told.probability[0, 0] == 0.0
    assert np.all(np.diff(told.probability.ravel()) > 0.0)
    assert told.range_precision_m[0, 0] == np.inf and told.range_precision_m[1, 1] < told.range_precision_m[1, 0]
    assert told.saturated.tolist() == [[False, False], [False, True]]


def test_a_prediction_follows_from_a_normal_law_cut_off_by_the_window_and_a_binomial_law_of_counts():
    """First photons of a rectangular pulse are exponential in time, cut off at its end, which has a closed form."""
    from scipy import stats

    length_s, taps, pulses = 3e-9, 61, 40
    array = ARRAY.replace(
        jitter_ns=0.6, bin_ns=1.2, peak_ns=3.6, dark_count_rate_hz=2e5, detection_efficiency=0.25, pulses=pulses,
        least_counts=8,
    )  # fmt: skip
    pulse = LaserPulse(length_s / taps, np.full(taps, 1.0 / length_s), length_s, timing_jitter_ns=0.8)
    n = np.array([0.4, 1.5])  # avalanches of a pulse
    told = detector.predict(array, pulse, n / 0.25, 0.0)
    first_s2 = (length_s / n) ** 2 - length_s**2 * np.exp(-n) / (1.0 - np.exp(-n)) ** 2
    sigma_s = np.sqrt(first_s2 + (0.6e-9**2 + 0.8e-9**2) + 1.2e-9**2 / 12.0)
    window = stats.truncnorm(-1.8e-9 / sigma_s, 1.8e-9 / sigma_s)
    live = math.exp(-2e5 * 150.0 / PER_M)  # until the middle of a gate of 300 m
    fired = (1.0 - np.exp(-n)) * (2.0 * stats.norm.cdf(1.8e-9 / sigma_s) - 1.0) * live
    dark = (1.0 - math.exp(-2e5 * 3.6e-9)) * live
    counted = fired + dark - fired * dark
    assert told.probability == pytest.approx(stats.binom.sf(7, pulses, counted), rel=2e-3)
    assert told.range_precision_m == pytest.approx(
        sigma_s * window.std() / np.sqrt(pulses * fired) * PER_M, rel=2e-3
    )  # to the square of a tap, by which a flat surface is smoothed
    noise = pulses * (fired * (1.0 - fired) + 2e5 * 3.6e-9)
    assert told.snr == pytest.approx(pulses * fired / np.sqrt(noise), rel=2e-3)


def test_returns_that_are_tried_as_one_are_weighted_by_their_light():
    """Of pixel 4 two of three are within a sixteenth of the pulse; what is dark, or of another pixel, is left out."""
    fwhm_s, c = 16e-9, 299_792_458.0
    delay_s = np.array([100.1e-9, 100.8e-9, 103.5e-9, 100.4e-9, 100.2e-9])
    photons = returns(delay_s * c / 2, [3.0, 1.0, 0.5, 0.0, 7.0], [4, 4, 4, 4, 6], (1, 9), pulse_fwhm_s=fwhm_s)
    photons = replace(photons, depth_spread_s=np.array([2e-9, 6e-9, 1e-9, 9e-9, 3e-9]))
    pixel, middle_s, light, depth_s = photon_counter._merge_returns(photons, np.array([2, 4]))
    assert pixel.tolist() == [1, 1] and light.tolist() == [4.0, 0.5]
    assert middle_s == pytest.approx([(3.0 * 100.1e-9 + 100.8e-9) / 4.0, 103.5e-9], rel=1e-12)
    assert depth_s == pytest.approx([3e-9, 1e-9], rel=1e-12)


# ------------------------------------------------------------------------------------------------------ in a scenario


def test_a_planned_gate_flies():
    """The gate contains the plate at 150 m until 1 s, and opens behind it from then on. Every frame records it."""
    plan = 'lidar.schedule={time_s=[0, 1], gate_delay_ns=[800, 1100], interpolation="step"}'
    scenario = rl.Scenario.load(BENCH, (FEW, plan))
    for frame in rl.simulate(scenario, frames=[0, 9, 10, 19]):
        plate = frame.labels.filled_fraction > 0.99
        settings = frame.observation.settings
        assert settings["gate_width_s"] == pytest.approx(60.0 / rl.units.RANGE_PER_DELAY_M_S, rel=1e-9)
        if frame.time_s < 1.0:
            assert settings["gate_delay_s"] == pytest.approx(800e-9)
            assert frame.valid[plate].mean() > 0.4
        else:
            assert settings["gate_delay_s"] == pytest.approx(1100e-9)
            assert frame.valid[plate].mean() < 0.02
    advice = scenario.advice()
    assert len(advice) == 1 and "misses it 50%" in advice[0] and "gate_from_m and gate_to_m" in advice[0]


def test_a_commanded_gate_finds_a_target_out_of_the_first_one():
    scenario = rl.Scenario.load(BENCH, (FEW, "lidar.schedule={time_s=[0], gate_delay_ns=[0]}", "time.duration_s=0.4"))
    frames = list(rl.simulate(scenario, lambda seen: rl.Command(gate_delay_s=seen.settings["gate_delay_s"] + 0.45e-6)))
    found = [frame.valid[frame.labels.filled_fraction > 0.99].mean() for frame in frames]
    # 0 to 60, 67 to 127, 67 to 127 (a command holds for one flash, the plan opens at 0 again), ...
    assert [frame.observation.settings["gate_delay_s"] for frame in frames] == pytest.approx(
        [0.0, 0.45e-6, 0.9e-6, 1.35e-6]
    )
    assert found[0] < 0.02 and found[1] < 0.02 and found[2] > 0.4 and found[3] < 0.02


def test_a_controlled_run_is_the_same_with_any_threads():
    scenario = rl.Scenario.load(BENCH, (FEW, "time.duration_s=0.2"))
    one, two = (list(rl.simulate(scenario, lambda _: None, threads=threads)) for threads in (1, 3))
    for mine, other in zip(one, two, strict=True):
        np.testing.assert_array_equal(mine.range_m, other.range_m)
        np.testing.assert_array_equal(mine.intensity_counts, other.intensity_counts)


def test_a_budget_places_the_gate_about_the_target():
    """A pixel needs 0.17 photons: those of 50 nJ come from 231 m, and a hundred times as many from ten times as far."""
    near, far = (rl.budget(rl.Scenario.load(BENCH, (f"lidar.laser.energy_mj={mj}",))) for mj in (5e-5, 5e-3))
    assert near.curves[0].max_range_m == pytest.approx(231.0, abs=2.0)
    assert far.curves[0].max_range_m == pytest.approx(2310.0, abs=20.0)
    assert near.curves[0].range_m[0] < 10.0
    assert " 0.17 " in near.table() and "a gate of 300 m about the target" in near.table()
