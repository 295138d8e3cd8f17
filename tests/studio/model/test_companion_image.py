"""Images of cameras show each pixel where it is found again, beside the lidar's, and the pyramid lies where they look."""

import io
import json
import struct

import numpy as np
import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import DARK, LIGHT, Stretch, choose_camera_window, choose_window
from rso_lidar.studio.model.companion_image import describe_point, draw_camera_image, list_bands
from rso_lidar.studio.model.flight import PreviewFlight
from rso_lidar.studio.model.flight_scenes import VIEWS
from rso_lidar.studio.model.frame_drawing import draw_recorded_frame
from rso_lidar.studio.model.frame_image import mark_pixel
from tests.settings_for_tests import limit_pixels

LENS = {"fov_deg": 30, "f_number": 4, "n_rows": 24, "n_cols": 32}
CAMERAS = [
    {"name": "nav", "bands": "rgb", "lens": LENS, "exposure_ms": 0.2, "mount": {"position_m": [0, 0.5, 0]}},
    {"name": "away", "lens": LENS, "mount": {"euler_zyx_deg": [90, 0, 0]}},
]


@pytest.fixture(scope="module")
def flight():
    near = ("target[0].motion.position_m=[15, 0, 0]", "lidar.receiver.fov_deg=20", "lidar.laser.divergence_deg=20")
    scenario = rl.Scenario.load("examples/bench_plate.toml", settings=(*limit_pixels(16, 1), *near))
    world = scenario.world.replace(sun_direction=(-1.0, 0.2, 0.5))
    return PreviewFlight(scenario.replace(camera=CAMERAS, world=world))


@pytest.fixture(scope="module")
def frame(flight):
    return flight.frame(0)


def find_plate(frame):
    """Return a pixel (row, col) of the camera in which there is nothing but the plate."""
    row, col = np.argwhere(frame.camera_labels["nav"].filled_fraction == 1.0)[0].tolist()
    return row, col


def test_one_camera_alone_takes_the_image_of_a_run(flight, frame):
    made = flight.frame(0, cameras=("away",))
    assert list(made.camera) == ["away"] and list(frame.camera) == ["nav", "away"]
    np.testing.assert_array_equal(made.camera["away"].intensity_counts, frame.camera["away"].intensity_counts)
    np.testing.assert_array_equal(made.range_m, frame.range_m)


@pytest.mark.parametrize(("scheme", "band", "whole"), [(LIGHT, "", False), (DARK, "blue", True)])
def test_the_colour_of_a_pixel_is_that_of_its_counts(frame, scheme, band, whole):
    row, col = find_plate(frame)
    window = choose_camera_window("nav", frame, whole=whole)
    assert window.whole == whole
    image = np.asarray(Image.open(io.BytesIO(draw_camera_image(frame, "nav", scheme, band=band, whole=whole))))
    x, y, side = mark_pixel(window, row, col)[0]
    counts = frame.camera["nav"].intensity_counts[row, col].astype(float)
    stretch = Stretch.of("nav", frame)
    values = 255.0 * ((counts - stretch.low_counts) / (stretch.high_counts - stretch.low_counts)).clip(0, 1) ** (
        1 / 2.2
    )
    expected = values if not band else np.repeat(values[2], 3)
    assert np.abs(image[int(y + side / 2), int(x + side / 2)] - expected).max() <= 1.0


def test_a_point_is_told_with_counts_target_and_part(frame):
    row, col = find_plate(frame)
    windows = choose_window(frame), choose_camera_window("nav", frame)
    x, y, side = mark_pixel(windows[1], row, col)[0]
    red, green, blue = frame.camera["nav"].intensity_counts[row, col].tolist()
    entry, labels = frame.source.targets[0], frame.camera_labels["nav"]
    part, away = entry.parts[labels.part[row, col]], f"{labels.range_m[row, col]:,.2f} m away"
    told = describe_point(frame, "nav", x + side / 2, y + side / 2, *windows)
    assert told == (
        f"nav, row {row}, column {col}: red {red:,}, green {green:,}, blue {blue:,} counts; {entry.name}, {part}, {away}"
    )
    row, col = np.argwhere(frame.valid)[0].tolist()
    x, y, side = mark_pixel(windows[0], row, col)[1]
    told = describe_point(frame, "nav", x + side / 2, y + side / 2, *windows)
    assert told.startswith(f"lidar, row {row}, column {col}: {frame.range_m[row, col]:,.2f} m, ")
    assert describe_point(frame, "nav", 2.0, 2.0, *windows) == ""
    sky = describe_point(frame, "away", 300.0, 200.0, windows[0], choose_camera_window("away", frame))
    assert sky.startswith("away, row ") and sky.endswith(" counts; sky")
    assert list_bands(frame.source.scenario) == {"nav": ("red", "green", "blue"), "away": ("grey",)}


def test_recordings_show_the_images_of_their_cameras_with_one_stretch(flight, frame, tmp_path):
    bright = flight.scenario.replace(camera=[CAMERAS[0] | {"exposure_ms": 0.4}])
    rl.save(tmp_path / "a.h5", iter([frame]))
    rl.save(tmp_path / "b.h5", rl.simulate(bright, frames=[0]))
    with rl.open(tmp_path / "a.h5") as first, rl.open(tmp_path / "b.h5") as other:
        drawn = draw_recorded_frame(0, first, other, False, LIGHT, "nav")
        assert list(drawn.images) == ["A", "B"]
        assert drawn.images["A"] == draw_camera_image(frame, "nav", beside=other[0]) != draw_camera_image(frame, "nav")
        assert drawn.images["B"] == draw_camera_image(other[0], "nav", beside=frame)
        assert drawn.describe_point("A", 264.0, 250.0).startswith("nav, row ")
        alone = draw_recorded_frame(0, first, other, False, LIGHT, "away")
    assert list(alone.images) == ["A"]
    assert alone.lines[-1] == "The other recording has no image of away of this size."


def test_the_pyramid_of_a_camera_lies_where_it_looks(flight):
    scene, ends = VIEWS["lidar"](flight, 0), []
    packed = scene.pack()
    (length,) = struct.unpack("<I", packed[:4])
    offset = 4 + length
    shown = json.loads(packed[4 : 4 + length])
    colours = {words: colour for colour, words in shown["legend"]["entries"]}
    for item in shown["items"]:
        if "count" in item:
            positions = np.frombuffer(packed, "<f4", 3 * item["count"], offset).reshape(-1, 3)
            offset += 12 * item["count"] + (-(-3 * item["count"] // 4) * 4 if item.get("coloured") else 0)
            if item.get("colour") == colours["field of camera nav"]:
                ends.append(positions)
    pose = flight.truth(0).pose("nav", flight.axes)
    from_lidar = flight.matrix(0, "lidar")[:3, 3]
    corners = pose.apply(np.concatenate(ends) + from_lidar)
    rim = corners[corners[:, 2] > 1.0]
    assert rim[:, 2] == pytest.approx(flight.range_m(0), rel=1e-6)
    across, down = np.abs(rim[:, :2] / rim[:, 2:]).T
    assert across == pytest.approx(np.tan(np.radians(15.0)), rel=1e-5)  # half of a field of 30 degrees
    assert down == pytest.approx(0.75 * np.tan(np.radians(15.0)), rel=1e-5)  # 24 rows and 32 columns
