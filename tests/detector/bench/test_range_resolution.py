"""How far apart two returns of a pixel may lie: from where they part to where the trace ends."""

from dataclasses import replace

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, simulate_separations
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.bench.range_resolution import Separations, simulate_pairs
from rso_lidar.detector.chain.camera import camera_of
from tests.detector.returns_for_tests import returns

C = 299_792_458.0
PULSE = make_reference_pulse()


def listed(over=5.0, **settings):
    return simulate_separations(Gsfl(max_returns=2, **settings), PULSE, 8e-9, over).interval_m(0.5)


def end_of_trace_m(over, samples, pretrigger, sample_s=2.38e-9):
    """Return the separation at which the far pulse peaks on the last sample, by hand, half the time.

    The latch falls anywhere in sample `pretrigger` (counted from 0), half a sample in on the average. The near pulse peaks
    some time after its latch, so long as its edge takes from the threshold. The far one may peak half a sample past the end.
    """
    part = Gsfl()
    pulse = camera_of(part, _light()).pulse
    rise_s = pulse.peak_s - pulse.rise_s(1.0 / (over * pulse.peak))
    return ((samples - 0.5 - pretrigger - 0.5) * sample_s - rise_s) * C / 2.0


def _light():
    return returns(100.0, 1.0)


@pytest.mark.parametrize("over", [3.0, 5.0, 30.0])
@pytest.mark.parametrize(("samples", "pretrigger"), [(20, 8), (20, 4), (44, 8)])
def test_the_far_end_is_that_of_the_trace(over, samples, pretrigger):
    """Derived by hand, within half a sample (0.18 m): noise and rounding decide about the last one."""
    _, far = listed(over, readout={"samples": samples, "pretrigger_samples": pretrigger})
    assert far == pytest.approx(end_of_trace_m(over, samples, pretrigger), abs=0.18)


def test_brighter_light_latches_earlier_and_leaves_less():
    ends = [listed(over)[1] for over in (2.0, 5.0, 20.0, 100.0)]
    assert np.all(np.diff(ends) < -0.2)


@pytest.mark.parametrize("fwhm_ns", [4.0, 8.0])
def test_the_near_end_goes_with_the_length_of_the_pulse(fwhm_ns):
    """A valley of a tenth shows between two Gaussians σ · 2 √(2 ln(2 / 0.9)) = 1.07 FWHM apart; smoothing asks for more."""
    step_s, power = PULSE
    pulse = (step_s * fwhm_ns / 8.0, power * 8.0 / fwhm_ns)
    part = Gsfl(max_returns=2, readout={"sample_ns": 1.0, "samples": 60})
    near, _ = simulate_separations(part, pulse, fwhm_ns * 1e-9).interval_m(0.5)
    wide_s = camera_of(part, replace(_light(), pulse_step_s=pulse[0], pulse_power_per_s=pulse[1])).pulse.fwhm_s
    assert 1.02 < near / (wide_s * C / 2.0) < 1.3


def test_a_gate_holds_what_it_is_wide():
    near, far = listed(gate={"delay_ns": 2000.0, "width_ns": 80.0})
    assert near < 1.7
    assert 80e-9 * C / 2.0 - 1.5 < far < 80e-9 * C / 2.0


def test_what_is_never_found_is_told_as_such():
    assert listed(readout={"samples": 12, "pretrigger_samples": 8}) is None
    separation = np.array([1.0, 2.0, 3.0])
    assert Separations(separation, np.array([0.0, 0.4, 0.1])).interval_m(0.5) is None
    assert Separations(separation, np.array([0.0, 1.0, 0.5])).interval_m(0.5) == (1.5, 3.0)
    assert Separations(separation, np.array([1.0, 1.0, 0.0])).interval_m(0.75) == (1.0, 2.25)


def test_dim_far_returns_are_found_less():
    bright = simulate_pairs(Gsfl(max_returns=2), PULSE, 8e-9, np.array([2.2]), (5000.0, 5000.0), 400)
    dim = simulate_pairs(Gsfl(max_returns=2), PULSE, 8e-9, np.array([2.2]), (5000.0, 900.0), 400)
    assert bright.probability[0] > 0.95 and dim.probability[0] < 0.5
