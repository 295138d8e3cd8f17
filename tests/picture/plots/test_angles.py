import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import RecordingError
from rso_lidar.picture import angles_figure, ptu_figure, save_figure
from rso_lidar.picture.plots.angles import join_viewing_geometry
from rso_lidar.pose import Link, PoseTree, pose
from rso_lidar.records import BodyState, PtuAngles, Truth, compute_viewing_geometry, find_shadow_spans_s
from rso_lidar.units import DEG

# The lidar's axes for one that looks along the follower's +x: x right, y down, z ahead (conventions: REP-103 optical).
LIDAR = Rotation.from_matrix([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def passing(count=61, pan_deg=0.0, sun=(0.0, 1.0, 0.0)):
    """A target that passes 100 m ahead from right to left at 10 m/s; the lidar turned left by a pan."""
    time_s = np.linspace(-30.0, 30.0, count)
    position = np.stack([np.full(count, 100.0), 10.0 * time_s, np.full(count, 20.0)], axis=-1)
    velocity = np.broadcast_to([0.0, 10.0, 0.0], (count, 3))
    spin = Link(pose(position), velocity, np.zeros(3))
    turned = Rotation.from_euler("z", pan_deg, degrees=True) * LIDAR
    tree = PoseTree(
        {"follower": "inertial", "target": "follower", "lidar": "follower"},
        {"follower": Link.still(), "target": spin, "lidar": Link.still(pose(rotation=turned))},
    )
    states = {
        "target": BodyState(position, velocity),
        "follower": BodyState(np.zeros((count, 3)), np.zeros((count, 3))),
    }
    lit = {"target": np.where(time_s > 10.0, 0.0, 1.0)}
    return Truth(time_s, tree, states, np.broadcast_to(sun, (count, 3)), None, lit)


def swinging(count=50):
    time_s = np.arange(count) / 10.0
    demand = np.stack([10.0 * np.sin(time_s), np.zeros(count)], axis=-1) * DEG
    late = np.stack([10.0 * np.sin(time_s - 0.05), np.zeros(count)], axis=-1) * DEG
    rate = np.stack([10.0 * np.cos(time_s - 0.05), np.zeros(count)], axis=-1) * DEG
    return time_s, [PtuAngles(*row) for row in zip(demand, late, late, rate, strict=True)]


def test_the_line_of_sight_by_hand():
    seen = compute_viewing_geometry(passing(pan_deg=30.0), "target")
    t = seen.time_s
    y = 10.0 * t
    range_m = np.sqrt(100.0**2 + y**2 + 20.0**2)
    np.testing.assert_allclose(seen.range_m, range_m, rtol=1e-14)
    np.testing.assert_allclose(seen.range_rate_m_s, 10.0 * y / range_m, atol=1e-12)
    np.testing.assert_allclose(seen.azimuth_rad, np.arctan2(y, 100.0), atol=1e-14)  # left positive
    np.testing.assert_allclose(seen.elevation_rad, np.arcsin(20.0 / range_m), atol=1e-14)
    ahead = np.array([np.cos(30 * DEG), np.sin(30 * DEG), 0.0])
    off = np.arccos((100.0 * ahead[0] + y * ahead[1]) / range_m)
    np.testing.assert_allclose(seen.off_boresight_rad, off, atol=1e-12)
    np.testing.assert_allclose(seen.sun_off_boresight_rad, 60.0 * DEG, atol=1e-14)  # Sun to the left, boresight at 30
    np.testing.assert_allclose(seen.phase_rad, np.arccos(-y / range_m), atol=1e-12)  # Sun-target-lidar


def test_range_rate_is_the_derivative_of_range_with_a_turning_lidar():
    truth = passing(601)
    spinning = Link(pose(rotation=LIDAR), np.zeros(3), np.array([0.3, -0.2, 0.5]))  # rad/s
    truth = Truth(truth.time_s, truth.poses.with_node("lidar", "follower", spinning), truth.states, truth.sun_direction)
    seen = compute_viewing_geometry(truth, "target")
    slope = np.gradient(seen.range_m, seen.time_s)[1:-1]
    # central differences over h = 0.1 s: h^2 / 6 * |range'''|, at most 0.859 v^3 / d^2 = 0.083 m/s^3
    np.testing.assert_allclose(seen.range_rate_m_s[1:-1], slope, atol=1.4e-4)


def test_a_batch_and_its_epochs_one_by_one_agree():
    truth = passing()
    whole, single = (
        compute_viewing_geometry(truth, "target"),
        join_viewing_geometry([truth.at(k) for k in range(61)], "target"),
    )
    for name in type(whole).__dataclass_fields__:
        np.testing.assert_array_equal(getattr(whole, name), getattr(single, name))


def test_the_figure_shades_the_shadow_and_marks_the_field(tmp_path):
    figure = angles_figure(passing(), half_field_rad=1.25 * DEG)
    assert len(figure.axes) == 5
    assert any("shadow" in text.get_text() for text in figure.texts)
    ranges, directions, off, sun = figure.axes[:4]
    assert all(len(axes.patches) == 1 for axes in (ranges, directions, off, sun))
    # Dark from the frame at 11 s on: from the middle between two frames to the last.
    assert (off.patches[0].get_x(), off.patches[0].get_width()) == pytest.approx((10.5, 19.5))
    np.testing.assert_allclose(off.lines[1].get_ydata(), 1.25)
    np.testing.assert_allclose(directions.lines[0].get_ydata()[30], 0.0, atol=1e-12)
    assert save_figure(figure, tmp_path / "angles.png").stat().st_size > 40_000


def test_shadow_runs_from_middle_to_middle_between_two_instants():
    time_s = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0])
    assert find_shadow_spans_s(time_s, np.array([1.0, 1.0, 0.0, 0.2, 0.9, 0.0])) == [(1.5, 6.0), (12.0, 16.0)]
    assert find_shadow_spans_s(time_s, np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0])) == [
        (0.0, 0.5)
    ]  # one frame, and the first
    assert find_shadow_spans_s(time_s, np.zeros(6)) == [(0.0, 16.0)]
    assert find_shadow_spans_s(time_s, np.full(6, np.nan)) == []
    half = np.array([1.0, 0.5, 0.5, 0.49, 0.5, 1.0])
    assert find_shadow_spans_s(time_s, half) == [(3.0, 6.0)]  # half a disc is light


def test_spans_of_shadow_may_be_given():
    figure = angles_figure(passing(), shadow_s=[(-np.inf, -20.25), (3.5, 4.5), (40.0, 50.0)])
    bands = [(band.get_x(), band.get_x() + band.get_width()) for band in figure.axes[3].patches]
    assert bands == [(-30.0, -20.25), (3.5, 4.5)]
    assert not any("frames have it" in text.get_text() for text in figure.texts)
    assert not angles_figure(passing(), shadow_s=[]).axes[0].patches


def test_a_target_on_the_boresight_and_the_farthest_range_are_inside_the_axes():
    figure = angles_figure(passing(2))  # 116.0 m at both ends: the axis is not that of the data's span
    ranges, _, off, sun = figure.axes[:4]
    assert ranges.get_ylim()[1] > 1.05 * np.sqrt(100.0**2 + 300.0**2 + 20.0**2)
    assert off.get_ylim()[0] < 0.0
    assert sun.get_ylim()[0] < 0.0
    assert sun.get_ylim()[1] > 180.0


def test_frames_give_the_angles_too(coming):
    for target in (None, "tdrs.rtn"):  # the first target, and axes that are no target
        shown = angles_figure(coming, target).axes[0].lines[0].get_ydata()
        expected = [np.linalg.norm(frame.truth.pose("lidar", target or "tdrs").translation) for frame in coming]
        np.testing.assert_allclose(shown, expected)


def test_a_world_without_a_sun_says_so():
    figure = angles_figure(passing(sun=(np.nan, np.nan, np.nan)))
    assert any("no Sun" in text.get_text() for text in figure.texts)


def test_an_unknown_target_is_told():
    with pytest.raises(RecordingError, match="no target named 'tarmac'; did you mean 'target'"):
        angles_figure(passing(), "tarmac")


def test_demand_and_response(tmp_path):
    time_s, angles = swinging()
    figure = ptu_figure((time_s, angles), "a swing", travel_rad=((-0.2, 0.2), (-1.0, 1.0)), max_rate_rad_s=12.0 * DEG)
    pan, _, errors, rates = figure.axes
    np.testing.assert_allclose(pan.lines[0].get_ydata(), 10.0 * np.sin(time_s))
    np.testing.assert_allclose(errors.lines[0].get_ydata(), 10.0 * (np.sin(time_s - 0.05) - np.sin(time_s)), atol=1e-12)
    heights = [line.get_ydata()[0] for line in rates.lines if len(set(line.get_ydata())) == 1]
    assert any(np.isclose(height, 12.0) for height in heights)
    assert "limits off the scale" in figure.axes[1].get_title(loc="right")  # tilt stands still, its ends are far
    assert save_figure(figure, tmp_path / "ptu.png").stat().st_size > 30_000


def test_without_a_ptu_there_is_nothing_to_draw(handmade):
    with pytest.raises(RecordingError, match="no pan and tilt"):
        ptu_figure((np.zeros(0), []))
