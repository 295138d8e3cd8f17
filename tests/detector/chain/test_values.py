"""Figures of the detectors by closed forms, all settings away from their defaults at once."""

import math

import numpy as np
import pytest
from scipy import optimize, stats

from rso_lidar.detector import (
    Amplifier,
    Apd,
    Empirical,
    Gate,
    Gsfl,
    Maps,
    Pulse,
    Readout,
    detect,
    false_alarm_probability,
)
from rso_lidar.detector.analysis.false_alarms import false_trigger_fraction, mean_false_alarms_per_s
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.chain.camera import camera_of, draw_camera_pixels
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.ranging.gate_threshold import GateThresholds
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import noise_covariance
from rso_lidar.detector.settings.apd import noise_rms
from rso_lidar.detector.stages import comparator
from rso_lidar.detector.stages.comparator import Bridge
from rso_lidar.detector.stages.crossing_rate import rice_rate
from rso_lidar.records import Waveforms
from tests.detector.returns_for_tests import STATED, nothing, returns
from tests.reference.detector.whole_chain import PATHS, computing

C = 299_792_458.0
ELECTRON_C = 1.602_176_634e-19
PART = Gsfl(
    quantum_efficiency=0.6,
    apd={"gain": 8.0, "ionisation_ratio": 0.3, "dark_current_na": 3.0},
    amplifier={"bandwidth_mhz": 130.0, "noise_electrons": 800.0, "integration_ns": 7.0},
    trigger={"threshold_electrons": 5200.0, "threshold_spread_fraction": 0.03},
    readout={"electrons_per_count": 90.0, "baseline_counts": 100.0, "sample_ns": 2.0},
    armed_from_m=1800.0,
    armed_to_m=2600.0,
    timing={"pixel_jitter_ns": 0.3, "frame_jitter_ns": 0.5},
)
TAU = math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * 130e6)
FACTOR = 0.3 * 8.0 + 0.7 * (2.0 - 1.0 / 8.0)  # McIntyre's F
DARK = 3e-9 / ELECTRON_C


def rms(rate_per_s):
    """Return the rms [electrons] of noise with so many primaries a second (Campbell), by hand."""
    return math.sqrt(800.0**2 + 64.0 * FACTOR * rate_per_s * 7e-9**2 / (4.0 * TAU))


# --------------------------------------------------------------------------------------------------- noise and triggers


def test_noise_of_dark_current_and_sunlight():
    assert PART.noise_electrons == pytest.approx(rms(DARK), rel=1e-12)
    assert PART.noise_in_light(3e11) == pytest.approx(rms(DARK + 0.6 * 3e11), rel=1e-12)
    told = noise_rms(PART.apd, np.array([1e9, 7e10]), 800.0, TAU, 7e-9)
    assert told == pytest.approx([rms(1e9), rms(7e10)], rel=1e-12)
    assert PART.noise_counts == pytest.approx(rms(DARK) / 90.0)
    assert PART.electrons_per_photon == pytest.approx(4.8) and PART.traits.threshold_photons == pytest.approx(
        5200.0 / 4.8
    )
    assert PART.full_scale_counts == 4095 - 100
    assert PART.counts(np.array([500.0])) == pytest.approx(500.0 * 4.8 / 90.0)


def test_rices_rate_and_the_share_of_pixels_that_noise_triggers():
    """Two equal poles: ν₀ = 1/(2πτ). The share counts from when pixels are armed, and is a mean over the camera."""
    assert rice_rate(np.array([3000.0]), 700.0, TAU) == pytest.approx(
        math.exp(-0.5 * (3000.0 / 700.0) ** 2) / (2.0 * math.pi * TAU), rel=1e-12
    )
    gaussian = PART.replace(apd=PART.apd.replace(statistics="gaussian"))
    threshold = 5200.0 * draw_camera_pixels(gaussian, 16_384).threshold
    rates = np.exp(-0.5 * (threshold / rms(DARK)) ** 2) / (2.0 * math.pi * TAU)
    assert mean_false_alarms_per_s(gaussian) == pytest.approx(rates.mean(), rel=1e-9)
    armed_s = 2.0 * 800.0 / C
    expected = [-np.expm1(-rates * after_s).mean() for after_s in (armed_s, 3e5 * armed_s)]
    assert expected[1] > 0.1  # where the share of all pixels is not that of a pixel with their mean rate
    got = false_trigger_fraction(gaussian, np.array([armed_s, 3e5 * armed_s]))
    assert got == pytest.approx(expected, rel=1e-9, abs=6e-5)  # rates within 5 % are averaged
    assert got[0] == pytest.approx(expected[0], rel=1e-4)
    alarms = false_alarm_probability(gaussian, np.array([0.0, gaussian.armed_to_m, 1e9]))
    assert alarms == pytest.approx([0.0, got[0], got[0]], rel=1e-9)


def test_a_row_holds_all_that_a_latch_stores_and_what_the_filter_remembers():
    """Steps of the plan, by the pulse and τ: rise 1.3 FWHM, fall 0.5 FWHM + 2τ, memory the longer of 6τ and 0.85 FWHM."""
    for fwhm_ns in (5.0, 8.0, 30.0):
        plan = plan_time(PART, fwhm_ns * 1e-9)
        per = plan.steps_per_sample
        step_ns = 2.0 / per
        assert plan.step_s == pytest.approx(step_ns * 1e-9)
        assert plan.rise == math.ceil(1.3 * fwhm_ns / step_ns)
        assert plan.fall == math.ceil((0.5 * fwhm_ns + 2.0 * TAU * 1e9) / step_ns)
        memory = math.ceil(max(6.0 * TAU * 1e9, 0.85 * fwhm_ns) / 2.0)
        assert plan.before == (8 + memory) * per and plan.after == 12 * per
        assert plan.room == math.ceil(0.65 * fwhm_ns / step_ns)
        assert plan.watched == plan.rise + plan.fall + per and plan.length >= plan.before + plan.watched + plan.after


@pytest.mark.parametrize("path", PATHS)
def test_what_comes_near_the_threshold_depends_on_the_light_in_that_step(path):
    """reach · sqrt(quiet² + shot² (primaries / step + base)): a step in light is near where a dark one is not."""
    step_s, quiet, shot, reach, base = 1e-9, 300.0, 2e-3, 0.5, 1e9
    dim = reach * math.sqrt(quiet**2 + shot**2 * base)
    lit = reach * math.sqrt(quiet**2 + shot**2 * (base + 200.0 / step_s))
    assert lit > 2.0 * dim
    amplitude = np.zeros((4, 30), np.float32)
    primaries = np.zeros((4, 30), np.float32)
    amplitude[:, 12] = [4000.0 - 0.97 * dim, 4000.0 - 1.03 * dim, 4000.0 - 0.97 * lit, 4000.0 - 1.03 * lit]
    primaries[2:, 11:13] = 200.0
    one = np.ones(4)
    with computing(path):
        latch = comparator.find_latches(
            amplitude,
            primaries,
            4000.0 * one,
            base * one,
            np.full(4, 5),
            np.full(4, 25),
            np.zeros(4, bool),
            hysteresis=1000.0,
            step_s=step_s,
            quiet_electrons=quiet,
            shot_electrons_rs=shot,
            reach=reach,
        )
    assert latch.tolist() == [-2, -1, -2, -1]


@pytest.mark.parametrize("path", PATHS)
def test_a_comparator_that_is_being_armed_waits_for_the_hysteresis(path):
    """Armed above: it fires again only after having been below threshold − hysteresis, not just below the threshold."""
    course = [[4500, 3500, 4500, 2900, 4600, 4700], [4500, 3500, 4500, 3100, 4600, 4700]]
    amplitude = np.array(course, np.float32)
    with computing(path):
        latch = comparator.find_latches(
            amplitude,
            np.zeros((2, 6), np.float32),
            np.full(2, 4000.0),
            np.zeros(2),
            np.zeros(2, int),
            np.full(2, 6),
            np.ones(2, bool),
            hysteresis=1000.0,
            step_s=1e-9,
            quiet_electrons=1.0,
            shot_electrons_rs=0.0,
            reach=1.0,
        )
    assert latch.tolist() == [4, -1]


def test_between_steps_noise_has_its_own_rms_and_the_mean_is_a_curve():
    """Of a polynomial of fifth degree the mean is exact; the highest of the rest grows with sigma, in proportion."""
    bridge = Bridge(TAU, 0.8e-9)
    step = np.arange(24.0)
    course = 3.0 * step + 0.4 * step**2 - 0.02 * step**3 + 1e-4 * step**5
    row, at = np.zeros(4000, int), np.full(4000, 9)
    mean = np.tile(course, (1, 1))
    still = bridge.path(mean, mean, row, at, np.zeros(4000), np.random.default_rng(1)).max(axis=1)
    fine = np.arange(1, 16) / 16.0 + 9.0
    inside = (3.0 * fine + 0.4 * fine**2 - 0.02 * fine**3 + 1e-4 * fine**5).max()
    assert still == pytest.approx(inside, rel=1e-9)
    # The conditional law of (1 + x) exp(-x) noise between four known steps, drawn here by its own covariance.
    known, between = np.arange(-1.0, 3.0), np.arange(1, 16) / 16.0

    def correlation(a, b):
        x = np.abs(np.subtract.outer(a, b)) * 0.8e-9 / TAU
        return (1.0 + x) * np.exp(-x)

    across = correlation(between, known)
    rest = correlation(between, between) - across @ np.linalg.inv(correlation(known, known)) @ across.T
    drawn = np.random.default_rng(3).multivariate_normal(np.zeros(15), rest, 100_000).max(axis=1)
    for sigma in (1.0, 50.0):
        path = bridge.path(mean * 0.0, mean * 0.0, row, at, np.full(4000, sigma), np.random.default_rng(2))
        highest = path.max(axis=1) / sigma
        error = drawn.std() * math.sqrt(1.0 / 4000 + 1.0 / 100_000)
        assert abs(highest.mean() - drawn.mean()) < 4.0 * error


# ----------------------------------------------------------------------------------------------------------- the gate


@pytest.mark.parametrize(("quantised", "samples"), [(True, 80), (False, 80), (True, 6)])
def test_a_gates_threshold_knows_pulses_rounding_and_offsets_at_once(quantised, samples):
    """Gaussian noise: σ² = (wᵀCw + wᵀw/12)/M + (o Σw)²; ν₀ T exp(−u²/2) + Q(u) = −ln(1 − p) (Rice 1944)."""
    gate = Gate(delay_ns=500.0, width_ns=2.0 * samples, pulses=5, false_alarm_probability=4e-3)
    amplifier = Amplifier(bandwidth_mhz=130.0, noise_electrons=90.0)
    readout = Readout(sample_ns=2.0, electrons_per_count=90.0, quantised=quantised)
    apd = Apd(gain=8.0, ionisation_ratio=0.3, dark_current_na=0.0)
    pulse = Pulse.after(*make_reference_pulse(), TAU, amplifier.integration_s)
    matched = Matched.of(pulse, 2e-9, TAU, 1.0)
    found = GateThresholds(gate, apd, amplifier, readout, matched, offset_counts=0.4).solve(np.zeros(2))
    weights = matched.height_weights()
    inside = weights @ noise_covariance(len(weights), 2e-9, TAU, 1.0) @ weights
    inside += quantised / 12.0 * (weights**2).sum()
    sigma = math.sqrt(inside / 5.0 + (0.4 * weights.sum()) ** 2)
    wanted = -math.log1p(-4e-3)
    crossings = matched.crossings_per_s * samples * 2e-9
    u = optimize.brentq(lambda u: crossings * math.exp(-0.5 * u**2) + stats.norm.sf(u) - wanted, 0.1, 9.0)
    assert found == pytest.approx(u * sigma, rel=2e-3)


def test_a_gate_tells_of_a_sample_that_clipped_in_any_of_its_pulses():
    """1 − (1 − p)⁴ of the pixels, p of one pulse alone: 4.5 standard errors of both."""
    part, n = Gsfl(timing={"pixel_jitter_ns": 0.0}), 3000
    gate = {"delay_ns": 6640.0, "width_ns": 60.0}
    one, several = part.replace(gate=gate), part.replace(gate={**gate, "pulses": 4})
    dim = store_waveforms(
        camera_of(one, returns(np.full(n, 1000.0), 50_000.0)),
        returns(np.full(n, 1000.0), 50_000.0),
        np.random.default_rng(3),
    )[0].samples_counts
    photons = returns(np.full(n, 1000.0), 50_000.0 * 4031.0 / (dim.mean(axis=0).max() - 64.0) * 0.995)
    p, q = (
        store_waveforms(camera_of(part, photons), photons, np.random.default_rng(4))[0].clipped.any(axis=1).mean()
        for part in (one, several)
    )
    assert 0.05 < p < 0.5
    error = math.hypot(4.0 * (1.0 - p) ** 3 * math.sqrt(p * (1.0 - p) / n), math.sqrt(q * (1.0 - q) / n))
    assert abs(q - (1.0 - (1.0 - p) ** 4)) < 4.5 * error


# -------------------------------------------------------------------------------------------------------- the reading


@pytest.mark.parametrize("pulses", [1, 9])
def test_a_frames_jitter_is_common_and_a_pixels_its_own_and_pulses_average_both(pulses):
    """Standard deviations within and between 40 frames of 100 pixels that would read alike: 4.5 of their errors."""
    gate = None if pulses == 1 else {"delay_ns": 6640.0, "width_ns": 60.0, "pulses": pulses}
    part = PART.replace(gate=gate)
    n, frames = 100, 40
    camera = camera_of(part, nothing((1, n)))
    pulse = camera.pulse
    start_s = 2.0 * 1000.0 / C - 9.3 * 2e-9
    shape = 100.0 + 900.0 * pulse.amplitude(np.arange(20) * 2e-9 - 9.3 * 2e-9) / pulse.peak
    same = np.full(n, start_s)
    stored = Waveforms((1, n), 2e-9, 100.0, np.arange(n), same, same + 17e-9, np.tile(shape, (n, 1)))
    rngs = (np.random.default_rng([9, k]) for k in range(frames))
    read = np.array([measure(camera.processor, stored, rng).range_m[0] for rng in rngs])
    delay_s = (read.astype(float) - 1000.0) * 2.0 / C
    within = (delay_s - delay_s.mean(axis=1, keepdims=True)).std() * math.sqrt(n / (n - 1))
    assert within == pytest.approx(0.3e-9 / math.sqrt(pulses), rel=4.5 / math.sqrt(2.0 * n * frames))
    between = delay_s.mean(axis=1).std(ddof=1)
    expected = math.hypot(0.5e-9, 0.3e-9 / math.sqrt(n)) / math.sqrt(pulses)
    assert between == pytest.approx(expected, rel=4.5 / math.sqrt(2.0 * frames))


def test_the_rail_stands_on_the_pixels_own_offset():
    """A sample within a count of baseline + offset + rail is held down; 3 counts below it is not, whatever the offset."""
    part = PART.replace(saturation={"rail_electrons": 90_000.0}, maps=Maps(offset_spread_counts=25.0), gate=None)
    n = 300
    camera = camera_of(part, nothing((1, n)))
    pulse, offset = camera.pulse, camera.front.pixels.offset_counts
    assert offset.min() < -40.0 and offset.max() > 40.0
    start = np.full(n, 6e-6)
    for below, held in ((0.5, True), (3.0, False)):
        samples = 100.0 + offset[:, None] + 200.0 * pulse.amplitude(np.arange(20) * 2e-9 - 18e-9) / pulse.peak
        samples[:, 10] = 100.0 + offset + 1000.0 - below
        stored = Waveforms((1, n), 2e-9, 100.0, np.arange(n), start, start + 17e-9, samples)
        reading = measure(camera.processor, stored, np.random.default_rng(1))
        assert np.isfinite(reading.range_m).all()
        assert (reading.saturated == held).all()


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("at", [0, 7, 19])
def test_any_clipped_sample_of_a_trace_says_saturated(path, at):
    part = PART.replace(timing={"pixel_jitter_ns": 0.0})
    camera = camera_of(part, nothing((1, 3)))
    pulse = camera.pulse
    samples = np.tile(100.0 + 300.0 * pulse.amplitude(np.arange(20) * 2e-9 - 18e-9) / pulse.peak, (3, 1))
    samples[1, at] = 4095.0
    start = np.full(3, 6e-6)
    stored = Waveforms((1, 3), 2e-9, 100.0, np.arange(3), start, start + 17e-9, samples)
    with computing(path):
        reading = measure(camera.processor, stored, np.random.default_rng(1))
    assert np.isfinite(reading.range_m).all() and reading.saturated[0].tolist() == [0, 1, 0]


# -------------------------------------------------------------------------------------------------- the fast detector


FAST = Empirical(**STATED, false_alarms_per_s=0.0, sample_ns=2.0, quantum_efficiency=0.6, adc_bits=16)


def test_range_and_intensity_of_the_fast_detector_have_their_own_noise():
    """σ_R² = plateau² + (c/2)² (s² F/(QE N) + 2 s Δt/√π (NEP/N)²), σ_N² = NEP² + F N/QE; the two are independent."""
    part = FAST.replace(
        range_noise_equivalent_photons=90.0,
        range_excess_noise_factor=2.5,
        intensity_noise_equivalent_photons=260.0,
        intensity_excess_noise_factor=5.0,
        counts_per_photon=1.0,
        compression_counts=1e7,
    )
    n, light = 40_000, 6000.0
    reading = detect(returns(np.full(n, 1500.0), light, pulse_fwhm_s=6e-9), part, np.random.default_rng(5))[0]
    error_m, counts = reading.range_m[0].astype(float) - 1500.0, reading.intensity_counts[0].astype(float)
    s = 6e-9 / (2.0 * math.sqrt(2.0 * math.log(2.0)))
    shot = s**2 * 2.5 / (0.6 * light)
    white = 2.0 * s * 2e-9 / math.sqrt(math.pi) * (90.0 / light) ** 2
    sigma_m = math.sqrt(0.05**2 + (C / 2.0) ** 2 * (shot + white))
    assert float(part.range_noise_m(np.array(light), 6e-9)) == pytest.approx(sigma_m, rel=1e-6)
    assert error_m.std() == pytest.approx(sigma_m, rel=4.5 / math.sqrt(2.0 * n))
    sigma_counts = math.sqrt(260.0**2 + 5.0 * light / 0.6 + 1.0 / 12.0)
    assert counts.std() == pytest.approx(sigma_counts, rel=4.5 / math.sqrt(2.0 * n))
    assert abs(counts.mean() - light) < 4.5 * sigma_counts / math.sqrt(n)
    assert abs(np.corrcoef(error_m, counts)[0, 1]) < 4.5 / math.sqrt(n)


def test_false_triggers_of_the_fast_detector():
    """Exponential waiting from when it is armed, at most to the end of the window; heights T + (NEP²/T) · exponential."""
    part = FAST.replace(
        false_alarms_per_s=2e5, armed_from_m=1000.0, armed_to_m=2500.0, counts_per_photon=10.0, compression_counts=1e7
    )
    n = 60_000
    reading = detect(nothing((200, 300)), part, np.random.default_rng(6))[0]
    seen = np.isfinite(reading.range_m)
    window_s = 2.0 * 1500.0 / C
    p = -math.expm1(-2e5 * window_s)
    assert abs(seen.sum() - n * p) < 4.5 * math.sqrt(n * p * (1.0 - p))
    wait_s = (reading.range_m[seen].astype(float) - 1000.0) * 2.0 / C
    assert stats.kstest(-np.expm1(-2e5 * wait_s) / p, "uniform").pvalue > 1e-3
    above = reading.intensity_counts[seen] / 10.0 - part.threshold_photons
    scale = 127.0**2 / part.threshold_photons
    assert above.mean() == pytest.approx(scale, rel=4.5 / math.sqrt(seen.sum()))
    assert part.threshold_photons == pytest.approx(
        1000.0 - 1.644854 * math.sqrt(127.0**2 + 3.52 * 1000.0 / 0.6), rel=1e-6
    )
