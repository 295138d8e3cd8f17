"""Images show each pixel where it is found again."""

import io

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import DARK, LIGHT, Scale, choose_window, find_target_returns, palette
from rso_lidar.records import Frame
from rso_lidar.studio.model.frame_image import (
    IMAGE_SIZE,
    draw_difference,
    draw_image,
    find_pixel,
    mark_pixel,
    outline_pixel,
)


@pytest.fixture(scope="module")
def frame() -> Frame:
    (made,) = rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml"), frames=[539])
    return made


@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_colour_of_a_pixel_is_that_of_its_range(frame: Frame, scheme: object) -> None:
    image = np.asarray(Image.open(io.BytesIO(draw_image(frame, scheme))))  # type: ignore[arg-type]
    assert image.shape[1::-1] == IMAGE_SIZE
    window, row, col = choose_window(frame), 70, 64
    x, y, side = mark_pixel(window, row, col)[0]
    expected = Scale.of_frames(frame).range_rgb(frame.range_m, 0.0)[row, col]
    assert np.abs(image[int(y + side / 2), int(x + side / 2)].astype(int) - expected).max() <= 1


def test_a_false_return_is_dim_in_both_panels(frame: Frame) -> None:
    image = np.asarray(Image.open(io.BytesIO(draw_image(frame, whole=True))), float)
    row, col = (int(k) for k in np.argwhere(frame.valid & (frame.labels.target < 0))[0])
    scale, window = Scale.of_frames(frame), choose_window(frame, whole=True)
    for (x, y, side), rgb, empty in zip(
        mark_pixel(window, row, col),
        (scale.range_rgb(frame.range_m, 0.0), scale.intensity_rgb(frame.intensity_counts)),
        ("#2e3036", "#000000"),
        strict=True,
    ):
        expected = (rgb[row, col] + 2.0 * np.array(palette.split_rgb(empty))) / 3.0
        assert np.abs(image[int(y + side / 2), int(x + side / 2)] - expected).max() <= 1.0


@pytest.mark.parametrize("whole", [True, False])
def test_a_marked_pixel_is_found_in_both_panels(frame: Frame, whole: bool) -> None:
    window = choose_window(frame, whole=whole)
    for x, y, side in mark_pixel(window, 70, 33):
        assert find_pixel(window, x + side / 2, y + side / 2) == (70, 33)
    assert find_pixel(window, 2.0, 2.0) is None


def test_a_difference_is_coloured_where_both_frames_report(frame: Frame) -> None:
    (other,) = rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml").replace(seed=2), frames=[539])
    image = np.asarray(Image.open(io.BytesIO(draw_difference(frame, other))))
    window, difference_m = choose_window(frame), np.asarray(other.range_m, float) - frame.range_m
    strength = {}
    known = np.where(np.abs(difference_m) < 1.0, difference_m, np.nan)
    for sign in (-1.0, 1.0):
        row, col = np.unravel_index(int(np.nanargmax(sign * known)), known.shape)
        x, y, side = mark_pixel(window, int(row), int(col))[0]
        red, _, blue = image[int(y + side / 2), int(x + side / 2)].astype(int)
        strength[sign] = red - blue
    assert strength[-1.0] * strength[1.0] < 0  # nearer and farther have opposite colours


def test_images_beside_each_other_show_the_returns_of_both(frame: Frame) -> None:
    (far,) = rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml"), frames=[300])
    window, scale = choose_window(frame, far), Scale.of_frames(frame, far)
    assert scale.low_m == Scale.of_frames(frame).low_m < scale.high_m == Scale.of_frames(far).high_m
    for shown, beside in ((frame, far), (far, frame)):
        image = np.asarray(Image.open(io.BytesIO(draw_image(shown, beside=beside))))
        row, col = (int(place[0]) for place in np.nonzero(find_target_returns(shown)))
        x, y, side = mark_pixel(window, row, col)[0]
        expected = scale.range_rgb(shown.range_m, 0.0)[row, col]
        assert np.abs(image[int(y + side / 2), int(x + side / 2)].astype(int) - expected).max() <= 1


def test_a_pixel_is_outlined_in_both_panels(frame: Frame) -> None:
    window = choose_window(frame)
    x, y, side = mark_pixel(window, 70, 33)[1]
    drawn = outline_pixel(window, 70, 33)
    assert drawn.count("<rect ") == 2
    assert f'<rect x="{x}" y="{y}" width="{side}"' in drawn
