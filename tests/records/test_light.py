"""The light of a frame of several pulses, pulse by pulse."""

from dataclasses import replace

import numpy as np
import pytest

from tests.detector.returns_for_tests import returns


def test_each_pulse_has_the_light_of_its_epoch_by_its_own_energy_and_later_by_its_own_delay():
    """Two epochs of one and of three pulses: means over four pulses are 4 and 4/3 times as much in those that have them."""
    frame = replace(
        returns([900.0, 910.0, 920.0], [100.0, 60.0, 30.0], [0, 0, 2], (1, 3)),
        late_s=5e-9,
        epoch=np.array([0, 1, 1]),
        pulse_epoch=np.array([0, 1, 1, 1]),
        pulse_energy_fraction=np.array([0.7, 1.2, 0.9, 1.2]),
        pulse_late_s=np.array([1e-9, -2e-9, 0.0, 3e-9]),
    )
    pulses = list(frame.split_pulses(4))
    assert [one.late_s for one in pulses] == pytest.approx([6e-9, 3e-9, 5e-9, 8e-9], rel=1e-12)
    assert [one.pixel.tolist() for one in pulses] == [[0], [0, 2], [0, 2], [0, 2]]
    for one, energy in zip(pulses, (0.7, 1.2, 0.9, 1.2), strict=True):
        full = [400.0] if one is pulses[0] else [80.0, 40.0]
        assert one.photons == pytest.approx(np.array(full) * energy, rel=1e-12)
        assert one.epoch is None and one.pulse_late_s is None
