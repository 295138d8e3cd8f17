"""A detector that is a plain Python object can be asked all that the shipped ones can."""

import numpy as np
import pytest

from rso_lidar import detector as rd
from rso_lidar import units
from rso_lidar.detector import make_plate, run_trial
from rso_lidar.detector.bench.range_resolution import simulate_pairs
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part
from rso_lidar.records import Photons, Reading

STEP_S = 8e-9 / 48.0
POWER = np.exp(-np.log(2.0) * (np.arange(-177, 178) / 24.0) ** 2)
PULSE = rd.LaserPulse(STEP_S, POWER / (POWER.sum() * STEP_S), 8e-9)


class Counting:
    """Reports the first return of each pixel that has a photoelectron, and lists the first two."""

    traits = rd.DetectorTraits(sees_to_m=2000.0, threshold_photons=1.0, max_returns=2, stored_behind_m=30.0)

    def detect(self, photons: Photons, rng: np.random.Generator) -> tuple[Reading, None]:
        n = photons.shape[0] * photons.shape[1]
        seen = np.flatnonzero(rng.poisson(photons.photons) > 0)
        pixel, first, number = np.unique(photons.pixel[seen], return_index=True, return_counts=True)
        listed_m, counts = np.full((n, 2), np.nan, np.float32), np.zeros((n, 2), np.uint16)
        for k in range(2):
            some = number > k
            at = seen[first[some] + k]
            listed_m[pixel[some], k] = photons.delay_s[at] * units.RANGE_PER_DELAY_M_S
            counts[pixel[some], k] = 1
        shape = photons.shape
        planes = listed_m[:, 0].reshape(shape), counts[:, 0].reshape(shape), np.zeros(shape, np.uint8)
        return Reading(*planes, listed_m.reshape(*shape, 2), counts.reshape(*shape, 2)), None


class Cautious(Counting):
    def describe(self, n_pixels):
        return [f"detector    counting with {n_pixels} pixels"]

    def check_size(self, pulse_fwhm_s, n_pixels):
        raise ScenarioError("detector: too many pixels; take fewer")

    def false_alarm_probability(self, range_m):
        return np.full(np.shape(range_m), 0.25)

    def noise_growth(self, background_photons_per_s):
        return 3.0


class Camera(Part):
    detector: rd.AnyDetector


def test_a_field_takes_an_object():
    mine = Counting()
    assert Camera(detector=mine).detector is mine
    assert Camera(detector={"type": "empirical"}).detector == rd.Empirical()
    with pytest.raises(ScenarioError, match="detect, traits"):
        Camera(detector=object())


def test_trials_of_an_object_follow_poisson():
    photons = np.repeat([0.2, 1.0, 3.0], 3000)
    light = make_plate(photons, photons.size, (PULSE.step_s, PULSE.power_per_s), PULSE.fwhm_s, 1000.0)
    found = run_trial(Counting(), light, np.random.default_rng(3)).detected.reshape(3, -1).mean(axis=1)
    expected = 1.0 - np.exp(-np.array([0.2, 1.0, 3.0]))
    assert np.all(np.abs(found - expected) < 5.0 * np.sqrt(expected * (1.0 - expected) / 3000))


def test_prediction_without_a_closed_form_is_a_trial():
    photons = np.array([[0.0, 0.5], [2.0, 50.0]])
    got = rd.predict(Counting(), PULSE, photons, np.zeros((2, 2)))
    expected = 1.0 - np.exp(-photons)
    assert got.probability.shape == photons.shape
    assert np.all(np.abs(got.probability - expected) <= 5.0 * np.sqrt(expected * (1.0 - expected) / 200) + 1e-12)
    assert np.isinf(got.range_precision_m[0, 0])
    assert np.all(got.range_precision_m[1] < 1e-4)
    assert not got.saturated.any()


def test_a_shipped_detector_is_predicted_by_its_closed_form():
    photons = np.array([800.0, 1000.0])
    got = rd.predict(rd.Empirical(), PULSE, photons, np.zeros(2))
    np.testing.assert_array_equal(got.probability, rd.Empirical().detection_probability(photons))


def test_both_of_two_returns_are_listed_at_any_separation():
    separations = simulate_pairs(Counting(), PULSE[:2], PULSE.fwhm_s, np.array([2.0, 100.0, 1900.0]), (50.0, 50.0))
    np.testing.assert_array_equal(separations.probability, 1.0)


def test_defaults_of_what_an_object_does_not_say():
    mine, range_m = Counting(), np.array([10.0, 100.0])
    rd.check_size(mine, 8e-9, 10**9)
    assert rd.describe(mine, 16) == ["detector    Counting, sees 0 to 2000 m"]
    assert rd.advise(mine, 8e-9) == []
    assert rd.describe_window(mine) == "armed 0 to 2000 m"
    assert rd.list_neglected_effects(mine) == []
    assert rd.describe_storage(mine) == []
    np.testing.assert_array_equal(rd.false_alarm_probability(mine, range_m), 0.0)
    assert rd.detection_probability(mine, range_m) is None
    assert rd.noise_growth(mine, 1e12) == 1.0
    assert rd.isolate(mine) is mine
    assert rd.frame_jitter_s(mine) == 0.0
    light = make_plate(10.0, 4, (PULSE.step_s, PULSE.power_per_s), PULSE.fwhm_s)
    load = rd.array_load(mine, light)
    np.testing.assert_array_equal(load.gain, np.ones(4))
    np.testing.assert_array_equal(load.together_fraction, np.zeros(4))
    np.testing.assert_array_equal(rd.draw_crosstalk_m(mine, np.ones(3), np.random.default_rng(0)), np.zeros(3))


def test_an_object_is_given_read_only_arrays():
    given = []

    def keep(result):
        def method(self, *arguments):
            given.extend(arguments)
            return result

        return method

    answers = {"false_alarm_probability": 0.0, "detection_probability": 0.0, "draw_crosstalk_m": 0.0}
    prediction = rd.Prediction(np.zeros(2), np.full(2, np.inf), np.zeros(2), np.zeros(2, bool))
    members = {name: keep(result) for name, result in answers.items()} | {"predict_closed_form": keep(prediction)}
    mine, values = type("Own", (Counting,), members)(), np.ones(2)
    rd.false_alarm_probability(mine, values)
    rd.detection_probability(mine, values)
    rd.draw_crosstalk_m(mine, values, np.random.default_rng(0))
    predicted = rd.predict(mine, PULSE, values, values)
    assert predicted.saturated.dtype == bool and np.isinf(predicted.range_precision_m).all()
    given += [pulse.power_per_s for pulse in given if isinstance(pulse, rd.LaserPulse)]
    arrays = [one for one in given if isinstance(one, np.ndarray)]
    assert len(arrays) == 6
    assert not any(one.flags.writeable for one in arrays)
    assert values.flags.writeable and PULSE.power_per_s.flags.writeable


def test_methods_of_an_object_answer_before_the_defaults():
    mine = Cautious()
    assert rd.describe(mine, 16) == ["detector    counting with 16 pixels"]
    assert rd.noise_growth(mine, 1e12) == 3.0
    np.testing.assert_array_equal(rd.false_alarm_probability(mine, np.ones(2)), 0.25)
    with pytest.raises(ScenarioError, match="too many pixels"):
        rd.check_size(mine, 8e-9, 4)


def test_traits_of_the_shipped_detectors():
    armed = rd.Gsfl(max_returns=3, returns="last").traits
    assert (armed.sees_from_m, armed.sees_to_m, armed.max_returns, armed.returns) == (1.0, 5000.0, 3, "last")
    assert armed.has_waveforms
    assert not armed.is_gated
    assert armed.settings == {}
    gated = rd.Gsfl(gate=rd.Gate(delay_ns=2000.0, width_ns=100.0, pulses=4))
    assert gated.traits.settings == pytest.approx({"gate_delay_s": 2e-6, "gate_width_s": 1e-7})
    assert (gated.traits.pulses, gated.traits.samples) == (4, 42)
    assert gated.with_gate_delay(3000.0).gate.delay_ns == 3000.0
    assert not rd.Empirical().traits.has_waveforms


@pytest.mark.parametrize("detector", [rd.Gsfl(), rd.Empirical(), rd.Empirical(adc_bits=14)])
def test_counts_clip_at_the_saturation_photons(detector):
    photons = detector.traits.saturation_photons
    if np.isinf(photons):
        assert float(detector.counts(np.array(1e12))) < detector.full_scale_counts
        return
    assert float(detector.counts(np.array(photons * 1.001))) == detector.full_scale_counts
    assert float(detector.counts(np.array(photons * 0.999))) < detector.full_scale_counts
