"""The journey of one who looks through a camera beside the lidar: the page See, its image, and what a pixel shows."""

import io

import numpy as np
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import choose_camera_window, choose_window
from rso_lidar.scenario import find_examples
from rso_lidar.studio.model.companion_image import describe_point, draw_camera_image
from rso_lidar.studio.model.frame_image import mark_pixel
from tests.studio.browser.page_elements import find, see_variance, wait_until_drawn

CAMERA = """
[[camera]]
name  = "nav"
bands = "rgb"
lens  = { fov_deg = 0.5, f_number = 4, n_rows = 24, n_cols = 32 }
"""


def test_camera_image(journey, tmp_path):
    path = tmp_path / "bench.toml"
    text = find_examples()["bench_plate"].text.replace('axes = "local"', 'axes = "local"\nsun_direction = [-1, 0, 0.5]')
    path.write_text(text + CAMERA, encoding="utf-8")
    (frame,) = rl.simulate(rl.Scenario.load(path), frames=[0])
    row, col = np.argwhere(frame.camera_labels["nav"].target >= 0)[0].tolist()
    windows = choose_window(frame), choose_camera_window("nav", frame)
    x, y, side = mark_pixel(windows[1], row, col)[0]

    page = journey()
    page.get_by_role("tab", name="See").click()
    page.get_by_role("tab", name="Camera").click()
    wait_until_drawn(page, "camera-image")
    picture = page.locator('[data-test="camera-image"] img')
    assert see_variance(picture) > 100.0
    box, (width, height) = picture.bounding_box(), Image.open(io.BytesIO(draw_camera_image(frame, "nav"))).size
    x, y = x + side / 2, y + side / 2
    page.mouse.move(box["x"] + x * box["width"] / width, box["y"] + y * box["height"] / height)
    told = describe_point(frame, "nav", x, y, *windows)
    assert "; plate, " in told
    page.get_by_text(told, exact=True).wait_for()

    page.reload()  # keeps page, panel and camera
    wait_until_drawn(page, "camera-image")
    assert find(page, "camera").count()
