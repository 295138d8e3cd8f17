"""The keyboard alone: Tab reaches each control of each page and leaves the editor, keys operate them, focus is visible."""

import pytest

import rso_lidar as rl
from tests.studio.browser.page_elements import find, find_input, find_thumb, wait_until_drawn

# Controls that a pointer can operate now. Of a group that is walked by arrow keys, such as tabs, one takes the focus.
CONTROLS = """button, a[href], input, textarea, [contenteditable=true], canvas, [role=button], [role=checkbox],
    [role=switch], [role=slider], [role=combobox]"""
MARK_CONTROLS = """(controls) => {
    let count = 0;
    for (const one of document.querySelectorAll(controls)) {
        const is_shown = one.checkVisibility({visibilityProperty: true, opacityProperty: true});
        const is_enabled = !one.disabled && !one.closest("[aria-disabled=true], [aria-hidden=true]");
        if (is_shown && is_enabled && one.getBoundingClientRect().width > 1) one.dataset.control = count++;
    }
    return count;
}"""
NOTE_FOCUS = """() => {
    const one = document.activeElement;
    if (one === document.body) return [true, false];
    one.closest("[data-control]")?.removeAttribute("data-control");
    one.querySelectorAll("[data-control]").forEach((inner) => inner.removeAttribute("data-control"));
    return [false, one.classList.contains("cm-content")];
}"""
LEFT = "() => [...document.querySelectorAll('[data-control]')].map((one) => one.outerHTML.slice(0, 160))"


def walk(page):
    """Walk over a page by Tab until the focus has left it twice, and return the controls that it did not reach."""
    page.evaluate("document.activeElement.blur()")  # Tab goes on from there, and begins anew at the end
    count = page.evaluate(MARK_CONTROLS, CONTROLS)
    assert count > 10
    rounds = 0
    for _ in range(6 * count):
        page.keyboard.press("Tab")
        has_left, is_editor = page.evaluate(NOTE_FOCUS)
        rounds += has_left
        if rounds == 2:
            break
        if is_editor:  # where Tab indents
            page.keyboard.press("Escape")
    else:
        raise AssertionError("Tab does not leave the page")
    return page.evaluate(LEFT)


@pytest.fixture
def folder(tmp_path, text):
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    rl.save(tmp_path / "bench.h5", rl.simulate(rl.Scenario.loads(text), frames=range(5)))
    return tmp_path


def test_tab_reaches_each_control(journey, folder):
    page = journey()
    page.get_by_text("Ready to fly").wait_for()
    before = (folder / "bench.toml").read_text(encoding="utf-8")
    find(page, "table-lidar.laser").click()
    find_input(page, "lidar.laser.energy_mj").wait_for()  # a form drawn during the walk would take the focus away
    left = {"build": walk(page)}
    find(page, "page-see").click()
    wait_until_drawn(page, "image")
    left["see"] = walk(page)
    find(page, "page-run").click()
    find(page, "recordings").get_by_role("checkbox").first.click()
    wait_until_drawn(page, "frame-A")
    left["run"] = walk(page)
    assert left == {"build": [], "see": [], "run": []}
    assert page.get_by_text("(edited)").count() == 0
    assert (folder / "bench.toml").read_text(encoding="utf-8") == before


def test_keys_operate_the_pages(journey, folder):
    page = journey()
    keys = page.keyboard
    page.get_by_text("Ready to fly: 10 frames").wait_for()
    find(page, "table-time").focus()
    keys.press("Enter")
    field = page.locator('input[data-test="field-time.duration_s"], [data-test="field-time.duration_s"] input').first
    field.focus()
    keys.press("Control+a")
    keys.type("4")
    keys.press("Tab")
    page.get_by_text("Ready to fly: 20 frames").wait_for()
    keys.press("Control+s")
    page.get_by_text("saved bench.toml").wait_for()
    find(page, "save-as").focus()
    keys.press("Enter")
    page.locator("[role=dialog]").get_by_label("File name").wait_for()
    keys.press("Escape")
    page.locator("[role=dialog]").wait_for(state="detached")

    find(page, "page-build").focus()
    keys.press("ArrowRight")
    keys.press("Enter")
    wait_until_drawn(page, "image")
    find_thumb(page, "time").focus()
    for key, number in (("End", 19), ("ArrowLeft", 18), ("Home", 0), ("ArrowRight", 1)):
        keys.press(key)
        page.get_by_text(f"frame {number}  ·").wait_for()

    find(page, "page-run").focus()
    keys.press("Enter")
    box = find(page, "recordings").get_by_role("checkbox").first
    box.wait_for()
    box.focus()
    keys.press("Space")
    wait_until_drawn(page, "frame-A")
    find_thumb(page, "slider").focus()
    for key, number in (("End", 4), ("ArrowLeft", 3), ("Home", 0), ("ArrowRight", 1)):
        keys.press(key)
        find(page, "words").get_by_text(f"Frame {number}, ").wait_for()
