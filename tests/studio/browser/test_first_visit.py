"""The journey of a first visit: an empty folder, the guide, the example, a recording as the command line makes it."""

import re

from rso_lidar.shipped import shipped
from tests.studio.browser.page_elements import find_differences, run_command_line, see_variance, wait_until_drawn


def test_first_visit(journey, tmp_path):
    page = journey()
    guide = page.locator('[data-test="guide"]')
    guide.get_by_text("Welcome (1 of 5)").wait_for()
    for title in ("The scenario (2 of 5)", "One frame (3 of 5)", "A recording (4 of 5)"):
        page.locator('[data-test="guide-next"]').click()
        guide.get_by_text(title).wait_for()
    source = tmp_path / "tdrs_approach.toml"
    assert source.read_bytes() == shipped("examples/tdrs_approach.toml").read_bytes()
    assert page.locator('[data-test="page-run"]').get_attribute("aria-selected") == "true"

    page.get_by_label("Frames").fill("538:540")
    page.get_by_label("Name of the result").fill("mine.h5")
    page.get_by_text("540 frames in all").wait_for()
    page.locator('[data-test="start"]').click()
    jobs = page.locator('[data-test="jobs"]')
    jobs.get_by_text("Run: mine.h5").wait_for()
    jobs.get_by_text("done", exact=True).wait_for(timeout=240_000)  # a new installation compiles the kernels first
    page.locator('[data-test="guide-next"]').click()
    guide.get_by_text("That is all (5 of 5)").wait_for()
    page.locator('[data-test="guide-next"]').click()
    guide.wait_for(state="hidden")

    row = page.locator('[data-test="recordings"] tbody tr').filter(has_text="mine.h5")
    row.get_by_text("complete").wait_for()
    page.get_by_text(re.compile(r"^Frame 53[89], 2,69[05]\.000 s")).wait_for()  # shown by itself, with its first frames
    wait_until_drawn(page, "frame-A")
    assert see_variance(page.locator('[data-test="frame-A"] img')) > 10.0

    run_command_line(source, tmp_path / "other.h5", "538:540")
    assert find_differences(tmp_path / "mine.h5", tmp_path / "other.h5") == []
