"""The window: keys, slider and clock lead to the frame that is drawn, and only that frame is read."""

import numpy as np
import pytest
from matplotlib.backend_bases import KeyEvent, MouseEvent
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rso_lidar.errors import RecordingError, suppress_warnings
from rso_lidar.evaluation import view
from rso_lidar.evaluation.recorded_runs.player import SIZE_IN, Player, window_backend
from rso_lidar.picture import Shape

PLATE = Shape(
    "tdrs", np.array([[[-3, -3, 0], [3, -3, 0], [3, 3, 0]], [[-3, -3, 0], [3, 3, 0], [-3, 3, 0]]], dtype=float)
)


class Told(list):
    """Frames that remember which of them were asked for."""

    def __init__(self, frames):
        super().__init__(frames)
        self.read = []

    def __getitem__(self, k):
        self.read.append(k)
        return super().__getitem__(k)


@pytest.fixture
def frames(coming):
    return Told(coming)


class Lazy(FigureCanvasAgg):
    """A canvas that draws when it is told to, and not whenever something has changed."""

    def draw_idle(self):
        pass


def opened(frames, *arguments, **options):
    figure = Figure(figsize=SIZE_IN)
    Lazy(figure)
    return Player(frames, *arguments, figure=figure, **options)


def press(player, key):
    player.figure.canvas.callbacks.process("key_press_event", KeyEvent("key_press_event", player.figure.canvas, key))


def drawn(player):
    """Return the range that the first panel shows, as an array without the pixels that are masked."""
    (image,) = player.figure.axes[0].images
    return np.ma.getdata(image.get_array())[~np.ma.getmaskarray(image.get_array())]


def seen(frame):
    """Return the ranges of a frame that lie where the panel looks: all those of the target do."""
    return frame.range_m[frame.valid & (frame.labels.target >= 0)]


def shows(player, k):
    frame = list.__getitem__(player.frames, k)
    assert player.shown == k
    assert np.isin(seen(frame), drawn(player)).all()
    texts = [text.get_text() for text in player.figure.texts]
    assert any(f"frame {frame.index}  " in text for text in texts)
    return True


def test_keys_lead_from_frame_to_frame(frames):
    player = opened(frames)
    assert shows(player, 0)
    for key, place in [
        ("right", 1), ("left", 0), ("left", 0), ("pagedown", 10), ("end", 11), ("right", 11), ("pageup", 1), ("home", 0),
        ("x", 0),
    ]:  # fmt: skip
        press(player, key)
        assert shows(player, place)
    assert player.slider.val == 0


def test_only_what_is_shown_is_read(frames):
    player = opened(frames, first=3)
    player.slider.set_val(7)
    press(player, "left")
    assert frames.read == [3, 7, 6]


def test_the_slider_leads_anywhere(frames):
    player = opened(frames)
    box = player.slider.ax.get_window_extent()
    place = player.figure.canvas
    for kind in ("button_press_event", "button_release_event"):
        x, y = box.x0 + box.width * 8 / 11, 0.5 * (box.y0 + box.y1)
        place.callbacks.process(kind, MouseEvent(kind, place, x, y, button=1))
    assert shows(player, 8)
    assert player.slider.valtext.get_text() == "8, 9 of 12"


def test_space_plays_to_the_end_and_again_from_the_start(frames):
    player = opened(frames, first=9)
    player.tick()
    assert player.shown == 9  # it stands still
    press(player, " ")
    for _ in range(5):
        player.tick()
    assert shows(player, 11)
    assert not player.playing
    press(player, " ")
    assert player.playing
    assert player.shown == 0
    player.tick()
    press(player, " ")
    player.tick()
    assert shows(player, 1)


def space(player):
    """Return the panel of the cloud, its points (x, y, z) and their colours."""
    panel = next(axes for axes in player.figure.axes if axes.name == "3d")
    (cloud,) = [one for one in panel.collections if type(one).__name__ == "Path3DCollection"]
    return panel, np.stack(cloud._offsets3d, axis=-1), cloud.get_facecolor()


def test_the_cloud_is_that_of_the_frame_with_up_up(frames):
    player = opened(frames, [PLATE], first=5)
    frame = list.__getitem__(frames, 5)
    points = frame.points_m[frame.valid & (frame.labels.target >= 0)]
    panel, drawn_m, _ = space(player)
    held = {tuple(point) for point in np.round(drawn_m, 6).tolist()}
    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=-1)
    middle = frame.truth.pose("lidar", "tdrs").translation
    near = np.abs(turned - [middle[0], middle[2], -middle[1]]).max(axis=-1) < 2.5
    assert near.sum() > 10
    assert {tuple(point) for point in np.round(turned[near], 6).tolist()} <= held
    (lines,) = [one for one in panel.collections if type(one).__name__ == "Line3DCollection"]
    ends = np.array(lines._segments3d).reshape(-1, 3)
    true = frame.truth.pose("lidar", "tdrs").apply(PLATE.edges_m.reshape(-1, 3))
    assert np.allclose(ends, np.stack([true[:, 0], true[:, 2], -true[:, 1]], axis=-1), atol=1e-9)
    for limits, at in zip((panel.get_xlim(), panel.get_ylim(), panel.get_zlim()), ends.mean(axis=0), strict=True):
        assert np.mean(limits) == pytest.approx(at, abs=1e-6)


def test_c_changes_what_the_colour_means(frames):
    player = opened(frames, [PLATE], first=5)
    panel, _, before = space(player)
    assert "colour: range" in panel.get_title()
    press(player, "c")
    panel, _, after = space(player)
    assert "colour: intensity" in panel.get_title()
    assert after.shape == before.shape
    assert np.ptp(after[:, :3], axis=1).max() == 0  # greys
    assert np.ptp(before[:, :3], axis=1).min() > 0
    press(player, "c")
    assert np.array_equal(space(player)[2], before)


def test_turning_the_cloud_outlasts_the_frame(frames):
    player = opened(frames)
    panel, *_ = space(player)
    panel.view_init(elev=50, azim=10)
    press(player, "right")
    assert (panel.elev, panel.azim) == (50, 10)


def test_one_frame_has_no_slider_and_stays(coming):
    player = opened(coming[:1])
    assert player.slider is None
    press(player, "right")
    press(player, " ")
    player.tick()
    assert player.shown == 0
    assert not player.playing


def test_nothing_came_back(handmade):
    frame = handmade.make_frame(range_m=60_000.0, n=32, false_returns=0)
    assert not frame.valid.any()
    for shapes in ((), (PLATE,)):
        player = opened([frame, frame], shapes)
        player.figure.canvas.draw()
        press(player, "c")


def test_no_frames_are_an_error():
    with pytest.raises(RecordingError, match="has no frames"):
        Player([])


def test_a_picture_of_the_window_is_of_the_frame_with_most_returns(frames, tmp_path):
    with suppress_warnings():  # of the meshes that these frames lack
        (place,) = view(frames, output=tmp_path / "a.png").paths
    assert place.read_bytes().startswith(b"\x89PNG")
    returns = [int((frame.valid & (frame.labels.target >= 0)).sum()) for frame in frames]
    assert frames.read[-1] == np.argmax(returns)


def test_agg_opens_no_window(monkeypatch):
    import matplotlib

    with matplotlib.rc_context({"backend": "agg"}):
        assert window_backend() is None
