import math

import pytest

from rso_lidar.detector import Empirical, Gsfl, get_constant
from rso_lidar.detector.curve_fit.free_constants import find_constants, set_constants
from rso_lidar.errors import ScenarioError


def test_limits_are_those_of_the_fields():
    gain, efficiency, noise = find_constants(Gsfl(), ["apd.gain", "quantum_efficiency", "amplifier.noise_electrons"])
    assert (gain.low, gain.high) == (1.0, math.inf)
    assert (efficiency.low, efficiency.high) == (0.0, 1.0)
    assert (noise.low, noise.high) == (0.0, math.inf)
    for constant, value in ((gain, 42.0), (efficiency, 0.31), (noise, 7.0)):
        assert constant.to_value(constant.to_free(value)) == pytest.approx(value, rel=1e-12)
        assert constant.low < constant.to_value(-30.0) < constant.to_value(30.0) <= constant.high


def test_constants_of_parts_are_set_by_dotted_names():
    changed = set_constants(Gsfl(), {"apd.gain": 20.0, "apd.ionisation_ratio": 0.1, "quantum_efficiency": 0.5})
    assert (changed.apd.gain, changed.apd.ionisation_ratio, changed.quantum_efficiency) == (20.0, 0.1, 0.5)
    assert get_constant(changed, "apd.gain") == 20.0
    assert changed.amplifier == Gsfl().amplifier


@pytest.mark.parametrize(
    ("names", "start", "words"),
    [
        (["noise_electron"], {}, "has no number 'noise_electron'"),
        (["readout.samples"], {}, "has no number 'readout.samples'"),
        (["saturation.rail_electrons"], {}, "has no number"),
        (["apd.gain", "apd.gain"], {}, "is given twice"),
        (["timing.frame_jitter_ns"], {}, "start.timing.frame_jitter_ns: 0 is not inside its limits"),
        (["apd.gain"], {"apd.gian": 2.0}, "start: 'apd.gian' is not among the constants"),
    ],
)
def test_bad_names_and_starts_are_refused(names, start, words):
    with pytest.raises(ScenarioError, match=words):
        find_constants(Gsfl(), names, start)


def test_values_that_the_detector_refuses_together_raise():
    with pytest.raises(ScenarioError, match="95 % detection there is impossible"):
        set_constants(Empirical(), {"noise_equivalent_photons": 900.0})
