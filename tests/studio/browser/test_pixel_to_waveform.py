"""The journey of one who asks what a pixel saw: the page See, the last frame, a click on a lit pixel, its waveform."""

import io
import shutil

import numpy as np
from PIL import Image

import rso_lidar as rl
from rso_lidar.picture import choose_window
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.frame_image import draw_image, mark_pixel
from tests.studio.browser.page_elements import find, find_thumb, see_variance, wait_until_drawn

IMAGE = '[data-test="image"] img'


def test_pixel_to_waveform(journey, tmp_path):
    path = tmp_path / "approach.toml"
    shutil.copyfile(shipped("examples/tdrs_approach.toml"), path)
    scenario = rl.Scenario.load(path)
    last = scenario.time.n_frames - 1
    (frame,) = rl.simulate(scenario, frames=[last])

    page = journey()
    page.get_by_role("tab", name="See").click()
    wait_until_drawn(page, "image")
    first = page.get_attribute(IMAGE, "src")
    track = page.locator('[data-test="time"]').bounding_box()
    page.mouse.click(track["x"] + track["width"] - 1, track["y"] + track["height"] / 2)
    find_thumb(page, "time").press("ArrowRight")  # the click may end one row before
    page.get_by_text(f"frame {last}").wait_for()
    page.wait_for_function(
        "([place, old]) => { const it = document.querySelector(place); return it.src.indexOf(old) < 0 && it.complete; }",
        arg=[IMAGE, first],
    )

    rows, cols = np.nonzero(frame.valid & (frame.labels.target >= 0))
    row, col = int(rows[len(rows) // 3]), int(cols[len(rows) // 3])
    x, y, side = mark_pixel(choose_window(frame), row, col)[0]
    width, height = Image.open(io.BytesIO(draw_image(frame))).size
    box = page.locator(IMAGE).bounding_box()
    page.mouse.click(
        box["x"] + (x + side / 2) * box["width"] / width, box["y"] + (y + side / 2) * box["height"] / height
    )

    page.get_by_text(f"{frame.range_m[row, col]:,.3f} m", exact=True).first.wait_for()
    page.get_by_text(f"{frame.labels.range_m[row, col]:,.3f} m", exact=True).first.wait_for()
    assert page.get_by_label("Row").input_value() == str(row)
    assert page.get_by_label("Column").input_value() == str(col)
    chart = page.locator('[data-test="waveform"]')
    chart.get_by_text("reported pulse").first.wait_for()
    assert see_variance(chart) > 10.0
    page.wait_for_selector("[data-ready]")
    assert see_variance(page.locator('[data-test="space"] canvas')) > 10.0
    assert see_variance(page.locator(IMAGE)) > 100.0

    find(page, "scheme").click()  # from that of the system, which is light, to dark
    page.wait_for_selector("body.body--dark")
    page.reload()  # keeps page, frame, pixel and scheme
    page.get_by_text(f"frame {last}").wait_for()
    page.get_by_text(f"{frame.range_m[row, col]:,.3f} m", exact=True).first.wait_for()
    assert page.get_by_label("Row").input_value() == str(row)
    page.wait_for_selector("body.body--dark")
