"""Many satellites in one call: the same bits as one by one, leap seconds included."""

import datetime

import numpy as np
import pytest

from rso_lidar.orbit import Epochs, Fleet
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.teme import propagate_in_teme
from rso_lidar.orbit.sets.tle_text import compute_checksum

UTC = datetime.UTC
LOW = (
    "1 31698U 07026A   {epoch}  .00001102  00000+0  55648-4 0  999",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 3900",
)
MOLNIYA = (  # SGP4-VER.TLE, 12 h resonant, its epoch ten years later
    "1 08195U 75081A   {epoch}  .00000099  00000-0  11873-3 0   81",
    "2 08195  64.1586 279.0717 6877146 264.7651  20.2257  2.0049138322565",
)


def at_epoch(lines, epoch):
    pair = (lines[0].format(epoch=epoch), lines[1])
    return parse_lines([f"{line}{compute_checksum(line)}" for line in pair], "here")[0]


@pytest.mark.parametrize("n", [1, 3])
def test_many_are_as_each_alone(n):
    # epochs on both sides of the leap second at the end of 2016
    sets = [(LOW, "17001.50000000"), (MOLNIYA, "16176.33215444"), (LOW, "16366.50000000")][:n]
    sets = [at_epoch(*one) for one in sets]
    epochs = Epochs(datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=UTC), np.arange(0.0, 10.0))
    position_m, velocity_m_s, error = Fleet(sets, epochs.start_utc).grid(np.arange(n), epochs.time_s)
    assert not error.any()
    assert (position_m.shape, velocity_m_s.shape, error.shape) == ((n, 10, 3), (n, 10, 3), (n, 10))
    for k, entry in enumerate(sets):
        alone = propagate_in_teme(entry, epochs)
        np.testing.assert_array_equal(position_m[k], alone[0])
        np.testing.assert_array_equal(velocity_m_s[k], alone[1])
        np.testing.assert_array_equal(error[k], alone[2])


def test_no_instants_and_no_sets():
    fleet = Fleet([at_epoch(LOW, "17001.50000000")], datetime.datetime(2017, 1, 1, tzinfo=UTC))
    none, one = np.zeros(0, int), np.zeros(1, int)
    assert fleet.grid(one, np.zeros(0))[0].shape == (1, 0, 3)
    assert fleet.grid(none, np.zeros(2))[2].shape == (0, 2)
    assert fleet.at(none, np.zeros(0))[0].shape == (0, 3)
