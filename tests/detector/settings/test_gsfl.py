"""The detector as a part: presets, derived figures, what it refuses, and that a generator decides all of a flash."""

import math

import numpy as np
import pytest

from rso_lidar import detector
from rso_lidar.detector import DETECTOR_PRESETS, Amplifier, Gsfl, Trigger, detect, make_plate, run_trial
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Command
from rso_lidar.scenario import Lidar
from tests.detector.returns_for_tests import nothing, returns

C = 299_792_458.0
LIMITED, OFFSET = DETECTOR_PRESETS["noise_limited"], DETECTOR_PRESETS["offset_limited"]


def constants(part):
    return {
        "noise_electrons": part.amplifier.noise_electrons,
        "threshold_electrons": part.trigger.threshold_electrons,
    }


# -------------------------------------------------------------------------------------------------------------- presets


def test_presets_bring_their_constants():
    assert constants(Gsfl()) == constants(Gsfl(preset="noise_limited")) == LIMITED
    assert constants(Gsfl(preset="offset_limited")) == OFFSET != LIMITED
    assert Gsfl(preset="offset_limited").trigger.hysteresis_electrons == Trigger().hysteresis_electrons


@pytest.mark.parametrize("table", [dict, Amplifier], ids=["table", "part"])
def test_what_is_set_beside_a_preset_holds(table):
    louder = Gsfl(preset="offset_limited", amplifier=table(noise_electrons=500.0))
    assert constants(louder) == {**OFFSET, "noise_electrons": 500.0}
    wider = Gsfl(preset="offset_limited", amplifier=table(bandwidth_mhz=150.0))
    assert constants(wider) == OFFSET and wider.amplifier.bandwidth_mhz == 150.0


def test_another_preset_brings_its_own_constants_unless_they_were_set():
    assert constants(Gsfl().replace(preset="offset_limited")) == OFFSET
    assert constants(Gsfl(preset="offset_limited").replace(preset="noise_limited")) == LIMITED
    own = Gsfl(trigger={"threshold_electrons": 8000.0}).replace(preset="offset_limited")
    assert constants(own) == {**OFFSET, "threshold_electrons": 8000.0}
    kept = Gsfl(amplifier={"bandwidth_mhz": 150.0}).replace(preset="offset_limited")
    assert kept.amplifier.bandwidth_mhz == 150.0 and constants(kept) == OFFSET
    there_and_back = Gsfl().replace(preset="offset_limited").replace(preset="noise_limited")
    assert constants(there_and_back) == LIMITED
    assert constants(Gsfl(preset="offset_limited").replace(max_returns=2)) == OFFSET


def test_nothing_is_solved_again_when_a_setting_changes():
    for changes in ({"quantum_efficiency": 0.4}, {"apd": {"gain": 20.0}}, {"steps_per_sample": 4}):
        assert constants(Gsfl(**changes)) == LIMITED


def test_noise_limited_has_a_threshold_of_six_sigma():
    # The preset's definition; its constants are written to five digits.
    assert Gsfl().threshold_over_noise == pytest.approx(6.0, abs=2e-3)
    assert Gsfl(preset="offset_limited").amplifier.noise_electrons == 300.0


def test_95_percent_at_1000_photons_and_a_shorter_pulse_does_better():
    """The reference state of the presets, 16,384 pixels: within 4 binomial sigma; 6 ns beats 95 %, 10 ns falls short."""
    n = 16_384
    sigma = math.sqrt(0.95 * 0.05 / n)
    found = {}
    for preset in ("noise_limited", "offset_limited"):
        for fwhm_ns in (6.0, 8.0, 10.0):
            laser = Laser(pulse_fwhm_ns=fwhm_ns)
            photons = make_plate(1000.0, n, laser.pulse, laser.pulse_fwhm_s)
            found[fwhm_ns] = run_trial(Gsfl(preset=preset), photons, np.random.default_rng(int(fwhm_ns))).probability
        assert abs(found[8.0] - 0.95) < 4.0 * sigma
        assert found[6.0] > 0.95 + 10.0 * sigma and found[10.0] < 0.95 - 10.0 * sigma


# ------------------------------------------------------------------------------------------------------ derived figures


def test_derived_figures():
    part = Gsfl()
    assert part.electrons_per_photon == 8.0
    assert part.traits.threshold_photons == pytest.approx(LIMITED["threshold_electrons"] / 8.0)
    shot = 352.0 * 6.241509e9 * (8.516e-9) ** 2 / (4.0 * part.amplifier.pole_s)  # Campbell, 1 nA, M²F = 352
    assert part.noise_electrons == pytest.approx(math.sqrt(LIMITED["noise_electrons"] ** 2 + shot), rel=1e-5)
    assert part.full_scale_counts == 4031 and part.window_m == pytest.approx(7.135, abs=1e-3)
    assert part.counts(np.array([1000.0, 1e7])).tolist() == [40.0, 4031.0]
    quiet = Gsfl(amplifier={"noise_electrons": 0.0}, apd={"dark_current_na": 0.0})
    assert quiet.threshold_over_noise == math.inf


def test_a_gate_sets_what_is_seen():
    part = Gsfl(gate={"delay_ns": 1000.0, "width_ns": 100.0})
    assert (part.sees_from_m, part.sees_to_m) == pytest.approx((500e-9 * C, 550e-9 * C))
    assert part.window_m == pytest.approx(50e-9 * C)
    assert (Gsfl().sees_from_m, Gsfl().sees_to_m) == (1.0, 5000.0)


def test_a_short_pulse_is_stepped_finely():
    """Three steps or more to a pulse's FWHM are the least that shares of a return keep to a thousandth; here 6.5 at 8 ns."""
    for fwhm_s in (1e-9, 2e-9, 5e-9, 8e-9, 20e-9):
        plan = plan_time(Gsfl(), fwhm_s)
        assert plan.step_s * plan.steps_per_sample == pytest.approx(2.38e-9)
        assert plan.step_s <= fwhm_s / 6.5 and plan.steps_per_sample >= 2


# ----------------------------------------------------------------------------------------------------------- generators


@pytest.mark.parametrize("gate", [None, {"delay_ns": 19_990.0, "width_ns": 60.0}], ids=["triggered", "gated"])
def test_the_same_generator_gives_the_same_bits(gate):
    part = Gsfl(
        gate=gate,
        max_returns=2,
        maps={},
        defects={},
        saturation={},
        droop={},
        crosstalk={},
        speckle={},
        trigger={"threshold_electrons": 5500.0},
    )
    photons = returns(np.full(512, 3000.0), np.geomspace(100.0, 1e6, 512), shape=(16, 32))
    readings = [detector.detect(photons, part, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    for name in ("range_m", "intensity_counts", "saturated", "return_range_m", "return_intensity_counts"):
        one, same, other = (getattr(reading, name) for reading, _ in readings)
        assert one.tobytes() == same.tobytes()
        assert name == "saturated" or one.tobytes() != other.tobytes()
    assert readings[0][1].samples_counts.tobytes() == readings[1][1].samples_counts.tobytes()


@pytest.mark.parametrize("gate", [None, {"delay_ns": 100.0}], ids=["triggered", "gated"])
def test_an_empty_scene_is_an_empty_reading(gate):
    part = Gsfl(preset="offset_limited", gate=gate and {**gate, "false_alarm_probability": 1e-9})
    reading, waveforms = detect(nothing((4, 6)), part, np.random.default_rng(0))
    assert reading.range_m.shape == (4, 6) and np.isnan(reading.range_m).all()
    assert len(waveforms.pixel) == (24 if gate else 0)


def test_valid_pixels_have_counts_and_no_others():
    photons = returns(np.full(4096, 3000.0), np.geomspace(200.0, 1e6, 4096))
    reading, _ = detect(photons, Gsfl(max_returns=3), np.random.default_rng(4))
    valid = np.isfinite(reading.range_m)
    assert 0 < valid.sum() < 4096 and np.array_equal(reading.intensity_counts >= 1, valid)
    assert reading.intensity_counts.max() == Gsfl().full_scale_counts
    full = reading.intensity_counts == Gsfl().full_scale_counts
    assert reading.saturated.astype(bool)[full].all() and not reading.saturated[~valid].any()


# ------------------------------------------------------------------------------------------------------------- schedule


def test_a_gate_follows_its_schedule_and_a_command_comes_before_it():
    lidar = Lidar(
        receiver=Receiver(fov_deg=2.5, f_number=2.8),
        detector=Gsfl(gate={"delay_ns": 1000.0, "width_ns": 60.0, "false_alarm_probability": 1e-6}),
        schedule={"time_s": [0.0, 10.0], "gate_delay_ns": [1000.0, 2000.0]},
    )
    assert lidar.at(5.0).detector.gate.delay_ns == pytest.approx(1500.0)
    assert lidar.at(5.0).settings["gate_delay_s"] == pytest.approx(1.5e-6)
    assert lidar.at(5.0, Command(gate_delay_s=3e-6)).detector.gate.delay_ns == pytest.approx(3000.0)
    # A target at 228 m, 1521 ns: outside at 0 s and 10 s, inside at 5 s.
    photons = returns(np.array([228.0]), 20_000.0, shape=(16, 16))
    seen = [
        bool(np.isfinite(detect(photons, lidar.at(t).detector, np.random.default_rng(5))[0].range_m[0, 0]))
        for t in (0.0, 5.0, 10.0)
    ]
    assert seen == [False, True, False]
    with pytest.raises(ScenarioError, match="needs a gate"):
        Lidar(receiver=lidar.receiver, schedule={"time_s": [0.0], "gate_delay_ns": [1000.0]})


# -------------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"armed_from_m": 100.0, "armed_to_m": 50.0}, "must be beyond armed_from_m"),
        ({"preset": "quiet"}, "unknown value 'quiet'"),
        ({"quantum_efficiency": 0.0}, "quantum_efficiency"),
        ({"quantum_efficiency": 1.2}, "quantum_efficiency"),
        ({"max_returns": 9}, "max_returns"),
        ({"returns": "all"}, "returns"),
        ({"steps_per_sample": 1}, "steps_per_sample"),
        ({"gain": 10.0}, "unknown key 'gain'"),
        ({"preset": "offset_limited", "amplifier": {"noise": 1.0}}, "unknown key 'noise'"),
        ({"preset": "offset_limited", "trigger": 5.0}, "trigger: needs a table"),
        ({"gate": {"delay_ns": "soon"}}, "gate.delay_ns"),
        ({"trigger": {"threshold_spread_fraction": 0.5}}, "threshold_spread_fraction"),
    ],
)
def test_what_cannot_be_is_one_line(settings, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        Gsfl(**settings)
    assert "\n" not in str(caught.value)
