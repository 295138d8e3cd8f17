"""When a comparator latches: the crossing of its threshold, whatever the step, and up to a million times that threshold."""

import numpy as np
import pytest
from scipy.special import erfcx

from rso_lidar.detector import Gsfl
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.stages.comparator import refine_crossings
from tests.detector.returns_for_tests import returns
from tests.reference.detector.whole_chain import PATHS, computing

# A threshold so high that the shot noise at it, one in the root of 1e11 electrons, moves no crossing by 0.001 ns.
STILL = Gsfl(
    quantum_efficiency=1.0,
    apd={"gain": 1.0, "dark_current_na": 0.0, "statistics": "gaussian"},
    amplifier={"noise_electrons": 1.0},
    trigger={"threshold_electrons": 1e11, "hysteresis_electrons": 0.0, "threshold_spread_fraction": 0.0},
)


def behind_two_poles(time_s, sigma_s, pole_s):
    """Return a Gaussian of unit area and rms `sigma_s` behind h(t) = t/τ² exp(−t/τ), in closed form [1/s].

    Completing the square, its integral over u ≥ 0 of u exp(−(t−u)²/2σ² − u/τ) is one of u times a normal about t − σ²/τ.
    """
    middle = (time_s - sigma_s**2 / pole_s) / sigma_s
    front = np.exp(-0.5 * (time_s / sigma_s) ** 2) / np.sqrt(2.0 * np.pi)
    tail = (
        0.5 * np.sqrt(2.0 * np.pi) * erfcx(-middle / np.sqrt(2.0))
    )  # the normal integral from −middle on, over its density
    return front * sigma_s / pole_s**2 * (1.0 + middle * tail)


def crossing_s(over, fwhm_s, pole_s):
    """Return when the rising edge passes 1/over of the peak [s after the delay], by bisection of the closed form."""
    sigma_s = fwhm_s / 2.354_820_045
    grid = np.linspace(-2.0 * sigma_s, 3.0 * sigma_s + 6.0 * pole_s, 20_001)
    curve = behind_two_poles(grid, sigma_s, pole_s)
    top_s, level = grid[curve.argmax()], curve.max() / over
    low, high = np.full(len(over), -9.0 * sigma_s), np.full(len(over), top_s)
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = behind_two_poles(middle, sigma_s, pole_s) >= level
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(("fwhm_ns", "bandwidth_mhz"), [(8.0, 100.0), (3.0, 400.0), (20.0, 50.0)])
def test_the_latch_is_the_crossing_from_just_above_the_threshold_to_a_million_times_it(path, fwhm_ns, bandwidth_mhz):
    """Where the edge passes the threshold, in closed form: within 0.02 ns up to 1000 times it, some 0.2 ns up to a million.

    Before, it was the step after, 0.6 ns late on the average, and 11.3 ns before the delay at the earliest.
    """
    over = np.random.default_rng(1).permutation(np.geomspace(1.05, 1e6, 240))
    part = STILL.replace(amplifier=STILL.amplifier.replace(bandwidth_mhz=bandwidth_mhz))
    range_m = 1000.0 + 0.137 * np.arange(240)
    peak = camera_of(part, returns(range_m, 1.0, pulse_fwhm_s=fwhm_ns * 1e-9)).pulse.peak
    photons = returns(range_m, over * 1e11 / peak, pulse_fwhm_s=fwhm_ns * 1e-9)
    with computing(path):
        made = store_waveforms(camera_of(part, photons), photons, np.random.default_rng(2))[0]
    assert np.array_equal(made.pixel, np.arange(240))
    late_s = made.latch_s - photons.delay_s - crossing_s(over, fwhm_ns * 1e-9, part.amplifier.pole_s)
    assert np.abs(late_s[over < 1e3]).max() < 0.02e-9
    # A transform in single precision rounds to some 2⁻²³ of the peak. The edge has fallen to 1 / over of it there, and so
    # rises by sqrt(2 ln over) / sigma, relative to itself.
    sigma_s = fwhm_ns * 1e-9 / 2.354_820_045
    rounding_s = 2.0**-23 * over * sigma_s / np.sqrt(2.0 * np.log(np.maximum(over, 2.0)))
    assert np.all(np.abs(late_s) < 0.2e-9 + 5.0 * rounding_s)


@pytest.mark.parametrize("steps", [2, 3, 8])
def test_neither_the_latch_nor_where_a_trace_begins_hangs_on_the_step(steps):
    """A noisy camera: pulses of four times the threshold latch where they cross, and eight whole samples lie before that.

    Where in a sample the latch falls is uniform: mean 8.5, rms 1/√12, 4 standard errors. The mean of the latches is that of
    eight steps to a sample within 4 standard errors of 2000.
    """
    part = Gsfl(preset="offset_limited", steps_per_sample=steps, trigger={"threshold_spread_fraction": 0.0})
    photons = returns(1000.0 + 0.1370 * np.arange(2000), 3200.0)
    made = store_waveforms(camera_of(part, photons), photons, np.random.default_rng(steps))[0]
    assert len(made.pixel) == 2000
    into = (made.latch_s - made.start_s) / part.readout.sample_s
    assert into.min() >= 8.0 and into.max() < 9.0
    assert abs(into.mean() - 8.5) < 4.0 / np.sqrt(12.0 * 2000)
    late_s = made.latch_s - photons.delay_s
    over = 3200.0 * 8.0 * camera_of(part, photons).pulse.peak / part.trigger.threshold_electrons
    still_s = float(crossing_s(np.array([over]), 8e-9, part.amplifier.pole_s)[0])
    # The first of a noisy edge's crossings comes before the mean's: by half of σ²/T over the slope at 6 %, 0.02 ns.
    assert abs(late_s.mean() - still_s) < 4.0 * late_s.std() / np.sqrt(2000) + 0.02e-9


def test_a_straight_edge_is_crossed_where_it_is():
    """asinh bends a straight edge of three tenths of the threshold a step, and the cubic takes nearly all of that back."""
    amplitude = np.array([[0.2, 0.5, 0.8, 1.1, 1.4]], np.float32)
    place = refine_crossings(amplitude, np.array([0]), np.ones(1, np.float32), np.array([3]), np.array([0]))
    assert place == pytest.approx([2.0 + 2.0 / 3.0], abs=0.01)


def test_what_is_above_at_once_crossed_before_the_watch_began():
    amplitude = np.array([[0.1, 0.5, 2.0, 4.0, 9.0], [3.0, 4.0, 5.0, 6.0, 7.0]], np.float32)
    place = refine_crossings(amplitude, np.array([0, 1]), np.ones(2, np.float32), np.array([4, 4]), np.array([0, 2]))
    assert 1.0 < place[0] < 2.0 and place[1] == 2.0
