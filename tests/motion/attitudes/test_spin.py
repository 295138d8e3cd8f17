import numpy as np
import pytest

from rso_lidar.errors import RsoLidarError
from rso_lidar.motion import Body, Fixed, Spin, load_spin_presets, truth
from rso_lidar.orbit import Epochs
from tests.orbit.earth.earth_for_tests import LOW, START


@pytest.mark.parametrize("direction", [(1.0, 2.0, -3.0), (0.0, 0.0, 5.0), (0.0, 0.0, -5.0), (1e-9, 0.0, -1.0)])
def test_the_axis_points_along_its_direction(direction):
    for axis in ((0.0, 0.0, 2.0), (1.0, 0.0, 0.0), (0.3, -0.5, 0.1)):
        rotation, rate = Spin(axis=axis, rate_deg_s=3.0, direction=direction).orientation(np.array([0.0, 17.0, 1e4]))
        pointed = rotation.apply(np.asarray(axis) / np.linalg.norm(axis))
        np.testing.assert_allclose(pointed, np.tile(direction / np.linalg.norm(direction), (3, 1)), rtol=0, atol=1e-12)
        np.testing.assert_allclose(np.degrees(np.linalg.norm(rate, axis=1)), 3.0)


def test_every_preset_flies_and_names_its_source():
    epochs = Epochs(START, np.arange(3.0))
    for name, table in load_spin_presets().items():
        spin = Spin(preset=name)
        assert spin.rate_deg_s == table["rate_deg_s"]
        assert "Sourced" in table["what"] and "Assumed" in table["what"] and "confidence" in table["what"]
        turned = truth([Body(name="a", motion=LOW, attitude=spin)], epochs).pose("inertial", "a").rotation
        assert turned[0].as_quat() != pytest.approx(turned[2].as_quat(), abs=1e-3)


def test_keys_beside_a_preset_replace_its_values():
    spin = Spin(preset="envisat_2013", rate_deg_s=1.0, quaternion_xyzw=(1.0, 0.0, 0.0, 0.0))
    assert (spin.rate_deg_s, spin.axes, spin.direction) == (1.0, "rtn", None)
    again = Spin.model_validate(spin.model_dump())
    assert again == spin


def test_bad_spins_are_one_line():
    for keys, message in (
        ({"preset": "envisat"}, "no rotation 'envisat'; did you mean"),
        ({"axis": (0, 0, 1), "rate_deg_s": 1.0, "direction": (0, 0, 0)}, "direction"),
        ({"axis": (0, 0, 1), "rate_deg_s": 1.0, "direction": (1, 0, 0), "quaternion_xyzw": (1, 0, 0, 0)}, "give one"),
        ({"axis": (0, 0, 1), "rate_deg_s": 1.0, "axes": "lvlh"}, "axes"),
    ):
        with pytest.raises(RsoLidarError, match=message):
            Spin(**keys)
    still = Body(name="a", motion=Fixed(position_m=(0, 0, 0)), attitude=Spin(preset="envisat_2013"))
    with pytest.raises(RsoLidarError, match="needs a body that orbits"):
        truth([still], Epochs(START, np.zeros(1)))
