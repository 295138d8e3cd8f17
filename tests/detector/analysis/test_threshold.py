"""Thresholds solved for a detection or for false alarms: by trials through the chain, and by dark frames."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import Apd, Gsfl, LaserPulse, Saturation, ThresholdCondition, detect, solve_threshold
from rso_lidar.detector.bench.trial import make_plate, run_trial
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import nothing


def pulse_of(fwhm_ns):
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    return LaserPulse(*laser.pulse, laser.pulse_fwhm_s)


@pytest.mark.parametrize(("pd", "photons", "fwhm_ns"), [(0.95, 1000.0, 8.0), (0.5, 400.0, 3.0), (0.9, 3000.0, 16.0)])
def test_trials_detect_as_often_as_was_wanted(pd, photons, fwhm_ns):
    """4 sigma of the binomial law, and the 0.01 of the closed form."""
    pulse, n = pulse_of(fwhm_ns), 6000
    solved = solve_threshold(Gsfl(solve=ThresholdCondition(pd=pd, photons=photons)), pulse)
    light = make_plate(photons, n, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, 300.0)
    share = run_trial(solved, light, np.random.default_rng(5)).probability
    assert abs(share - pd) < 0.01 + 4.0 * math.sqrt(pd * (1.0 - pd) / n)
    assert solved.solve is None


def test_a_threshold_is_solved_below_the_rail():
    """The search does not try thresholds that no signal reaches; where only such a one would do, that is said."""
    condition = ThresholdCondition(pd=0.95, photons=1000.0)
    clipped = solve_threshold(Gsfl(solve=condition, saturation=Saturation()), pulse_of(8.0))
    free = solve_threshold(Gsfl(solve=condition), pulse_of(8.0))
    assert clipped.trigger.threshold_electrons == pytest.approx(free.trigger.threshold_electrons, rel=0.01)
    beyond = ThresholdCondition(pd=0.95, photons=1e6)
    with pytest.raises(ScenarioError, match=r"detector\.solve: no threshold"):
        solve_threshold(Gsfl(solve=beyond, saturation=Saturation(rail_electrons=8000.0)), pulse_of(8.0))


def test_the_condition_of_the_presets_gives_their_threshold():
    """`make calibrate` solved it by trials of 24 flashes of 16,384 pixels; the closed form is right to 0.01, here 0.7 %."""
    solved = solve_threshold(Gsfl(solve=ThresholdCondition(pd=0.95, photons=1000.0)), pulse_of(8.0))
    assert solved.trigger.threshold_electrons == pytest.approx(Gsfl().trigger.threshold_electrons, rel=0.007)


def test_dark_frames_have_the_false_alarms_that_were_wanted():
    """A gain of 80, whose avalanches make most alarms: the law is up to a quarter too high, and 4 sigma of Poisson's."""
    condition = ThresholdCondition(false_alarms_per_s=3000.0)
    apd = Apd(gain=80.0, ionisation_ratio=0.02, dark_current_na=0.05)
    solved = solve_threshold(Gsfl(apd=apd, armed_to_m=1500.0, solve=condition), pulse_of(5.0))
    expected = 3000.0 * 1499.0 / rl.units.RANGE_PER_DELAY_M_S * 64 * 64 * 6
    rng = np.random.default_rng(6)
    seen = sum(int(np.isfinite(detect(nothing((64, 64)), solved, rng)[0].range_m).sum()) for _ in range(6))
    assert 0.75 * expected - 4.0 * math.sqrt(expected) < seen < 1.05 * expected + 4.0 * math.sqrt(expected)


def test_a_lidar_solves_with_its_own_pulse_and_keeps_the_number():
    short, long = (
        rl.Lidar(
            preset="gsfl_1064",
            laser={"pulse_fwhm_ns": fwhm_ns},
            detector={"type": "gsfl", "solve": {"pd": 0.95, "photons": 1000.0}},
        )
        for fwhm_ns in (4.0, 8.0)
    )
    assert short.detector.trigger.threshold_electrons > 1.3 * long.detector.trigger.threshold_electrons
    assert short.detector.solve is None
    shorter = short.replace(laser=short.laser.replace(pulse_fwhm_ns=2.0))
    assert shorter.detector == short.detector  # nothing is solved again
    stated = rl.Lidar(
        preset="gsfl_1064",
        laser={"pulse_fwhm_ns": 4.0},
        detector={"type": "gsfl", "solve": {"pd": 0.95, "photons": 1000.0, "pulse_fwhm_ns": 8.0}},
    )
    assert stated.detector == long.detector


def test_a_recording_holds_the_threshold_that_was_solved():
    settings = ("lidar.detector.solve={pd=0.9, photons=800}", "lidar.detector.data_sheet={noise_pa_per_sqrt_hz=1.0}")
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", settings)
    again = rl.Scenario.loads(scenario.source.scenario)
    assert again.lidar.detector == scenario.lidar.detector
    assert again.lidar.detector.amplifier.noise_a_per_sqrt_hz == pytest.approx(1e-12)


@pytest.mark.parametrize(
    ("condition", "says"),
    [
        (
            {"false_alarms_per_s": 1e12},
            r"no threshold from 0\.5 times the noise of 1040 electrons on gives false_alarms",
        ),
        ({"pd": 0.95, "photons": 30.0}, "gives pd = 0.95 at 30 photons"),
    ],
)
def test_conditions_that_no_threshold_fulfils_are_one_line(condition, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        solve_threshold(Gsfl(solve=ThresholdCondition(**condition)), pulse_of(8.0))
    assert "\n" not in str(caught.value)


def test_a_measured_pulse_needs_a_stated_one():
    with pytest.raises(ScenarioError, match="give pulse_fwhm_ns in solve"):
        rl.Lidar(
            preset="gsfl_1064",
            laser={"pulse_shape": "measured", "pulse_file": "pulse.csv"},
            detector={"type": "gsfl", "solve": {"pd": 0.95, "photons": 1000.0}},
        )
