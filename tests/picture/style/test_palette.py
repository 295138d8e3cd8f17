"""Contrast against the background, and distance of colours as people with colour blindness see them."""

from itertools import combinations

import numpy as np
import pytest

from rso_lidar.picture import DARK, LIGHT
from rso_lidar.picture.style.colour_maps import AMOUNT_RAMP, ERROR_RAMP, INTENSITY_RAMP, RANGE_RAMP, ramp
from rso_lidar.picture.style.palette import ALARM_SHADE, NO_RETURN, OKABE_ITO, PARTS, SHADE, choose_ink, split_rgb

SCHEMES = pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=["light", "dark"])

# Machado, Oliveira and Fernandes (2009), IEEE Trans. Vis. Comput. Graph. 15, table of severity 1.0, on linear RGB.
SEEN_BY = {
    "all": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ_FROM_RGB = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = np.array([0.95047, 1.0, 1.08883])  # D65


def linear_rgb(colour):
    """Return linear RGB of a colour, a text or bytes (IEC 61966-2-1)."""
    value = np.asarray(split_rgb(colour) if isinstance(colour, str) else colour) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def contrast(one, other):
    """Return the contrast of two colours, 1 to 21 (WCAG 2.2)."""
    low, high = sorted(float(linear_rgb(colour) @ XYZ_FROM_RGB[1]) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def lab(linear):
    """Return CIE L*a*b* of linear RGB (…, rgb)."""
    ratio = np.clip(linear, 0.0, 1.0) @ np.transpose(XYZ_FROM_RGB) / WHITE
    f = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def nearest(colours, eye):
    """Return the least distance between two of some colours as an eye sees them."""
    seen = [lab(np.asarray(SEEN_BY[eye]) @ linear_rgb(colour)) for colour in colours]
    return min(float(np.linalg.norm(one - other)) for one, other in combinations(seen, 2))


def test_contrast_is_that_of_the_guideline():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # the well-known grey that just fails


@SCHEMES
def test_text_can_be_read(scheme):
    for background in (scheme.paper, scheme.shade, scheme.alarm_shade):
        assert contrast(scheme.ink, background) >= 7.0
        assert contrast(scheme.quiet, background) >= 4.5


@SCHEMES
def test_lines_stand_out(scheme):
    assert {c for c in (*scheme.lines, scheme.mark, scheme.rule) if contrast(c, scheme.paper) < 3.0} == set()


@SCHEMES
@pytest.mark.parametrize("eye", SEEN_BY)
def test_lines_are_told_apart(scheme, eye):
    """Two units are just noticeable side by side; ten are seen at a glance (CIE 1976)."""
    assert nearest((*scheme.lines, scheme.ink), eye) >= 10.0


def test_the_measure_finds_colours_that_are_confused():
    """Okabe and Ito's orange, darkened without care, is their vermilion for the most frequent colour blindness."""
    pair = ("#b87c00", "#d55e00")
    assert nearest(pair, "deuteranopia") < 10.0 < nearest(pair, "all")


def test_the_dark_scheme_and_the_parts_are_published_colours():
    assert DARK.lines == OKABE_ITO == PARTS[:6]


def test_a_scheme_can_be_exchanged_for_the_other():
    """No colour has two roles, and no dark colour is a light one of another role, so that twice dark is dark."""
    assert len(set(LIGHT.all)) == len(LIGHT.all)
    changed = dict(zip(LIGHT.all, DARK.all, strict=True))
    assert all(changed.get(colour, colour) == colour for colour in DARK.all)
    assert not {*PARTS, NO_RETURN} & set(LIGHT.all)
    assert LIGHT.all[5:7] == (SHADE, ALARM_SHADE)


@pytest.mark.parametrize("name", [RANGE_RAMP, AMOUNT_RAMP, INTENSITY_RAMP])
def test_maps_of_amounts_are_uniform(name):
    """Lightness grows all along, and no step of a tenth is more than 2.5 times another."""
    lightness = lab(linear_rgb(ramp(name)))[:, 0]
    steps = np.diff(lightness[np.linspace(0, 255, 11).astype(int)])
    assert (steps > 0).all()
    assert steps.max() < 2.5 * steps.min()


def test_the_map_of_errors_is_lightest_at_zero():
    lightness = lab(linear_rgb(ramp(ERROR_RAMP)))[:, 0]
    assert (np.diff(lightness[:126]) > 0).all()
    assert (np.diff(lightness[130:]) < 0).all()
    assert abs(lightness[0] - lightness[-1]) < 10.0


@pytest.mark.parametrize("name", [RANGE_RAMP, AMOUNT_RAMP, ERROR_RAMP])
def test_no_return_is_on_no_map(name):
    apart = np.linalg.norm(lab(linear_rgb(ramp(name))) - lab(linear_rgb(NO_RETURN)), axis=-1)
    assert apart.min() > 10.0


@pytest.mark.parametrize("name", [RANGE_RAMP, AMOUNT_RAMP])
def test_numbers_on_a_map_can_be_read(name):
    assert min(contrast(choose_ink(tuple(step / 255)), step) for step in ramp(name)) >= 4.4
