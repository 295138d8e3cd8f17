"""The converter: counts, baseline, rounding, and the rail."""

import math

import numpy as np
import pytest

from rso_lidar.detector import Readout
from rso_lidar.detector.stages.sampling import convert
from rso_lidar.errors import ScenarioError

C = 299_792_458.0


def test_counts_are_scaled_and_stand_on_the_baseline():
    readout = Readout(electrons_per_count=200.0, baseline_counts=64.0, quantised=False)
    counts = convert(readout, np.array([[0.0, 200.0, -1000.0, 12_345.0]], np.float32))
    assert counts.dtype == np.float32
    assert counts[0] == pytest.approx([64.0, 65.0, 59.0, 64.0 + 61.725], rel=1e-6)


def test_rounding_adds_a_twelfth_of_a_count_squared():
    """Sheppard: a level spread over many counts is off by sigma 1/√12 = 0.2887. 100,000 draws, 4 sigma of their variance."""
    level = np.random.default_rng(4).normal(200_000.0, 10_000.0, (10, 10_000)).astype(np.float32)
    error = convert(Readout(), level).astype(float) - convert(Readout(quantised=False), level)
    # The square of a uniform error has variance 1/180.
    assert abs((error**2).mean() - 1.0 / 12.0) < 4.0 * math.sqrt(1.0 / 180.0 / level.size)
    assert abs(error.mean()) < 4.0 * math.sqrt(1.0 / 12.0 / level.size)
    assert np.abs(error).max() <= 0.5


def test_the_rail_and_the_floor():
    readout = Readout(adc_bits=10)
    counts = convert(readout, np.array([-1e6, 1e6], np.float32))
    assert counts.tolist() == [0.0, 1023.0] and readout.full_scale_counts == 1023


def test_an_offset_is_the_pixels_own():
    counts = convert(Readout(), np.zeros((2, 3), np.float32), np.array([[2.0], [-3.0]]))
    assert counts.tolist() == [[66.0] * 3, [61.0] * 3]


def test_the_window_of_the_papers_20_samples_is_7_1_metres():
    readout = Readout()
    assert (readout.samples, readout.pretrigger_samples) == (20, 8)
    assert readout.window_m == pytest.approx(20 * 2.38e-9 * C / 2.0) == pytest.approx(7.13, abs=0.01)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"pretrigger_samples": 17}, "fewer than 4 of 20 samples"),
        ({"adc_bits": 8, "baseline_counts": 200.0}, "more than half of the 255 counts"),
        ({"samples": 4}, "samples"),
        ({"electrons_per_count": 0.0}, "electrons_per_count"),
    ],
)
def test_what_cannot_be_is_one_line(settings, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Readout(**settings)
    assert "\n" not in str(caught.value)
