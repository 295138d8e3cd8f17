import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FixedPoint, Ptu, ScanPoint, TrackPoint
from rso_lidar.motion.gimbal.demand import DemandCurve, find_pan_tilt
from rso_lidar.units import DEG


@pytest.mark.parametrize(
    ("direction", "pan_deg", "tilt_deg"),
    [
        ((1, 0, 0), 0, 0),
        ((0, 1, 0), 90, 0),  # left
        ((0, -1, 0), -90, 0),
        ((1, 0, 1), 0, 45),  # up
        ((1, 1, -np.sqrt(2)), 45, -45),
        ((-1, 0, 0), 180, 0),
        ((0, 0, 1), 0, 90),
    ],
)
def test_pan_is_left_and_tilt_is_up(direction, pan_deg, tilt_deg):
    pan, tilt = find_pan_tilt(3.0 * np.array(direction))
    assert pan / DEG == pytest.approx(pan_deg)
    assert tilt / DEG == pytest.approx(tilt_deg)


def test_fixed_point_asks_for_one_thing():
    np.testing.assert_allclose(FixedPoint(pan_deg=10, tilt_deg=-5).demand(np.arange(3.0)) / DEG, [[10, -5]] * 3)


SCANS = [
    ScanPoint(pattern="raster", pan_deg=5, half_width_deg=4, half_height_deg=1, step_deg=0.5, rate_deg_s=3),
    ScanPoint(pattern="raster", half_width_deg=4, half_height_deg=0, step_deg=0.5, rate_deg_s=3),
    ScanPoint(pattern="raster", half_width_deg=0.3, half_height_deg=1, step_deg=0.7, rate_deg_s=3),
    ScanPoint(pattern="spiral", tilt_deg=-2, radius_deg=3, step_deg=0.5, rate_deg_s=3),
]


@pytest.mark.parametrize("scan", SCANS)
def test_scans_move_at_their_rate_and_never_jump(scan):
    time = np.arange(0, 200_000) * 1e-3
    step = np.diff(scan.demand(time) / DEG, axis=0)
    length = np.hypot(*step.T)
    assert length.max() <= 3e-3 * (1 + 1e-9)  # a chord is no longer than its arc
    # shorter only at corners and turns of the way, and by the curvature at the heart of a spiral
    assert np.mean(length < 3e-3 * (1 - 1e-3)) < 0.02


def test_raster_covers_its_box_from_the_upper_left_and_repeats():
    scan = SCANS[0]
    way = (5 * 8 + 2) / 3.0  # five lines of 8 deg and four steps of 0.5 deg, at 3 deg/s
    angles = scan.demand(np.linspace(0, way, 40_001)) / DEG
    np.testing.assert_allclose(angles[0], [9, 1])  # pan grows to the left
    np.testing.assert_allclose(angles[-1], [1, -1], atol=1e-12)
    np.testing.assert_allclose((angles.min(axis=0), angles.max(axis=0)), [[1, -1], [9, 1]], atol=1e-12)
    lines = np.unique(np.round(angles[np.abs(angles[:, 0] - 5) < 3.9, 1], 9))
    np.testing.assert_allclose(lines, [-1, -0.5, 0, 0.5, 1], atol=1e-9)
    time = np.linspace(0, 5, 50)
    np.testing.assert_allclose(scan.demand(time + 2 * way), scan.demand(time), atol=1e-12)
    np.testing.assert_allclose(scan.demand(2 * way - time), scan.demand(time), atol=1e-12)


def test_spiral_grows_by_its_step_each_turn_to_its_radius():
    scan = SCANS[3]
    x, y = (scan.demand(np.arange(0, 60_000) * 1e-3) / DEG - [0, -2]).T
    radius = np.hypot(x, y)
    assert radius[0] == 0.0
    assert radius.max() == pytest.approx(3.0, abs=3e-3)
    out = slice(1, int(np.argmax(radius)))
    turns = np.unwrap(np.arctan2(y[out], x[out])) / (2 * np.pi)
    np.testing.assert_allclose(radius[out], 0.5 * turns, atol=1e-9)


@pytest.mark.parametrize(
    ("fields", "cure"),
    [
        ({"pattern": "raster", "radius_deg": 1}, "half_width_deg and half_height_deg"),
        ({"pattern": "raster", "half_width_deg": 1}, "half_width_deg and half_height_deg"),
        ({"pattern": "spiral"}, "radius_deg"),
        ({"pattern": "spiral", "radius_deg": 1, "half_width_deg": 1}, "radius_deg"),
        ({"pattern": "star", "radius_deg": 1}, "pattern"),
    ],
)
def test_scans_of_no_clear_size_are_refused(fields, cure):
    with pytest.raises(ScenarioError, match=cure):
        ScanPoint(step_deg=0.1, rate_deg_s=1, **fields)


def test_points_are_told_apart_by_their_type():
    point = Ptu(point={"type": "track", "at": "tdrs"}).point
    assert isinstance(point, TrackPoint)
    with pytest.raises(ScenarioError, match="did you mean 'track'"):
        Ptu(point={"type": "trak", "at": "tdrs"})


# ------------------------------------------------------------------------------------------ a demand that follows


def flyby(time):
    """Return a straight pass at a least distance of 1 km at 100 m/s: 5.7 deg/s at most."""
    return np.stack([np.full_like(time, 1000.0), 100.0 * (time - 60.0), np.full_like(time, 50.0)], axis=-1)


def test_the_curve_follows_a_flyby_as_well_as_it_promises():
    curve = DemandCurve(flyby, 120.0)
    time = np.arange(0.0, 120.0, 0.0037)
    expected = np.stack(find_pan_tilt(flyby(time)), axis=-1)
    # The promise is 0.017 h^3 max|f'''|; the third derivative of atan(u / 10 s) is at most 2 / (10 s)^3. Slopes at the
    # ends are one-sided, twice as far off, but there the pass is slow.
    assert np.abs(curve(time) - expected).max() < 0.017 * 0.05**3 * 2e-3


def test_the_curve_goes_smoothly_through_a_turn():
    def around(time):
        return np.stack([np.cos(0.3 * time), np.sin(0.3 * time), 0.1 + 0 * time], axis=-1)

    pan = DemandCurve(around, 400.0)(np.arange(0.0, 400.0, 0.01))[:, 0]
    np.testing.assert_allclose(pan, 0.3 * np.arange(0.0, 400.0, 0.01), atol=1e-6)


def test_the_curve_is_smooth_where_blocks_meet():
    joint = DemandCurve.BLOCK * DemandCurve.KNOT_S
    h = 1e-4
    curve = DemandCurve(lambda time: flyby(time - joint + 25.6), 2.0 * joint)  # passes 4.4 s after the joint
    a, b, c, d, e = curve(joint + h * np.arange(-2, 3))[:, 0]
    assert ((e - d) - (b - a)) / h == pytest.approx(2.0 * h * (e - 2 * c + a) / (4 * h * h), rel=1.0, abs=1e-7)
    assert ((d - c) - (c - b)) / h == pytest.approx(0.0, abs=1e-5)  # no kink: slope times curvature is 1e-3 * 1e-4


def test_the_slope_is_one_on_both_sides_of_a_joint():
    """Of 0.4 sin 3t, whose third derivative f3 is 10.8 there: a slope by one side errs by h^2 f3 / 3, 9e-3 rad/s.

    A straight chord over 0.1 ms errs by nothing here; central differences on both sides are one number, h^2 f3 / 6 off.
    """
    joint, h = DemandCurve.BLOCK * DemandCurve.KNOT_S, 1e-4

    def nodding(time):
        angle = 0.4 * np.sin(3.0 * (time - joint))
        return np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)

    before, here, after = DemandCurve(nodding, 2.0 * joint)(joint + h * np.array([-1.0, 0.0, 1.0]))[:, 0]
    assert (here - before) / h == pytest.approx((after - here) / h, abs=1e-3)
    assert (after - before) / (2.0 * h) == pytest.approx(1.2, abs=1.1 * 0.05**2 * 10.8 / 6.0)


def test_the_curve_has_the_same_bits_however_it_is_asked():
    def spinning(time):
        return np.stack([np.cos(0.5 * time), np.sin(0.5 * time), 0.3 * np.cos(time)], axis=-1)

    time = np.arange(0, 120_000) / 1000
    whole = DemandCurve(spinning, 120.0)(time)
    pieces = DemandCurve(spinning, 120.0)
    cut = [pieces(part) for part in np.split(time, [1, 2, 777, 25_600, 51_199, 100_000])]
    assert np.array_equal(whole, np.concatenate(cut))
    assert np.array_equal(whole[3:9], pieces(time[3:9]))  # and back
    late = DemandCurve(spinning, 120.0)
    assert np.array_equal(late(time[-5:]), whole[-5:])  # at once to the end: the turns before are counted


def test_the_curve_never_asks_beyond_the_end_and_holds_little():
    asked = []

    def watched(time):
        asked.append((time.min(), time.max(), len(time)))
        return flyby(time)

    curve = DemandCurve(watched, 99.97)
    curve(np.arange(0, 99_970) / 1000)
    assert min(low for low, _, _ in asked) == 0.0
    assert max(high for _, high, _ in asked) == pytest.approx(99.95)
    assert max(count for _, _, count in asked) <= DemandCurve.BLOCK + 3
    expected = np.stack(find_pan_tilt(flyby(np.array([99.97]))), axis=-1)
    np.testing.assert_allclose(curve(np.array([99.97])), expected, atol=1e-8)


@pytest.mark.parametrize("end_s", [0.0, 0.03, 0.05, 0.1])
def test_the_curve_of_a_short_run(end_s):
    angles = DemandCurve(lambda time: flyby(time + 60.0), end_s)(np.array([0.0, end_s]))
    expected = np.stack(find_pan_tilt(flyby(60.0 + np.array([0.0, end_s]))), axis=-1)
    # below one knot the first angle stays: off by rate times time
    np.testing.assert_allclose(angles, expected, atol=0.1 * end_s if end_s < 0.05 else 1e-6)
