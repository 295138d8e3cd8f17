import dataclasses

import numpy as np
import pytest

from rso_lidar.detector import (
    Amplifier,
    Apd,
    Gate,
    Gsfl,
    Readout,
    Saturation,
    ShotList,
    Trigger,
    detect,
    fit_constants,
    make_plate,
    merge_points,
    reduce_shots,
)
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import Lidar

HIDDEN = Gsfl(
    armed_to_m=500.0,
    apd=Apd(gain=20.0, ionisation_ratio=0.1, dark_current_na=0.2),
    amplifier=Amplifier(noise_electrons=900.0, bandwidth_mhz=140.0),
    trigger=Trigger(threshold_electrons=9000.0, threshold_spread_fraction=0.0),
    readout=Readout(sample_ns=1.0, samples=64, pretrigger_samples=24, electrons_per_count=60.0, baseline_counts=80.0),
)
SHEET = HIDDEN.replace(
    amplifier=Amplifier(noise_electrons=1500.0, bandwidth_mhz=100.0),
    readout=HIDDEN.readout.replace(electrons_per_count=100.0, baseline_counts=64.0),
)
TRUTH = {
    "amplifier.noise_electrons": 900.0,
    "amplifier.bandwidth_mhz": 140.0,
    "readout.electrons_per_count": 60.0,
    "readout.baseline_counts": 80.0,
    "apd.ionisation_ratio": 0.1,
}
PULSE = Lidar(laser={"pulse_fwhm_ns": 5.0}, receiver={"fov_deg": 2.5, "f_number": 2.8}, detector=HIDDEN).pulse


def take_shots(photons, n, seed, camera=HIDDEN):
    """Return shots of a plate, or of the dark: then under a gate, for nothing triggers."""
    if photons == 0.0:
        camera = camera.replace(gate=Gate(delay_ns=200.0, width_ns=64.0, pulses=1))
    light = make_plate(max(photons, 1e-9), n, (PULSE.step_s, PULSE.power_per_s), PULSE.fwhm_s, 15.0)
    _, waveforms = detect(light, camera, np.random.Generator(np.random.Philox(seed)))
    return ShotList("shots", waveforms.samples_counts, camera.readout.sample_s, photons)


@pytest.fixture(scope="module")
def shots():
    return [take_shots(photons, 400, k) for k, photons in enumerate((0.0, 1500.0, 4000.0, 8000.0, 60_000.0))]


def fit(shots, names=tuple(TRUTH), sheet=SHEET):
    curves, _ = reduce_shots(shots, sheet, PULSE)
    return fit_constants(sheet, PULSE, merge_points(curves, "shots"), names)


def test_hidden_constants_are_found_from_raw_shots(shots):
    found = fit(shots)
    assert not found.is_rejected
    for constant in found.constants:
        sigma = (constant.high - constant.low) / 3.92
        assert abs(constant.value - TRUTH[constant.name]) < 4.5 * sigma
        assert sigma < 0.2 * TRUTH[constant.name]
    quantities = [curve.curve.quantity for curve in found.curves]
    assert quantities == ["baseline", "sample_noise", "noise_correlation", "pulse_area", "area_variance", "pulse_width",
                          "clip_level"]  # fmt: skip


def test_the_clip_level_tells_the_rail_of_an_amplifier(shots):
    camera = HIDDEN.replace(saturation=Saturation(rail_electrons=180_000.0))
    sheet = SHEET.replace(readout=HIDDEN.readout, saturation=Saturation(rail_electrons=230_000.0))
    found = fit([take_shots(60_000.0, 200, 9, camera), shots[0]], ("saturation.rail_electrons",),
                sheet.replace(amplifier=HIDDEN.amplifier))  # fmt: skip
    (rail,) = found.constants
    assert abs(rail.value - 180_000.0) < 60.0  # a count
    assert not found.is_rejected


def test_a_laser_whose_energy_jitters_is_rejected(shots):
    def jitter(each, seed):
        factor = 1.0 + 0.1 * np.random.Generator(np.random.Philox(seed)).standard_normal(len(each.samples_counts))
        return dataclasses.replace(each, samples_counts=80.0 + factor[:, None] * (each.samples_counts - 80.0))

    found = fit([shots[0], *(jitter(each, 50 + k) for k, each in enumerate(shots[1:4]))],
                tuple(TRUTH)[:4])  # fmt: skip
    assert found.is_rejected
    assert any("area_variance" in curve.curve.name for curve in found.misfits)


def test_the_mean_pulse_has_the_shape_of_the_hidden_camera(shots):
    _, pulses = reduce_shots(shots, SHEET, PULSE)
    assert [pulse.photons for pulse in pulses] == [1500.0, 4000.0, 8000.0]
    value = pulses[-1].value
    assert value.max() == pytest.approx(1.0, abs=5.0 * pulses[-1].error[value.argmax()])
    half = pulses[-1].time_s[value > 0.5]
    assert half.max() - half.min() == pytest.approx(5.476e-9, abs=0.5e-9)  # of 5 ns behind 140 MHz; bins of 0.25 ns


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda shots: [dataclasses.replace(shots[0], samples_counts=shots[0].samples_counts[:1])],
            "1 shot at 0 photons",
        ),
        (
            lambda shots: [dataclasses.replace(shots[0], samples_counts=np.full((30, 64), 80.0))],
            "all samples are equal",
        ),
        (
            lambda shots: [shots[0], dataclasses.replace(shots[2], samples_counts=shots[2].samples_counts[:, 26:])],
            "the first sample still holds .* give longer shots",
        ),
        (
            lambda shots: [
                shots[0],
                dataclasses.replace(
                    shots[3],
                    samples_counts=np.minimum(
                        shots[3].samples_counts, np.quantile(shots[3].samples_counts.max(axis=1), 0.7)
                    ),
                ),
            ],
            "shots of 8000 photons reach .* counts: some are clipped and others not",
        ),
    ],
)
def test_shots_that_tell_nothing_are_refused(shots, change, words):
    with pytest.raises(ScenarioError, match=words) as caught:
        reduce_shots(change(shots), SHEET, PULSE)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("factor", "words"), [(1000.0, "1,000 times too low"), (0.1, "10 times too high")])
def test_photons_in_another_unit_are_named(shots, factor, words):
    other = [dataclasses.replace(each, photons=each.photons * factor) for each in shots[:4]]
    with pytest.raises(ScenarioError, match=f"pulse_area: its values are {words}"):
        fit(other)
