"""The style as defaults of matplotlib: plain plots are drawn in it, and figures of the package do not change."""

import io

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgba_array
from matplotlib.figure import Figure

from rso_lidar import picture
from rso_lidar.picture import DARK, LIGHT
from rso_lidar.picture.style.colour_maps import RANGE_RAMP
from rso_lidar.picture.style.defaults import make_rc_params
from rso_lidar.picture.style.figures import LINE_PT, SMALL_PT, TEXT_PT


@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_a_plain_plot_is_drawn_in_the_style(scheme):
    with matplotlib.rc_context(make_rc_params(scheme)):
        figure = Figure()
        axes = figure.subplots()
        curves = [axes.plot([0, 1], label="curve")[0] for _ in range(len(scheme.lines))]
        level = axes.axhline(0.5)
        legend = axes.legend()
        axes.set_xlabel("time [s]")
        figure.canvas.draw()
    assert tuple(to_hex(curve.get_color()) for curve in curves) == scheme.lines
    assert {curve.get_linewidth() for curve in curves} == {LINE_PT}
    assert level.get_color() == scheme.rule  # no curve
    assert to_hex(figure.get_facecolor()) == to_hex(axes.get_facecolor()) == scheme.paper
    assert (axes.xaxis.label.get_fontsize(), axes.get_xticklabels()[0].get_fontsize()) == (TEXT_PT, SMALL_PT)
    assert axes.get_xticklabels()[0].get_color() == scheme.quiet
    assert to_hex(to_rgba_array(legend.get_texts()[0].get_color())[0]) == scheme.quiet
    assert not legend.get_frame_on()
    assert [side for side, spine in axes.spines.items() if spine.get_visible()] == ["left", "bottom"]


def test_an_image_has_the_ramp_of_range_and_no_grid():
    with matplotlib.rc_context(make_rc_params()):
        axes = Figure().subplots()
        shown = axes.imshow(np.eye(3))
        lines = axes.xaxis.get_gridlines()
    assert (shown.get_cmap().name, shown.get_interpolation()) == (RANGE_RAMP, "nearest")
    assert not any(line.get_visible() for line in lines)


def save(draw):
    """Return the bytes of a figure."""
    with io.BytesIO() as held:
        draw().savefig(held, format="png", dpi=50)
        return held.getvalue()


@pytest.mark.parametrize(
    "draw",
    [
        lambda frames: picture.frame_figure(frames[-1]),
        picture.curve_figure,
        picture.angles_figure,
        picture.orbit_figure,
    ],
    ids=["frame", "curve", "angles", "orbit"],
)
def test_figures_of_the_package_look_the_same(coming, draw):
    plain = save(lambda: draw(coming))
    with matplotlib.rc_context(make_rc_params()):
        assert save(lambda: draw(coming)) == plain
