"""The figure of a link budget: every curve on every plot, and its greatest range marked and named."""

import itertools

import numpy as np
import pytest

from rso_lidar.mission_analysis.budgets.budget_figure import Line, budget_figure

RANGE_M = np.geomspace(100.0, 5000.0, 31)


def line(name, max_range_m=2000.0, photons=1e9, armed=False):
    light = photons / RANGE_M**2
    return Line(
        name,
        RANGE_M,
        light,
        (RANGE_M < max_range_m) * 1.0,
        0.05 + 1 / np.sqrt(light + 1),
        1e8 / RANGE_M**2,
        max_range_m,
        armed,
    )


def drawn(figure):
    """Return how many curves and how many marks stand on each plot."""
    lines = [axes.get_lines() for axes in figure.axes]
    marks = [sum(one.get_marker() == "o" for one in each) for each in lines]
    return [sum(len(one.get_xdata()) == len(RANGE_M) for one in each) for each in lines], marks


def test_curves_marks_and_names():
    figure = budget_figure([line("near", 700.0), line("far", 5000.0, armed=True)], "Budget", "note", 0.95, ("armed",))
    assert drawn(figure) == ([2, 2, 2, 2], [2, 2, 0, 2])
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["near: 700 m", "far: 5 km (end of the armed window)"]
    figure.canvas.draw()


def test_a_curve_that_is_never_seen_is_drawn_without_a_mark():
    figure = budget_figure([line("dark", float("nan"), photons=0.0), line("outside", 9000.0)], "Budget", "", 0.5)
    assert drawn(figure)[1] == [0, 0, 0, 0]
    assert figure.legends[0].get_texts()[0].get_text() == "dark: never"
    figure.canvas.draw()


def test_nothing_to_see_is_drawn_all_the_same():
    figure = budget_figure([line("dark", float("nan"), photons=0.0)], "Budget", "", 0.5)
    figure.canvas.draw()
    assert drawn(figure) == ([1, 1, 1, 1], [0, 0, 0, 0])


@pytest.mark.parametrize("count", [1, 5, 12])
def test_names_stand_below_the_plots_and_above_the_small_print(count):
    figure = budget_figure(
        [line(f"curve {k}", 500.0 + 100 * k) for k in range(count)], "Budget", "note", 0.9, ("a", "b")
    )
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    lowest = min(axes.get_tightbbox().y0 for axes in figure.axes)
    prints = [text for text in figure.texts if text.get_text() in ("a", "b")]
    assert len(prints) == 2
    assert box.y1 <= lowest
    assert max(text.get_window_extent().y1 for text in prints) <= box.y0 + 2
    # The names stand close under the plots: nothing but the labels of the axes lies between.
    assert lowest - box.y1 < 0.3 * figure.dpi


@pytest.mark.parametrize(("near_m", "far_m"), [(900.0, 1000.0), (1.0, 1e5), (2000.0, 9000.0), (0.5, 0.50001)])
def test_every_axis_carries_three_numbers_at_least(near_m, far_m):
    range_m = np.geomspace(near_m, far_m, 9)
    curve = Line("a", range_m, 1e9 / range_m**2, np.ones(9), np.full(9, 0.05), 1e4 / range_m**2, np.nan, False)
    figure = budget_figure([curve], "Budget", "note", 0.9)
    figure.canvas.draw()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [
                text
                for at, text in zip(axis.get_majorticklocs(), axis.get_ticklabels(), strict=True)
                if low <= at <= high
            ]
            assert len({text.get_text() for text in ticks}) >= 3, (axes.get_title(loc="left"), axis.axis_name)
            boxes = [text.get_window_extent() for text in ticks]
            assert not any(a.overlaps(b) for a, b in itertools.pairwise(boxes))


def test_beyond_what_the_target_fills_a_curve_is_faint():
    """The full line ends at 700 m, and a faint one goes on; without a target the line goes on."""
    whole = line("a", 700.0)
    limited = Line(**{**vars(whole), "fill_limits": True, "filled_to_m": 700.0})
    figure = budget_figure([limited], "Budget", "note", 0.9)
    full = [
        one for one in figure.axes[0].get_lines() if one.get_alpha() is None and len(one.get_xdata()) == len(RANGE_M)
    ]
    assert [float(np.max(one.get_xdata()[np.isfinite(one.get_ydata())])) for one in full] == [
        RANGE_M[RANGE_M <= 700.0].max()
    ]
    assert [one.get_alpha() for one in figure.axes[0].get_lines()].count(0.3) == 1
    assert figure.legends[0].get_texts()[0].get_text() == "a: 700 m (fills a pixel no farther)"
    assert 0.3 not in [one.get_alpha() for one in budget_figure([whole], "Budget", "", 0.9).axes[0].get_lines()]
