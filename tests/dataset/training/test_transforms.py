"""Crops and clouds by hand."""

import numpy as np
import pytest

from rso_lidar.dataset.torch import CropReturns, PointCloud
from tests.dataset.training.frame_for_tests import F_PX, N, make_frame


def test_a_crop_that_enlarges_repeats_pixels():
    frame = {"range_m": np.full((40, 40), np.nan, "f4"), "intensity_counts": np.zeros((40, 40), "u2")}
    for row, col, range_m, counts in ((10, 20, 100.0, 9), (12, 21, 102.0, 99), (11, 22, 101.0, 0)):
        frame["range_m"][row, col], frame["intensity_counts"][row, col] = range_m, counts
    frame["range_m"][30, 3] = 500.0  # a false alarm far from the median
    image = CropReturns(size=10, margin_pixels=1, range_scale_m=2.0)(frame)["image"]
    assert image.dtype == np.float32 and image.shape == (3, 10, 10)
    small = np.zeros((5, 5))
    small[1, 1], small[3, 2], small[2, 3] = -0.5, 0.5, 0.0
    np.testing.assert_allclose(image[0], np.kron(small, np.ones((2, 2))), atol=1e-6)
    assert image[2].sum() == 3 * 4
    assert image[1].max() == pytest.approx(np.log(100.0))


def test_a_crop_that_reduces_takes_means():
    range_m = np.full((64, 64), 50.0, "f4")
    range_m[:, 1::2] = 52.0
    frame = {"range_m": range_m, "intensity_counts": np.full((64, 64), 7, "u2")}
    image = CropReturns(size=33, margin_pixels=1)(frame)["image"]
    np.testing.assert_allclose(image[0, 1:-1, 1:-1], 0.0, atol=1.01)
    assert image[0, image[2] > 0].mean() == pytest.approx(0.0, abs=0.05)
    np.testing.assert_allclose(image[1, image[2] > 0], np.log(8.0), rtol=1e-6)
    empty = {"range_m": np.full((8, 8), np.nan, "f4"), "intensity_counts": np.zeros((8, 8), "u2")}
    assert not CropReturns(size=4)(empty)["image"].any()


def test_place_and_range_do_not_show_in_a_crop():
    frame = make_frame(noisy=False)
    frame["range_m"][2, 3] = frame["range_m"][14, 18] = np.nan
    moved = {name: np.roll(frame[name], (5, -9), axis=(0, 1)) for name in ("range_m", "intensity_counts")}
    moved["range_m"] = moved["range_m"] + 250.0
    one, two = (CropReturns(size=24)(dict(given))["image"] for given in (frame, moved))
    np.testing.assert_allclose(one, two, atol=1e-4)


def test_a_cloud_is_that_of_the_lines_of_sight():
    row, col = np.mgrid[:N, :N]
    sight = np.stack([(col - 15.5) / F_PX, (row - 15.5) / F_PX, np.ones((N, N))], axis=-1)
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    frame = make_frame()
    found = PointCloud((sight,), points=500)(dict(frame))
    seen = np.isfinite(frame["range_m"]) & (frame["range_m"] > 400.0)
    wanted = frame["range_m"][seen][:, None] * sight[seen]
    assert found["returns"] == len(wanted)
    np.testing.assert_allclose(found["center_m"], wanted.mean(axis=0), rtol=1e-6)
    cloud = found["cloud_m"] + found["center_m"]
    np.testing.assert_allclose(cloud[: len(wanted)], wanted, atol=1e-3)
    np.testing.assert_array_equal(cloud[len(wanted) :], cloud[: 500 - len(wanted)])
    few = PointCloud((sight,), points=50)(dict(frame))["cloud_m"]
    assert len(np.unique(few, axis=0)) == 50
    none = PointCloud((sight,), points=8)(dict(frame) | {"range_m": np.full((N, N), np.nan, "f4")})
    assert none["returns"] == 0 and not none["cloud_m"].any()
