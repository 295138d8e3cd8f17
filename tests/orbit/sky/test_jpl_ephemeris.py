"""Against skyfield, with the day of DE430 that skyfield's own tests contain, and against the built-in series."""

import datetime
from pathlib import Path

import numpy as np
import pytest
import skyfield

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit import Epochs, JplEphemeris, angle_rad, moon_position_m, sun_position_m

KERNEL = Path(skyfield.__file__).parent / "tests" / "data" / "de430-2015-03-02.bsp"
EPOCHS = Epochs(datetime.datetime(2015, 3, 2, 1, tzinfo=datetime.UTC), np.linspace(0.0, 70_000.0, 11))


@pytest.fixture(scope="module")
def kernel():
    if not KERNEL.exists():
        pytest.skip("this skyfield has no day of DE430 among its tests")
    return JplEphemeris(KERNEL)


def test_geometric_positions_are_skyfields(kernel):
    from skyfield.jpllib import SpiceKernel

    spice = SpiceKernel(str(KERNEL))
    for body in ("sun", "moon"):
        expected = (spice[body] - spice["earth"]).at(EPOCHS.skyfield_time()).position.m.T
        np.testing.assert_array_equal(kernel.position_m(body, EPOCHS, light_time=False), expected)
    spice.close()


def test_apparent_positions_are_skyfields(kernel):
    from skyfield.jpllib import SpiceKernel

    spice = SpiceKernel(str(KERNEL))
    earth = spice["earth"].at(EPOCHS.skyfield_time())
    for body, most_arcsec in (("sun", 0.005), ("moon", 0.005)):  # second order of v / c, and light bent by the Sun
        expected = earth.observe(spice[body]).apparent(deflectors=()).position.m.T
        turned = angle_rad(kernel.position_m(body, EPOCHS), expected)
        assert turned.max() < most_arcsec * units.ARCSEC
    spice.close()


def test_the_built_in_series_are_as_near_as_they_say(kernel):
    assert angle_rad(sun_position_m(EPOCHS), kernel.position_m("sun", EPOCHS)).max() < 0.0105 * units.DEG
    moon = kernel.position_m("moon", EPOCHS)
    assert angle_rad(moon_position_m(EPOCHS), moon).max() < 18.0 * units.ARCSEC
    assert np.abs(np.linalg.norm(moon_position_m(EPOCHS), axis=1) - np.linalg.norm(moon, axis=1)).max() < 32e3


def test_an_epoch_has_the_same_bits_among_many(kernel):
    many = kernel.position_m("moon", EPOCHS)
    np.testing.assert_array_equal(kernel.position_m("moon", EPOCHS.at(slice(4, 5)))[0], many[4])


def test_bad_input_is_told(kernel, tmp_path):
    assert {"sun", "moon", "earth"} <= set(kernel.bodies)
    with pytest.raises(ScenarioError, match="has no body 'moo'; did you mean 'moon'"):
        kernel.position_m("moo", EPOCHS)
    late = Epochs(EPOCHS.start_utc, np.array([0.0, 1e9]))
    with pytest.raises(
        PropagationError, match="does not cover 1 of 2 epochs: it spans 2015-02-26 to 2015-03-06"
    ) as caught:
        kernel.position_m("sun", late)
    assert caught.value.bad.tolist() == [False, True]
    (tmp_path / "a.bsp").write_bytes(b"no kernel" * 500)
    for path, message in (
        (tmp_path / "none.bsp", "no such file"),
        (tmp_path / "a.bsp", "is not a kernel"),
        (tmp_path, "is a folder; give a kernel"),
    ):
        with pytest.raises(ScenarioError, match=message):
            JplEphemeris(path)
