"""Images of cameras on a screen: noise stays dark, the light of targets spans the screen, and colours keep their ratios."""

from types import SimpleNamespace

import numpy as np
import pytest

from rso_lidar.picture import Stretch

SCENARIO = '[[camera]]\nname = "nav"\nsensor = { black_level_counts = 64 }\n'
NOISE = 3.0


def make_frame(light, scenario=SCENARIO):
    """Return what a stretch reads of a frame whose camera has light (row, col, band) [counts] above its black level."""
    noise = np.random.default_rng(4).normal(64.0, NOISE, light.shape)
    counts = np.clip((light + noise).round(), 0, 4095).astype(np.uint16)
    source = SimpleNamespace(scenario=scenario)
    return SimpleNamespace(camera={"nav": SimpleNamespace(intensity_counts=counts)}, source=source)


def test_an_image_of_noise_is_dark():
    frame = make_frame(np.zeros((64, 64, 1)))
    values = Stretch.of("nav", frame).paint(frame.camera["nav"].intensity_counts)
    assert np.median(values) == 0 and (values > 128).mean() < 0.001


def test_a_small_target_among_dark_pixels_spans_the_screen_and_keeps_its_colour():
    light = np.zeros((256, 256, 3))
    light[100:110, 100:110] = np.array([1600.0, 800.0, 400.0])  # 0.15 % of the pixels
    frame = make_frame(light)
    stretch = Stretch.of("nav", frame)
    assert stretch.low_counts == pytest.approx(64 + 2 * NOISE, rel=0.05)
    assert stretch.high_counts == pytest.approx(64 + 1600, rel=0.02)
    rgb = stretch.paint(frame.camera["nav"].intensity_counts)
    middle = rgb[100:110, 100:110].reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(middle / middle[0], [1.0, 0.5 ** (1 / 2.2), 0.25 ** (1 / 2.2)], rtol=0.02)
    blue = stretch.paint(frame.camera["nav"].intensity_counts, 2)
    np.testing.assert_array_equal(blue, np.repeat(rgb[..., 2:], 3, axis=2))


def test_several_images_share_a_stretch_and_a_scenario_without_a_sensor_has_black_at_zero():
    faint, bright = (make_frame(np.full((16, 16, 1), level)) for level in (100.0, 3000.0))
    alone, shared = Stretch.of("nav", faint), Stretch.of("nav", faint, bright)
    assert shared.high_counts == Stretch.of("nav", bright).high_counts > 10 * alone.high_counts
    unknown = Stretch.of("nav", make_frame(np.full((16, 16, 1), 100.0), "[other]\n"))
    assert unknown.low_counts == 2.0  # twice a noise of at least one count
