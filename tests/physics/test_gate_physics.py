"""The range gate against every photoelectron by hand, and the false alarms that it was asked for.

Bands are 4 standard deviations of the draws on both sides (one in 16,000 fails by chance), unless a tolerance says
otherwise.
"""

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Amplifier, Apd, Gate, Gsfl, Readout, Trigger, detect
from tests.detector.returns_for_tests import nothing
from tests.physics import chain_by_hand as by_hand
from tests.physics.test_gsfl_physics import C, seen, share_band


def search_band(p):
    """Return by how much a threshold 2 % (0.08 sigma) higher changes a probability of detection."""
    return 0.08 * float(stats.norm.pdf(stats.norm.ppf(p)))


def gated(part, photons, n, seed, every=4):
    """Return which share of returns a gated detector finds, in a scene that fills one pixel in `every`."""
    light = seen(np.where(np.arange(n) % every == 0, photons, 0.0), n)
    reading, _ = detect(light, part, np.random.default_rng(seed))
    error = reading.range_m.ravel() - light.delay_s * C / 2
    return float(np.mean(np.abs(error[::every]) < 5.0))


GATE = Gate(delay_ns=6651.0, width_ns=47.6, false_alarm_probability=1e-3)  # 20 samples, open from 997 m


@pytest.mark.parametrize(
    ("photons", "pulses"),
    [
        (30, 1),
        (30, 5),
        pytest.param(30, 20, marks=pytest.mark.slow),
        (100, 1),
        pytest.param(100, 5, marks=pytest.mark.slow),
    ],
)
def test_what_a_gate_finds(validation, photons, pulses):
    """The aspiration of 30 photons (Fuller et al., sec. 3.3): a quiet amplifier needs some 20 pulses to see half of them.

    By hand the best of fits at quarters of a sample, at the threshold that noise alone passes with 1e-3, Gaussian without
    dark current. The chain takes Rice's bound for that threshold, which is 2 % higher, 0.08 sigma.
    """
    part = Gsfl(preset="offset_limited", apd=Apd(dark_current_na=0.0), gate=GATE.replace(pulses=pulses))
    n, n_by_hand = 8192, 40_000 // pulses
    got = gated(part, float(photons), n, seed=pulses)
    exact = by_hand.gate_detection(part, photons, 8e-9, min(n_by_hand, 8000), photons, pulses, 1e-3)
    validation(
        case=f"offset_limited: {photons} photons in a gate of 20 samples, {pulses} pulses, false alarms 1e-3",
        source="every photoelectron by hand, best fit over the gate",
        expected=exact,
        got=got,
        tolerance=share_band(exact, n // 4, min(n_by_hand, 8000)) + search_band(exact),
        unit="1",
    )


def test_30_photons_in_one_pulse(validation):
    """An amplifier of 60 electrons: 30 photons in one pulse would be found in 90 % if its noise were white.

    Noise behind the amplifier is not: neighbouring samples correlate by a third, the matched filter gains 1.19 over the
    top sample and not 1.53, and the signal's own shot noise counts. Dark current is off: 1 nA would leave next to nothing.
    """
    part = Gsfl(
        amplifier=Amplifier(noise_electrons=60.0),
        trigger=Trigger(threshold_electrons=5000.0),
        readout=Readout(electrons_per_count=20.0),
        apd=Apd(dark_current_na=0.0),
        gate=GATE,
    )
    n, n_by_hand = 32_768, 8000
    exact = by_hand.gate_detection(part, 30.0, 8e-9, n_by_hand, 4, 1, 1e-3)
    validation(
        case="30 photons in one gated pulse, amplifier 60 electrons, no dark current",
        source="every photoelectron by hand (white noise without signal shot noise: 0.9)",
        expected=exact,
        got=gated(part, 30.0, n, seed=6),
        tolerance=share_band(exact, n // 4, n_by_hand) + search_band(exact),
        unit="1",
    )


@pytest.mark.parametrize(
    ("case", "part", "expected", "band"),
    [
        (
            "offset_limited, no dark current",
            Gsfl(preset="offset_limited", apd=Apd(dark_current_na=0.0)),
            0.75e-3,
            0.25e-3,
        ),
        ("offset_limited", Gsfl(preset="offset_limited"), 1.0e-3, 0.5e-3),
        (
            "60 electrons and 1 nA",
            Gsfl(amplifier={"noise_electrons": 60.0}, readout={"electrons_per_count": 20.0}),
            1.5e-3,
            0.75e-3,
        ),
    ],
    ids=["Gaussian", "offset_limited", "avalanches"],
)
def test_false_alarms_of_a_gate(validation, case, part, expected, band):
    """Rice's sum bounds Gaussian noise from above, samples 2.4 ns apart reach it to within a half.

    Where avalanches of dark current stand out, each is a pulse that the fit finds at its best place, up to twice as often.
    """
    n = 131_072
    reading, _ = detect(nothing((1, n)), part.replace(gate=GATE), np.random.default_rng(3))
    validation(
        case=f"false alarms of a gate of 20 samples, a pixel: {case}",
        source="the probability asked for, 1e-3",
        expected=expected,
        got=float(np.isfinite(reading.range_m).mean()),
        tolerance=band + share_band(2e-3, n),
        unit="1",
    )
