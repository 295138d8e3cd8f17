"""A detector that is a user's Python object flies with a scenario: checked, described, recorded, and asked by studies."""

from dataclasses import dataclass

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.detector import ArrayLoad, DetectorTraits, Prediction
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis.time_history.opportunities import find_detection_curve
from rso_lidar.records import Command, Photons, Reading
from rso_lidar.study import reach_m


@dataclass(frozen=True)
class FirstPhoton:
    """Reports the first return of each pixel that has a photoelectron."""

    efficiency: float = 0.5

    @property
    def traits(self) -> DetectorTraits:
        settings = {"efficiency": self.efficiency}
        return DetectorTraits(sees_to_m=2000.0, threshold_photons=2.0, settings=settings)

    def detect(self, photons: Photons, rng: np.random.Generator) -> tuple[Reading, None]:
        n_pixels = photons.shape[0] * photons.shape[1]
        seen = np.flatnonzero(rng.poisson(self.efficiency * photons.photons) > 0)
        pixel, first = np.unique(photons.pixel[seen], return_index=True)
        range_m, counts = np.full(n_pixels, np.nan, np.float32), np.zeros(n_pixels, np.uint16)
        range_m[pixel] = photons.delay_s[seen[first]] * units.RANGE_PER_DELAY_M_S
        counts[pixel] = 1
        return Reading(
            *(plane.reshape(photons.shape) for plane in (range_m, counts, np.zeros(n_pixels, np.uint8)))
        ), None


@pytest.fixture
def flown(text):
    scenario = rl.Scenario.loads(text)
    return scenario.replace(lidar=scenario.lidar.replace(detector=FirstPhoton()))


def test_it_is_flown_and_recorded(flown, tmp_path):
    frames = list(rl.simulate(flown))
    assert frames[0].valid.sum() > 10
    assert abs(np.nanmedian(frames[0].range_m - frames[0].labels.range_m)) < 0.05
    rl.save(tmp_path / "own.h5", frames)
    recording = rl.open(tmp_path / "own.h5")
    np.testing.assert_array_equal(recording[0].range_m, frames[0].range_m)
    assert recording[0].observation.settings["efficiency"] == 0.5
    assert "FirstPhoton(efficiency=0.5" in recording.source.scenario
    with pytest.raises(
        ScenarioError, match=r"lidar\.detector: represents the Python object .*FirstPhoton.*; set it again"
    ):
        rl.Scenario.loads(recording.source.scenario)


def test_workers_take_it_along(flown):
    alone, shared = (next(iter(rl.simulate(flown, frames=[1], **how))) for how in ({}, {"workers": 1}))
    np.testing.assert_array_equal(alone.range_m, shared.range_m)


def test_its_description_says_what_is_known_of_it(flown):
    text = flown.describe()
    assert "detector    FirstPhoton, sees 0 to 2000 m" in text
    assert "P(detect) 1.000" in text
    assert "FirstPhoton(efficiency=0.5" in text and "cannot rebuild it" in text


def test_studies_ask_it(flown):
    budget = rl.budget(flown, probability=0.9)
    assert budget.curves[0].detection_probability[0] > 0.99
    assert reach_m(flown.lidar)[1] <= 2000.0
    curve = find_detection_curve(flown.lidar)
    photons = np.array([1.0, 10.0])
    np.testing.assert_allclose(curve(photons), -np.expm1(-0.5 * photons), atol=0.12)  # 200 trials a level
    assert rl.timeline(flown, casts=2).table["detection_probability"].max() > 0.9


def test_what_it_has_not_is_refused(flown):
    with pytest.raises(ScenarioError, match='"FirstPhoton" has no waveforms'):
        next(rl.simulate(flown, keep="waveforms"))
    with pytest.raises(ScenarioError, match="the detector has no gate"):
        list(rl.simulate(flown, lambda _: Command(gate_delay_s=1e-6)))
    with pytest.raises(ScenarioError, match=r"needs a gate"):
        flown.lidar.replace(schedule={"time_s": [0.0], "gate_delay_ns": [3000.0]})


def test_it_must_be_hashable(flown):
    @dataclass
    class Loose:
        efficiency: float = 0.5
        traits = FirstPhoton().traits
        detect = FirstPhoton.detect

    with pytest.raises(ScenarioError, match=r"objects of Loose cannot be hashed; .*frozen=True"):
        flown.lidar.replace(detector=Loose())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sees_to_m": -5.0}, r"sees_to_m: -5\.0 is not beyond"),
        ({"sees_to_m": float("nan")}, r"sees_to_m: nan is not beyond"),
        ({"sees_to_m": "far"}, r"sees_to_m: 'far' is not beyond"),
        ({"sees_from_m": 3000.0}, r"sees_to_m: 2000\.0 is not beyond sees_from_m \(3000\)"),
        ({"threshold_photons": -1.0}, r"threshold_photons: -1\.0 is not a number from 0"),
        ({"max_returns": 0}, r"max_returns: 0 is not a whole number from 1"),
        ({"max_returns": 2.5}, r"max_returns: 2\.5 is not a whole number"),
        ({"pulses": 0}, r"pulses: 0 is not"),
        ({"returns": "middle"}, r"returns: 'middle' is none of first"),
        ({"settings": None}, r"settings: needs finite numbers by name"),
        ({"settings": {"a/b c": 1.0}}, r"settings: needs finite numbers by name"),
        ({"settings": {"x_s": float("nan")}}, r"settings: needs finite numbers by name"),
        ({"saturation_photons": float("nan")}, r"saturation_photons: nan is not a number from 0"),
        ({"is_gated": "no"}, r"is_gated: 'no' is not True or False"),
        ({"has_waveforms": 1}, r"has_waveforms: 1 is not True or False"),
        ({"window_keys": 3}, r"window_keys: 3 is not a text"),
    ],
)
def test_traits_that_no_detector_has_are_refused(change, message):
    with pytest.raises(ScenarioError, match=rf"DetectorTraits\.{message}"):
        DetectorTraits(**({"sees_to_m": 2000.0, "threshold_photons": 2.0} | change))


NONE = np.zeros((32, 32))


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, r"detect\(\) returned None; return \(Reading, Waveforms or None\)"),
        ((NONE, None), r"detect\(\) returned array.*; return a Reading of \(32, 32\) pixels"),
        (
            (Reading(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))), None),
            r"returned <Reading.*; return a Reading of",
        ),
        ((Reading(NONE - 1.0, NONE, NONE), None), r"ranges that are negative or infinite"),
        ((Reading(NONE + np.inf, NONE, NONE), None), r"ranges that are negative or infinite"),
        ((Reading(NONE, NONE, NONE, NONE[..., None] - 1.0), None), r"ranges that are negative or infinite"),
        ((Reading(NONE, NONE, NONE, NONE[..., None] + np.inf), None), r"ranges that are negative or infinite"),
        ((Reading(NONE, NONE, NONE), "w"), r"returned 'w'; return Waveforms or None after the Reading"),
    ],
)
def test_what_is_no_reading_is_refused(flown, answer, message):
    class Answering(FirstPhoton):
        def detect(self, photons, rng):
            return answer

    wrong = flown.replace(lidar=flown.lidar.replace(detector=Answering()))
    assert wrong.lidar.receiver.shape == NONE.shape
    with pytest.raises(ScenarioError, match=rf"Answering\(.*\): .*{message}"):
        next(rl.simulate(wrong, frames=[0]))


def asked(flown, **members):
    """Return the scenario with a detector that has further members."""
    own = type("Own", (FirstPhoton,), members)
    return flown.replace(lidar=flown.lidar.replace(detector=own()))


GATED = DetectorTraits(sees_to_m=2000.0, threshold_photons=2.0, is_gated=True)
TAPPED = DetectorTraits(sees_to_m=2000.0, threshold_photons=2.0, has_taps=True)


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"traits": {"sees_to_m": 3}}, r"traits is \{'sees_to_m': 3\}; give it a DetectorTraits"),
        ({"traits": lambda self: GATED}, r"traits is a method; give it a DetectorTraits"),
        ({"traits": GATED}, r"promise a method with_gate_delay\(\), which it lacks"),
        ({"traits": TAPPED}, r"promise a method detect_with_taps\(\), which it lacks"),
        ({"check_size": 3}, r"check_size is 3; make it a method"),
        ({"describe": lambda self, n: None}, r"describe\(\) returned None; return a list of texts"),
        ({"describe": lambda self, n: "a line"}, r"describe\(\) returned 'a line'; return a list of texts"),
        ({"describe": lambda self, n: [3]}, r"describe\(\) returned \[3\]; return a list of texts"),
        ({"describe_window": lambda self: None}, r"describe_window\(\) returned None; return a text"),
        ({"advise": lambda self, fwhm: "look"}, r"advise\(\) returned 'look'; return a list of texts"),
        ({"list_neglected_effects": lambda self: 3}, r"list_neglected_effects\(\) returned 3"),
        ({"noise_growth": lambda self, light: "x"}, r"noise_growth\(\) returned 'x'; return a number"),
        ({"noise_growth": lambda self, light: -1.0}, r"noise_growth\(\) returned -1\.0; return a number from 0"),
        ({"false_alarm_probability": lambda self, at: at}, r"returned [\d.]+; return numbers of shape .* from 0 to 1"),
        (
            {"false_alarm_probability": lambda self, at: np.zeros(7)},
            r"returned an array of shape \(7,\); return numbers of",
        ),
        ({"detection_probability": lambda self, n: n * np.nan}, r"detection_probability\(\) returned nan"),
        ({"predict_closed_form": lambda self, *given: 3}, r"returned 3; return a Prediction with arrays of shape"),
        (
            {"predict_closed_form": lambda self, pulse, n, depth: Prediction(n + 7.0, n, n, n > 0.0)},
            r"predict_closed_form\(\) returned 8\.0 in probability; return numbers of shape \(2,\) from 0 to 1",
        ),
        (
            {"predict_closed_form": lambda self, pulse, n, depth: Prediction(0.0 * n, n, n * np.nan, n > 0.0)},
            r"predict_closed_form\(\) returned nan in snr; return numbers of shape \(2,\) from 0",
        ),
        ({"isolate": lambda self, gain: None}, r"isolate\(\) returned None; return a detector"),
        ({"array_load": lambda self, photons: None}, r"array_load\(\) returned None; return an ArrayLoad"),
        (
            {"array_load": lambda self, photons: ArrayLoad(np.ones(3), np.zeros(1024))},
            r"array_load\(\) returned an array of shape \(3,\) in gain; return numbers of shape \(1024,\)",
        ),
        (
            {"array_load": lambda self, photons: ArrayLoad(np.ones(1024), np.full(1024, 1.5))},
            r"array_load\(\) returned 1\.5 in together_fraction; return numbers of shape \(1024,\) from 0 to 1",
        ),
        ({"frame_jitter_s": lambda self: np.inf}, r"frame_jitter_s\(\) returned inf; return a number from 0 to 1e\+12"),
        (
            {"draw_crosstalk_m": lambda self, share, rng: -np.inf},
            r"returned -inf; return numbers of shape .* from -1e\+12",
        ),
        ({"frame_jitter_s": lambda self: None}, r"frame_jitter_s\(\) returned None; return a number"),
        ({"draw_crosstalk_m": lambda self, share, rng: "x"}, r"draw_crosstalk_m\(\) returned 'x'; return numbers"),
    ],
)
def test_what_an_optional_member_must_not_be(flown, members, message):
    """Each is told in one line, wherever it is read first."""
    from rso_lidar import detector

    with pytest.raises(ScenarioError, match=rf"Own\(.*\): .*{message}") as error:
        scenario = asked(flown, **members)
        mine, photons = scenario.lidar.detector, np.array([1.0, 5.0])
        next(rl.simulate(scenario, frames=[0], keep="photons"))
        detector.describe(mine, 4)
        detector.describe_window(mine)
        detector.advise(mine, 1e-9)
        detector.list_neglected_effects(mine)
        detector.noise_growth(mine, 1.0)
        detector.false_alarm_probability(mine, np.array([1e3, 2e3]))
        detector.detection_probability(mine, photons)
        detector.predict(mine, detector.LaserPulse(1e-9, np.array([0.0, 1e9, 0.0]), 1e-9), photons, 0.0)
        detector.isolate(mine)
        detector.array_load(mine, next(rl.simulate(scenario, frames=[0], keep="photons")).kept["photons"])
        detector.frame_jitter_s(mine)
        detector.draw_crosstalk_m(mine, photons, np.random.default_rng(1))
    assert "\n" not in str(error.value)


def test_a_setting_does_not_replace_one_of_the_lidar(flown):
    traits = DetectorTraits(sees_to_m=2000.0, threshold_photons=2.0, settings={"laser_energy_j": 3.0})
    with pytest.raises(
        ScenarioError, match=r"detector: 'laser_energy_j' among its settings is one of the lidar's; rename"
    ):
        asked(flown, traits=traits)


def test_it_lists_as_many_returns_as_its_traits_say(flown):
    two = asked(flown, traits=DetectorTraits(sees_to_m=2000.0, threshold_photons=2.0, max_returns=2))
    with pytest.raises(ScenarioError, match=r"Own\(.*\): detect\(\) returned <Reading.*; list 2 returns of each pixel"):
        next(rl.simulate(two, frames=[0]))


def test_taps_of_its_own_are_checked_and_kept(flown):
    def detect_with_taps(self, photons, rng):
        return (*self.detect(photons, rng), answer)

    scenario = asked(flown, traits=TAPPED, detect_with_taps=detect_with_taps)
    answer = None
    assert next(rl.simulate(scenario, frames=[0], keep="taps")).kept == {}
    answer = 3
    with pytest.raises(
        ScenarioError, match=r"detect_with_taps\(\) returned \(<Reading.*; return \(Reading, Waveforms or None"
    ):
        next(rl.simulate(scenario, frames=[0], keep="taps"))


def test_a_gate_of_its_own_follows_a_plan(flown):
    @dataclass(frozen=True)
    class Gated(FirstPhoton):
        delay_ns: float = 0.0

        @property
        def traits(self):
            return DetectorTraits(9000.0, 2.0, is_gated=True, settings={"gate_delay_s": self.delay_ns * units.NS})

        def with_gate_delay(self, delay_ns):
            return Gated(delay_ns=delay_ns)

    plan = {"time_s": (0.0, 1.0), "gate_delay_ns": (100.0, 300.0)}
    scenario = flown.replace(lidar=flown.lidar.replace(detector=Gated(), schedule=plan))
    seen = [frame.observation.settings["gate_delay_s"] for frame in rl.simulate(scenario, frames=[0, 1])]
    assert seen == pytest.approx([100e-9, 140e-9])  # 5 frames a second
