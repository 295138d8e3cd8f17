"""Sizes of text at printed width, and the page of a figure."""

from hypothesis import given
from hypothesis import strategies as st

from rso_lidar.picture.style.figures import (
    LANDSCAPE_IN,
    PAGE_IN,
    SMALL_PT,
    TEXT_PT,
    colour_of,
    log_ticks,
    new_figure,
    round_down,
    round_up,
)
from rso_lidar.picture.style.palette import LINES

MM_PER_IN = 25.4


def test_no_text_is_under_seven_points_when_printed():
    """A page of A4 with margins of 10 mm is 190 mm wide, and a landscape one with margins of 28 mm 240 mm."""
    for width_in, printed_mm in ((PAGE_IN, 190.0), (LANDSCAPE_IN, 240.0)):
        assert min(SMALL_PT, TEXT_PT) * printed_mm / (width_in * MM_PER_IN) >= 7.0


def test_a_heading_too_long_for_its_figure_is_shortened():
    (title, *_) = new_figure(4.0, 2.0, "word " * 40).texts
    assert title.get_text().endswith("…")
    assert title.get_window_extent().width <= 400


def test_curves_differ_in_colour_first_and_then_in_style():
    looks = [colour_of(k) for k in range(3 * len(LINES))]
    assert [colour for colour, _ in looks[: len(LINES)]] == list(LINES)
    assert len({(colour, str(style)) for colour, style in looks}) == 3 * len(LINES)


@given(st.floats(1e-6, 1e9))
def test_nice_numbers_bracket_a_value_closely(value):
    assert value * (1 - 1e-6) <= round_up(value) <= 1.5 * value * (1 + 1e-6)
    assert value / 2.5 * (1 - 1e-6) <= round_down(value) <= value * (1 + 1e-6)


def test_nice_up_of_nothing_is_one():
    assert round_up(0.0) == round_up(float("nan")) == 1.0


def test_many_decades_have_powers_of_ten_as_labels_and_few_have_numbers():
    axes = new_figure(4.0, 3.0, "decades").subplots()
    labels = {}
    for decades in (3, 5, 6):
        axes.set_xscale("log")
        axes.set_xlim(1.0, 10.0**decades)
        log_ticks(axes.xaxis, 1.0, 10.0**decades)
        labels[decades] = axes.xaxis.get_major_formatter()(100.0, 0)
    assert labels[3] == labels[5] == "100" and "10^{2}" in labels[6]
