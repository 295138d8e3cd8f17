"""Images show each pixel where it is found again."""

import io

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import DARK, LIGHT
from rso_lidar.records import Frame
from rso_lidar.studio.preview.images import IMAGE_SIZE, choose_scale, choose_window, draw_image, find_pixel, mark_pixel
from rso_lidar.studio.preview.pixels import report_pixel
from rso_lidar.studio.preview.space import draw_cloud


@pytest.fixture(scope="module")
def frame() -> Frame:
    (made,) = rl.simulate(
        rl.Scenario.load("examples/tdrs_approach.toml"), frames=[539], keep=("waveforms", "taps", "prediction")
    )
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


def test_the_reported_pulse_lies_on_the_samples(frame: Frame) -> None:
    lidar = rl.Scenario.load("examples/tdrs_approach.toml").instrument
    row, col = np.unravel_index(int(frame.intensity_counts.argmax()), frame.valid.shape)
    report = report_pixel(frame, lidar, (int(row), int(col)))
    samples, pulse = report.curves["samples"], report.curves["reported pulse"]
    fitted = np.interp(samples[:, 0], pulse[:, 0], pulse[:, 1])
    assert np.abs(fitted - samples[:, 1]).max() < 0.1 * np.ptp(samples[:, 1])
    assert report.instants_ns["trigger"] < report.instants_ns["reported"] + 20.0


@pytest.mark.parametrize("colour", ["range", "intensity", "part", "probability"])
def test_a_cloud_has_all_returns(frame: Frame, colour: str) -> None:
    assert f'"count": {int(frame.valid.sum())}' in draw_cloud(frame, LIGHT, colour, "tdrs").decode("latin-1")
