"""Cameras by name: each loads, describes itself and flies; what the user writes wins over what the preset says."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import load_presets

PRESETS = tuple(load_presets())
RANGE_M = {"proximity_1570": 50, "long_range_1064": 3000, "geiger_1064": 150}


@pytest.fixture
def camera(text):
    """Return a function that gives the bench with a camera by name, and more of `[lidar]` and its tables."""

    def scenario(name, more="", *settings):
        bench = text[: text.index("[lidar.laser]")].replace("[1000, 0, 0]", f"[{RANGE_M.get(name, 1000)}, 0, 0]")
        return rl.Scenario.loads(f'{bench}[lidar]\npreset = "{name}"\n{more}', where="bench.toml", settings=settings)

    return scenario


def test_each_says_what_is_sourced_and_what_assumed():
    assert {"gsfl_1064", "proximity_1570", "long_range_1064"} <= set(PRESETS)
    for name, table in load_presets().items():
        assert "ssumed" in table["what"], name


@pytest.mark.parametrize("name", PRESETS)
def test_each_loads_describes_and_flies(camera, name):
    scenario = camera(name, "", "time.duration_s=0.2")
    assert scenario.lidar == rl.Lidar(preset=name)
    described = scenario.describe()
    assert f"{scenario.lidar.laser.wavelength_nm:g} nm" in described
    assert "P(detect) 1.0" in described or "P(detect) 0.99" in described  # each at a range that it is for
    frame = next(rl.simulate(scenario))
    on_target = frame.labels.filled_fraction > 0.99
    assert on_target.any()
    assert frame.valid[on_target].mean() > 0.9


@pytest.mark.parametrize("name", PRESETS)
def test_each_is_resolved_to_a_text_that_loads_back(camera, name):
    scenario = camera(name, "[lidar.laser]\nenergy_mj = 7\n[lidar.receiver]\nfocal_length_mm = 100\naperture_mm = 20\n")
    again = rl.Scenario.loads(scenario.dumps())
    assert again.lidar == scenario.lidar
    assert again.dumps() == scenario.dumps()
    assert "what" not in scenario.dumps()


def test_the_seeds_camera_is_the_seeds():
    """Seed, section 5: 2.5 deg, f/2.8, 1064 nm, 50 mJ, 128 x 128 pixels of 100 um, 20 samples."""
    lidar = rl.Lidar(preset="gsfl_1064")
    assert (lidar.laser.wavelength_nm, lidar.laser.energy_mj, lidar.laser.divergence_deg) == (1064, 50, 2.5)
    assert (lidar.receiver.fov_deg, lidar.receiver.f_number, lidar.receiver.shape) == (2.5, 2.8, (128, 128))
    assert lidar.receiver.pixel_pitch_um == 100
    assert lidar.detector.readout.samples == 20
    assert 6 <= lidar.laser.pulse_fwhm_ns <= 10


class TestTheUserWins:
    def test_key_by_key(self, camera):
        lidar = camera("proximity_1570", "[lidar.laser]\nenergy_mj = 3\n").lidar
        assert (lidar.laser.energy_mj, lidar.laser.wavelength_nm, lidar.laser.divergence_deg) == (3, 1570, 20)

    def test_from_the_command_line(self, camera):
        lidar = camera("proximity_1570", "", "lidar.detector.gate.delay_ns=300").lidar
        assert lidar.detector.gate.delay_ns == 300
        assert lidar.detector.quantum_efficiency == 0.85
        assert camera("gsfl_1064", "", "lidar.preset=proximity_1570").lidar == rl.Lidar(preset="proximity_1570")

    def test_of_two_ways_to_say_a_thing_theirs_is_taken(self, camera):
        receiver = camera("proximity_1570", "[lidar.receiver]\nfocal_length_mm = 50\n").lidar.receiver
        assert (receiver.fov_deg, receiver.focal_length_mm, receiver.f_number) == (None, 50, 1.8)
        receiver = camera("proximity_1570", "[lidar.receiver]\naperture_mm = 5\n").lidar.receiver
        assert (receiver.fov_deg, receiver.f_number, receiver.aperture_mm) == (20, None, 5)
        with pytest.raises(ScenarioError, match="exactly one of fov_deg and focal_length_mm"):
            camera("proximity_1570", "[lidar.receiver]\nfocal_length_mm = 50\nfov_deg = 9\n")

    def test_parts_written_in_python(self):
        lidar = rl.Lidar(
            preset="proximity_1570", laser=rl.Laser(energy_mj=3), receiver=rl.Receiver(fov_deg=9, f_number=2)
        )
        assert (lidar.laser.energy_mj, lidar.laser.wavelength_nm) == (3, 1570)
        assert (lidar.receiver.fov_deg, lidar.receiver.f_number, lidar.receiver.filter_width_nm) == (9, 2, 10)

    def test_another_type_of_detector_replaces_the_whole(self, camera):
        detector = camera("proximity_1570", '[lidar.detector]\ntype = "empirical"\n').lidar.detector
        assert detector == rl.Empirical()

    def test_the_detectors_own_preset_brings_its_constants(self):
        lidar = rl.Lidar(preset="gsfl_1064_offset_limited", detector={"preset": "noise_limited"})
        assert lidar.detector == rl.Gsfl(preset="noise_limited")
        lidar = rl.Lidar(preset="gsfl_1064_offset_limited", detector={"trigger": {"threshold_electrons": 9000.0}})
        assert lidar.detector.trigger.threshold_electrons == 9000
        assert lidar.detector.amplifier == rl.Gsfl(preset="offset_limited").amplifier


class TestReplace:
    def test_another_preset_brings_its_values(self):
        seed = rl.Lidar(preset="gsfl_1064")
        assert seed.replace(preset="proximity_1570") == rl.Lidar(preset="proximity_1570")

    def test_what_the_user_set_stays(self):
        mine = rl.Lidar(preset="gsfl_1064", laser={"energy_mj": 7.0}, receiver={"aperture_mm": 30.0})
        other = mine.replace(preset="proximity_1570")
        assert (other.laser.energy_mj, other.laser.wavelength_nm) == (7, 1570)
        assert (other.receiver.aperture_mm, other.receiver.f_number, other.receiver.fov_deg) == (30, None, 20)

    def test_without_its_preset_it_stays_what_it_is(self):
        seed = rl.Lidar(preset="gsfl_1064")
        bare = seed.replace(preset=None)
        assert (bare.laser, bare.receiver, bare.detector) == (seed.laser, seed.receiver, seed.detector)


@pytest.mark.parametrize(
    ("name", "words"),
    [("gsfl_1604", "did you mean 'gsfl_1064'"), ("thing", "known: gsfl_1064"), ("", "known: gsfl_1064")],
)
def test_an_unknown_name_gets_one_line(camera, name, words):
    with pytest.raises(ScenarioError, match=words) as error:
        camera(name)
    assert str(error.value).startswith("bench.toml: lidar: preset: no camera")
    assert "\n" not in str(error.value)


def test_without_a_preset_a_receiver_is_asked_for():
    with pytest.raises(ScenarioError, match="receiver: is missing"):
        rl.Lidar()


def test_the_wide_camera_sees_the_wide_field(camera):
    """Pixels of the proximity camera: 20 deg over 128 is 2.76 mrad on the boresight, 2 tan(10 deg) / 128."""
    line_of_sight = camera("proximity_1570").lidar.receiver.line_of_sight
    edge = np.degrees(np.arctan2(line_of_sight[64, -1, 0], line_of_sight[64, -1, 2]))
    np.testing.assert_allclose(edge, np.degrees(np.arctan(np.tan(np.radians(10)) * 127 / 128)), atol=1e-9)
