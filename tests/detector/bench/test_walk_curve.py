"""Walk curves: of any detector, the same each time, and what they refuse; how a detector tells of its options."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Gsfl, LaserPulse, LowGain, Readout, ZeroCrossing, describe, list_neglected_effects
from rso_lidar.detector import simulate_walk_curve as simulate
from rso_lidar.errors import ScenarioError

LASER = rl.Laser()
PULSE = LaserPulse(*LASER.pulse, LASER.pulse_fwhm_s)


@pytest.mark.parametrize("detector", [rl.Empirical(), rl.GeigerArray(), Gsfl()], ids=["empirical", "geiger", "gsfl"])
def test_any_detector_has_a_curve(detector):
    curve, again = (simulate(detector, PULSE, pixels=40) for _ in range(2))
    assert curve.photons[-1] / curve.photons[0] == pytest.approx(250_000.0) and len(curve.photons) == 24
    assert curve.bias_m.tobytes() == again.bias_m.tobytes()
    assert np.isfinite(curve.half_walk_m) and (np.diff(curve.photons) > 0.0).all()


def test_levels_are_sorted_and_levels_without_a_return_are_nan():
    curve = simulate(Gsfl(), PULSE, np.array([1e5, 1.0]), pixels=50)
    assert curve.photons.tolist() == [1.0, 1e5] and curve.found_fraction.tolist() == [0.0, 1.0]
    assert (
        np.isnan(curve.bias_m[0]) and abs(curve.bias_m[1]) < 0.04 and curve.noise_m[1] == pytest.approx(0.05, rel=0.5)
    )


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"photons": np.array([])}, "at least one positive, finite number"),
        ({"photons": np.array([1e3, -1.0])}, "at least one positive, finite number"),
        ({"photons": np.array([np.nan])}, "at least one positive, finite number"),
        ({"pixels": 0}, "pixels: 0 leaves nothing to simulate"),
        ({"range_m": 6000.0}, "does not see a plate at 6000 m, only 1 to 5000 m"),
    ],
)
def test_what_cannot_be_simulated_is_one_line(given, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        simulate(Gsfl(), PULSE, **given)
    assert "\n" not in str(caught.value)


def test_a_detector_tells_of_its_options():
    part = Gsfl(zero_crossing=ZeroCrossing(), readout=Readout(low_gain=LowGain()))
    text = "\n".join(describe(part, 128 * 128))
    assert "two gains, 64 : 1, up to 6,449,600 photons" in text and "zero crossing of a bipolar pulse" in text
    assert any("zero_crossing" in line for line in list_neglected_effects(part))
    assert part.traits.strong_return_cure == "" and part.traits.clipped_range_photons == np.inf
    assert Gsfl().traits.clipped_range_photons == pytest.approx(3.02e6, rel=0.01)
