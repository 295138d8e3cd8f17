"""Returns that are deep, from tilted surfaces: as often found as light and noise say, however time is cut up for the work.

A return that is longer than what a row of time watches reaches over several of them. Each moment of a pixel has one noise:
were it drawn for each row, a dim return would have several chances.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, LaserPulse, detect, make_plate, predict
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.optics import Laser
from tests.physics import chain_by_hand as by_hand
from tests.reference.detector.whole_chain import computing

FWHM_S = 8e-9
PULSE = LaserPulse(*Laser().pulse, Laser().pulse_fwhm_s, Laser().timing_jitter_ns)
N, N_BY_HAND = 32_768, 12_000
BY_HAND = [(1000.0, 10e-9), (2600.0, 40e-9), (5500.0, 100e-9)]
CLOSED = 0.003  # of a probability: the closed form's lattice, and depths rounded by up to half a per cent


def found(photons, depth_s, steps, seed=1, n=N):
    """Return the share of pixels that find a return as deep as this, through the whole chain."""
    seen = make_plate(photons, n, Laser().pulse, FWHM_S, 50.0)  # so near, one of 250,000 pixels triggers falsely before
    seen = replace(seen, depth_spread_s=np.full(n, depth_s))
    reading, _ = detect(seen, Gsfl(steps_per_sample=steps), np.random.default_rng(seed))
    return float(np.isfinite(reading.range_m).mean())


@lru_cache(maxsize=8)
def exact(photons, depth_s):
    return by_hand.detected(Gsfl(), photons, FWHM_S, N_BY_HAND, seed=7, depth_s=depth_s)


def band(p, *numbers):
    """Return 4 standard deviations of the difference of shares of so many draws."""
    return 4 * math.sqrt(p * (1 - p) * sum(1 / n for n in numbers))


@pytest.mark.parametrize(
    ("photons", "depth_s", "steps"),
    [
        *((1000.0, 10e-9, steps) for steps in (2, 8)),
        (1000.0, 6e-9, 8),
        (1200.0, 14e-9, 2),
    ],
)
def test_detection_of_a_deep_return(validation, photons, depth_s, steps):
    p = float(predict(Gsfl(), PULSE, np.array([photons]), np.array([depth_s]), only_probability=True).probability[0])
    validation(
        case=f"{photons:g} photons {depth_s * 1e9:g} ns deep, {steps} steps to a sample: probability of detection",
        source=f"the closed form, to {CLOSED:g}; {N} pixels, binomial, 4 sigma",
        expected=p,
        got=found(photons, depth_s, steps),
        tolerance=CLOSED + band(p, N),
        unit="1",
    )


@pytest.mark.parametrize(
    ("photons", "depth_s"), [BY_HAND[0], *(pytest.param(*deep, marks=pytest.mark.slow) for deep in BY_HAND[1:])]
)
def test_detection_of_a_deep_return_by_hand(validation, photons, depth_s):
    """Up to 64 ns of a return are watched; of 100 ns, the rest would add 0.01."""
    p = exact(photons, depth_s)
    validation(
        case=f"{photons:g} photons {depth_s * 1e9:g} ns deep: probability of detection",
        source="every photoelectron by hand",
        expected=p,
        got=found(photons, depth_s, 4, seed=2),
        tolerance=band(p, N, N_BY_HAND) + 0.01 * (depth_s > 64e-9),
        unit="1",
    )


@pytest.mark.slow
def test_detection_of_a_deep_return_by_the_oracles(validation):
    with computing("oracles"):
        got = found(1000.0, 10e-9, 4, seed=3, n=8192)
    p = exact(1000.0, 10e-9)
    validation(
        case="1000 photons 10 ns deep, by the oracles: probability of detection",
        source="every photoelectron by hand",
        expected=p,
        got=got,
        tolerance=band(p, 8192, N_BY_HAND),
        unit="1",
    )


def test_these_returns_do_reach_over_several_rows():
    """Else the tests above would say nothing; a facing plate needs one row."""
    plan = plan_time(Gsfl(), FWHM_S)
    for _, depth_s in BY_HAND:
        seen = replace(make_plate(1000.0, 50, Laser().pulse, FWHM_S), depth_spread_s=np.full(50, depth_s))
        assert len(place_rows(seen, plan).pixel) >= 90
    assert len(place_rows(make_plate(1000.0, 50, Laser().pulse, FWHM_S), plan).pixel) == 50
