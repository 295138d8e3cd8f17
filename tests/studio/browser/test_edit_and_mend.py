"""The journey of one who mistypes: a wrong number in the form, the way to it, the right one, a file with comments."""

import re

from rso_lidar.shipped import shipped

FIELD = '[data-test="field-lidar.laser.energy_mj"]'


def find_input(page):
    """Return the input of the field; NiceGUI puts the mark on it, or on what surrounds it."""
    return page.locator(f"input{FIELD}, {FIELD} input").first


def test_edit_and_mend(journey, tmp_path):
    text = shipped("examples/tdrs_approach.toml").read_text(encoding="utf-8")
    path = tmp_path / "approach.toml"
    path.write_bytes(text.encode())
    page = journey()
    verdict = page.locator('[data-test="verdict"]')
    page.get_by_text("Ready to fly: 540 frames").wait_for()

    page.locator('[data-test="table-lidar.laser"]').click()
    energy = find_input(page)
    assert energy.input_value() == "50"
    energy.fill("-3")
    energy.press("Tab")
    page.wait_for_function(
        "(place) => document.querySelector(place).textContent.includes('lidar.laser.energy_mj')",
        arg='[data-test="verdict"]',
    )
    assert "approach.toml" in verdict.inner_text()
    page.get_by_text("approach.toml (edited)").wait_for()

    page.locator('[data-test="table-time"]').click()
    page.locator('[data-test="field-time.duration_s"]').first.wait_for()
    page.locator('[data-test="go-to-problem"]').click()
    energy = find_input(page)
    energy.wait_for()
    page.wait_for_function(
        "(place) => document.activeElement && document.activeElement.closest(place) !== null", arg=FIELD
    )
    assert energy.input_value() == "-3"
    energy.fill("forty")
    energy.press("Tab")
    page.get_by_text("forty: is not a number such as 12.5").wait_for()
    energy.fill("40")
    energy.press("Tab")
    page.get_by_text("Ready to fly: 540 frames").wait_for()
    assert path.read_bytes() == text.encode()

    page.locator('[data-test="save"]').click()
    page.get_by_text("saved approach.toml").wait_for()
    assert path.read_bytes().decode() == re.sub(r"(?m)^(energy_mj +=) 50$", r"\1 40", text)
    assert [one.name for one in tmp_path.iterdir() if one.name.endswith(".draft")] == []
    page.locator('[data-test="undo"]').click()
    page.get_by_text("approach.toml (edited)").wait_for()
