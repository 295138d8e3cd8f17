import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgba

from rso_lidar.picture import DARK, Stretch, colour_parts, draw, frame_figure, rank_parts, save_frame, summarize_frame
from rso_lidar.picture.frames.frame import _describe_geometry
from rso_lidar.picture.frames.panels import _free_corner
from rso_lidar.picture.style.palette import IMAGE_BLACK, IMAGE_WHITE
from rso_lidar.records import Reading


def panels(figure):
    return {axes.get_title(loc="left"): axes for axes in figure.axes if axes.get_title(loc="left")}


def shown(axes, k=0):
    drawn = axes.images[k]
    left, right, bottom, top = drawn.get_extent()
    return np.ma.filled(drawn.get_array().astype(float), np.nan), tuple(
        round(v + 0.5) for v in (top, bottom, left, right)
    )


def test_panels_show_the_arrays_where_they_are_in_the_field(handmade):
    frame = handmade.make_frame(1350.0, 900.0)
    by_title = panels(frame_figure(frame))
    assert list(by_title) == ["Range", "Intensity", "Parts, by the labels", "Error"]
    for title, array in (("Range", frame.range_m), ("Intensity", frame.intensity_counts)):
        values, (top, bottom, left, right) = shown(by_title[title])
        expected = np.where(frame.valid, array, np.nan)[top:bottom, left:right]
        np.testing.assert_array_equal(values, expected.astype(float))
    assert 0 < top < bottom < 128  # at 900 m the target fills a corner of the field: a crop, with its locator
    assert len(by_title["Range"].child_axes) == 2
    assert by_title["Range"].images[0].cmap.get_bad()[0] == pytest.approx(46 / 255, abs=0.01)


def test_error_is_range_minus_truth_in_centimetres(handmade):
    frame = handmade.make_frame(1350.0, 900.0)
    reading = frame.observation.reading
    moved = Reading(reading.range_m + np.float32(0.2), reading.intensity_counts, reading.saturated)
    frame = dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, reading=moved))
    axes = panels(frame_figure(frame))["Error"]
    values, (top, bottom, left, right) = shown(axes)
    expected = 100 * (frame.range_m.astype(float) - frame.labels.range_m)[top:bottom, left:right]
    np.testing.assert_allclose(values, expected, atol=1e-6)
    # The noise made is 5 cm or more, so the median of about 120 is within 3 cm of the 20 cm put in (5 sigma).
    assert "median +2" in axes.get_title(loc="right") or "median +1" in axes.get_title(loc="right")
    assert np.nanmedian(values) == pytest.approx(20.0, abs=3.0)


def test_missed_and_false_pixels_are_counted(handmade):
    frame = handmade.make_frame(100.0, 2800.0, false_returns=5)
    there = frame.labels.target >= 0
    missed, false = int((there & ~frame.valid).sum()), int((frame.valid & ~there).sum())
    assert missed > 0
    legend = panels(frame_figure(frame))["Error"].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [f"missed  {missed}", f"false  {false}"]


def test_parts_keep_their_colour_and_are_named(handmade):
    colours = {}
    for time_s, range_m in ((100.0, 2000.0), (2600.0, 300.0), (1350.0, 900.0)):
        frame = handmade.make_frame(time_s, range_m)
        legend = panels(frame_figure(frame))["Parts, by the labels"].get_legend()
        for text, patch in zip(legend.get_texts(), legend.get_patches(), strict=True):
            name, count = text.get_text().split("  ")
            part = frame.source.targets[0].parts.index(name)
            assert int(count.replace(",", "")) == ((frame.labels.part == part) & (frame.labels.target == 0)).sum()
            colours.setdefault(name, set()).add(patch.get_facecolor())
        there, image = frame.labels.target >= 0, colour_parts(frame).image
        assert (image[there] >= 0).all() and (image[~there] == -1).all() and not there.all()
    assert set(colours) == {"bus", "solar_array", "antenna"}
    assert all(len(own) == 1 for own in colours.values())


def test_many_parts_share_the_last_colour(handmade):
    frame = handmade.make_frame(2600.0, 300.0)
    parts = tuple(f"part_{k}" for k in range(14))
    entry = dataclasses.replace(frame.source.targets[0], parts=parts, materials=("m",) * 14)
    there = frame.labels.target >= 0
    spread = np.where(there, np.arange(there.size).reshape(there.shape) % 14, -1)
    frame = dataclasses.replace(
        frame,
        source=dataclasses.replace(frame.source, targets=(entry,)),
        labels=dataclasses.replace(frame.labels, part=spread),
    )
    words = [text.get_text() for text in panels(frame_figure(frame))["Parts, by the labels"].get_legend().get_texts()]
    assert len(words) == 11
    assert words[-1].startswith("4 more  ")
    assert sum(int(word.split("  ")[1].replace(",", "")) for word in words) == there.sum()


def test_in_a_series_one_of_many_parts_keeps_its_colour(handmade):
    frame = handmade.make_frame(2600.0, 300.0)
    parts = tuple(f"part_{k}" for k in range(14))
    entry = dataclasses.replace(frame.source.targets[0], parts=parts, materials=("m",) * 14)
    source = dataclasses.replace(frame.source, targets=(entry,))
    there = frame.labels.target >= 0
    series = []
    for most in (11, 2):  # the part with most pixels, first of one frame and then of the other
        spread = np.where(
            np.arange(there.size).reshape(there.shape) % 3, most, np.cumsum(there).reshape(there.shape) % 14
        )
        labels = dataclasses.replace(frame.labels, part=np.where(there, spread, -1))
        series.append(dataclasses.replace(frame, source=source, labels=labels))
    order, colours = rank_parts(series), {}
    for one in series:
        legend = panels(frame_figure(one, order))["Parts, by the labels"].get_legend()
        for text, patch in zip(legend.get_texts(), legend.get_patches(), strict=True):
            colours.setdefault(text.get_text().split("  ")[0], set()).add(patch.get_facecolor())
    assert set(order[:2]) == {(0, 2), (0, 11)}
    assert len(colours) == 11 and "4 more" in colours
    assert all(len(own) == 1 for own in colours.values())


def test_words_say_time_returns_and_geometry(handmade):
    frame = handmade.make_frame(1350.0, 900.0, index=4)
    text = summarize_frame(frame)
    assert "frame 4" in text
    assert "1,350.000 s after 2024-09-17T12:00:00Z" in text
    assert f"{frame.valid.sum()} returns" in text
    about, field = _describe_geometry(frame)
    assert about.startswith(f"tdrs: {np.linalg.norm(frame.truth.pose('lidar', 'tdrs').translation):.2f} m")
    assert "along-track −900.0" in about
    # Moving at 0.99 m/s along the track from 900 m behind, 7 degrees off the line: it closes.
    assert "range rate −0.9" in about
    assert "128 × 128 pixels of 0.3409 mrad" in field
    assert "pan +0.688°, tilt −1.948°" in field


def test_long_words_and_many_targets_stay_on_the_page(handmade):
    frame = handmade.make_frame(1350.0, 900.0, 32)
    entries = tuple(dataclasses.replace(frame.source.targets[0], name=name) for name in ("tdrs",) * 5)
    source = dataclasses.replace(frame.source, title="very " * 60, targets=entries)
    figure = frame_figure(dataclasses.replace(frame, source=source))
    figure.canvas.draw()
    width = figure.bbox.width
    for text in figure.texts:
        assert text.get_window_extent().x1 < width


def test_the_legend_of_the_error_keeps_clear_of_the_target():
    busy = np.ones((16, 16), dtype=bool)
    busy[:4, -4:] = False
    assert _free_corner(busy) == "upper right"
    assert _free_corner(np.zeros((1, 1), dtype=bool)) == "lower left"


def test_the_legend_of_the_error_keeps_clear_of_missed_pixels(handmade):
    """Nothing is reported, and the target fills all corners but one."""
    frame = handmade.make_frame(2600.0, 300.0)
    target = np.zeros_like(frame.labels.target)
    target[: len(target) // 3, -len(target) // 3 :] = -1
    nothing = dataclasses.replace(frame.observation.reading, range_m=np.full_like(frame.range_m, np.nan))
    frame = dataclasses.replace(
        frame,
        observation=dataclasses.replace(frame.observation, reading=nothing),
        labels=dataclasses.replace(frame.labels, target=target),
    )
    legend = panels(frame_figure(frame))["Error"].get_legend()
    assert legend._loc == 1  # matplotlib's number of "upper right"


@pytest.mark.parametrize(
    "options",
    [
        {"photons_at_km": 0.0, "false_returns": 0},
        {"labelled": False},
        {"range_m": 60_000.0},
        {"range_m": 20.0},
        {"n": 1},
    ],
)
def test_odd_frames_are_drawn_too(handmade, tmp_path, options):
    frame = handmade.make_frame(**{"range_m": 900.0, "n": 48, **options})
    assert save_frame(frame, tmp_path / "odd.png").stat().st_size > 10_000


def test_drawing_leaves_no_global_state(tmp_path):
    program = (
        "import sys, importlib.util as u, matplotlib\n"
        "settings = lambda: {k: dict.__getitem__(matplotlib.rcParams, k) for k in matplotlib.rcParams}\n"
        "before = settings()\n"
        f"spec = u.spec_from_file_location('made', {str(Path(__file__).parents[1] / 'frames_for_tests.py')!r})\n"
        "made = u.module_from_spec(spec); spec.loader.exec_module(made)\n"
        "import rso_lidar.picture as picture\n"
        f"picture.save_frame(made.make_frame(n=32), {str(tmp_path / 'a.png')!r})\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert before == settings()\n"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_the_scale_bar_is_seen_on_saturated_pixels(handmade):
    frame = handmade.make_frame(0.0, 60.0, 64)
    full = np.full(frame.valid.shape, 4095)
    reading = Reading(np.full(full.shape, 60.0), full, full > 0)
    frame = dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, reading=reading))
    axes = panels(frame_figure(frame))["Intensity"]
    under, bar = axes.lines
    assert (under.get_color(), bar.get_color()) == (IMAGE_BLACK, IMAGE_WHITE)
    assert under.get_linewidth() > bar.get_linewidth() + 2
    assert axes.texts[0].get_bbox_patch().get_facecolor() == to_rgba(IMAGE_BLACK)


def test_one_glint_turns_nothing_black(handmade):
    """Of a target at 100 counts nine pixels shine with 4000: in logarithms the rest keeps a middle grey."""
    frame = handmade.make_frame(1350.0, 900.0)
    counts = np.where(frame.valid, 100, 0).astype(np.uint16)
    row, col = np.argwhere(frame.valid & (frame.labels.target >= 0))[0]
    counts[row : row + 3, col : col + 3] *= 40
    reading = dataclasses.replace(frame.observation.reading, intensity_counts=counts)
    observation = dataclasses.replace(frame.observation, reading=reading)
    figure = frame_figure(dataclasses.replace(frame, observation=observation))
    image = panels(figure)["Intensity, logarithmic"].images[0]
    assert image.norm(100.0) < image.norm(1000.0) < image.norm(4000.0)
    assert image.norm(1000.0) > 0.5  # linear: 0.25


def test_no_label_of_a_panel_is_cut_at_the_edge_of_the_figure(handmade):
    """A legend of long names takes the width from which the panels get theirs."""
    frame = handmade.make_frame(2600.0, 300.0)
    parts = tuple(f"antenna_of_single_access_{k}_on_its_boom" for k in range(len(frame.source.targets[0].parts)))
    source = dataclasses.replace(frame.source, targets=(dataclasses.replace(frame.source.targets[0], parts=parts),))
    figure = frame_figure(dataclasses.replace(frame, source=source))
    figure.draw_without_rendering()
    page = figure.bbox
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box.x0 >= page.x0
        assert box.x1 <= page.x1
        assert box.y0 >= page.y0
        assert box.y1 <= page.y1


def test_the_image_of_a_camera_stands_below_the_lidars(handmade):
    frame = handmade.add_camera(handmade.make_frame())
    by_title = panels(frame_figure(frame))
    assert list(by_title) == ["Range", "Intensity", "Parts, by the labels", "Error", "Camera nav"]
    values, (top, bottom, left, right) = shown(by_title["Camera nav"])
    assert (top, bottom, left, right) == (3, 11, 4, 12)  # a crop about rows 5 to 8 and columns 6 to 9
    painted = Stretch.of("nav", frame).paint(frame.camera["nav"].intensity_counts)
    np.testing.assert_array_equal(values, painted[3:11, 4:12])
    assert by_title["Camera nav"].get_title(loc="right").startswith("20 ms; 2 to ")


def test_a_notebook_shows_the_picture_of_a_frame(handmade):
    """It is an image of Pillow, which states itself as PNG."""
    frame = handmade.make_frame(1350.0, 900.0)
    light, dark = draw(frame), draw(frame, DARK)
    assert light._repr_png_().startswith(b"\x89PNG")
    assert light.size == dark.size
    assert light.getpixel((1, 1)) == (255, 255, 255)
    assert max(dark.getpixel((1, 1))) < 60
