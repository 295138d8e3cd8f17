import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import RecordingError
from rso_lidar.picture import orbit_figure, save_figure
from rso_lidar.picture.plots.trajectory import relative_path
from rso_lidar.pose import Link, PoseTree, pose
from rso_lidar.records import Truth


def batch(times_s, position_m, node):
    """A truth over epochs: the lidar at positions in the target's `node` axes."""
    parents = {node: "inertial", "tdrs": node, "lidar": node}
    far = Link(pose(np.array([42_164e3, 0, 0])), np.zeros(3), np.zeros(3))
    turned = Link(pose(rotation=Rotation.from_euler("z", 90, degrees=True)), np.zeros(3), np.zeros(3))
    lidar = Link(pose(position_m), np.zeros_like(position_m), np.zeros(3))
    return Truth(
        times_s, PoseTree(parents, {node: far, "tdrs": turned, "lidar": lidar}), {}, np.zeros((len(times_s), 3))
    )


def ellipse(count=50):
    """The 2 by 1 ellipse of Clohessy and Wiltshire about the target, in rtn axes."""
    phase = np.linspace(0, 2 * np.pi, count)
    return phase * 900, np.stack([100 * np.cos(phase), -200 * np.sin(phase), 30 * np.sin(phase)], axis=-1)


def test_frames_give_the_lidar_in_rtn_axes(coming):
    path = relative_path(coming)
    assert (path.target, path.axes, path.words[1]) == ("tdrs", "tdrs.rtn", "Along-track")
    np.testing.assert_allclose(path.time_s, [frame.time_s for frame in coming])
    np.testing.assert_allclose(path.position_m[0, 1], -3000.0, atol=1e-6)
    np.testing.assert_allclose(path.position_m[-1, 1], -300.0, atol=1e-6)


def test_a_truth_over_epochs_needs_no_frames():
    times_s, position_m = ellipse()
    path = relative_path(batch(times_s, position_m, "tdrs.rtn"))
    np.testing.assert_allclose(path.position_m, position_m, atol=1e-7)
    figure = orbit_figure(batch(times_s, position_m, "tdrs.rtn"))
    plane = figure.axes[0]
    np.testing.assert_allclose(plane.lines[2].get_xydata(), position_m[:, [1, 0]], atol=1e-7)
    assert plane.get_aspect() == 1.0
    assert "scales differ" not in plane.get_title(loc="right")


@pytest.mark.parametrize("node", ["tdrs.origin", "base"])
def test_without_an_orbit_other_axes_serve(node):
    times_s, position_m = ellipse()
    path = relative_path(batch(times_s, position_m, node), target="tdrs")
    assert path.words == ("x", "y", "z")
    if node == "base":  # the body's own axes, turned by 90 degrees about z
        position_m = np.stack([position_m[:, 1], -position_m[:, 0], position_m[:, 2]], axis=-1)
    np.testing.assert_allclose(path.position_m, position_m, atol=1e-7)


def test_unknown_and_missing_targets_are_told(coming):
    with pytest.raises(RecordingError, match="no target named 'tdr'; did you mean 'tdrs'"):
        orbit_figure(coming, "tdr")
    times_s, position_m = ellipse()
    with pytest.raises(RecordingError, match="no target to draw about"):
        orbit_figure(batch(times_s, position_m, "base"))


def test_long_thin_tracks_say_that_scales_differ(coming, tmp_path, caplog):
    figure = orbit_figure(coming)
    assert figure.axes[1].get_title(loc="right") == "scales differ"
    assert save_figure(figure, tmp_path / "orbit.png").stat().st_size > 20_000
    assert caplog.text == ""  # matplotlib grumbles into its log where limits and aspect quarrel


@pytest.mark.parametrize(("radial_m", "differ"), [(55.0, False), (45.0, True)])
def test_scales_differ_from_twelve_times_as_long_as_wide(radial_m, differ):
    s = np.linspace(0.0, 1.0, 11)
    path = np.stack([radial_m * s, -600.0 * (1.0 - s), 300.0 * s], axis=-1)
    figure = orbit_figure(batch(10.0 * s, path, "tdrs.rtn"))
    assert any(axes.get_title(loc="right") == "scales differ" for axes in figure.axes) == differ


def test_a_lidar_that_stands_still_has_a_figure(tmp_path):
    times_s = np.arange(3.0)
    still = np.broadcast_to([0.0, -50.0, 0.0], (3, 3)).copy()
    assert save_figure(orbit_figure(batch(times_s, still, "tdrs.rtn")), tmp_path / "still.png").is_file()


def boxes(figure):
    """The panels of a drawn figure with the boxes of the labels in each."""
    figure.draw_without_rendering()
    return [(axes, [text.get_window_extent() for text in axes.texts if text.get_text()]) for axes in figure.axes[:3]]


def arrivals():
    """Paths whose labels crowd: a short one far off, one that stops under the target, one that starts beside its end."""
    times_s = np.linspace(0.0, 10.0, 11)
    s = times_s / 10.0
    short = np.stack([-345.0 + 5.0 * s, -314.0 + 8.0 * s, -66.0 - s], axis=-1)
    below = np.stack([-500.0 + 460.0 * s, 0.0 * s, 0.0 * s], axis=-1)
    loop = np.stack([np.sin(6.0 * s), -300.0 + 3.0 * s, 40.0 * np.sin(6.5 * s)], axis=-1)
    return times_s, (short, below, loop)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_labels_lie_in_their_panels_and_apart(which):
    times_s, paths = arrivals()
    figure = orbit_figure(batch(times_s, paths[which], "tdrs.rtn"))
    for axes, labels in boxes(figure):
        panel = axes.get_window_extent()
        assert len(labels) >= 2
        for k, label in enumerate(labels):
            assert panel.x0 <= label.x0 < label.x1 <= panel.x1
            assert panel.y0 <= label.y0 < label.y1 <= panel.y1
            assert not any(label.overlaps(other) for other in labels[:k])


def test_the_farthest_range_is_inside_its_panel():
    times_s, paths = arrivals()
    still = np.broadcast_to([0.0, -302.4, 0.0], (11, 3)) + paths[2] * [0.0, 0.01, 0.0]
    figure = orbit_figure(batch(times_s, still, "tdrs.rtn"))
    low, high = figure.axes[3].get_ylim()
    assert low == 0.0
    assert high == pytest.approx(1.06 * np.linalg.norm(still, axis=-1).max())
    figure = orbit_figure(batch(times_s, still, "tdrs.rtn"), keep_out_m=800.0)
    assert figure.axes[3].get_ylim()[1] > 800.0


def test_a_long_name_stays_on_the_page():
    name = "a_target_with_a_rather_long_name_for_a_plot"
    times_s, position_m = ellipse()
    truth = batch(times_s, position_m, f"{name}.origin")
    parents = {f"{name}.origin": "inertial", name: f"{name}.origin", "lidar": f"{name}.origin"}
    links = {new: truth.poses[old] for new, old in zip(parents, (f"{name}.origin", "tdrs", "lidar"), strict=True)}
    figure = orbit_figure(Truth(times_s, PoseTree(parents, links), {}, truth.sun_direction))
    figure.canvas.draw()
    width, height = figure.canvas.get_width_height()
    for axes in figure.axes:
        for text in (axes.title, axes._left_title, axes._right_title, axes.xaxis.label, axes.yaxis.label):
            box = text.get_window_extent()
            assert not text.get_text() or (box.x0 >= 0 and box.x1 <= width and box.y0 >= 0 and box.y1 <= height)
