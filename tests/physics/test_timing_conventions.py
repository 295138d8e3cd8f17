"""From where times count: the zero of a leading edge, straight lines between samples, taps, and counts under droop."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Droop, Gsfl, detect, detect_with_taps
from rso_lidar.detector.bench.trial import make_plate, make_point_returns
from rso_lidar.detector.ranging.location import Locator, locate
from rso_lidar.detector.ranging.pulse import Pulse

LASER = rl.Laser()
GSFL = Gsfl()
PULSE = Pulse.after(*LASER.pulse, GSFL.amplifier.pole_s, GSFL.amplifier.integration_s)
THRESHOLD = 31.2  # counts
CM = 299_792_458.0 / 2.0 * 100.0


def leading_edge_cm(over, sample_ns=2.38, phases=1000):
    """Return the bias (phase) [cm] of pulses so many times as high as the threshold, without noise."""
    ranging = rl.detector.Ranging(algorithm="leading_edge")
    sample_s = sample_ns * 1e-9
    locator = Locator.of(
        PULSE, ranging, sample_s=sample_s, sigma_counts=5.2, pole_s=GSFL.amplifier.pole_s, threshold_counts=THRESHOLD
    )
    place = 150.0 + (np.arange(phases) + 0.5) / phases
    at_s = (np.arange(250) - place[:, None]) * sample_s
    samples = (over * THRESHOLD / PULSE.peak * PULSE.amplitude(at_s)).astype(np.float32)
    found_s, _ = locate(samples, np.full(phases, 140), locator)
    return (found_s - place * sample_s) * CM


def true_crossing_cm(over):
    """Return by bisection of the pulse's table when it crosses the threshold, after half of its peak [cm]."""
    t = np.linspace(PULSE.from_s, PULSE.peak_s, 400_001)
    height = PULSE.amplitude(t) / PULSE.peak
    return (t[np.argmax(height >= 1.0 / over)] - t[np.argmax(height >= 0.5)]) * CM


@pytest.mark.parametrize("over", [1.5, 2.0, 5.0, 30.0])
def test_a_leading_edge_counts_from_half_of_the_peak(over):
    """With samples 0.2 ns apart nothing but the walk is left: none at twice the threshold."""
    assert leading_edge_cm(over, 0.2).mean() == pytest.approx(true_crossing_cm(over), abs=0.1)


@pytest.mark.parametrize(("over", "early"), [(2.0, 0.59), (5.0, 2.41), (100.0, 5.15)])
def test_straight_lines_cross_the_foot_of_a_pulse_early(over, early):
    """Figures of docs/instrument.md; a line lies above a convex curve, so no phase of a strong pulse is late."""
    off = leading_edge_cm(over) - true_crossing_cm(over)
    assert off.mean() == pytest.approx(-early, abs=0.05)
    if over >= 5.0:
        assert off.max() < 0.01 and off.min() < -1.4 * early


def test_a_tap_stands_at_its_instant():
    """The output peaks as the pulse in closed form does, and the primaries are centred on the delay of the light."""
    part = Gsfl(
        amplifier={"noise_electrons": 1.0},
        apd={"dark_current_na": 0.0},
        trigger={"threshold_electrons": 6242.8, "threshold_spread_fraction": 0.0},
    )
    light = make_plate(3e6, 100, LASER.pulse, LASER.pulse_fwhm_s, 50.0)
    taps = detect_with_taps(light, part, np.random.default_rng(1))[2]
    at_s = taps.start_s[:, None] + np.arange(taps.primaries.shape[1]) * taps.step_s
    centre_s = (taps.primaries * at_s).sum(axis=1) / taps.primaries.sum(axis=1)
    assert np.abs(centre_s - light.delay_s).max() < 1e-3 * taps.step_s
    row, top = np.arange(100), np.nanargmax(taps.amplitude_electrons, axis=1)
    before, at, after = (taps.amplitude_electrons[row, top + k].astype(float) for k in (-1, 0, 1))
    vertex = top + 0.5 * (before - after) / (before - 2.0 * at + after)  # of a parabola: to 1 % of a step
    peak_s = taps.start_s + vertex * taps.step_s
    assert np.abs(peak_s - light.delay_s - PULSE.peak_s).mean() < 0.02 * taps.step_s


@pytest.mark.parametrize(("photons", "lost", "early_mm"), [(5000.0, 0.003, 0.7), (50_000.0, 0.025, 7.4)])
def test_droop_lowers_counts_by_the_gain_and_ranges_by_its_slope(photons, lost, early_mm):
    """Figures of docs/instrument.md, of a whole array. Noise of both is drawn alike; what remains of it is 0.2 mm."""
    n = 128
    range_m = 50.0 + np.random.default_rng(1).random(n * n)
    light = make_point_returns(
        (n, n), LASER.pulse, LASER.pulse_fwhm_s, np.arange(n * n), range_m, np.full(n * n, photons), np.inf
    )
    plain, drooped = (
        detect(light, Gsfl(droop=droop, timing={"pixel_jitter_ns": 0.0}), np.random.default_rng(2))[0]
        for droop in (None, Droop())
    )
    counts = [reading.intensity_counts.mean() for reading in (plain, drooped)]
    assert 1.0 - counts[1] / counts[0] == pytest.approx(lost, abs=0.001)
    assert 1e3 * float(np.nanmean(plain.range_m - drooped.range_m)) == pytest.approx(early_mm, abs=0.4)
    assert not drooped.saturated.any()
