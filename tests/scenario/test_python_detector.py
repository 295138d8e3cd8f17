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
