"""What `check` says of constants that were solved for another instrument, and of defaults that are nobody's figures."""

import pytest

import rso_lidar as rl
from rso_lidar.detector import DataSheet, Gsfl, LaserPulse, describe_foreign_constants, list_assumed_settings
from tests.settings_for_tests import limit_pixels


def describe(detector, fwhm_ns=8.0, wavelength_nm=1064.0):
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    pulse = LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
    return describe_foreign_constants(detector, pulse, wavelength_nm * 1e-9)


def test_the_instrument_of_the_presets_needs_no_line():
    assert describe(Gsfl()) == describe(Gsfl(preset="offset_limited")) == describe(rl.Empirical()) == []


@pytest.mark.parametrize(
    ("detector", "given", "says"),
    [
        (Gsfl(), {"fwhm_ns": 2.0}, "solved for a pulse of 8 ns, not 2;"),
        (Gsfl(), {"wavelength_nm": 850.0}, "1064 nm, not 850"),
        (Gsfl(apd={"gain": 20.0, "ionisation_ratio": 0.02}), {}, "gain 10, not 20, k 0.2, not 0.02"),
        (Gsfl(quantum_efficiency=0.6), {}, "QE 0.8, not 0.6"),
    ],
)
def test_what_differs_is_told_in_one_line(detector, given, says):
    first, *rest = describe(detector, **given)
    assert first.startswith("amplifier noise and threshold of preset noise_limited are") and says in first
    assert "\n" not in first and "solve = { pd = 0.95, photons = 1000 }" in first
    assert len(rest) == 1 and "armed_to_m" in rest[0]


def test_own_constants_are_not_the_presets():
    own = Gsfl(amplifier={"noise_electrons": 500.0}, trigger={"threshold_electrons": 5000.0})
    assert not any("solved for" in line for line in describe(own, 2.0))
    half = Gsfl(trigger={"threshold_electrons": 7000.0})
    assert describe(half, 2.0)[0].startswith("amplifier noise of preset noise_limited is solved for")


def test_a_data_sheet_of_another_wavelength_is_told():
    sheet = DataSheet(wavelength_nm=850.0, nep_w_per_sqrt_hz=2e-13)
    lines = describe(Gsfl(data_sheet=sheet))
    assert "hold at 850 nm, and the laser has 1064 nm" in lines[-1]
    assert not any("hold at" in line for line in describe(Gsfl(data_sheet=sheet), wavelength_nm=850.0))


def test_check_tells_it():
    settings = (*limit_pixels(16, 4), "lidar.laser.pulse_fwhm_ns=4")
    scenario = rl.Scenario.load("examples/bench_plate.toml", (*settings, 'lidar.detector.type="gsfl"'))
    assert "  constants amplifier noise and threshold of preset noise_limited" in scenario.describe()


def test_assumed_settings_are_those_left_alone():
    assert "quantum_efficiency" in list_assumed_settings(Gsfl())
    assert "apd.gain" not in list_assumed_settings(Gsfl())  # Fuller et al.
    given = list_assumed_settings(Gsfl(quantum_efficiency=0.7, amplifier={"noise_electrons": 500.0}))
    assert "quantum_efficiency" not in given and "amplifier.noise_electrons" not in given
    assert "amplifier.noise_electrons" in list_assumed_settings(Gsfl(preset="offset_limited"))
    gated = list_assumed_settings(Gsfl(gate={"delay_ns": 9.0}))
    assert gated and not [place for place in gated if place.startswith(("armed_", "trigger."))]
    assert list_assumed_settings(object()) == []
