"""Pixels whose returns lie far apart, and gates of several pulses: what is counted once, and what is drawn anew."""

import numpy as np
import pytest

from rso_lidar.detector import Droop, Gsfl, detect, make_plate, run_trial
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.chain.traces import arm_rows
from rso_lidar.detector.stages.array_effects import solve_gain
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import returns, simulate_rows

NOISY = Gsfl(trigger={"threshold_electrons": 4600.0, "threshold_spread_fraction": 0.0})


def two_returns(near_m, far_m, photons, n):
    """Return n pixels with a return of so many photons at either range."""
    pixel = np.repeat(np.arange(n), 2)
    return returns(np.tile([near_m, far_m], n), photons, pixel=pixel, shape=(1, n), cluster=np.arange(2 * n))


def test_noise_triggers_between_far_apart_returns():
    """Dim light at 100 m and 4.8 km: as many false triggers between them as with the far return alone; 5 sigma."""
    n = 16_384
    both = two_returns(100.0, 4800.0, 20.0, n)
    far = returns(np.full(n, 4800.0), 20.0)
    shares = []
    for seed, photons in enumerate((both, far)):
        reading, _ = detect(photons, NOISY, np.random.default_rng(seed))
        range_m = reading.range_m.ravel()
        shares.append(np.mean((range_m > 200.0) & (range_m < 4700.0)))
    assert shares[1] > 0.01
    assert abs(shares[0] - shares[1]) < 5.0 * np.sqrt(2.0 * shares[1] / n)


def test_overlapping_rows_draw_on_the_bias_once():
    """Two returns 4 m apart lie in two rows that both hold both: the supply gives their charge once."""
    part = NOISY.replace(droop=Droop(capacitance_nf=1000.0, resistance_ohm=1e9, gain_slope_per_v=1000.0))
    n, photons = 400, 500.0
    seen = two_returns(1000.0, 1004.0, photons, n)
    plan = plan_time(part, 8e-9)
    rows, _ = arm_rows(camera_of(part, seen).comparators, place_rows(seen, plan), plan.step_s)
    assert len(rows.pixel) == 2 * n
    made = simulate_rows(part, seen, rows, np.random.default_rng(1))
    charge = n * 2.0 * photons * 0.8 * 10.0  # the dark current belongs to rest, and sags nothing further
    sag = 1000.0 * charge * 1.602_176_634e-19 / 1e-6
    late = made.amplitude[1::2, -30:].mean(axis=0)  # the far row's end, after both pulses
    full = (
        simulate_rows(part.replace(droop=None), seen, rows, np.random.default_rng(1)).amplitude[1::2, -30:].mean(axis=0)
    )
    dark = part.apd.dark_electrons_per_s * 10.0 * part.amplifier.integration_s
    # The baseline is that of rest: the dark current, multiplied less, falls below it by its share of the sag.
    assert (full - late)[-3] / dark == pytest.approx(sag, rel=0.1)


def test_steady_sunlight_sags_the_bias_before_the_flash():
    droop = Droop(capacitance_nf=10.0, resistance_ohm=1000.0, gain_slope_per_v=0.05)
    electrons_per_s = 1e13
    gain = solve_gain(droop, np.zeros(5), 1e-9, electrons_per_s)
    assert gain == pytest.approx(1.0 - 0.05 * 1000.0 * electrons_per_s * 1.602_176_634e-19)


@pytest.mark.parametrize("pulses", [1, 16])
def test_each_pulse_of_a_gate_jitters_by_itself(pulses):
    """0.334 ns or 5 cm in each of M flashes is 5/sqrt(M) cm in their mean; bright light adds 1 cm at most."""
    part = Gsfl(gate={"delay_ns": 19_990.0, "pulses": pulses})
    error_m = run_trial(
        part, make_plate(30_000.0, 4000, make_reference_pulse(), 8e-9), np.random.default_rng(2)
    ).range_noise_m
    assert error_m == pytest.approx(np.hypot(0.050_07, 0.0083) / np.sqrt(pulses), rel=0.06)


def test_one_clipped_pulse_of_many_is_told():
    """Near full scale some pulses clip and some do not: with more of them a pixel is saturated more often, not less."""
    share = []
    for pulses in (1, 8):
        part = Gsfl(gate={"delay_ns": 19_990.0, "pulses": pulses})
        reading, _ = detect(make_plate(109_000.0, 3000, make_reference_pulse(), 8e-9), part, np.random.default_rng(3))
        share.append(reading.saturated.mean())
    assert 0.01 < share[0] < 0.95
    assert share[1] > share[0]
