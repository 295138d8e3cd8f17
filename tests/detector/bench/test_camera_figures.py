"""Figures of a data sheet against closed forms by hand, and against trials that do not use them."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import (
    Amplifier,
    Apd,
    Defects,
    Gsfl,
    LaserPulse,
    Readout,
    Saturation,
    detect,
    find_saturation_photons,
    list_camera_figures,
    predict,
    simulate_walk_curve,
)
from rso_lidar.detector.bench.trial import make_plate
from tests.detector.returns_for_tests import nothing

Q, H, C = 1.602176634e-19, 6.62607015e-34, 299792458.0


def figures(detector, fwhm_ns=8.0, wavelength_nm=1064.0, n_pixels=4096):
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    found = list_camera_figures(detector, LaserPulse(*laser.pulse, laser.pulse_fwhm_s), wavelength_nm * 1e-9, n_pixels)
    return {figure.name: figure for figure in found}


def test_nep_is_that_of_amplifier_and_dark_current_by_hand():
    """Currents after the APD, with F of McIntyre, the noise bandwidth by a sum over |H|², and the responsivity at 850 nm."""
    gsfl = Gsfl(
        quantum_efficiency=0.7,
        apd=Apd(gain=80.0, ionisation_ratio=0.02, dark_current_na=0.05),
        amplifier=Amplifier(bandwidth_mhz=180.0, noise_electrons=900.0),
        armed_to_m=1500.0,
        trigger=rl.detector.Trigger(threshold_electrons=20_000.0),
    )
    sheet = figures(gsfl, 5.0, 850.0)
    tau = math.sqrt(math.sqrt(2.0) - 1.0) / (2.0 * math.pi * 180e6)
    f = np.arange(0.0, 2000.0, 1e-3) * 1e7
    bandwidth = float((1.0 / (1.0 + (2.0 * math.pi * f * tau) ** 2) ** 2).sum() * 1e4)
    amplifier = 900.0 * Q / 8.516e-9 / math.sqrt(bandwidth)
    excess = 0.02 * 80.0 + 0.98 * (2.0 - 1.0 / 80.0)
    dark = math.sqrt(2.0 * Q * 0.05e-9 * 80.0**2 * excess)
    responsivity = 0.7 * Q * 850e-9 / (H * C)
    assert sheet["noise_bandwidth_hz"].value == pytest.approx(bandwidth, rel=1e-3)
    assert sheet["amplifier_noise_a_per_sqrt_hz"].value == pytest.approx(amplifier, rel=1e-3)
    assert sheet["excess_noise_factor"].value == pytest.approx(excess)
    assert sheet["responsivity_a_per_w"].value == pytest.approx(responsivity)
    nep = math.hypot(amplifier, dark) / (80.0 * responsivity)
    assert sheet["nep_w_per_sqrt_hz"].value == pytest.approx(nep, rel=1e-3)


def test_steady_light_of_the_nep_equals_the_noise_of_the_comparator():
    sheet, gsfl = figures(Gsfl()), Gsfl()
    power_w = sheet["nep_w_per_sqrt_hz"].value * math.sqrt(sheet["noise_bandwidth_hz"].value)
    electrons = power_w / (H * C / 1064e-9) * 0.8 * 10.0 * 8.516e-9
    assert electrons == pytest.approx(gsfl.noise_electrons, rel=1e-9)


@pytest.mark.parametrize("fwhm_ns", [2.0, 8.0, 16.0])
def test_noise_equivalent_photons_are_those_of_the_own_pulse(fwhm_ns):
    """By hand: the peak of a Gaussian of unit charge through h(t) = t/τ² exp(−t/τ), in units of the integration time."""
    tau, step = 1.0243e-9, 5e-12
    t = np.arange(0.0, 120e-9, step)
    s = fwhm_ns * 1e-9 / 2.35482
    pulse = np.exp(-0.5 * ((t - 60e-9) / s) ** 2) / (s * math.sqrt(2.0 * math.pi))
    h = t / tau**2 * np.exp(-t / tau)
    peak = float(np.convolve(pulse, h)[: len(t)].max() * step * 8.516e-9)
    sheet, gsfl = figures(Gsfl(), fwhm_ns), Gsfl()
    assert sheet["noise_equivalent_photons"].value == pytest.approx(gsfl.noise_electrons / (8.0 * peak), rel=2e-3)
    assert sheet["threshold_photons"].value == pytest.approx(6242.8 / (8.0 * peak), rel=2e-3)


@pytest.mark.parametrize("saturation", [None, Saturation(rail_electrons=200_000.0)], ids=["converter", "rail"])
def test_pulses_saturate_at_the_stated_photons(saturation):
    """Samples 0.3 ns apart meet the peak; noise of one count and shot noise of 0.4 % stay far inside 8 %."""
    gsfl = Gsfl(readout=Readout(sample_ns=0.3, samples=160, pretrigger_samples=60), saturation=saturation)
    full = figures(gsfl, 4.0)["saturation_photons"].value
    laser = rl.Laser(pulse_fwhm_ns=4.0)
    light = make_plate(np.repeat([0.92, 1.08], 100) * full, 200, laser.pulse, laser.pulse_fwhm_s, 50.0)
    reading, _ = detect(light, gsfl, np.random.default_rng(3))
    assert not reading.saturated[0, :100].any() and reading.saturated[0, 100:].all()
    if saturation is None:  # which the closed form leaves out
        pulse = LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
        assert predict(gsfl, pulse, np.array([0.92, 1.08]) * full, np.zeros(2)).saturated.tolist() == [False, True]


SATURATING = [
    pytest.param(Gsfl(), 1.03, id="converter"),
    pytest.param(Gsfl(amplifier=Amplifier(bandwidth_mhz=300.0)), 1.03, id="fast amplifier"),
    pytest.param(Gsfl(gate=rl.detector.Gate(delay_ns=300.0, width_ns=200.0)), 1.03, id="gate"),
    pytest.param(Gsfl(saturation=Saturation(rail_electrons=200_000.0)), 1.11, id="rail"),
]


@pytest.mark.parametrize("fwhm_ns", [2.0, 4.0, 8.0])
@pytest.mark.parametrize(("gsfl", "above"), SATURATING)
def test_there_is_one_law_of_saturation_for_all_pulses(gsfl, above, fwhm_ns):
    """Half of all flashes saturate within 3 % of it, or within 11 % where samples may miss a short time on the rail."""
    laser = rl.Laser(pulse_fwhm_ns=fwhm_ns)
    pulse = LaserPulse(*laser.pulse, laser.pulse_fwhm_s)
    full = find_saturation_photons(gsfl, pulse)
    assert figures(gsfl, fwhm_ns)["saturation_photons"].value == full
    near = predict(gsfl, pulse, np.array([0.99, 1.01]) * full, np.zeros(2))  # the closed form's own peak
    assert near.saturated.tolist() == [False, True]
    trial = simulate_walk_curve(gsfl, pulse, np.array([0.97, above]) * full, pixels=400, range_m=60.0)
    assert trial.saturated_fraction[0] < 0.25 and trial.saturated_fraction[1] > 0.5


def test_the_rail_counts_in_the_traits_too():
    """A quantum efficiency of 0.8 and a gain of 10 make 8 electrons of a photon; the converter clips at 806,200."""
    for rail, electrons in ((200_000.0, 200_000.0), (2e6, 806_200.0)):
        traits = Gsfl(saturation=Saturation(rail_electrons=rail)).traits
        assert traits.saturation_photons == pytest.approx(electrons / 8.0)
        assert traits.clipped_range_photons == pytest.approx(30.0 * electrons / 8.0)


@pytest.mark.parametrize("detector", [rl.Empirical(adc_bits=10), rl.GeigerArray()])
def test_other_detectors_saturate_as_their_traits_say(detector):
    pulse = LaserPulse(*rl.Laser().pulse, 8e-9)
    assert find_saturation_photons(detector, pulse) == detector.traits.saturation_photons < math.inf


def test_the_nep_of_a_photon_counter_doubles_nothing_but_its_noise():
    """In half a second, 1 / (2 · 1 Hz), light of the NEP counts as much as dark counts scatter."""
    array = rl.GeigerArray(dark_count_rate_hz=5000.0)
    nep = figures(array)["nep_w_per_sqrt_hz"].value
    dark = np.random.default_rng(2).poisson(5000.0 * 0.5, 20_000)
    assert 0.4 * nep / (H * C / 1064e-9) * 0.5 == pytest.approx(dark.std(), rel=4.0 / math.sqrt(2 * 20_000))


def test_false_alarms_of_a_frame_are_those_of_dark_frames():
    gsfl = Gsfl(trigger=rl.detector.Trigger(threshold_electrons=5200.0))
    expected = figures(gsfl, n_pixels=64 * 64)["false_alarms_per_frame"].value
    rng, frames = np.random.default_rng(4), 12
    seen = sum(int(np.isfinite(detect(nothing((64, 64)), gsfl, rng)[0].range_m).sum()) for _ in range(frames))
    # the 4096 thresholds of this camera are other draws than the 16,384 of the figure: 10 %; and 4 sigma of Poisson
    assert abs(seen - frames * expected) < 0.1 * frames * expected + 4.0 * math.sqrt(frames * expected)


def test_operability_counts_the_defects_of_this_camera():
    found = figures(Gsfl(defects=Defects(dead_fraction=0.03, hot_fraction=0.02)), n_pixels=16_384)[
        "operability_fraction"
    ]
    assert found.value == pytest.approx(0.95, abs=4.0 * math.sqrt(0.05 * 0.95 / 16_384))
    assert figures(Gsfl())["operability_fraction"].value == 1.0


def test_each_kind_tells_what_it_has():
    class Own:
        traits = rl.detector.DetectorTraits(sees_to_m=500.0, threshold_photons=7.0, saturation_photons=900.0)

        def detect(self, photons, rng):
            raise NotImplementedError

        def false_alarm_probability(self, range_m):
            return -np.expm1(-3000.0 * np.asarray(range_m) / (C / 2.0))

    own = figures(Own(), n_pixels=100)
    assert own["threshold_photons"].value == 7.0 and own["saturation_photons"].value == 900.0
    assert own["false_alarms_per_s"].value == pytest.approx(3000.0)
    assert own["false_alarms_per_frame"].value == pytest.approx(100.0 * -math.expm1(-3000.0 * 1000.0 / C))
    assert {"noise_equivalent_photons", "threshold_photons", "false_alarms_per_s"} <= set(figures(rl.Empirical()))
    assert {"nep_w_per_sqrt_hz", "least_counts", "false_alarms_per_gate_s"} <= set(figures(rl.GeigerArray()))
    gated = figures(Gsfl(gate=rl.detector.Gate(delay_ns=1000.0)), n_pixels=1000)
    assert "threshold_electrons" not in gated and gated["false_alarms_per_frame"].value == pytest.approx(1.0)


def test_crosstalk_in_amplitude_is_listed_by_distance_with_the_light_that_triggers_a_neighbour():
    sheet = figures(Gsfl(amplitude_crosstalk={}))
    levels = [sheet[f"amplitude_crosstalk_{distance}_db"].value for distance in (1, 2, 3, 4)]
    assert levels == pytest.approx([-40.0, -46.667, -53.333, -60.0], abs=1e-3)
    needed = sheet["crosstalk_at_threshold_photons"].value
    assert needed == pytest.approx(100.0 * sheet["threshold_photons"].value)
    # Frames of one bright pixel: its neighbour triggers in half of them, or more, as noise has some tries at the peak.
    laser, gsfl = rl.Laser(), Gsfl(amplitude_crosstalk={}, trigger={"threshold_spread_fraction": 0.0})
    shares = []
    for times in (0.6, 1.0, 1.4):
        light = rl.detector.make_point_returns(
            (1, 200),
            laser.pulse,
            laser.pulse_fwhm_s,
            np.arange(0, 200, 10),
            np.full(20, 900.0),
            np.full(20, times * needed),
        )
        seen = np.isfinite(detect(light, gsfl, np.random.default_rng(1))[0].range_m[0])
        shares.append(float(seen[1::10].mean() + seen[9::10].mean()) / 2.0)
    assert shares[0] < 0.2 and 0.3 < shares[1] and shares[2] > 0.9
    clipped = figures(Gsfl(amplitude_crosstalk={}, saturation=Saturation(rail_electrons=600_000.0)))
    assert clipped["crosstalk_at_threshold_photons"].value == math.inf  # a hundredth of the rail is below the threshold
    gated = figures(Gsfl(amplitude_crosstalk={}, gate={"delay_ns": 0.0, "width_ns": 500.0}))
    assert "crosstalk_at_threshold_photons" not in gated and "amplitude_crosstalk_4_db" in gated
    assert not [name for name in figures(Gsfl()) if "crosstalk" in name]
