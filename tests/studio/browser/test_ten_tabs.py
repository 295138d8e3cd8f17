"""Ten tabs at once: each sees its own frame, edits of two tabs in one document are all kept, all view one recording."""

import base64
import re

import rso_lidar as rl
from rso_lidar.studio.model.frame_image import draw_image
from tests.studio.browser.page_elements import find, find_input, find_recording, find_thumb, wait_until_drawn

TABS = 10
READ_IMAGE = """async (place) => {
    const { src } = document.querySelector(place);
    if (src.startsWith("data:")) return src.split(",")[1];
    const answer = await fetch(src);
    return btoa(String.fromCharCode(...new Uint8Array(await answer.arrayBuffer())));
}"""


def read_image(page, name):
    """Return the bytes of an image, as its address gives them."""
    return base64.b64decode(page.evaluate(READ_IMAGE, f'[data-test="{name}"] img'))


def test_ten_tabs(journey, tmp_path, text):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    frames = list(rl.simulate(rl.Scenario.load(path)))
    assert len(frames) == TABS
    rl.save(tmp_path / "bench.h5", frames)
    tabs = [journey() for _ in range(TABS)]
    see_frames(tabs, frames)
    edit_in_two_tabs(tabs, path)
    view_one_recording(tabs, frames)


def see_frames(tabs, frames):
    """Show another frame of the scenario in each tab, all at once, and compare each with that of the package."""
    for page in tabs:
        find(page, "page-see").click()
    for row, page in enumerate(tabs):
        wait_until_drawn(page, "image")
        for _ in range(row):  # faster than a busy server answers: none is lost
            find_thumb(page, "time").press("ArrowRight")
    for row, page in enumerate(tabs):
        find(page, "when").get_by_text(re.compile(f"^frame {row} ")).wait_for(timeout=60_000)
    expected = [draw_image(frame) for frame in frames]
    for row, page in enumerate(tabs):
        for _ in range(100):
            if read_image(page, "image") == expected[row]:
                break
            page.wait_for_timeout(100)
        assert read_image(page, "image") == expected[row], row
    assert len(set(expected)) == TABS


def edit_in_two_tabs(tabs, path):
    """Edit one document in two tabs at the same time, by form and by text, and save it from a third one."""
    first, second, third = tabs[:3]
    for page in tabs:
        find(page, "page-build").click()
    find(first, "table-lidar.laser").click()
    find(second, "table-lidar.receiver").click()
    for step in range(1, 4):
        find_input(first, "lidar.laser.energy_mj").fill(f"{50 + step}")
        find_input(second, "lidar.receiver.f_number").fill(f"2.{step}")
        for page, other in ((first, "receiver"), (second, "laser")):  # neither waits for the edit of the other
            page.keyboard.press("Tab")
            assert find(page, f"table-lidar.{other}").is_visible()
    find(first, "table-lidar.receiver").click()
    find(second, "table-lidar.laser").click()
    wait_for_value(first, "lidar.receiver.f_number", "2.3")
    wait_for_value(second, "lidar.laser.energy_mj", "53")
    find(second, "editor").locator(".cm-line").first.click()
    second.keyboard.type("# by the second tab")
    find(third, "editor").get_by_text("# by the second tab").wait_for()
    find(third, "save").click()
    third.get_by_text("saved bench.toml").wait_for()
    saved = path.read_text(encoding="utf-8")
    for words in ("energy_mj = 53\n", "f_number = 2.3\n", "# by the second tab\n"):
        assert words in saved
    for page in tabs:
        page.get_by_text("bench.toml", exact=True).first.wait_for()
        find(page, "editor").get_by_text("energy_mj = 53").wait_for()


def wait_for_value(page, place, value):
    """Wait until the field at a place has a value."""
    find_input(page, place).wait_for()
    page.wait_for_function(
        "([one, value]) => one.value === value", arg=[find_input(page, place).element_handle(), value]
    )


def view_one_recording(tabs, frames):
    """View one recording in all tabs."""
    expected = draw_image(frames[0])
    for page in tabs:
        find(page, "page-run").click()
        find_recording(page, "bench.h5").get_by_role("checkbox").click()
    for page in tabs:
        wait_until_drawn(page, "frame-A")
        assert read_image(page, "frame-A") == expected
