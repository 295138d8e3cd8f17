"""A data sheet in its own words: what it fills, read back, and what over-determines or cannot be."""

import math

import numpy as np
import pytest
import tomli_w

import rso_lidar as rl
from rso_lidar.detector import Amplifier, Apd, DataSheet, Gsfl, LaserPulse, ThresholdCondition, list_camera_figures
from rso_lidar.errors import ScenarioError

Q, H, C = 1.602176634e-19, 6.62607015e-34, 299792458.0
WORDS = {
    "wavelength_nm": 850.0,
    "responsivity_a_per_w": 0.5,
    "excess_noise_factor": 3.55,
    "noise_bandwidth_mhz": 180.0,
    "nep_w_per_sqrt_hz": 30e-15,
}


def camera(**more):
    return Gsfl(
        apd=Apd(gain=80.0, dark_current_na=0.05), trigger={"threshold_electrons": 18_000.0}, armed_to_m=900.0, **more
    )


def read_back(gsfl, wavelength_nm=850.0):
    laser = rl.Laser(pulse_fwhm_ns=5.0)
    pulse = LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
    return {figure.name: figure.value for figure in list_camera_figures(gsfl, pulse, wavelength_nm * 1e-9, 64)}


def test_what_is_entered_is_read_back():
    read = read_back(camera(data_sheet=DataSheet(**WORDS)))
    assert read["responsivity_a_per_w"] == pytest.approx(0.5)
    assert read["excess_noise_factor"] == pytest.approx(3.55)
    assert read["noise_bandwidth_hz"] == pytest.approx(180e6)
    assert read["nep_w_per_sqrt_hz"] == pytest.approx(30e-15)


def test_figures_are_filled_as_by_hand():
    """QE from the photon's energy, k from McIntyre's F, and electrons from the NEP without the dark current's share."""
    filled = camera(data_sheet=DataSheet(**WORDS))
    assert filled.quantum_efficiency == pytest.approx(0.5 * H * C / 850e-9 / Q)
    least = 2.0 - 1.0 / 80.0
    assert filled.apd.ionisation_ratio == pytest.approx((3.55 - least) / (80.0 - least))
    total_a, dark_a = 30e-15 * 0.5 * 80.0, math.sqrt(2.0 * Q * 0.05e-9 * 80.0**2 * 3.55)
    rms_a = math.sqrt((total_a**2 - dark_a**2) * 180e6)
    assert filled.amplifier.noise_electrons == pytest.approx(rms_a * 8.516e-9 / Q, rel=1e-6)


def test_a_rise_time_is_that_of_the_step_response():
    """The response of two equal poles to a step, summed: 10 to 90 % in the stated time."""
    amplifier = Gsfl(data_sheet=DataSheet(rise_time_ns=3.5)).amplifier
    t = np.arange(0.0, 30e-9, 1e-12)
    step = np.cumsum(t / amplifier.pole_s**2 * np.exp(-t / amplifier.pole_s)) * 1e-12
    assert t[np.argmax(step > 0.9)] - t[np.argmax(step > 0.1)] == pytest.approx(3.5e-9, rel=1e-3)
    assert amplifier.bandwidth_mhz == pytest.approx(1e3 * 0.344 / 3.5, rel=2e-3)


def test_current_noise_is_white_through_the_bandwidth():
    quiet = Gsfl(data_sheet=DataSheet(noise_pa_per_sqrt_hz=1.5)).amplifier
    assert quiet.noise_a_per_sqrt_hz == pytest.approx(1.5e-12)
    wide = Gsfl(
        data_sheet=DataSheet(noise_pa_per_sqrt_hz=1.5, noise_bandwidth_mhz=4.0 * quiet.noise_bandwidth_hz / 1e6)
    )
    assert wide.amplifier.noise_electrons == pytest.approx(2.0 * quiet.noise_electrons)


def test_a_filled_detector_is_one_of_numbers():
    """It is written, read and changed like any other: nothing is filled twice."""
    filled = camera(data_sheet=DataSheet(**WORDS))
    assert filled.data_sheet == DataSheet(wavelength_nm=850.0)
    table = filled.model_dump(exclude_none=True)
    assert rl.Gsfl(**table) == filled
    assert filled.replace(armed_to_m=800.0).amplifier == filled.amplifier
    louder = filled.replace(apd=filled.apd.replace(gain=60.0))
    assert louder.amplifier == filled.amplifier and louder.apd.ionisation_ratio == filled.apd.ionisation_ratio


def test_the_constant_of_a_preset_gives_way_to_a_data_sheet():
    quiet = Gsfl(preset="offset_limited", data_sheet={"noise_pa_per_sqrt_hz": 1.0})
    assert quiet.amplifier.noise_a_per_sqrt_hz == pytest.approx(1e-12)
    assert quiet.trigger.threshold_electrons == Gsfl(preset="offset_limited").trigger.threshold_electrons
    lidar = rl.Lidar(
        preset="proximity_1570",
        detector={"type": "gsfl", "data_sheet": {"wavelength_nm": 1570, "responsivity_a_per_w": 1.0}},
    )
    assert lidar.detector.quantum_efficiency == pytest.approx(H * C / 1570e-9 / Q)


def test_words_of_a_data_sheet_replace_what_a_preset_file_states(tmp_path):
    """A file that `camera fit` writes states every key; a data sheet or a condition beside it is the later word."""
    stated = rl.Lidar(preset="gsfl_1064").detector.model_dump(exclude_none=True)
    (tmp_path / "own.toml").write_text(tomli_w.dumps({"detector": stated}))
    told = {"data_sheet": {"noise_pa_per_sqrt_hz": 1.0, "rise_time_ns": 4.0}, "solve": {"pd": 0.9, "photons": 500.0}}
    lens = {"fov_deg": 2.5, "f_number": 2.8}
    lidar = rl.Lidar(preset=str(tmp_path / "own.toml"), receiver=lens, detector=told)
    plain = rl.Lidar(preset="gsfl_1064", receiver=lens, detector=told)
    assert lidar.detector.amplifier == plain.detector.amplifier
    assert lidar.detector.trigger.threshold_electrons == plain.detector.trigger.threshold_electrons
    assert lidar.detector.amplifier.noise_electrons != stated["amplifier"]["noise_electrons"]


def test_a_photodiode_without_gain_has_no_excess_noise():
    detector = Gsfl(apd=Apd(gain=1.0), data_sheet=DataSheet(excess_noise_factor=1.0))
    assert detector.apd.gain == 1.0


def test_nothing_stated_changes_nothing():
    assert Gsfl(data_sheet=DataSheet()).replace(data_sheet=None) == Gsfl()
    assert "data_sheet" not in Gsfl().model_dump(exclude_none=True)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            {"data_sheet": {"responsivity_a_per_w": 0.5}},
            "responsivity_a_per_w holds at one wavelength; give wavelength_nm",
        ),
        ({"data_sheet": {"nep_w_per_sqrt_hz": 1e-14}}, "nep_w_per_sqrt_hz holds at one wavelength"),
        ({"data_sheet": {"wavelength_nm": 850.0, "responsivity_a_per_w": 50.0}}, "is 72.9 electrons for each photon"),
        ({"data_sheet": {"wavelength_nm": 850.0, "nep_w_per_sqrt_hz": 30.0}}, "less than or equal to"),
        (
            {"data_sheet": {"wavelength_nm": 850.0, "nep_w_per_sqrt_hz": 1e-15}},
            "less than the noise of apd.dark_current_na",
        ),
        ({"data_sheet": {"excess_noise_factor": 1.2}}, "excess_noise_factor .1.2. is not possible at apd.gain = 10"),
        ({"data_sheet": {"excess_noise_factor": 10.5}}, "not possible"),
        ({"data_sheet": {"rise_time_ns": 3.0, "noise_bandwidth_mhz": 90.0}}, "noise_bandwidth_mhz and rise_time_ns"),
        (
            {"data_sheet": {"noise_pa_per_sqrt_hz": 1.0, "nep_w_per_sqrt_hz": 1e-13, "wavelength_nm": 850.0}},
            "noise_pa_per_sqrt_hz and nep_w_per_sqrt_hz",
        ),
        (
            {"data_sheet": {"noise_pa_per_sqrt_hz": 1.0}, "amplifier": {"noise_electrons": 300.0}},
            "data_sheet.noise_pa_per_sqrt_hz and amplifier.noise_electrons",
        ),
        (
            {"data_sheet": {"rise_time_ns": 3.0}, "amplifier": Amplifier(bandwidth_mhz=90.0)},
            "data_sheet.rise_time_ns and amplifier.bandwidth_mhz",
        ),
        (
            {"data_sheet": {"excess_noise_factor": 3.0}, "apd": {"ionisation_ratio": 0.1}},
            "data_sheet.excess_noise_factor and apd.ionisation_ratio",
        ),
        (
            {"data_sheet": {"wavelength_nm": 850.0, "responsivity_a_per_w": 0.5}, "quantum_efficiency": 0.7},
            "data_sheet.responsivity_a_per_w and quantum_efficiency",
        ),
        ({"solve": {"pd": 0.9}}, "needs pd and photons, or false_alarms_per_s"),
        ({"solve": {"pd": 0.9, "photons": 10.0, "false_alarms_per_s": 2.0}}, "pd and false_alarms_per_s"),
        ({"solve": {"pd": 1.0, "photons": 10.0}}, "less than 1"),
        (
            {"solve": {"pd": 0.9, "photons": 900.0}, "trigger": {"threshold_electrons": 6000.0}},
            "solve and trigger.threshold_electrons",
        ),
        ({"solve": {"pd": 0.9, "photons": 900.0}, "gate": {"delay_ns": 100.0}}, "solve and gate"),
    ],
)
def test_what_over_determines_names_both(words, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Gsfl(**words)
    assert "\n" not in str(caught.value)


def test_a_threshold_that_is_not_solved_is_never_used():
    waiting = Gsfl(solve=ThresholdCondition(pd=0.95, photons=500.0))
    with pytest.raises(ScenarioError, match="not solved yet; give the detector to a Lidar"):
        _ = waiting.traits
