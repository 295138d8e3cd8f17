import math

import numpy as np
import pytest
from scipy import stats

from rso_lidar import detector
from rso_lidar.detector import Empirical
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import STATED, nothing, returns

QUIET = Empirical(**STATED, false_alarms_per_s=0.0)
N = 100_000


def rng(seed=1):
    return np.random.default_rng(seed)


def read(photons, part=QUIET, seed=1):
    return detector.detect(photons, part, rng(seed))[0]


def test_a_pixel_without_light_and_noise_reports_nothing():
    reading = read(nothing((8, 9)))
    assert reading.range_m.shape == (8, 9) and np.all(np.isnan(reading.range_m))
    assert np.all(reading.intensity_counts == 0) and np.all(reading.saturated == 0)


def test_valid_pixels_have_a_count_and_the_others_none():
    dim = QUIET.replace(counts_per_photon=1e-4)  # 0.08 counts at the threshold
    reading = read(returns(np.full(N, 1000.0), 1000.0), dim)
    valid = np.isfinite(reading.range_m)
    assert 0.9 < valid.mean() < 1
    assert np.array_equal(reading.intensity_counts > 0, valid)
    assert reading.intensity_counts[valid].min() == 1


def test_the_same_generator_gives_the_same_bits_and_another_does_not():
    photons = returns(np.linspace(500, 4000, 500), 1200.0)
    one, same, other = (read(photons, Empirical(**STATED), seed) for seed in (3, 3, 4))
    assert one.range_m.tobytes() == same.range_m.tobytes()
    assert one.intensity_counts.tobytes() == same.intensity_counts.tobytes()
    assert one.range_m.tobytes() != other.range_m.tobytes()


def test_the_generator_is_drawn_from_alike_whatever_comes_of_it():
    """A change of threshold or window must not shift the noise of what is drawn later, so runs can be compared."""
    photons = returns(np.linspace(500, 4000, 500), 1200.0)
    states = []
    near = dict(STATED, armed_to_m=700.0)
    for part in (Empirical(**STATED), QUIET, Empirical(**near), Empirical(**STATED, reference_photons=5000.0)):
        generator = rng()
        detector.detect(photons, part, generator)
        states.append(generator.random())
    assert len(set(states)) == 1


def test_returns_outside_the_armed_window_are_not_seen():
    window = QUIET.replace(armed_from_m=1000.0, armed_to_m=2000.0)
    reading = read(returns([999.0, 999.99, 1000.01, 1500.0, 1999.99, 2000.01, 4000.0], 1e5), window)
    assert np.isfinite(reading.range_m[0]).tolist() == [False, False, True, True, True, False, False]


def test_the_first_surface_that_triggers_is_reported():
    """One return per pixel: a strong far one behind a strong near one is hidden, behind a faint one it is not."""
    pixel, cluster = np.repeat(np.arange(1000), 2), np.arange(2000)
    far_and_near = np.tile([1000.0, 1010.0], 1000)
    both = read(returns(far_and_near, 1e5, pixel, (10, 100), cluster))
    assert np.all(np.abs(both.range_m - 1000) < 1)
    faint = read(returns(far_and_near, np.tile([10.0, 1e5], 1000), pixel, (10, 100), cluster))
    assert np.all(np.abs(faint.range_m - 1010) < 1)


def test_light_of_one_cluster_adds_up_and_its_range_is_the_mean_by_light():
    """Sixteen sub-rays of 1000/16 photons are a pixel of 1000 photons, not sixteen faint ones."""
    n = 20_000
    pixel = np.repeat(np.arange(n), 16)
    ranges = np.tile(np.linspace(1000, 1000.6, 16), n)
    weights = np.tile(np.linspace(1, 3, 16), n)
    light = weights * 1000 / weights[:16].sum()
    reading = read(returns(ranges, light, pixel, (100, 200), pixel))
    found = np.isfinite(reading.range_m)
    assert stats.binomtest(int(found.sum()), n, 0.95).pvalue > 1e-4
    mean = np.average(ranges[:16], weights=light[:16])
    sigma = float(QUIET.range_noise_m(np.array(1000.0), 8e-9))
    assert reading.range_m[found].astype(float).mean() == pytest.approx(mean, abs=5 * sigma / math.sqrt(n))


def test_a_cluster_without_light_keeps_quiet_and_raises_nothing():
    reading = read(returns(np.full(1000, 1000.0), 0.0))
    assert np.isfinite(reading.range_m).sum() == 0


@pytest.mark.parametrize("adc_bits", [8, 12, 16])
def test_counts_rise_bend_and_clip(adc_bits):
    part = QUIET.replace(adc_bits=adc_bits, compression_counts=2.0 * 2**adc_bits, counts_per_photon=0.04)
    full = 2**adc_bits - 1
    photons = np.geomspace(1500, 1e9, 400)
    reading = read(returns(np.full(400, 1000.0), photons), part)
    counts = reading.intensity_counts[0].astype(int)
    assert counts.max() == full and counts[-1] == full
    assert np.array_equal(reading.saturated[0] == 1, counts == full)
    linear = 0.04 * photons
    low = linear < 0.2 * full
    noise = 0.04 * part.noise_photons(photons[low])
    if low.any():
        assert np.all(np.abs(counts[low] - linear[low]) < 6 * noise + 1)
    assert np.all(counts <= linear + 6 * 0.04 * part.noise_photons(photons) + 1)


def test_a_soft_roll_off_below_full_scale_bends_like_its_formula():
    """x / (1 + (x/s)^4)^(1/4): 2^(-1/4) of itself at s, never above s."""
    part = QUIET.replace(compression_counts=1000.0)
    assert float(part.counts(np.array(1000.0 / 0.04))) == pytest.approx(1000 * 2**-0.25, rel=1e-12)
    assert float(part.counts(np.array(1e9))) == pytest.approx(1000, rel=1e-9)
    assert float(part.counts(np.array(100.0 / 0.04))) == pytest.approx(100, rel=3e-5)


@pytest.mark.parametrize(
    "bad",
    [
        {"armed_from_m": 500.0, "armed_to_m": 400.0},
        {"noise_equivalent_photons": 5000.0},  # the threshold would be negative
        {"quantum_efficiency": 1.2},
        {"quantum_efficiency": 0.0},
        {"excess_noise_factor": 0.5},
        {"adc_bits": 20},
        {"adc_bits": 12.0},
        {"reference_photons": 0.0},
        {"range_plateau_m": -0.01},
    ],
)
def test_a_detector_that_cannot_be(bad):
    with pytest.raises(ScenarioError):
        Empirical(**STATED | bad)
