"""Images show each pixel where it is found again."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import DARK, LIGHT
from rso_lidar.records import Frame, Reading
from rso_lidar.studio.model.frame_image import (
    IMAGE_SIZE,
    choose_scale,
    choose_window,
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
    expected = choose_scale(frame).range_rgb(frame.range_m, 0.0)[row, col]
    assert np.abs(image[int(y + side / 2), int(x + side / 2)].astype(int) - expected).max() <= 1


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


@pytest.fixture(scope="module")
def pair(handmade) -> tuple[Frame, Frame]:
    """A frame with 8 weak returns near 900 m, and one with 391 returns from 1000 to 1010 m of up to 4000 counts."""
    seen = handmade.make_frame(labelled=False)
    frames = []
    for top, count, across, ends_m, ends_counts in (
        (16, 8, 4, (900.0, 900.7), (20, 27)),
        (96, 391, 20, (1000.0, 1010.0), (100, 4000)),
    ):
        range_m, counts = np.full((128, 128), np.nan), np.zeros((128, 128))
        at = divmod(np.arange(count), across)
        place = at[0] + top, at[1] + top
        range_m[place], counts[place] = np.linspace(*ends_m, count), np.linspace(*ends_counts, count)
        reading = Reading(range_m=range_m, intensity_counts=counts, saturated=np.zeros((128, 128), bool))
        frames.append(replace(seen, observation=replace(seen.observation, reading=reading)))
    return frames[0], frames[1]


def test_the_scale_of_two_frames_spans_both(pair: tuple[Frame, Frame]) -> None:
    weak, strong = pair
    scale = choose_scale(weak, strong)
    # Percentiles of even steps: 900 m + 1 % of 0.7 m, 1000 m + 99 % of 10 m; 20 + 2 % of 7, 100 + 99.5 % of 3900 counts.
    assert (scale.low_m, scale.high_m) == pytest.approx((900.007, 1009.9), abs=1e-3)
    assert (scale.low_counts, scale.high_counts, scale.logarithmic) == (20.0, 3981.0, True)
    assert choose_scale(strong, weak) == scale
    assert choose_scale(weak).high_m == pytest.approx(900.693, abs=1e-3)


def test_eight_weak_returns_leave_the_other_frame_its_colours(pair: tuple[Frame, Frame]) -> None:
    weak, strong = pair
    alone, both = choose_scale(weak), choose_scale(weak, strong)
    colours = [len(np.unique(scale.range_rgb(strong.range_m, 0.0)[strong.valid], axis=0)) for scale in (alone, both)]
    assert colours == [1, 24]  # 9.9 of 109.9 m of a ramp of 256 are 23 steps
    assert alone.intensity_fraction(strong.intensity_counts[strong.valid]).min() > 1.0  # all of it white
    faintest, brightest = both.intensity_fraction(np.array([100.0, 3981.0]))
    assert (faintest, brightest) == pytest.approx((np.log(100 / 20) / np.log(3981 / 20), 1.0))


def test_images_beside_each_other_show_the_returns_of_both(pair: tuple[Frame, Frame]) -> None:
    weak, strong = pair
    window = choose_window(weak, strong)
    assert (window.top, window.left, window.bottom, window.right) == (0, 0, 128, 128)
    images = [np.asarray(Image.open(io.BytesIO(draw_image(a, beside=b)))) for a, b in ((weak, strong), (strong, weak))]
    for image, one, row, col in ((images[0], weak, 16, 16), (images[1], strong, 96, 96)):
        x, y, side = mark_pixel(window, row, col)[0]
        expected = choose_scale(weak, strong).range_rgb(one.range_m, 0.0)[row, col]
        assert np.abs(image[int(y + side / 2), int(x + side / 2)].astype(int) - expected).max() <= 1


def test_a_pixel_is_outlined_in_both_panels(frame: Frame) -> None:
    window = choose_window(frame)
    x, y, side = mark_pixel(window, 70, 33)[1]
    drawn = outline_pixel(window, 70, 33)
    assert drawn.count("<rect ") == 2
    assert f'<rect x="{x}" y="{y}" width="{side}"' in drawn
