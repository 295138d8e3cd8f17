"""Where a range gate puts its threshold: Rice for Gaussian noise, and avalanches for what is not."""

import math

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Amplifier, Apd, Defects, Gate, Gsfl, Pulse, detect
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.chain.camera import draw_camera_pixels
from rso_lidar.detector.ranging.gate_threshold import GateThresholds
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import noise_covariance
from tests.detector.returns_for_tests import nothing

GATE = Gate(delay_ns=19_990.0, width_ns=200.0, false_alarm_probability=1e-3)


def matched_of(part):
    pulse = Pulse.after(*make_reference_pulse(), part.amplifier.pole_s, part.amplifier.integration_s)
    return Matched.of(pulse, part.readout.sample_s, part.amplifier.pole_s, 5.0)


def thresholds(part, rate, gate=GATE):
    return GateThresholds(gate, part.apd, part.amplifier, part.readout, matched_of(part)).solve(rate)


def test_gaussian_noise_is_rice_s():
    """ν₀ T exp(−u²/2) + Q(u) = −ln(1 − p) (Rice 1944), solved here on a grid; sigma is that of the weighted samples."""
    part = Gsfl(apd=Apd(dark_current_na=0.0))
    matched = matched_of(part)
    weights = matched.height_weights()
    sigma = part.amplifier.noise_electrons / part.readout.electrons_per_count
    covariance = (
        noise_covariance(len(weights), part.readout.sample_s, part.amplifier.pole_s, sigma) + np.eye(len(weights)) / 12
    )
    u = np.linspace(0.0, 8.0, 800_001)
    open_s = round(200.0 / 2.38) * 2.38e-9
    expected = u[
        np.argmax(matched.crossings_per_s * open_s * np.exp(-0.5 * u**2) + stats.norm.sf(u) < -math.log1p(-1e-3))
    ]
    found = thresholds(part, np.zeros(3))
    assert found == pytest.approx(expected * math.sqrt(weights @ covariance @ weights), rel=2e-3)
    assert thresholds(part, np.zeros(1), GATE.replace(pulses=16)) == pytest.approx(found[:1] / 4.0, rel=2e-3)


def test_many_primaries_are_gaussian_and_few_are_not():
    """By the central limit theorem the two statistics agree at 1e13 primaries a second, and part at 1e9."""
    quiet = Gsfl(amplifier=Amplifier(noise_electrons=60.0))
    gaussian = quiet.replace(apd=Apd(statistics="gaussian"))
    for rate, least, most in ((1e13, 1.0, 1.03), (1e9, 1.2, 3.0)):
        ratio = float(thresholds(quiet, np.array([rate]))[0] / thresholds(gaussian, np.array([rate]))[0])
        assert least <= ratio <= most


@pytest.mark.parametrize(
    "part",
    [
        Gsfl(preset="offset_limited"),
        Gsfl(amplifier=Amplifier(noise_electrons=60.0), readout={"electrons_per_count": 20.0}),
        Gsfl(preset="offset_limited", defects=Defects(dead_fraction=0.0, hot_fraction=1.0, hot_dark_current_na=100.0)),
    ],
    ids=["offset_limited", "60 electrons", "all pixels hot"],
)
def test_false_alarms_of_skewed_noise(part):
    """Noise whose tail avalanches make: as many as asked, up to twice that, for the fit takes the best of all places."""
    part, rng = part.replace(gate=GATE), np.random.default_rng(5)
    seen = sum(np.isfinite(detect(nothing((128, 128)), part, rng)[0].range_m).sum() for _ in range(4))
    expected = 4 * 16_384 * 1e-3
    assert 0.5 * expected - 4 * math.sqrt(expected) < seen < 2.2 * expected + 4 * math.sqrt(2.2 * expected)


def test_hot_pixels_fire_no_oftener_than_the_others():
    part = Gsfl(
        preset="offset_limited",
        gate=GATE.replace(false_alarm_probability=1e-2),
        defects=Defects(dead_fraction=0.0, hot_fraction=0.5, hot_dark_current_na=100.0),
    )
    hot, rng = draw_camera_pixels(part, 16_384).hot, np.random.default_rng(6)
    seen = sum(np.isfinite(detect(nothing((128, 128)), part, rng)[0].range_m).ravel().astype(float) for _ in range(4))
    among, rest = seen[hot].sum() / hot.sum() / 4, seen[~hot].sum() / (~hot).sum() / 4
    assert 0.5e-2 < among < 2e-2 and 0.5e-2 < rest < 2e-2
