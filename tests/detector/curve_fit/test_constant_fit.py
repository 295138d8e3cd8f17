import dataclasses

import numpy as np
import pytest

from rso_lidar.detector import Empirical, fit_constants
from rso_lidar.detector.curve_fit import constant_fit
from rso_lidar.detector.curve_fit.free_constants import set_constants
from rso_lidar.errors import ScenarioError
from tests.detector.curve_fit.bench_for_tests import CAMERAS, fit, make_curve, make_pulse, measure

FAST = dataclasses.replace(
    CAMERAS["curves"],
    hidden={"reference_photons": 420.0, "noise_equivalent_photons": 60.0, "range_plateau_m": 0.021},
    quantities=("detection_rate", "range_scatter"),
    photons=tuple(np.geomspace(250.0, 4000.0, 12)),
    dark_s=0.0,
)
COUNTS = dataclasses.replace(
    FAST, hidden={"counts_per_photon": 0.05, "compression_counts": 2500.0}, quantities=("counts_mean",), start={},
    photons=tuple(np.geomspace(1000.0, 80_000.0, 10)),
)  # fmt: skip
RATES = dataclasses.replace(FAST, quantities=("detection_rate",), hidden=dict(list(FAST.hidden.items())[:2]))


def test_a_hidden_camera_is_found_within_its_intervals():
    found = fit(FAST, measure(FAST, 3), trials=8192)
    for constant in found.constants:
        sigma = (constant.high - constant.low) / 3.92
        assert abs(constant.value - FAST.hidden[constant.name]) < 4.0 * sigma
        assert sigma < 0.1 * constant.value
    assert not found.is_rejected
    assert found.freedom < sum(len(curve.residuals) for curve in found.curves)


def test_counts_are_fitted_by_slopes_of_trials():
    found = fit(COUNTS, measure(COUNTS, 4), trials=8192)
    for constant in found.constants:
        assert abs(constant.value - COUNTS.hidden[constant.name]) < 4.0 * (constant.high - constant.low) / 3.92
    assert not found.is_rejected


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(CAMERAS))
def test_each_invented_camera_is_found(name):
    camera = CAMERAS[name]
    found = fit(camera, measure(camera, 11), trials=8192)
    assert not found.is_rejected
    for constant in found.constants:
        assert abs(constant.value - camera.hidden[constant.name]) < 4.0 * (constant.high - constant.low) / 3.92


@pytest.mark.slow
def test_intervals_cover_as_often_as_they_say():
    # 20 fits of three constants: at 95 % each, 50 or fewer of 60 have a probability of 0.07 %.
    covered = 0
    for seed in range(20):
        for constant in fit(FAST, measure(FAST, 400 + seed), trials=16_384).constants:
            covered += constant.low <= FAST.hidden[constant.name] <= constant.high
    assert covered >= 51


def test_an_amplifier_that_clips_otherwise_is_rejected():
    (curve,) = measure(COUNTS, 5)
    clipped = dataclasses.replace(curve, value=1500.0 * np.tanh(curve.value / 1500.0))
    found = fit(COUNTS, [clipped], trials=8192)
    assert found.is_rejected
    assert found.p_value < 1e-6


def test_a_threshold_that_drifts_is_rejected():
    # The points are taken in another order than that of their light, while the threshold rises by a quarter.
    order = np.random.Generator(np.random.Philox(7)).permutation(len(FAST.photons))
    (curve,) = measure(RATES, 6)
    rates = curve.value.copy()
    for turn, point in enumerate(order):
        reference = 420.0 * (1.0 + 0.25 * turn / len(order))
        now = set_constants(FAST.sheet, {**FAST.hidden, "reference_photons": reference})
        rates[point] = measure(RATES, 60 + turn, detector=now)[0].value[point]
    found = fit(RATES, [dataclasses.replace(curve, value=rates)], trials=8192)
    assert found.is_rejected


def test_stated_errors_of_the_bench_keep_a_fit_from_rejection():
    (curve,) = measure(COUNTS, 8)
    bent = curve.value * (1.0 + 0.03 * np.cos(3.0 * np.arange(len(curve.value))))
    bad = dataclasses.replace(curve, value=bent)
    honest = dataclasses.replace(bad, systematic=0.03 * bent)
    assert fit(COUNTS, [bad], trials=8192).is_rejected
    assert not fit(COUNTS, [honest], trials=8192).is_rejected


def test_an_error_of_the_photons_widens_the_intervals_that_rest_on_them():
    curves = measure(RATES, 9)
    sharp = fit(RATES, curves, trials=8192)
    wide = fit(RATES, curves, trials=8192, photons_error_fraction=0.05)
    reference = [found.constants[0] for found in (sharp, wide)]
    relative = [(constant.high - constant.low) / 3.92 / constant.value for constant in reference]
    assert relative[0] < 0.015
    # Nearly all of the 5 %: shot noise, which tells absolute photons, is weak in a rate.
    assert 0.03 < relative[1] < np.hypot(relative[0], 0.05) * 1.01
    assert wide.photons_scale.low < 1.0 < wide.photons_scale.high


def test_constants_that_only_a_ratio_tells_are_refused_by_name():
    # The shot noise of the empirical detector is F / QE times the photons.
    names = ["reference_photons", "quantum_efficiency", "excess_noise_factor"]
    with pytest.raises(ScenarioError, match="quantum_efficiency and excess_noise_factor cannot be told apart"):
        true = set_constants(FAST.sheet, FAST.hidden)
        fit_constants(true, RATES.pulse, measure(RATES, 10), names, trials=4096)


def test_a_constant_without_effect_is_refused_by_name():
    with pytest.raises(ScenarioError, match="hardly depend on compression_counts"):
        fit_constants(FAST.sheet, FAST.pulse, measure(FAST, 10), ["compression_counts", "range_plateau_m"], trials=4096)


def test_more_constants_than_points_are_refused():
    curve = make_curve("detection_rate", [900.0, 1000.0], [0.8, 0.95], [100, 100])
    names = ["reference_photons", "noise_equivalent_photons"]
    with pytest.raises(ScenarioError, match="2 constants from 2 points"):
        fit_constants(Empirical(), make_pulse(8.0), [curve], names)


def test_a_fit_that_still_moves_at_the_end_is_refused(monkeypatch):
    monkeypatch.setattr(constant_fit, "_MOST_ROUNDS", 1)
    with pytest.raises(ScenarioError, match="does not converge in 1 rounds"):
        fit(FAST, measure(FAST, 12), trials=4096)


@pytest.mark.parametrize(("factor", "word"), [(1000.0, "1,000 times too high"), (0.1, "10 times too low")])
def test_photons_in_another_unit_are_recognised(factor, word):
    curves = measure(FAST, 13)
    shifted = dataclasses.replace(curves[0], photons=curves[0].photons * factor)
    with pytest.raises(ScenarioError, match=f"detection_rate: its photons are {word}"):
        fit(FAST, [shifted], trials=4096)


def test_values_in_another_unit_are_recognised():
    curves = measure(FAST, 14)
    millimetres = dataclasses.replace(curves[1], value=curves[1].value * 1e3)
    with pytest.raises(ScenarioError, match="range_scatter: its values are 1,000 times too high"):
        fit(FAST, [curves[0], millimetres], trials=4096)
