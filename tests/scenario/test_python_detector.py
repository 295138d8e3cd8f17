"""A detector that is a user's Python object flies with a scenario: checked, described, recorded, and asked by studies."""

from dataclasses import dataclass

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.detector import DetectorTraits
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Command, Photons, Reading
from rso_lidar.study import reach_m
from rso_lidar.study.time_history.opportunities import find_detection_curve


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
        ScenarioError, match=r"lidar\.detector: stands for the Python object .*FirstPhoton.*give the object"
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
        ({"settings": None}, r"settings: needs numbers by name"),
        ({"settings": {"a/b c": 1.0}}, r"settings: needs numbers by name"),
    ],
)
def test_traits_that_no_detector_has_are_refused(change, message):
    with pytest.raises(ScenarioError, match=rf"DetectorTraits\.{message}"):
        DetectorTraits(**({"sees_to_m": 2000.0, "threshold_photons": 2.0} | change))


NONE = np.zeros((32, 32))


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, r"detect\(\) returned a NoneType; return \(Reading, Waveforms or None\)"),
        ((NONE, None), r"detect\(\) returned no Reading"),
        ((Reading(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))), None), r"returned no Reading of"),
        ((Reading(NONE - 1.0, NONE, NONE), None), r"ranges that are negative or infinite"),
        ((Reading(NONE + np.inf, NONE, NONE), None), r"ranges that are negative or infinite"),
        ((Reading(NONE, NONE, NONE), "w"), r"returned a str as waveforms"),
    ],
)
def test_what_is_no_reading_is_refused(flown, answer, message):
    class Answering(FirstPhoton):
        def detect(self, photons, rng):
            return answer

    wrong = flown.replace(lidar=flown.lidar.replace(detector=Answering()))
    assert wrong.lidar.receiver.shape == NONE.shape
    with pytest.raises(ScenarioError, match=rf"Answering: .*{message}"):
        next(rl.simulate(wrong, frames=[0]))
