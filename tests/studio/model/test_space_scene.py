"""Point clouds for a browser hold all returns, in each colour and in the axes of a target."""

import json
import struct

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.picture import LIGHT
from rso_lidar.studio.model.space_scene import draw_cloud


@pytest.fixture(scope="module")
def frame():
    """Return the last frame of the approach, with the probabilities of detection."""
    (made,) = rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml"), frames=[539], keep=("prediction",))
    return made


@pytest.mark.parametrize("colour", ["range", "intensity", "part", "probability"])
def test_a_cloud_has_all_returns(frame, colour):
    packed = draw_cloud(frame, LIGHT, colour, "tdrs")
    (length,) = struct.unpack("<I", packed[:4])
    (points, *_), count = json.loads(packed[4 : 4 + length])["items"], int(frame.valid.sum())
    assert points["count"] == count
    drawn = np.frombuffer(packed, "<f4", 3 * count, 4 + length).reshape(-1, 3)
    expected = frame.truth.pose("tdrs", "lidar").apply(frame.points_m[frame.valid].astype(float))
    apart = np.abs(np.ptp(drawn, axis=0) - np.ptp(expected, axis=0))
    assert np.all(apart < 2e-7 * np.ptp(expected, axis=0))  # float32; false triggers lie kilometres from the target


def test_the_chosen_pixel_is_marked_and_false_returns_are_dim(frame):
    row, col = (int(k) for k in np.argwhere(frame.labels.target >= 0)[500])
    packed, false = draw_cloud(frame, LIGHT, pixel=(row, col)), frame.labels.target[frame.valid] < 0
    (length,) = struct.unpack("<I", packed[:4])
    header, count = json.loads(packed[4 : 4 + length]), int(frame.valid.sum())
    (mark,) = (item for item in header["items"] if item.get("on_top"))
    label = next(one for one in header["labels"] if one["text"] == f"row {row}, column {col}")
    points = np.frombuffer(packed, "<f4", 3 * count, 4 + length).reshape(-1, 3)
    number = int(frame.valid.ravel()[: row * frame.valid.shape[1] + col].sum())
    np.testing.assert_allclose(label["at"], points[number], rtol=1e-6)
    assert mark["count"] == 1
    rgb = np.frombuffer(packed, np.uint8, 3 * count, 4 + length + 12 * count).reshape(-1, 3)
    assert 0 < false.sum() < 50
    assert rgb[false].min() >= 170 > rgb[~false].min()  # two thirds of white, and whatever the ramp has
