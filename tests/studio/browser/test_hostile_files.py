"""Files that are not meant well, in a real browser: their names and titles are shown as text, and nothing of them runs."""

import os

import pytest

import rso_lidar as rl
from tests.studio.browser.conftest import watch_pages
from tests.studio.browser.page_elements import find_recording, wait_until_drawn
from tests.studio.conftest import serve_studio

SCRIPT = "<img src=x onerror=alert(1)>"


@pytest.mark.skipif(os.name != "posix", reason="Windows has no such file names")
def test_names_and_titles_are_text(journey, text, tmp_path):
    hostile = text.replace("a plate on a bench", f"{SCRIPT}</script><script>alert(2)</script>")
    hostile = hostile.replace("[1000, 0, 0]", "[200, 0, 0]") + '\n[lidar.detector]\ntype = "empirical"\n'
    (tmp_path / f"0{SCRIPT}.toml").write_text(hostile, encoding="utf-8")
    rl.save(tmp_path / f"1{SCRIPT}.h5", rl.simulate(rl.Scenario.loads(hostile), frames=[0, 1]))
    page = journey()
    shown = {
        "Build": lambda: page.get_by_text("Ready to fly").wait_for(),
        "See": lambda: wait_until_drawn(page, "image"),
        "Run": lambda: find_recording(page, "1<img").wait_for(),
    }
    for name in ("Build", "See", "Run", "Build"):
        page.get_by_role("tab", name=name, exact=True).click()
        shown[name]()
        page.wait_for_timeout(500)  # in which an image without a source would have failed
        assert page.locator('img[src="x"]').count() == 0
        assert page.locator("[onerror]").count() == 0
    assert SCRIPT in page.content().replace("&lt;", "<").replace("&gt;", ">")


@pytest.fixture(scope="module")
def served(tmp_path_factory, text):
    """Return a studio whose folder has a scenario; the broken files come and go, and it must survive them all."""
    folder = tmp_path_factory.mktemp("broken")
    (folder / "good.toml").write_text(text, encoding="utf-8")
    with serve_studio(folder) as studio:
        yield studio


@pytest.fixture
def tab(chromium, served, content, request):
    """Return a new tab of that studio while a broken file is the first one of its folder."""
    broken = served.folder / f"a_{request.node.callspec.id}.toml"
    broken.write_bytes(content)
    with watch_pages(chromium, served) as open_tab:
        yield open_tab()
    broken.unlink()


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe not a text",
        b"\0" * 1000,
        b"version = 1\n" + b"# a comment\n" * 700_000,  # 8 MB
        b"a = " + b"[" * 50_000 + b"]" * 50_000,
        b"a." * 20_000 + b"b = 1\n",
        b"x = 1" + b"0" * 100_000 + b"\n",
        'name = "\u202e\u0007\U0001f600"\n'.encode(),
    ],
    ids=["no_utf8", "zeros", "large", "nested", "dotted", "digits", "odd_letters"],
)
def test_broken_files_leave_the_studio_usable(tab):
    see_that_it_is_usable(tab)


def test_a_file_of_many_tables_leaves_the_studio_usable(journey, text, tmp_path):
    """In a studio of its own, which is busy with them for seconds."""
    (tmp_path / "a.toml").write_bytes(b"[[target]]\n" * 20_000)
    (tmp_path / "b.toml").write_text(text, encoding="utf-8")
    see_that_it_is_usable(journey())


def see_that_it_is_usable(page):
    """Change pages, and see that the tab is still connected."""
    page.get_by_role("tab", name="Run", exact=True).click()
    page.get_by_role("tab", name="Build", exact=True).click()
    page.wait_for_timeout(1500)
    assert page.evaluate("window.socket.connected")
    assert page.get_by_role("tab", name="See", exact=True).is_visible()
