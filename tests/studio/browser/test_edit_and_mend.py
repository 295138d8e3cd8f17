"""The journey of one who mistypes: a wrong number, the way to it, the right one, a run, and its comparison with another."""

import base64
import re

import rso_lidar as rl
from rso_lidar.evaluation import compare_frames
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.frame_image import draw_difference, draw_image
from tests.studio.browser.page_elements import (
    find,
    find_differences,
    find_input,
    find_recording,
    find_thumb,
    run_command_line,
    see_variance,
    start_run,
)

FIELD = "lidar.laser.energy_mj"
FRAMES, COUNT = "536:540", 4


def read_image(page, name):
    """Return the bytes of an image on the page."""
    return base64.b64decode(find(page, name).locator("img").get_attribute("src").partition(",")[2])


def test_edit_mend_run_and_compare(journey, tmp_path):
    text = shipped("examples/tdrs_approach.toml").read_text(encoding="utf-8")
    path = tmp_path / "approach.toml"
    path.write_bytes(text.encode())
    run_command_line(path, tmp_path / "before.h5", FRAMES)
    page = journey()
    make_and_mend_an_error(page)
    assert path.read_bytes() == text.encode()

    find(page, "save").click()
    page.get_by_text("saved approach.toml").wait_for()
    mended = re.sub(r"(?m)^(energy_mj +=) 50$", r"\1 40", text)
    assert path.read_bytes().decode() == mended != text
    assert [one.name for one in tmp_path.iterdir() if one.name.endswith(".draft")] == []

    find(page, "page-run").click()
    start_run(page, "after.h5", FRAMES)
    run_command_line(path, tmp_path / "command.h5", FRAMES)
    assert find_differences(tmp_path / "after.h5", tmp_path / "command.h5") == []
    assert "intensity" in find_differences(tmp_path / "after.h5", tmp_path / "before.h5")
    compare_recordings(page, tmp_path)

    find(page, "page-build").click()
    find(page, "undo").click()
    page.get_by_text("approach.toml (edited)").wait_for()


def make_and_mend_an_error(page):
    """Type a wrong number, see that no page flies it, go to it from another table, and correct it."""
    page.get_by_text("Ready to fly: 540 frames").wait_for()
    find(page, "table-lidar.laser").click()
    energy = find_input(page, FIELD)
    assert energy.input_value() == "50"
    energy.fill("-3")
    energy.press("Tab")
    page.wait_for_function(
        "([place, words]) => document.querySelector(place)?.textContent.includes(words)",
        arg=['[data-test="verdict"]', FIELD],
    )
    assert "approach.toml" in find(page, "verdict").inner_text()
    page.get_by_text("approach.toml (edited)").wait_for()
    find(page, "page-run").click()
    page.wait_for_function("document.querySelector('[data-test=\"start\"]')?.disabled")
    find(page, "page-see").click()
    page.get_by_role("button", name="Show in Build").click()

    find(page, "table-time").click()
    find(page, "field-time.duration_s").wait_for()
    find(page, "go-to-problem").click()
    energy = find_input(page, FIELD)
    energy.wait_for()
    page.wait_for_function(
        "(place) => document.activeElement && document.activeElement.closest(place) !== null",
        arg=f'[data-test="field-{FIELD}"]',
    )
    assert energy.input_value() == "-3"
    energy.fill("forty")
    energy.press("Tab")
    page.get_by_text("forty: is not a number such as 12.5").wait_for()
    energy.fill("40")
    energy.press("Tab")
    page.get_by_text("Ready to fly: 540 frames").wait_for()


def compare_recordings(page, folder):
    """Compare the new recording with the one before, frame by frame, by one slider."""
    find_recording(page, "after.h5").get_by_text("complete").wait_for()
    page.get_by_text(re.compile(r"^after\.h5: ")).wait_for()  # shown by itself, because it was started here
    find(page, "compare").click()
    page.get_by_role("option", name="before.h5", exact=True).click()
    find(page, "frame-difference").locator("img").wait_for()
    words = find(page, "words")
    thumb = find_thumb(page, "slider")
    thumb.press("Home")
    seen = set()
    with rl.open(folder / "after.h5") as after, rl.open(folder / "before.h5") as before:
        for k in range(COUNT):
            first, second = after[k], before[k]
            page.get_by_text(re.compile(rf"^Frame {first.index}, ")).wait_for()
            for line in compare_frames(first, second).describe().splitlines():
                words.get_by_text(line, exact=True).wait_for()
            assert read_image(page, "frame-A") == draw_image(first, beside=second)
            assert read_image(page, "frame-B") == draw_image(second, beside=first)
            difference = read_image(page, "frame-difference")
            assert difference == draw_difference(first, second)
            seen.add(difference)
            thumb.press("ArrowRight")
    assert len(seen) == COUNT
    for name in ("frame-A", "frame-B", "frame-difference"):
        assert see_variance(find(page, name).locator("img")) > 10.0
    find_recording(page, "before.h5").get_by_role("checkbox").click()
    page.get_by_text(re.compile(r"^before\.h5: ")).wait_for()
    find(page, "compare").click()  # all but the one that is shown
    page.get_by_role("option", name="after.h5", exact=True).wait_for()
    assert page.get_by_role("option", name="before.h5", exact=True).count() == 0
    page.keyboard.press("Escape")
