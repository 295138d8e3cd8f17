import numpy as np
import pytest
from PIL import Image, ImageDraw

from rso_lidar.errors import RecordingError
from rso_lidar.picture import Scale, Thumbnail, contact_sheet, draw_panel
from rso_lidar.picture.frames.raster import GAP, draw_pair, load_font, shorten
from rso_lidar.picture.frames.sheet import CAPTION, HEAD, MARGIN, SIDE, SPACE, _look
from rso_lidar.picture.selection.window import crop
from rso_lidar.picture.style.palette import IMAGE_MARK, NO_LIGHT, NO_RETURN, split_rgb


def pixels(picture):
    return np.asarray(picture.convert("RGB")).astype(int)


def test_each_pixel_of_a_panel_has_its_own_sharp_square(handmade):
    colours = np.random.default_rng(1).integers(0, 255, (24, 24, 3), dtype=np.uint8)
    drawn = pixels(draw_panel(colours, 192, NO_LIGHT))
    assert drawn.shape == (192, 192, 3)
    np.testing.assert_array_equal(drawn, np.repeat(np.repeat(colours, 8, axis=0), 8, axis=1))


@pytest.mark.parametrize("shape", [(128, 128), (64, 128), (128, 64), (300, 300), (1, 5)])
def test_a_panel_keeps_shape_and_mean_colour(shape):
    colours = np.full((*shape, 3), (10, 200, 30), dtype=np.uint8)
    drawn = pixels(draw_panel(colours, 192, NO_LIGHT))
    assert drawn.shape == (192, 192, 3)
    share = (drawn == (10, 200, 30)).all(axis=-1).mean()
    assert share == pytest.approx(min(shape) / max(shape), abs=0.02)


def test_a_pair_shows_the_crop_in_range_and_intensity(handmade):
    frame = handmade.make_frame(1350.0, 900.0)
    thumbnail = Thumbnail.of(frame)
    scale, window = Scale.of([thumbnail]), crop(thumbnail.bounds)
    drawn = pixels(draw_pair(thumbnail, scale, window, 192))
    times = 192 // window.width
    for row, col in [(5, 8), (8, 10), (0, 0), (12, 9)]:
        x, y = col * times + times // 2, row * times + times // 2
        expected = scale.range_rgb(window.cut(frame.range_m), thumbnail.median_m)[row, col]
        assert tuple(drawn[y, x]) == tuple(expected)
        expected = scale.intensity_rgb(window.cut(frame.intensity_counts))[row, col]
        assert tuple(drawn[y, 192 + GAP + x]) == tuple(expected)
    # The mark of the locator stands where the crop is in the field: about the middle of the small square.
    rows, cols = np.nonzero((drawn[:, :192] == split_rgb(IMAGE_MARK)).all(axis=-1))
    side = max(26, 192 // 7)
    middle = (window.left + window.right) / 2 / 128
    assert cols.mean() == pytest.approx(192 - 4 - side + middle * side, abs=1.0)
    assert rows.mean() == pytest.approx(3 + (window.top + window.bottom) / 2 / 128 * side, abs=1.0)


def test_the_whole_field_has_no_locator(handmade):
    thumbnail = Thumbnail.of(handmade.make_frame(0.0, 60.0, 64))
    window = crop(thumbnail.bounds)
    assert window.whole
    assert (
        not (pixels(draw_pair(thumbnail, Scale.of([thumbnail]), window, 192)) == split_rgb(IMAGE_MARK))
        .all(axis=-1)
        .any()
    )


def test_a_sheet_holds_every_cell(coming, tmp_path):
    place = contact_sheet(coming, tmp_path / "sheet.png", columns=4, rows=3)
    with Image.open(place) as page:
        drawn = pixels(page)
    for k in range(12):
        x = MARGIN + (k % 4) * (2 * SIDE + GAP + SPACE)
        y = HEAD + (k // 4) * (SIDE + CAPTION + SPACE // 2)
        cell = drawn[y : y + SIDE, x : x + SIDE]
        dark = (cell == split_rgb(NO_RETURN)).all(axis=-1).mean()
        green = (cell[..., 1] > cell[..., 0] + 30).mean()
        assert 0.1 < dark < 0.99
        assert green > 0.01  # something of the range ramp in each cell, whatever the range


@pytest.mark.parametrize(
    ("count", "columns", "rows", "cells"), [(12, 2, 2, (2, 2)), (3, 4, 4, (3, 1)), (12, 5, 9, (5, 3))]
)
def test_a_sheet_is_no_larger_than_its_frames(coming, tmp_path, count, columns, rows, cells):
    place = contact_sheet(coming[:count], tmp_path / "sheet.png", columns, rows)
    with Image.open(place) as page:
        across = (page.width - 2 * MARGIN + SPACE) / (2 * SIDE + GAP + SPACE)
        assert across == pytest.approx(cells[0], abs=0.3) or page.width == 2 * MARGIN + 860
        down = (page.height - HEAD) // (SIDE + CAPTION + SPACE // 2)
        assert down == cells[1]


def test_a_sheet_of_an_iterator(coming, tmp_path):
    listed = contact_sheet(coming, tmp_path / "a.png", 4, 3)
    streamed = contact_sheet(iter(coming), tmp_path / "b.png", 4, 3)
    with Image.open(listed) as one, Image.open(streamed) as two:
        assert (pixels(one) == pixels(two)).all()


def test_a_sheet_without_cells_is_an_error(coming, tmp_path):
    with pytest.raises(RecordingError, match="give 1 or more of each"):
        contact_sheet(coming, tmp_path / "a.png", 0, 3)


def test_dark_frames_have_a_sheet(handmade, tmp_path):
    dark = [handmade.make_frame(k, 900.0, 32, photons_at_km=0.0, false_returns=0) for k in range(2)]
    assert contact_sheet(dark, tmp_path / "dark.png").is_file()


def test_a_frame_without_a_target_is_shown_whole(handmade):
    empty = handmade.make_frame(0.0, 500.0, 64, photons_at_km=0.0, labelled=False, false_returns=2)
    assert not crop(Thumbnail.of(empty).bounds).whole
    assert crop(_look(empty).bounds).whole
    there = handmade.make_frame(0.0, 900.0, 128, photons_at_km=0.0, false_returns=0)  # labelled, too faint to return
    assert not crop(_look(there).bounds).whole


def test_long_titles_are_shortened():
    draw = ImageDraw.Draw(Image.new("RGB", (10, 10)))
    text = shorten(draw, "A very long title that goes on and on", 14, 120)
    assert text.endswith("…")
    assert draw.textlength(text, font=load_font(14)) <= 120
    assert shorten(draw, "short", 14, 120) == "short"
