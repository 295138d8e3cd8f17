"""Cameras: what settings, pulse and pixels determine is worked out once, and shared where it is the same."""

from dataclasses import replace

import numpy as np

from rso_lidar.detector import Gate, Gsfl, LaserPulse
from rso_lidar.detector.chain.camera import build_camera, camera_of
from tests.detector.returns_for_tests import nothing


def test_flashes_of_one_pulse_share_a_camera():
    """The taps decide, not the array that holds them; another pulse, setting or number of pixels needs another camera."""
    photons, part = nothing((4, 5)), Gsfl()
    copied = replace(photons, pulse_power_per_s=photons.pulse_power_per_s.copy())
    camera = camera_of(part, photons)
    assert camera_of(Gsfl(), copied) is camera
    assert camera_of(part, nothing((20, 1))) is camera
    others = (
        camera_of(part, nothing((4, 6))),
        camera_of(part.replace(camera_seed=5), photons),
        camera_of(part, replace(photons, pulse_power_per_s=photons.pulse_power_per_s[::-1] * 0.5)),
    )
    assert all(other is not camera for other in others)


def test_equal_pulses_have_equal_taps():
    pulse = LaserPulse(1e-10, np.array([0.0, 1e9, 0.0]), 4e-9)
    same = LaserPulse(1e-10, np.array([0.0, 1e9, 0.0]), 4e-9)
    assert pulse == same and hash(pulse) == hash(same)
    assert pulse != LaserPulse(1e-10, np.array([0.0, 1e9, 1.0]), 4e-9)
    assert pulse != LaserPulse(1e-10, np.array([0.0, 1e9, 0.0, 0.0]), 4e-9)
    assert pulse != same._replace(timing_jitter_ns=0.1)


def test_a_pulse_that_a_caller_changes_gets_a_camera_of_its_own():
    power = np.array([0.0, 1e9, 0.0])
    before = build_camera(Gsfl(), LaserPulse(1e-10, power, 4e-9), 6)
    power[2] = 1e9
    after = build_camera(Gsfl(), LaserPulse(1e-10, power, 4e-9), 6)
    assert after is not before and not np.array_equal(after.pulse.table, before.pulse.table)
    assert build_camera(Gsfl(), LaserPulse(1e-10, np.array([0.0, 1e9, 0.0]), 4e-9), 6) is before


def test_a_gate_moves_without_a_new_camera():
    pulse = LaserPulse.of(nothing((1, 1)))
    near, far = (build_camera(Gsfl(gate=Gate(delay_ns=delay_ns)), pulse, 6) for delay_ns in (1000.0, 2000.0))
    assert (near.gate.delay_ns, far.gate.delay_ns) == (1000.0, 2000.0)
    assert near.processor is far.processor and near.front is far.front
    assert near.axis(256) is far.axis(256)
    wider = build_camera(Gsfl(gate=Gate(delay_ns=1000.0, width_ns=80.0)), pulse, 6)
    assert wider.processor is not near.processor


def test_selected_pixels_are_those_of_the_whole_camera():
    camera, chosen = camera_of(Gsfl(maps={}), nothing((3, 4))), np.array([7, 2, 7])
    some = camera.select(chosen)
    for piece in ("front", "comparators", "processor"):
        pixels = getattr(some, piece).pixels
        assert np.array_equal(pixels.t0_s, camera.front.pixels.t0_s[chosen])
    for level in (None, 30):
        whole = camera.comparators.rates(level)
        assert np.array_equal(some.comparators.rates(level).most_per_s, whole.most_per_s[chosen])
    assert some.axis is camera.axis
