"""Clipped pulses: the kernel beside its oracle, and ranges through the chain where nearly all samples clip."""

import numpy as np
import pytest

from rso_lidar.detector import Gate, Gsfl, Readout, Saturation, Timing, detect
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.ranging.clipped_pulse import place_by_edges, tabulate_edges
from rso_lidar.detector.ranging.matched_filter import Matched
from tests.detector.returns_for_tests import returns
from tests.reference.detector import clipped_pulse as oracle

STILL = Timing(pixel_jitter_ns=0.0)


def matched_for_tests():
    part = Gsfl()
    return Matched.of(camera_of(part, returns(100.0, 1e3)).pulse, part.readout.sample_s, part.amplifier.pole_s, 5.2)


def test_edges_are_those_of_the_pulse():
    matched = matched_for_tests()
    edges = tabulate_edges(matched, 0.0)
    level = np.arange(len(edges.rise)) / edges.per_neper
    shown = level < 13.0
    for edge in (edges.rise, edges.fall):
        height = matched.pulse.amplitude(edge[shown] * matched.sample_s + matched.pulse.peak_s) / matched.pulse.peak
        assert np.log(height) == pytest.approx(-level[shown], abs=2e-3)
    assert (np.diff(edges.rise) < 0.0).all() and (np.diff(edges.fall) > 0.0).all()
    slow = tabulate_edges(matched, 4e-9)
    # Far behind the peak the charge of the amplifier decays by a neper each 4 ns.
    assert np.diff(slow.fall[-20:]) * slow.per_neper * 2.38 == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("n", [20, 40])
def test_the_kernel_is_its_oracle(n):
    """Pulses 2 to 1e8 times as high as the rail; of 20 samples many do not show the last edge."""
    rng, matched = np.random.default_rng(8), matched_for_tests()
    edges = tabulate_edges(matched, 0.0)
    height = np.geomspace(8000.0, 4e11, 60)
    curve = matched.curve(n, 9.0 + rng.uniform(0.0, 6.0, 60)).astype(float)
    samples = np.minimum(height[:, None] * curve + rng.normal(0.0, 5.0, curve.shape), 4031.0).astype(np.float32)
    clipped = samples >= 4031.0
    peak, place = clipped.argmax(axis=1), np.full(60, -1.0)
    some = np.arange(0, 60, 2)
    expected = oracle.place_by_edges(samples, clipped, some, peak, 5.2, *edges, place)
    place_by_edges(samples, clipped, some, peak, 5.2, *edges, place)
    assert (place[1::2] == -1.0).all()
    assert place == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("part", "photons", "bias_m", "most_m"),
    [
        (Gsfl(timing=STILL), 1e6, 0.005, 0.02),  # three samples are left: the fit
        (Gsfl(timing=STILL), 1e8, 0.05, 0.8),  # 20 samples end before the pulse does
        (Gsfl(timing=STILL), 1e13, 0.80, 1.4),
        (Gsfl(timing=STILL, readout=Readout(samples=40)), 1e8, 0.005, 0.03),
        (Gsfl(timing=STILL, readout=Readout(samples=40)), 1e13, 0.02, 0.08),
        (Gsfl(timing=STILL, gate=Gate(delay_ns=640.0, width_ns=150.0)), 1e10, 0.01, 0.04),
        (Gsfl(timing=STILL, readout=Readout(samples=40), saturation=Saturation()), 3e7, 0.05, 0.20),
    ],
)
def test_ranges_of_pulses_that_clip(part, photons, bias_m, most_m):
    """The least and the greatest error of 300 pixels; before, 1e8 photons were read 30 cm early and 1e13, 1.3 m."""
    range_m = 100.0 + np.arange(300) / 300.0
    reading = detect(returns(range_m, photons), part, np.random.default_rng(1))[0]
    error_m = reading.range_m.ravel() - range_m
    assert reading.saturated.all() and np.isfinite(error_m).all()
    assert abs(np.median(error_m)) < bias_m and np.abs(error_m).max() < most_m
