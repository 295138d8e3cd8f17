"""A real browser for the tests of the studio: Debian's Chromium, driven by playwright."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from tests.studio.conftest import serve_studio

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# WebGL without a graphics card; no sandbox, which containers forbid; no calls home by the browser itself.
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
WAIT_MS = 180_000  # on a busy machine


def pytest_collection_modifyitems(items):
    """Mark journeys as slow: all tests that need the browser."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("slow")


class Watch:
    """What the pages of a browser did that they must not: errors, and requests to other hosts."""

    def __init__(self, port: int) -> None:
        self.port, self.found = port, []

    def add(self, page):
        page.on("console", lambda message: self._take("console", message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: self._take("error of a script", error))
        page.on("request", lambda request: self._check(request.url))
        page.on("websocket", lambda socket: self._check(socket.url))
        page.on("dialog", lambda dialog: (self._take("dialog", dialog.message), dialog.dismiss()))
        return page

    def _take(self, kind, text):
        self.found.append(f"{kind}: {text}")

    def _check(self, url):
        parts = urlsplit(url)
        if parts.scheme not in ("data", "blob", "about") and (parts.hostname, parts.port) != ("127.0.0.1", self.port):
            self._take("request to another host", url)


@pytest.fixture(scope="module")
def chromium() -> Iterator:
    """Return Debian's Chromium. While it is there, `asyncio.run` cannot be used: playwright's loop runs in this thread."""
    playwright = pytest.importorskip("playwright.sync_api", reason="the studio's journeys need playwright")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("the studio's journeys need Chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(FLAGS))
        yield browser
        browser.close()


@contextmanager
def watch_pages(browser, served, **settings):
    """Yield a function that opens a tab of a studio; at the end, no tab may have had an error or asked another host."""
    watch = Watch(served.port)
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **settings})
    context.set_default_timeout(WAIT_MS)

    def open_tab():
        page = watch.add(context.new_page())
        page.goto(served.url)
        page.wait_for_function("window.socket && window.socket.connected")
        return page

    try:
        yield open_tab
        assert watch.found == []
    finally:
        context.close()


@pytest.fixture
def journey(chromium, tmp_path):
    """Return a function that starts the studio in the test's folder and opens a tab."""
    with serve_studio(tmp_path) as served, watch_pages(chromium, served) as open_tab:
        yield open_tab
