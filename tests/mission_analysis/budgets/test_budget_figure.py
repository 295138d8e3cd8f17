"""The figure of a link budget: every curve on every plot, and its greatest range marked and named."""

import itertools

import numpy as np
import pytest

from rso_lidar.mission_analysis import BudgetCurve
from rso_lidar.mission_analysis.budgets.budget_figure import budget_figure

RANGE_M = np.geomspace(100.0, 5000.0, 31)


def curve(range_m, photons, max_range_m, *, seen=None, precision_m=None, pixels=None, armed=False, fills=True):
    none = np.zeros(len(range_m))
    return BudgetCurve(
        material="a",
        tilt_deg=0.0,
        divergence_deg=1.0,
        range_m=range_m,
        photons=photons,
        fill_fraction=none,
        detection_probability=(range_m < max_range_m) * 1.0 if seen is None else seen,
        range_precision_m=0.05 + 1 / np.sqrt(photons + 1) if precision_m is None else precision_m,
        snr=none,
        saturated=none > 0.0,
        false_alarm_probability=none,
        pixel_m=none,
        pixels_on_target=1e8 / range_m**2 if pixels is None else pixels,
        pixels_across=none,
        target_fills_pixel=none == 0.0,
        max_range_m=max_range_m,
        armed_limits=armed,
        fill_limits=not fills,
    )


def line(max_range_m=2000.0, photons=1e9, **more):
    return curve(RANGE_M, photons / RANGE_M**2, max_range_m, **more)


def drawn(figure):
    """Return how many curves and how many marks stand on each plot."""
    lines = [axes.get_lines() for axes in figure.axes]
    marks = [sum(one.get_marker() == "o" for one in each) for each in lines]
    return [sum(len(one.get_xdata()) == len(RANGE_M) for one in each) for each in lines], marks


def test_curves_marks_and_names():
    figure = budget_figure(
        [line(700.0), line(5000.0, armed=True)], ["near", "far"], "Budget", "note", 0.95, small_print=("armed",)
    )
    assert drawn(figure) == ([2] * 6, [2, 0, 2, 0, 0, 2])
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["near: 700 m", "far: 5 km (end of the armed window)"]


def test_a_curve_on_another_is_dashed_so_that_both_are_seen():
    """The third has the pixels of the first two, and other photons."""
    figure = budget_figure([line(700.0), line(700.0), line(700.0, photons=7.0)], ["a", "b", "c"], "Budget", "", 0.9)
    light, pixels = (
        [entry.get_linestyle() for entry in axes.get_lines() if len(entry.get_xdata()) > 1]
        for axes in (figure.axes[0], figure.axes[5])
    )
    assert light == ["-", "--", "-"]
    assert pixels == ["-", "--", "--"]


def test_a_curve_that_is_never_seen_is_drawn_without_a_mark():
    figure = budget_figure([line(float("nan"), photons=0.0), line(9000.0)], ["dark", "outside"], "Budget", "", 0.5)
    assert drawn(figure)[1] == [0] * 6
    assert figure.legends[0].get_texts()[0].get_text() == "dark: never"


def test_nothing_to_see_is_drawn_all_the_same():
    figure = budget_figure([line(float("nan"), photons=0.0)], ["dark"], "Budget", "", 0.5)
    figure.canvas.draw()
    assert drawn(figure) == ([1] * 6, [0] * 6)


@pytest.mark.parametrize("count", [1, 12])
def test_names_stand_below_the_plots_and_above_the_small_print(count):
    lines, names = [line(500.0 + 100 * k) for k in range(count)], [f"curve {k}" for k in range(count)]
    figure = budget_figure(lines, names, "Budget", "note", 0.9, small_print=("a", "b"))
    figure.canvas.draw()
    box = figure.legends[0].get_window_extent()
    lowest = min(axes.get_tightbbox().y0 for axes in figure.axes)
    prints = [text for text in figure.texts if text.get_text() in ("a", "b")]
    assert len(prints) == 2
    assert box.y1 <= lowest
    assert max(text.get_window_extent().y1 for text in prints) <= box.y0 + 2
    # The names stand close under the plots: nothing but the labels of the axes lies between.
    assert lowest - box.y1 < 0.3 * figure.dpi


@pytest.mark.parametrize(("near_m", "far_m"), [(900.0, 1000.0), (1.0, 1e5), (0.5, 0.50001)])
def test_every_axis_carries_three_numbers_at_least(near_m, far_m):
    range_m = np.geomspace(near_m, far_m, 9)
    values = {"seen": np.ones(9), "precision_m": np.full(9, 0.05), "pixels": 1e4 / range_m**2}
    figure = budget_figure([curve(range_m, 1e9 / range_m**2, np.nan, **values)], ["a"], "Budget", "note", 0.9)
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
    figure = budget_figure([line(700.0, fills=False)], ["a"], "Budget", "note", 0.9, filled_to_m=700.0)
    full = [
        one for one in figure.axes[0].get_lines() if one.get_alpha() is None and len(one.get_xdata()) == len(RANGE_M)
    ]
    assert [float(np.max(one.get_xdata()[np.isfinite(one.get_ydata())])) for one in full] == [
        RANGE_M[RANGE_M <= 700.0].max()
    ]
    assert [one.get_alpha() for one in figure.axes[0].get_lines()].count(0.3) == 1
    assert figure.legends[0].get_texts()[0].get_text() == "a: 700 m (fills a pixel no farther)"
    assert 0.3 not in [
        one.get_alpha() for one in budget_figure([line(700.0)], ["a"], "Budget", "", 0.9).axes[0].get_lines()
    ]
