"""When a comparator latches, and where two returns of a pixel part: against closed forms of a Gaussian behind two poles."""

import numpy as np
import pytest

from rso_lidar.detector import Droop, Gsfl, simulate_separations
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.stages.array_effects import solve_gain
from tests.detector.chain.test_traces import STILL, crossing_s
from tests.detector.returns_for_tests import returns

C = 299_792_458.0


@pytest.mark.parametrize("over", [1.05, 2.0, 10.0, 1e3, 1e6])
def test_a_pulse_latches_where_its_edge_passes_the_threshold(over, validation):
    """64 phases of the clock: the mean to 0.01 ns up to 1000 times the threshold, to a tenth of a step up to a million."""
    photons = returns(500.0 + 0.0223 * np.arange(64), 1.0)
    photons = returns(500.0 + 0.0223 * np.arange(64), over * 1e11 / camera_of(STILL, photons).pulse.peak)
    made = store_waveforms(camera_of(STILL, photons), photons, np.random.default_rng(1))[0]
    validation(
        case=f"latch of a pulse of 8 ns at {over:g} times the threshold, after its nominal delay",
        source="Gaussian behind two poles in closed form",
        expected=float(crossing_s(np.array([over]), 8e-9, STILL.amplifier.pole_s)[0]) * 1e9,
        got=float((made.latch_s - photons.delay_s).mean()) * 1e9,
        tolerance=0.01 if over <= 1e3 else 0.12,
        unit="ns",
    )


def test_two_returns_part_and_are_lost_where_pulse_and_trace_say(validation):
    """Near: a valley of a tenth between Gaussians, less half a sample of smoothing. Far: see tests/detector."""
    part = Gsfl(max_returns=2)
    near, far = simulate_separations(part, make_reference_pulse(), 8e-9).interval_m(0.5)
    pulse = camera_of(part, returns(100.0, 1.0)).pulse
    validation(
        case="least separation of two equal returns that are listed half the time, 8 ns",
        source="2 sqrt(2 ln(2 / 0.9)) sigma: a valley of a tenth between two Gaussians, and up to a sample for smoothing",
        expected=2.53 / 2.3548 * pulse.fwhm_s * C / 2.0 + 0.18,
        got=near,
        tolerance=0.18,
        unit="m",
    )
    rise_s = pulse.peak_s - pulse.rise_s(1.0 / (5.0 * pulse.peak))
    validation(
        case="greatest separation of two equal returns that are listed half the time, 20 samples of 2.38 ns",
        source="the far one peaks on the last sample; closed form of the edge from threshold to peak",
        expected=((20 - 0.5 - 8 - 0.5) * 2.38e-9 - rise_s) * C / 2.0,
        got=far,
        tolerance=0.18,
        unit="m",
    )


def test_the_gain_falls_as_the_data_sheet_says(validation):
    """After a sag of 1 V at a gain of 10: M = a/(V_b - V), a = 40 to 50 V (Excelitas C30662)."""
    electrons = np.zeros(3)
    electrons[0] = 4e-9 / 1.602_176_634e-19
    validation(
        case="gain left at M = 10 after 1 V of sag, Droop()",
        source="data sheet C30645, C30662: M = a/(V_b - V), a = 40 to 50 V",
        expected=float(np.mean([1.0 / (1.0 + 10.0 / a) for a in (40.0, 50.0)])),
        got=float(solve_gain(Droop(), electrons, 1e-12)[1]),
        tolerance=0.5 * (1.0 / 1.2 - 1.0 / 1.25),
        unit="1",
    )
