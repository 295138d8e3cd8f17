import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rso_lidar.picture import Window
from rso_lidar.picture.selection.window import LADDER, bounding_window, crop, grow


@st.composite
def bounds(draw):
    n_rows, n_cols = draw(st.integers(4, 300)), draw(st.integers(4, 300))
    top, left = draw(st.integers(0, n_rows - 1)), draw(st.integers(0, n_cols - 1))
    return Window(top, draw(st.integers(top + 1, n_rows)), left, draw(st.integers(left + 1, n_cols)), n_rows, n_cols)


@given(bounds(), st.none() | st.integers(4, 300))
def test_a_crop_shows_all_of_its_bounds_inside_the_field(inner, held):
    previous = None
    if held is not None:
        previous = Window(0, min(held, inner.n_rows), 0, min(held, inner.n_cols), inner.n_rows, inner.n_cols)
    shown = crop(inner, previous)
    assert 0 <= shown.top <= inner.top < inner.bottom <= shown.bottom <= inner.n_rows
    assert 0 <= shown.left <= inner.left < inner.right <= shown.right <= inner.n_cols
    if not shown.whole and previous is None:
        assert max(shown.height, shown.width) in LADDER


def test_around_is_tight_and_of_nothing_the_whole_field():
    mask = np.zeros((20, 30), dtype=bool)
    assert bounding_window(mask).whole
    mask[4, 7] = mask[9, 11] = True
    assert bounding_window(mask) == Window(4, 10, 7, 12, 20, 30)
    assert bounding_window(mask).cut(mask).sum() == 2


def test_the_size_is_held_while_it_fits():
    small, large = Window(60, 70, 60, 70, 128, 128), Window(50, 90, 50, 90, 128, 128)
    first = crop(small)
    assert first.width == 16
    turned = Window(60, 68, 60, 66, 128, 128)
    assert crop(turned).width == 12
    assert crop(turned, first).width == 16
    assert crop(large, first).width == 48
    assert crop(small, crop(Window(0, 128, 0, 128, 128, 128))).width == 16


def test_the_target_stands_in_the_middle_unless_the_field_ends():
    shown = crop(Window(60, 68, 20, 28, 128, 128))
    assert (shown.top + shown.bottom, shown.left + shown.right) == (128, 48)
    shown = crop(Window(0, 8, 120, 128, 128, 128))
    assert (shown.top, shown.right) == (0, 128)


def test_a_few_returns_are_shown_with_half_of_the_target_around_them():
    target = Window(40, 64, 50, 80, 128, 128)
    few = Window(60, 62, 55, 58, 128, 128)
    shown = grow(few, target)
    assert (shown.height, shown.width) == (12, 15)
    assert shown.top <= few.top
    assert shown.bottom >= few.bottom
    assert shown.left <= few.left
    assert shown.right >= few.right
    assert grow(target, target) == target
