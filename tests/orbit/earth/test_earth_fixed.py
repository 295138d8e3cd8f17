"""Tabulated Earth-fixed axes against the rotation that they tabulate."""

import numpy as np
import pytest

from rso_lidar.orbit import EarthOrientation, Epochs, itrs_from_gcrs
from rso_lidar.orbit.earth.earth_fixed import EarthFixedAxes
from tests.orbit.earth.earth_for_tests import START, finals


@pytest.mark.parametrize("has_pole", [False, True])
def test_the_table_follows_the_rotation_of_the_earth(tmp_path, has_pole):
    orientation = None
    if has_pole:
        (tmp_path / "finals").write_text(finals(range(60_560, 60_580), 0.2, 0.4, 0.03))
        orientation = EarthOrientation.from_file(tmp_path / "finals")
    times = np.random.default_rng(1).uniform(-86_400.0, 172_800.0, 200)
    got = np.array([EarthFixedAxes(START, orientation)(time_s) for time_s in times.tolist()])
    # 1e-10 radian is a millimetre on the ground
    np.testing.assert_allclose(got, itrs_from_gcrs(Epochs(START, times), orientation), rtol=0, atol=1e-10)


def test_an_instant_has_the_same_bits_whatever_was_requested_before():
    times = [12_345.6, -50.0, 86_400.0, 12_345.6]
    axes = EarthFixedAxes(START)
    assert [axes(time_s) for time_s in times] == [EarthFixedAxes(START)(time_s) for time_s in times]
