"""What the pixels of one flash do to each other: gain lost to the array's current, and shares that latch together."""

import math

import numpy as np
import pytest

from rso_lidar.detector import Crosstalk, Droop, Empirical, Gsfl, Surroundings, array_load, make_plate, run_trial
from rso_lidar.detector.analysis.array_load import simulate_array_load
from rso_lidar.detector.bench.calibration import make_reference_pulse
from tests.detector.returns_for_tests import nothing, returns

ELECTRON_C = 1.602_176_634e-19
DROOP = Droop(capacitance_nf=0.5, resistance_ohm=1e6, gain_slope_per_v=0.22)  # nothing recovers within a flash


def test_the_gain_of_a_pixel_is_the_mean_over_its_own_light():
    """4000 pixels of 5000 photons draw Q together: half of it is gone in the mean over the pulse, all of it 15 m later."""
    range_m = np.where(np.arange(4096) < 4000, 500.0, 515.0)
    photons = returns(range_m, 5000.0, shape=(64, 64))
    load = simulate_array_load(Gsfl(droop=DROOP), photons)
    sag = 0.22 * 4000 * 5000.0 * 8.0 * ELECTRON_C / 0.5e-9
    # What a step draws is felt in the next: half a step of a pulse of 7 steps earlier than half, and of second order in sag.
    assert load.gain[:4000].mean() == pytest.approx(1.0 - 0.5 * sag, abs=0.15 * sag)
    late = 1.0 / (1.0 + sag / (1.0 + 0.5 * sag))
    assert load.gain[4000:].mean() == pytest.approx(late, abs=0.03 * sag)
    assert np.array_equal(load.together_fraction, np.zeros(4096))


def test_the_share_is_that_of_pixels_that_latch_within_a_clock():
    """1000 pixels at 500 m, 24 at 510 m; 3072 stay dark. Threshold spread and noise move a latch by 0.3 ns."""
    range_m = np.where(np.arange(1024) < 1000, 500.0, 510.0)
    photons = returns(range_m, 20_000.0, shape=(64, 64))
    load = simulate_array_load(Gsfl(crosstalk=Crosstalk()), photons)
    assert np.median(load.together_fraction[:1000]) == pytest.approx(1000 / 4096, rel=0.02)
    assert np.median(load.together_fraction[1000:1024]) == pytest.approx(24 / 4096, rel=0.1)
    assert not load.together_fraction[1024:].any()
    gated = Gsfl(crosstalk=Crosstalk(), gate={"delay_ns": 3300.0})  # nothing latches
    assert not simulate_array_load(gated, photons).together_fraction.any()


def test_without_coupling_or_light_nothing_is_done():
    photons = returns(np.full(16, 500.0), 20_000.0, shape=(4, 4))
    coupled = Gsfl(crosstalk=Crosstalk(), droop=DROOP)
    for part, light in ((Gsfl(), photons), (Empirical(), photons), (coupled, nothing((4, 4)))):
        load = array_load(part, light)
        assert np.array_equal(load.gain, np.ones(16)) and not load.together_fraction.any()


def test_a_trial_s_pixels_do_nothing_to_each_other_but_what_is_said():
    """4000 pixels at once: neither droop nor crosstalk of their own. With a share of 0.5, 1 m of noise is 0.5 m."""
    seen, noise = make_plate(20_000.0, 4000, make_reference_pulse(), 8e-9), Crosstalk(noise_m=1.0)
    plain = run_trial(Gsfl(), seen, np.random.default_rng(1))
    coupled = Gsfl(crosstalk=noise, droop=DROOP.replace(capacitance_nf=0.001))
    alone = run_trial(coupled, seen, np.random.default_rng(1))
    assert np.array_equal(alone.range_error_m, plain.range_error_m)
    together = run_trial(coupled, seen, np.random.default_rng(1), around=Surroundings(together_fraction=0.5))
    # A quartile range of n normal values is known to 1.17/√n.
    assert together.range_noise_m == pytest.approx(
        math.hypot(0.5, plain.range_noise_m), rel=4.0 * 1.17 / math.sqrt(4000)
    )
    sagged = run_trial(coupled, seen, np.random.default_rng(1), around=Surroundings(gain=0.8))
    assert sagged.intensity_counts.mean() / plain.intensity_counts.mean() == pytest.approx(0.8, rel=0.01)


@pytest.mark.parametrize("part", [Gsfl(timing={"pixel_jitter_ns": 0.0, "frame_jitter_ns": 0.6}), Empirical()])
def test_jitter_of_frames_and_laser_is_noise_of_a_pixel(part):
    """0.6 ns of a frame and 0.8 ns of the laser are 15 cm of range together; the fast detector has no frame jitter."""
    seen = make_plate(20_000.0, 4000, make_reference_pulse(), 8e-9)
    still = run_trial(part, seen, np.random.default_rng(2)).range_noise_m
    moved = run_trial(part, seen, np.random.default_rng(2), around=Surroundings(timing_jitter_s=0.8e-9)).range_noise_m
    assert moved == pytest.approx(math.hypot(0.8e-9 * 299_792_458.0 / 2.0, still), rel=4.0 * 1.17 / math.sqrt(4000))
    if isinstance(part, Gsfl):
        assert still == pytest.approx(math.hypot(0.6e-9 * 299_792_458.0 / 2.0, 0.012), rel=4.0 * 1.17 / math.sqrt(4000))


def test_energy_jitter_spreads_the_counts():
    seen = make_plate(20_000.0, 4000, make_reference_pulse(), 8e-9)
    made = run_trial(Gsfl(), seen, np.random.default_rng(3), around=Surroundings(energy_jitter_fraction=0.2))
    plain = run_trial(Gsfl(), seen, np.random.default_rng(3))
    relative = made.intensity_counts.std() / made.intensity_counts.mean()
    own = plain.intensity_counts.std() / plain.intensity_counts.mean()
    assert relative == pytest.approx(math.hypot(0.2, own), rel=4.0 / math.sqrt(8000))
