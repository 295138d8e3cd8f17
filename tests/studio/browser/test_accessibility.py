"""The pages as axe-core judges them: labels, roles and contrast, in narrow and wide windows, light and dark."""

import pytest

import rso_lidar as rl
from tests.studio.browser.conftest import watch_pages
from tests.studio.browser.page_elements import find, find_input, find_recording, wait_until_drawn
from tests.studio.conftest import serve_studio

WINDOWS = [{"width": 1280, "height": 800}, {"width": 1920, "height": 1080}]
# Fading lowers contrast, and axe-core takes the shade behind a dialog for the background of the buttons in it.
STILL = """*, *::before, *::after { transition: none !important; animation: none !important; }
    .q-dialog__backdrop { background: transparent; }"""
AUDIT = """async () => (await axe.run(document, {resultTypes: ["violations"]})).violations.flatMap(
    (one) => one.nodes.map((node) => [one.impact, one.id, node.html.slice(0, 240), node.failureSummary]))"""


@pytest.fixture(scope="module")
def served(tmp_path_factory, text):
    """Return a studio whose folder has a scenario and two recordings of it."""
    folder = tmp_path_factory.mktemp("missions")
    (folder / "bench.toml").write_text(text, encoding="utf-8")
    scenario = rl.Scenario.loads(text)
    for name, seed in (("one.h5", 1), ("two.h5", 2)):
        rl.save(folder / name, rl.simulate(scenario.replace(seed=seed), frames=range(3)))
    with serve_studio(folder) as studio:
        yield studio


class Auditor:
    """axe-core on one page, and the serious and critical violations that it found so far."""

    def __init__(self, page, script):
        self.page, self.windows, self.found = page, WINDOWS, []
        page.add_style_tag(content=STILL)
        page.evaluate(script)

    def audit(self, where):
        """Audit what the page shows now, in each size of the window, and begin with the size that it has."""
        for window in self.windows:
            self.page.set_viewport_size(window)
            self.page.wait_for_timeout(300)
            for impact, rule, html, summary in self.page.evaluate(AUDIT):
                if impact in ("serious", "critical"):
                    self.found.append(f"{where}, {window['width']} wide: {impact} {rule}: {html}\n{summary}")
        self.windows = self.windows[::-1]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_serious_violation(chromium, served, scheme):
    axe = pytest.importorskip("axe_playwright_python.base", reason="axe-core comes with axe-playwright-python")
    with watch_pages(chromium, served, color_scheme=scheme, viewport=WINDOWS[0]) as open_tab:
        page = open_tab()
        page.get_by_text("Ready to fly").wait_for()
        auditor = Auditor(page, axe.AXE_SCRIPT)
        audit_build(page, auditor)
        audit_dialogs(page, auditor)
        audit_see(page, auditor)
        audit_run(page, auditor, f"{scheme}.h5")
    assert not auditor.found, "\n\n".join(auditor.found)


def audit_build(page, auditor):
    """Audit forms, a wrong number, the message about it, the description, and the guide."""
    auditor.audit("Build")
    for table in ("target[0]", "ptu", "lidar.detector", "lidar.laser"):
        find(page, f"table-{table}").click()
        auditor.audit(f"Build, {table}")
    energy = find_input(page, "lidar.laser.energy_mj")
    energy.fill("-3")
    energy.press("Tab")
    find(page, "go-to-problem").wait_for()
    auditor.audit("Build, a wrong value")
    energy.fill("three")
    energy.press("Tab")
    page.get_by_text("is not a number").wait_for()
    auditor.audit("Build, no number")
    find(page, "undo").click()
    page.get_by_text("Ready to fly").wait_for()
    find(page, "guide-start").click()
    find(page, "guide").wait_for()
    auditor.audit("guide")
    find(page, "guide-close").click()


def audit_dialogs(page, auditor):
    """Audit the dialogs of the menu and the choosers of the forms."""
    find(page, "table-target[0]").click()
    for name in ("new", "open", "save-as", "upload", "choose-target[0].model"):
        find(page, name).click()
        page.locator(".q-dialog__inner > .q-card").wait_for()
        auditor.audit(f"dialog, {name}")
        page.keyboard.press("Escape")
        page.locator(".q-dialog__inner > .q-card").wait_for(state="detached")


def audit_see(page, auditor):
    """Audit the page See: image, point cloud, a figure and the text."""
    find(page, "page-see").click()
    wait_until_drawn(page, "image")
    find(page, "waveform").locator("svg").wait_for()
    auditor.audit("See")
    for name in ("cloud", "budget", "text"):
        find(page, f"show-{name}").click()
        auditor.audit(f"See, {name}")
    find(page, "show-image").click()


def audit_run(page, auditor, name):
    """Audit the page Run: its form, two recordings that are compared, and a job with its result of another name."""
    find(page, "page-run").click()
    auditor.audit("Run")
    find_recording(page, "one.h5").get_by_role("checkbox").click()
    wait_until_drawn(page, "frame-A")
    find(page, "compare").click()
    auditor.audit("Run, choice of a recording")
    page.get_by_role("option", name="two.h5", exact=True).click()
    wait_until_drawn(page, "frame-difference")
    find(page, "marks").click()
    auditor.audit("Run, compared")
    find(page, "output").fill(name)
    page.get_by_label("Frames").fill("0:1")
    find(page, "start").click()
    page.get_by_role("progressbar").first.wait_for()
    auditor.audit("Run, a job")
    find(page, "jobs").get_by_text("done", exact=True).wait_for(timeout=240_000)
    find(page, "remove").click()
    (auditor.page.locator("[data-test=jobs] .q-card")).wait_for(state="detached")
