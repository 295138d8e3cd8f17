"""SGP4 in TEME axes: error codes, impossible states, and the rotation to GCRS."""

import datetime

import numpy as np

from rso_lidar.orbit import Epochs, gcrs_from_teme
from rso_lidar.orbit.sets.teme import REASONS, find_failures


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
