"""Trades drawn: means along an axis, maps over pairs, and one figure of merit against another."""

import numpy as np
import pytest

from rso_lidar.study.trades.trade_figures import Quantity, against_figure, effects_figure, format_value, maps_figure

A, B = np.repeat([1.0, 10.0, 100.0], 4), np.tile(["x", "y"], 6)
MERIT = np.arange(12.0)


def drawn(axes):
    return [np.array(line.get_xydata()) for line in axes.lines]


def test_means_along_an_axis_of_numbers_and_of_words():
    figure = effects_figure(Quantity("m", MERIT), [Quantity("a", A, log=True), Quantity("b", B)], "more")
    first, second = figure.axes
    assert drawn(first)[1].tolist() == [[1.0, 1.5], [10.0, 5.5], [100.0, 9.5]]
    assert first.get_xscale() == "log"
    assert drawn(second)[1].tolist() == [[0.0, 5.0], [1.0, 6.0]]
    assert [tick.get_text() for tick in second.get_xticklabels()] == ["x", "y"]


def test_drawn_values_are_averaged_in_stretches():
    place = np.linspace(0.0, 1.0, 64)
    figure = effects_figure(Quantity("m", 2.0 * place), [Quantity("a", place, drawn=64)], "less")
    middle, mean = drawn(figure.axes[0])[1].T
    assert len(middle) == 8
    assert mean == pytest.approx(2.0 * middle)


def test_few_drawn_values_are_dots_alone_and_seeds_make_them_no_more():
    place, text = np.repeat(np.linspace(0.0, 1.0, 14), 4), np.repeat([f"x{k}" for k in range(14)], 4)
    for axis in (Quantity("a", place, drawn=14), Quantity("b", text, drawn=14)):
        assert len(drawn(effects_figure(Quantity("m", np.cos(40.0 * place)), [axis], "less").axes[0])) == 1


def test_the_line_through_drawn_values_is_a_median_and_that_of_a_grid_of_one_axis_its_runs():
    place = np.arange(20.0)
    wild = np.where(place == 7.0, 1e9, place)
    figure = effects_figure(Quantity("m", wild), [Quantity("a", place, drawn=20)], "less")
    assert drawn(figure.axes[0])[1].tolist() == [[2.0, 2.0], [7.0, 8.0], [12.0, 12.0], [17.0, 17.0]]
    listed = Quantity("b", np.tile([1.0, 2.0], 10), drawn=20)  # of a list: its values, ten times each
    assert [x for x, _ in drawn(effects_figure(Quantity("m", wild), [listed], "less").axes[0])[1]] == [1.0, 2.0]
    figure = effects_figure(Quantity("m", wild), [Quantity("a", place)], "less")
    assert drawn(figure.axes[0])[1].tolist() == np.stack([place, wild], axis=1).tolist()


def test_what_has_no_value_is_left_out():
    values = np.where(A == 10.0, np.nan, MERIT)
    figure = effects_figure(Quantity("m", values), [Quantity("a", A)], "more")
    assert drawn(figure.axes[0])[1].tolist() == [[1.0, 1.5], [100.0, 9.5]]


def test_a_map_holds_the_mean_of_the_runs_that_share_both_values():
    figure = maps_figure(Quantity("m", MERIT), [Quantity("a", A), Quantity("b", B)], "more")
    (image,) = figure.axes[0].images
    assert image.get_array().tolist() == [[1.0, 2.0], [5.0, 6.0], [9.0, 10.0]]
    assert "5" in [text.get_text() for text in figure.axes[0].texts]


def test_nothing_to_map():
    assert maps_figure(Quantity("m", MERIT), [Quantity("a", A)], "more") is None
    assert maps_figure(Quantity("m", MERIT * np.nan), [Quantity("a", A), Quantity("b", B)], "more") is None


def test_one_against_another():
    best = MERIT > 9.0
    figure = against_figure([Quantity("m", MERIT), Quantity("n", -MERIT)], ["more", "less"], Quantity("b", B), best)
    axes = figure.axes[0]
    assert axes.collections[0].get_offsets().tolist() == [[m, -m] for m in MERIT.tolist()]
    assert drawn(axes)[0].tolist() == [[10.0, -10.0], [11.0, -11.0]]
    assert against_figure([Quantity("m", MERIT)], ["more"], Quantity("b", B), best) is None


def test_numbers_are_short():
    assert [format_value(x) for x in (1234567.0, 12.0, 0.000123456, np.nan)] == ["1,235,000", "12", "0.0001235", "–"]


def test_values_that_rank_no_point_are_hollow_and_in_no_mean():
    held = MERIT < 2.0
    merit = Quantity("m", MERIT, unranked=held)
    along = [Quantity("a", A, log=True), Quantity("b", B)]
    figure = effects_figure(merit, along, "less")
    hollow, dots, line = figure.axes[0].lines
    assert (hollow.get_markerfacecolor(), hollow.get_ydata().tolist()) == ("none", [0.0, 1.0])
    assert dots.get_ydata().tolist() == MERIT[2:].tolist()
    assert line.get_xydata().tolist() == [[1.0, 2.5], [10.0, 5.5], [100.0, 9.5]]
    assert any("hollow: too little detected" in text.get_text() for text in figure.texts)
    table = maps_figure(Quantity("m", MERIT, unranked=MERIT < 4.0), along, "less").axes[0].images[0].get_array()
    assert table.mask.tolist() == [[True, True], [False, False], [False, False]]
    against = against_figure([merit, Quantity("n", MERIT)], ["less", "less"], along[0], ~held)
    assert len(against.axes[0].collections[0].get_offsets()) == 10
    assert any("hollow: not ranked" in text.get_text() for text in against.texts)
    assert maps_figure(Quantity("m", MERIT, unranked=MERIT < 99.0), along, "less") is None
