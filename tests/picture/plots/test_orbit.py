import numpy as np
import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.picture import inertial_figure, orbit_figure, osculating_orbit_m, save_figure
from rso_lidar.picture.plots.orbit import _choose_view
from rso_lidar.picture.plots.trajectory import _describe_cost
from rso_lidar.pose import Link, PoseTree, pose
from rso_lidar.records import BodyState, Truth
from rso_lidar.units import EARTH_GM_M3_S2, EARTH_RADIUS_M

RADIUS_M = 7000e3


def circle(time_s, behind_s=0.0):
    """A circular orbit inclined by 60 degrees."""
    rate = np.sqrt(EARTH_GM_M3_S2 / RADIUS_M**3)
    phase = rate * (time_s - behind_s)
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.5, np.sqrt(0.75)])
    cosine, sine = np.cos(phase)[:, None], np.sin(phase)[:, None]
    return BodyState(RADIUS_M * (cosine * x + sine * y), RADIUS_M * rate * (cosine * y - sine * x))


def batch(count=200, sun=(1.0, 0.0, 0.0), **lit):
    time_s = np.linspace(0.0, 3000.0, count)
    states = {"stage": circle(time_s), "follower": circle(time_s, 0.2)}
    return Truth(time_s, PoseTree({}, {}), states, np.broadcast_to(sun, (count, 3)), None, lit)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.9, 1.4])
def test_the_osculating_orbit_is_the_conic_through_the_state(e):
    # At periapsis r = 7000 km, v^2 = GM (1 + e) / r; vis-viva and the orbit equation hold at every point of the conic.
    speed = np.sqrt(EARTH_GM_M3_S2 * (1.0 + e) / RADIUS_M)
    points = osculating_orbit_m(np.array([RADIUS_M, 0.0, 0.0]), np.array([0.0, 0.6 * speed, 0.8 * speed]))
    distance = np.linalg.norm(points, axis=-1)
    p = RADIUS_M * (1.0 + e)
    np.testing.assert_allclose(distance, p - e * points[:, 0], rtol=1e-12)
    np.testing.assert_allclose(points[:, 1] * 0.8, points[:, 2] * 0.6, atol=1e-6)
    assert distance.min() == pytest.approx(RADIUS_M, rel=1e-9)
    if e < 1.0:
        assert distance.max() == pytest.approx(p / (1.0 - e), rel=1e-4)


def test_two_views_of_all_bodies(tmp_path, caplog):
    figure = inertial_figure(batch(stage=np.ones(200)), "two in one orbit")
    assert len(figure.axes) == 2
    for axes in figure.axes:
        assert axes.get_aspect() == 1.0
        assert "Sun" in [text.get_text() for text in axes.texts]
    words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert words == ["stage", "follower"]
    assert save_figure(figure, tmp_path / "orbit.png").stat().st_size > 40_000
    assert caplog.text == ""


def test_from_the_pole_the_circle_is_round_and_the_sun_to_the_right():
    pole = inertial_figure(batch(sun=(0.6, 0.8, 0.0))).axes[1]
    drawn = next(line.get_xydata() for line in pole.lines if line.get_label() == "stage")
    np.testing.assert_allclose(np.hypot(*drawn.T), RADIUS_M / 1e3, rtol=1e-9)
    sun = next(text for text in pole.texts if text.get_text() == "Sun")
    assert sun.xy[0] > EARTH_RADIUS_M / 1e3
    assert sun.xy[1] == pytest.approx(0.0, abs=1.0)


def test_shadow_is_said_only_where_there_is_some():
    lit = np.ones(200)
    said = [text.get_text() for text in inertial_figure(batch(stage=lit)).texts]
    assert not any("hides the Sun" in words for words in said)
    lit[50:90] = 0.0
    figure = inertial_figure(batch(stage=lit))
    assert any("hides the Sun" in text.get_text() for text in figure.texts)


def shadowed(figure):
    """The points (point, 2) [km] of black lines on the view from the pole."""
    lines = [line.get_xydata() for line in figure.axes[1].lines if line.get_color() == "#1c1e22"]
    points = np.concatenate(lines)
    return points[np.isfinite(points).all(axis=-1)]


def test_shadow_between_frames_is_drawn_where_the_caller_says():
    # 12 frames 272.7 s apart; the given span lies between two frames, at phases n t of the circle.
    rate = np.sqrt(EARTH_GM_M3_S2 / RADIUS_M**3)
    lit = {"stage": np.ones(12), "follower": np.ones(12)}
    spans = {"stage": [(300.0, 500.0)], "follower": []}
    figure = inertial_figure(batch(12, **lit), shadows_s=spans)
    points = shadowed(figure)
    start = next(line.get_xydata()[0] for line in figure.axes[1].lines if line.get_label() == "stage")
    turned = np.unwrap(np.arctan2(points[:, 1], points[:, 0]) - np.arctan2(start[1], start[0]))
    # Hermite's cubic over a = 0.294 rad is off by a^4 / 384 = 2e-5 of the radius at most
    assert (turned.min() / rate, turned.max() / rate) == pytest.approx((300.0, 500.0), abs=2e-5 / rate)
    assert not any("frames have it" in text.get_text() for text in figure.texts)


def test_one_dark_frame_is_dark_to_the_middle_of_its_neighbours():
    lit = np.ones(12)
    lit[4] = 0.0
    points = shadowed(inertial_figure(batch(12, stage=lit)))
    rate = np.sqrt(EARTH_GM_M3_S2 / RADIUS_M**3)
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert np.ptp(angles) / rate == pytest.approx(3000.0 / 11.0, abs=4e-5 / rate)


def test_the_path_between_coarse_frames_is_round():
    # 600 s are 0.647 rad: 0.647^4 / 384 = 4.6e-4 of the radius; a chord's middle would lie 5 % inside.
    pole = inertial_figure(batch(6)).axes[1]
    drawn = next(line.get_xydata() for line in pole.lines if line.get_label() == "stage")
    drawn = drawn[np.isfinite(drawn).all(axis=-1)]
    assert len(drawn) > 80
    np.testing.assert_allclose(np.hypot(*drawn.T), RADIUS_M / 1e3, rtol=4.6e-4)


def test_what_does_not_orbit_has_no_such_picture():
    time_s = np.arange(3.0)
    still = BodyState(np.ones((3, 3)), np.zeros((3, 3)))
    with pytest.raises(RecordingError, match="no body orbits"):
        inertial_figure(Truth(time_s, PoseTree({}, {}), {"plate": still}, np.full((3, 3), np.nan)))


def relative(position_m, time_s):
    """The lidar at positions in a target's rtn axes."""
    tree = PoseTree(
        {"stage.rtn": "inertial", "lidar": "stage.rtn"},
        {"stage.rtn": Link.still(), "lidar": Link.still(pose(position_m))},
    )
    return Truth(time_s, tree, {}, np.zeros((len(time_s), 3)))


def test_three_planes_of_a_relative_orbit_with_impulses_and_a_keep_out_sphere(tmp_path):
    time_s = np.linspace(0.0, 100.0, 101)
    position_m = np.stack([np.sin(time_s / 20.0) * 80.0, 3.0 * time_s - 400.0, 0.5 * time_s], axis=-1)
    impulses = [(0.0, np.array([0.3, 0.0, 0.0])), (50.5, np.array([0.0, -0.4, 0.0]))]
    plan = relative(position_m, time_s)
    figure = orbit_figure(plan, impulses=impulses, keep_out_m=60.0, delta_v_m_s=0.96507, title="a plan")
    assert figure.texts[1].get_text().endswith("   ·   delta-v 0.965 m/s in all, 0.7 of it in 2 impulses")
    planes = figure.axes[:3]
    for axes, (right, up) in zip(planes, [(1, 0), (1, 2), (2, 0)], strict=True):
        np.testing.assert_allclose(axes.lines[2].get_xydata(), position_m[:, [right, up]])
        assert {patch.radius for patch in axes.patches} == {60.0}
        marks = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "^"]
        here = 0.5 * (position_m[50] + position_m[51])  # halfway between two rows
        np.testing.assert_allclose(marks[1], here[[right, up]])
        # An impulse along the line of sight of a plane has no arrow in it.
        arrows = [text.get_position() for text in axes.texts if text.arrow_patch is not None]
        expected = [27.0 * (right == 0), 27.0 * (up == 0)], [-36.0 * (right == 1), -36.0 * (up == 1)]
        assert [tuple(np.round(arrow, 6)) for arrow in arrows] == [tuple(way) for way in expected if any(way)]
    assert save_figure(figure, tmp_path / "plan.png").stat().st_size > 40_000


@pytest.mark.parametrize(
    ("impulses", "total", "words"),
    [
        ([], None, None),
        ([], 0.3, "delta-v 0.3 m/s in all"),
        ([0.4], None, "1 impulse, 0.4 m/s"),
        ([0.3, 0.4], None, "2 impulses, 0.7 m/s together"),
        ([0.2, 0.2], 0.4, "2 impulses, 0.4 m/s in all"),
        ([0.2, 0.2], 0.46507, "delta-v 0.465 m/s in all, 0.4 of it in 2 impulses"),
    ],
)
def test_the_total_of_a_plan_is_the_callers(impulses, total, words):
    assert _describe_cost(impulses, total) == (f"   ·   {words}" if words else "")


@pytest.mark.parametrize("phase", [150.0, 180.0, 210.0])
def test_the_path_is_drawn_before_the_earth(phase):
    """Seen from where the path leans a fifth of its way towards the eye, whatever its size."""
    middle_m = RADIUS_M * np.array([np.cos(np.radians(phase)), np.sin(np.radians(phase)), 0.0])
    eye = _choose_view(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), middle_m)
    assert eye @ middle_m / RADIUS_M > 0.2
