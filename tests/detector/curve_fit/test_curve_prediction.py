import dataclasses

import numpy as np
import pytest

from rso_lidar.detector import Empirical, GeigerArray, Gsfl, Ranging, fit_constants
from rso_lidar.detector.curve_fit.curve_prediction import CurvePredictor, from_link, to_link
from rso_lidar.detector.curve_fit.free_constants import set_constants
from rso_lidar.detector.curve_fit.measured_curve import simulate_levels
from tests.detector.curve_fit.bench_for_tests import (
    CAMERAS,
    Invented,
    make_curve,
    make_pulse,
    measure,
    measure_dark_counts,
)

PULSE = make_pulse(8.0)


@pytest.mark.parametrize("quantity", ["detection_rate", "range_scatter", "counts_mean", "counts_scatter", "walk"])
def test_near_its_reference_a_prediction_is_that_of_the_large_trial(quantity):
    photons = np.array([700.0, 800.0, 1000.0])
    curve = make_curve(quantity, photons, np.full(3, 0.5), np.full(3, 100.0))
    predictor, detector = CurvePredictor(PULSE), Gsfl()
    reference = predictor.refer(detector, curve, 4096)
    large = simulate_levels(detector, PULSE, photons, curve.range_m, 4096, 38)
    value = {
        "detection_rate": large.share,
        "range_scatter": large.range_scatter_m,
        "counts_mean": large.counts_mean,
        "counts_scatter": large.counts_scatter,
        "walk": large.range_mean_m,
    }[quantity]
    assert from_link(quantity, reference.link) == pytest.approx(value, rel=1e-9)
    if predictor.has_closed_form(detector, curve):
        assert predictor.predict(detector, curve, reference) == pytest.approx(value, rel=1e-9)
    assert from_link(quantity, to_link(quantity, value)) == pytest.approx(value, rel=1e-9)


def test_a_closed_form_that_neglects_the_algorithm_is_not_taken():
    curve = make_curve("range_scatter", [1000.0], [0.1], [100.0])
    predictor = CurvePredictor(PULSE)
    assert predictor.has_closed_form(Gsfl(), curve)
    assert not predictor.has_closed_form(Gsfl(ranging=Ranging(algorithm="centroid")), curve)


def test_dark_counts_are_those_of_the_law_of_the_noise():
    empirical, geiger = Empirical(false_alarms_per_s=70.0), GeigerArray(dark_count_rate_hz=3e4)
    curve = make_curve("dark_counts", [0.0, 0.0], [1.0, 1.0], [2.0, 3.0])
    assert CurvePredictor(PULSE).predict(empirical, curve).tolist() == [140.0, 210.0]
    assert CurvePredictor(PULSE).predict(geiger, curve).tolist() == [6e4, 9e4]


def test_dark_counts_over_thresholds_tell_the_noise_of_an_amplifier():
    # The chain in the dark gives the counts, at three thresholds of a camera whose noise is hidden. Few pixels trigger in a
    # window: otherwise those of low thresholds would be armed for less time than the others.
    hidden = Gsfl(amplifier={"noise_electrons": 1150.0}, armed_to_m=201.0)
    bench = Invented(hidden, {}, PULSE, (), (), dark_s=0.1)
    thresholds = np.array([5000.0, 5500.0, 6000.0])
    found = [
        measure_dark_counts(set_constants(hidden, {"trigger.threshold_electrons": threshold}), bench, 20)
        for threshold in thresholds
    ]
    counts, armed_s = (np.concatenate([getattr(curve, name) for curve in found]) for name in ("value", "trials"))
    assert counts.min() > 20.0
    curve = dataclasses.replace(make_curve("dark_counts", np.zeros(3), counts, armed_s), threshold_electrons=thresholds)
    fit = fit_constants(Gsfl(armed_to_m=201.0), PULSE, [curve], ["amplifier.noise_electrons"])
    (noise,) = fit.constants
    assert abs(noise.value - 1150.0) < 4.0 * (noise.high - noise.low) / 3.92
    assert noise.high - noise.low < 100.0
    assert not fit.is_rejected


@pytest.mark.slow
def test_the_walk_of_a_leading_edge_tells_its_threshold():
    sheet = Gsfl(ranging=Ranging(algorithm="leading_edge"), timing={"pixel_jitter_ns": 0.1})
    camera = Invented(
        sheet, {"trigger.threshold_electrons": 7500.0}, PULSE, tuple(np.geomspace(1500.0, 20_000.0, 6)), ("walk",)
    )
    fit = fit_constants(sheet, PULSE, measure(camera, 21), ["trigger.threshold_electrons"], trials=8192)
    (threshold,) = fit.constants
    assert abs(threshold.value - 7500.0) < 4.0 * (threshold.high - threshold.low) / 3.92
    assert threshold.high - threshold.low < 1000.0
    assert not fit.is_rejected


def test_the_invented_cameras_lie_outside_the_defaults():
    for camera in CAMERAS.values():
        at = set_constants(camera.sheet, camera.hidden)
        assert at not in (Gsfl(), Empirical(), GeigerArray(), camera.sheet)
