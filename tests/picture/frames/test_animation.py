import sys

import numpy as np
import pytest
from PIL import Image

from rso_lidar.errors import RecordingError
from rso_lidar.picture import Stretch, animate
from rso_lidar.picture.frames.animation import HEAD, HEIGHT, MARGIN, SIDE, WIDTH
from rso_lidar.picture.frames.raster import GAP
from rso_lidar.picture.style.palette import MARK, PAPER, split_rgb


def test_a_gif_has_a_picture_for_each_frame(coming, tmp_path):
    place = animate(coming, tmp_path / "a.gif", frame_rate_hz=8.0)
    with Image.open(place) as film:
        assert film.n_frames == 12
        assert film.size == (WIDTH, HEIGHT)
        assert film.info["loop"] == 0
        assert film.info["duration"] == 120  # 1/8 s in hundredths, half to even
        marks = []
        for k in range(12):
            film.seek(k)
            drawn = np.asarray(film.convert("RGB")).astype(int)
            assert np.abs(drawn[2, 2] - split_rgb(PAPER)).max() <= 2
            strip = drawn[HEAD + SIDE :]
            marks.append(np.nonzero(np.abs(strip - split_rgb(MARK)).max(axis=-1) <= 8)[1].mean())
            assert drawn[HEAD : HEAD + SIDE, MARGIN : MARGIN + SIDE].std() > 1
    assert (np.diff(marks) > 10).all()  # the mark in the time line goes from left to right
    assert marks[-1] - marks[0] > 0.7 * WIDTH


def test_a_long_sequence_is_thinned_and_stays_small(handmade, tmp_path):
    frames = handmade.approach(40, n=128)
    place = animate(frames, tmp_path / "a.gif", max_frames=30)
    with Image.open(place) as film:
        assert film.n_frames == 30
        assert film.info["duration"] == 250  # 30 pictures in ten seconds would be 3 Hz: 4 Hz is the slowest
    assert place.stat().st_size < 30 * 50_000  # 6 MB for 120 frames


def test_one_frame_is_a_film_too(coming, tmp_path):
    with Image.open(animate(coming[:1], tmp_path / "a.gif")) as film:
        assert film.size == (WIDTH, HEIGHT)


def test_a_colour_camera_has_a_panel_in_its_colours(handmade, coming, tmp_path):
    place = animate([handmade.add_camera(frame) for frame in coming[:2]], tmp_path / "a.gif")
    with Image.open(place) as film:
        assert film.size == (WIDTH + SIDE + GAP, HEIGHT)
        drawn = np.asarray(film.convert("RGB")).astype(int)
    left = WIDTH - MARGIN + GAP  # of the panel: a crop of 8 pixels about the square
    middle = drawn[HEAD + SIDE // 2, left + SIDE // 2]
    expected = Stretch(2.0, 900.0).apply(np.array([900, 600, 300]))
    assert np.abs(middle - expected).max() <= 3
    assert (drawn[HEAD + 5, left + 5] < 60).all()
    assert drawn[HEAD : HEAD + SIDE, MARGIN : MARGIN + SIDE].std() > 1


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, 60.0, float("nan")])
def test_a_rate_that_players_cannot_keep_is_an_error(coming, tmp_path, rate_hz):
    with pytest.raises(RecordingError, match="choose a rate above 0 and up to 50 Hz"):
        animate(coming, tmp_path / "a.gif", frame_rate_hz=rate_hz)


def test_mp4_without_the_extra_names_it(coming, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(RecordingError, match=r"a\.mp4: MP4 needs an extra: pip install rso-lidar\[mp4\]"):
        animate(coming, tmp_path / "a.mp4")


def test_mp4_plays_every_frame(coming, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra mp4: pip install 'rso-lidar[mp4]'")
    place = animate(coming, tmp_path / "a.mp4", frame_rate_hz=6.0)
    count, seconds = ffmpeg.count_frames_and_secs(str(place))
    assert count == 12
    assert seconds == pytest.approx(12 / 6.0, abs=0.05)


def test_the_page_suits_mp4():
    assert WIDTH % 2 == HEIGHT % 2 == 0
