"""The timeline of an encounter: geometry against closed forms, light against rendered frames."""

import csv

import numpy as np
import pytest
from matplotlib.colors import to_hex

import rso_lidar as rl
from rso_lidar.mission_analysis.time_history.opportunities import find_detection_curve
from rso_lidar.picture import palette

HALF_FIELD = 1.25 * rl.units.DEG


@pytest.fixture
def passing(text, tmp_path):
    """Return a bench whose plate, always facing, moves 20 m/s to the left, 100 m ahead; and the text to change."""
    (tmp_path / "way.csv").write_text("time_s,x_m,y_m,z_m\n0,100,-20,5\n2,100,20,5\n", encoding="utf-8")
    moved = text.replace('type = "fixed", position_m = [1000, 0, 0]', 'type = "table", file = "way.csv"')
    moved = moved.replace(
        '{ type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }', '{ type = "look_at", at = "follower" }'
    )
    assert moved.count("way.csv") == moved.count("look_at") == 1
    return moved, tmp_path


def test_a_straight_pass_in_closed_form(passing):
    text, folder = passing
    table = rl.timeline(rl.Scenario.loads(text, folder=folder)).table
    x, y, z = 100.0, -20.0 + 20.0 * table["time_s"], 5.0
    level = np.hypot(x, y)
    r = np.sqrt(x**2 + y**2 + z**2)
    close = {"rtol": 1e-9, "atol": 1e-12}  # rounding, through the spline of the table
    np.testing.assert_allclose(table["range_m"], r, **close)
    np.testing.assert_allclose(table["range_rate_m_s"], 20.0 * y / r, **close)
    np.testing.assert_allclose(table["azimuth_rate_rad_s"], 20.0 * x / level**2, **close)
    np.testing.assert_allclose(table["elevation_rate_rad_s"], -z * 20.0 * y / level / r**2, **close)
    np.testing.assert_allclose(table["line_of_sight_rate_rad_s"], 20.0 * np.hypot(x, z) / r**2, **close)
    # The PTU's angles to a target from its own origin are those directions: demand's cubic is good to nanoradians.
    np.testing.assert_allclose(table["pan_demand_rate_rad_s"], 20.0 * x / level**2, rtol=1e-3)
    assert "phase_rad" not in table  # a bench has no Sun
    assert not table["pan_at_greatest_rate"].any()
    assert not table["pan_beyond_travel"].any()


def test_a_drive_too_slow_or_too_short_is_told(passing):
    text, folder = passing
    slow = text.replace("damping = 0.7 }", "damping = 0.7, max_rate_deg_s = 11.3, pan_limits_deg = [-9, 9] }")
    table = rl.timeline(rl.Scenario.loads(slow, folder=folder)).table
    y = -20.0 + 20.0 * table["time_s"]
    needed = 20.0 * 100.0 / (100.0**2 + y**2)  # [rad/s], 11.46 deg/s in the middle
    fast = needed > 11.3 * rl.units.DEG
    assert 0 < fast.sum() < fast.size
    assert (table["pan_at_greatest_rate"][fast] == 1).all()
    beyond = np.abs(np.arctan2(y, 100.0)) > 9.0 * rl.units.DEG
    np.testing.assert_array_equal(table["pan_beyond_travel"], beyond)
    assert not table["tilt_at_greatest_rate"].any()
    assert table["pointing_error_rad"][beyond].max() > 1.0 * rl.units.DEG  # 11.3 deg asked at the ends of the way


def test_half_a_plate_at_the_edge_of_the_field(text):
    side = 1000.0 * np.tan(HALF_FIELD)
    changes = {
        "[1000, 0, 0]": f"[1000, {side}, 0]",
        'point    = { type = "track", at = "plate" }\n': "",
        'attitude = { type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }\n': "",
        "errors   = { jitter_deg = 0.001, encoder_noise_deg = 0.001 }\n": "",
    }
    quiet = text
    for old, new in changes.items():
        assert old in quiet
        quiet = quiet.replace(old, new)
    table = rl.timeline(rl.Scenario.loads(quiet)).table
    np.testing.assert_allclose(table["in_field_fraction"], 0.5, atol=1e-5)  # the plate is 2 mm thick
    pixel_m = 1000.0 * 2.0 * np.tan(HALF_FIELD) / 32
    np.testing.assert_allclose(table["width_pixels"], 4.0 / pixel_m, rtol=1e-4)  # 4 m wide, 2 mm thick
    np.testing.assert_allclose(table["filled_pixels"], 0.5 * (4.0 / pixel_m) ** 2, rtol=0.02)  # refined grid of rays
    beside = rl.timeline(rl.Scenario.loads(quiet.replace(f"{side}", f"{side + 2.1}"))).table
    behind = rl.timeline(rl.Scenario.loads(quiet.replace("[1000,", "[-1000,"))).table
    for nothing in (beside, behind):
        for name in ("in_field_fraction", "target_pixels", "filled_pixels", "brightest_photons", "expected_returns"):
            assert not nothing[name].any(), name


@pytest.mark.parametrize("detector", ["gsfl", "empirical"])
def test_light_is_that_of_rendered_frames(text, detector):
    """Rays are cast at 6 of 12 frames of a tumbling satellite; the others are carried, within 20 and 30 %."""
    craft = text.replace('model    = "plate"', 'model    = "tdrs"').replace("[1000, 0, 0]", "[600, 0, 0]")
    craft = craft.replace("duration_s    = 2", "duration_s    = 2.4") + f'\n[lidar.detector]\ntype = "{detector}"\n'
    scenario = rl.Scenario.loads(craft)
    table = rl.timeline(scenario, casts=6).table
    assert table["cast"].sum() == 6
    returns, expected = 0, 0.0
    for frame in rl.simulate(scenario):
        k, on = frame.index, frame.labels.target == 0
        near = {"rel": 1e-6} if table["cast"][k] else {"rel": 0.2}
        assert table["target_pixels"][k] == pytest.approx(on.sum(), **near)
        assert table["filled_pixels"][k] == pytest.approx(frame.labels.filled_fraction.sum(), **near)
        bright = {"rel": 1e-6} if table["cast"][k] else {"rel": 0.3}
        assert table["brightest_photons"][k] == pytest.approx(frame.labels.photons.max(), **bright)
        returns += int((frame.valid & on).sum())
        expected += float(table["expected_returns"][k])
    # 12 frames of some 130 pixels, most of them sure: 3 binomial sigmas of what is unsure are below 60, and the curve's own
    # error of 0.035 a level, shared by neighbours, adds 3 %.
    assert returns == pytest.approx(expected, abs=60 + 0.03 * expected)


def test_detection_curves():
    lidar = rl.Lidar(receiver=rl.Receiver(fov_deg=2.5, f_number=2.8))
    chain = find_detection_curve(lidar)
    # 95 % at 1000 photons is what the preset was solved for; 200 trials a level: 3 sigma are 0.046, and isotonic
    # regression shares neighbours.
    assert float(chain(np.array(1000.0))) == pytest.approx(0.95, abs=0.046)
    assert float(chain(np.array(0.0))) == 0.0
    assert float(chain(np.array(1e7))) == 1.0
    assert (np.diff(chain(np.geomspace(1, 1e6, 500))) >= 0.0).all()
    told = find_detection_curve(lidar.replace(detector=rl.Empirical()))
    photons = np.geomspace(300.0, 3000.0, 50)
    # Linear between 24 levels a decade: h²/8 times the greatest curvature, 0.008 at the bend.
    np.testing.assert_allclose(told(photons), rl.Empirical().detection_probability(photons), atol=0.01)


def test_what_is_too_near_or_too_far_for_the_detector_is_not_found(text):
    table = rl.timeline(rl.Scenario.loads(text + '\n[lidar.detector]\ntype = "gsfl"\narmed_from_m = 1200\n')).table
    assert (table["brightest_photons"] > 1000.0).all()
    assert not table["detection_probability"].any()


def test_rows_and_files(passing):
    text, folder = passing
    made = rl.timeline(rl.Scenario.loads(text, folder=folder), "plate", every_s=0.4)
    np.testing.assert_allclose(made.table["time_s"], [0.0, 0.4, 0.8, 1.2, 1.6, 1.8])  # and the last
    place = made.save(folder / "pass.csv")
    with place.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["range_m"]) for row in rows] == made.table["range_m"].tolist()
    units = ("_s", "_m", "_m_s", "_rad", "_rad_s", "_fraction", "_pixels", "_photons", "_probability", "_returns")
    flags = ("utc", "cast", "_beyond_travel", "_at_greatest_rate")
    assert all(name.endswith(units + flags) for name in made.table)
    assert len(made.figure().axes) == 6 + 2 + 2  # panels, with a PTU and no Sun, and two axes at the right
    assert made.save(folder / "pass.png").read_bytes().startswith(b"\x89PNG")


def test_the_figure_shades_when_the_target_leaves_the_field(passing):
    text, folder = passing
    still = 'ptu.point={type="fixed", tilt_deg=2.8624}'  # the plate crosses the field in the middle of the run
    made = rl.timeline(rl.Scenario.loads(text, folder=folder, settings=(still,)), "plate")
    shades = [patch for patch in made.figure().axes[0].patches if to_hex(patch.get_facecolor()) == palette.ALARM_SHADE]
    depth = [sum(a.get_x() < t < a.get_x() + a.get_width() for a in shades) for t in made.table["time_s"][1:-1]]
    seen = made.table["in_field_fraction"][1:-1]
    assert (
        {0, 2} <= set(depth) and (np.array(depth)[seen == 1.0] == 0).all() and (np.array(depth)[seen == 0.0] == 2).all()
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"target": "plat"}, "did you mean 'plate'"),
        ({"every_s": 0.0}, "seconds above 0"),
        ({"every_s": 0.1}, "frames are 0.2 s apart"),
        ({"casts": 0}, "from 1"),
    ],
)
def test_refused(text, given, said):
    with pytest.raises(rl.ScenarioError, match=said):
        rl.timeline(rl.Scenario.loads(text), **given)


def test_in_orbit_there_is_a_sun():
    scenario = rl.Scenario.load("examples/tumbling_inspection.toml", ("time.duration_s=1200",))
    made = rl.timeline(scenario, every_s=60, casts=1)
    assert {"phase_rad", "sun_off_boresight_rad", "sunlit_fraction"} <= set(made.table)
    dark = made.table["sunlit_fraction"] < 0.5
    assert made.shadow_s
    inside = [any(a <= t <= b for a, b in made.shadow_s) for t in made.table["time_s"]]
    np.testing.assert_array_equal(dark, inside)
    assert 0 < dark.sum() < dark.size
    assert len(made.figure().axes) == 7 + 2
