"""Many satellites in one call: the same bits as one by one, leap seconds included."""

import datetime

import numpy as np
import pytest

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.formats import parse_lines
from rso_lidar.orbit.sets.teme import REASONS, find_failures, gcrs_from_teme, propagate_in_teme, propagate_many_in_teme
from rso_lidar.orbit.sets.tle_text import compute_checksum

UTC = datetime.UTC
LINES = (
    "1 31698U 07026A   {epoch}  .00001102  00000+0  55648-4 0  999",
    "2 31698  97.4465  83.5666 0001759  83.5600 276.5835 15.19149353 3900",
)
MOLNIYA = (  # SGP4-VER.TLE, 12 h resonant
    "1 08195U 75081A   06176.33215444  .00000099  00000-0  11873-3 0   813",
    "2 08195  64.1586 279.0717 6877146 264.7651  20.2257  2.00491383225656",
)


def low(epoch):
    pair = (LINES[0].format(epoch=epoch), LINES[1])
    return parse_lines([f"{line}{compute_checksum(line)}" for line in pair], "here")[0]


@pytest.mark.parametrize("n", [1, 3])
def test_many_are_as_each_alone(n):
    # epochs on both sides of the leap second at the end of 2016
    sets = [low("17001.50000000"), *parse_lines(MOLNIYA, "here"), low("16366.50000000")][:n]
    epochs = Epochs(datetime.datetime(2016, 12, 31, 23, 59, 55, tzinfo=UTC), np.arange(0.0, 10.0))
    position_m, velocity_m_s, error = propagate_many_in_teme([entry.satrec() for entry in sets], epochs)
    assert (position_m.shape, velocity_m_s.shape, error.shape) == ((n, 10, 3), (n, 10, 3), (n, 10))
    for k, entry in enumerate(sets):
        alone = propagate_in_teme(entry, epochs)
        np.testing.assert_array_equal(position_m[k], alone[0])
        np.testing.assert_array_equal(velocity_m_s[k], alone[1])
        np.testing.assert_array_equal(error[k], alone[2])


def test_none_of_either():
    epochs = Epochs(datetime.datetime(2017, 1, 1, tzinfo=UTC), np.zeros(0))
    assert propagate_many_in_teme([], epochs)[0].shape == (0, 0, 3)
    assert propagate_many_in_teme([low("17001.50000000").satrec()], epochs)[0].shape == (1, 0, 3)
    assert propagate_many_in_teme([], Epochs(epochs.start_utc, np.zeros(2)))[2].shape == (0, 2)


def test_every_code_of_the_library_has_words():
    from sgp4.api import SGP4_ERRORS

    assert set(REASONS) == set(SGP4_ERRORS)


def test_a_state_underground_or_beyond_the_moon_is_none():
    position_m = np.array([[7e6, 0, 0], [6e6, 0, 0], [2e9, 0, 0], [np.nan, 0, 0], [7e6, 0, 0]])
    velocity_m_s = np.ones((5, 3))
    assert find_failures(position_m, velocity_m_s, np.array([0, 0, 0, 0, 6])).tolist() == [
        False,
        True,
        True,
        True,
        True,
    ]


def test_the_turn_of_teme_is_skyfields_between_the_hours():
    """At odd minutes of a month: 1e-12 rad, a hundredth of a millimetre in geosynchronous orbit, and in that direction."""
    from skyfield.sgp4lib import TEME

    epochs = Epochs(datetime.datetime(2024, 9, 17, 12, 7, 13, tzinfo=datetime.UTC), np.linspace(0.0, 2.6e6, 23))
    theirs = TEME.rotation_at(epochs.skyfield_time())  # (3, 3, time), teme_from_gcrs
    np.testing.assert_allclose(gcrs_from_teme(epochs), theirs.transpose(2, 1, 0), atol=1e-12)
    assert np.abs(theirs[:, :, 0] - theirs[:, :, 0].T).max() > 1e-4  # its inverse is another
