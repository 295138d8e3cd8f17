"""The dark scheme in figures: every kind of artist takes it, and what is drawn on images does not."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Patch

from rso_lidar.picture import DARK, LIGHT, curve_figure, frame_figure, orbit_figure, recolour, save_figure
from rso_lidar.picture.style.figures import draw_legend, new_figure, style_axes, style_bar
from rso_lidar.picture.style.palette import BLUE, GRID, IMAGE_WHITE, INK, PAPER, PARTS, QUIET, RED, RULE, split_rgb

# Colours that a dark figure must not show on its page: those of the light one that the dark one has not.
LIGHT_ALONE = {*LIGHT.all, "#000000"} - set(DARK.all)


def shown_colours(figure):
    """Return the colours of the texts, lines and patches of a figure, drawn first, so that all ticks are made."""
    figure.canvas.draw()
    found = set()
    for artist in figure.findobj():
        for name in ("color", "facecolor", "edgecolor", "markerfacecolor", "markeredgecolor"):
            value = getattr(artist, f"get_{name}", lambda: None)()
            if isinstance(value, (str, tuple)) and len(value) and value not in ("none", "auto", "face"):
                colour = to_hex(value, keep_alpha=True)
                if not colour.endswith("00"):
                    found.add(colour[:7])
    return found


def example():
    figure = new_figure(6.0, 4.0, "Title", "note", ("small print",))
    axes = figure.subplots()
    axes.plot([1, 2, 3], [1, 3, 2], "o-", color=BLUE, mec=PAPER, label="line")
    axes.errorbar([1, 2], [1, 2], [0.1, 0.2], color=RED, capsize=2)
    axes.fill_between([1, 2], [0, 1], [1, 2], color=BLUE, alpha=0.2)
    axes.axhline(2.0, color=RULE)
    axes.annotate("word", (1, 1), (2, 2), color=INK, arrowprops={"arrowstyle": "->", "color": QUIET},
                  bbox={"facecolor": PAPER, "edgecolor": "none"})  # fmt: skip
    axes.scatter([1, 2], [1, 2], c=[0.0, 1.0], cmap="viridis", edgecolors=INK)
    style_bar(figure.colorbar(axes.images[0] if axes.images else axes.collections[-1], ax=axes), "bar [m]")
    style_axes(axes, "heading", "x [s]", "y [m]", "note")
    draw_legend(axes)
    return figure


def test_no_light_colour_stays_on_the_page():
    figure = example()
    assert shown_colours(figure) & LIGHT_ALONE  # else this test sees nothing
    recolour(figure, DARK)
    assert not shown_colours(figure) & LIGHT_ALONE
    axes = figure.axes[0]
    assert to_hex(figure.get_facecolor()) == DARK.paper
    assert to_hex(axes.lines[0].get_color()) == DARK.lines[0]
    assert to_hex(axes.texts[0].get_bbox_patch().get_facecolor()) == DARK.paper
    assert to_hex(axes.texts[0].arrow_patch.get_edgecolor()) == DARK.quiet
    assert {to_hex(edge) for edge in axes.collections[-1].get_edgecolor()} == {DARK.ink}
    assert to_hex(axes.get_xgridlines()[0].get_color()) == DARK.grid


def test_transparency_stays():
    figure = example()
    filled = figure.axes[0].collections[1]
    recolour(figure, DARK)
    assert np.allclose(filled.get_facecolor()[0], [*(value / 255 for value in split_rgb(DARK.lines[0])), 0.2])


def test_twice_is_once_and_light_is_nothing():
    figure = example()
    before = shown_colours(figure)
    recolour(figure, LIGHT)
    assert shown_colours(figure) == before
    recolour(figure, DARK)
    once = shown_colours(figure)
    recolour(figure, DARK)
    assert shown_colours(figure) == once


@pytest.mark.parametrize("draw", [curve_figure, orbit_figure, lambda frames: frame_figure(frames[-1])])
def test_figures_of_frames_are_dark_all_over(coming, draw):
    figure = draw(list(coming))
    recolour(figure, DARK)
    assert not shown_colours(figure) & LIGHT_ALONE


def test_images_and_their_legends_keep_their_colours(coming):
    light, dark = frame_figure(coming[-1]), frame_figure(coming[-1])
    recolour(dark, DARK)

    def parts(figure):
        return {to_hex(patch.get_facecolor()) for patch in figure.findobj(Patch)} & set(PARTS)

    assert parts(dark) == parts(light) != set()
    assert IMAGE_WHITE in shown_colours(dark)  # the scale bar


def test_a_saved_figure_has_the_background_of_its_scheme(tmp_path):
    from PIL import Image

    for scheme in (LIGHT, DARK):
        figure = new_figure(2.0, 2.0, "a")
        figure.subplots().grid(color=GRID)
        with Image.open(save_figure(figure, tmp_path / "a.png", scheme=scheme)) as picture:
            assert picture.convert("RGB").getpixel((1, picture.height - 2)) == split_rgb(scheme.paper)
