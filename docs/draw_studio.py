"""Draw the pictures of the studio: ``python docs/draw_studio.py`` writes docs/pictures/studio_*.png, light and dark.

It starts the studio on a temporary folder with two examples, and flies the last 20 frames of the first. It photographs the
three pages, and a camera on See, in Chromium. It needs playwright and a Chromium (``pip install playwright``, ``playwright
install chromium``); `CHROMIUM` names the program where it stands elsewhere. A folder on the command line is written instead.
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from PIL import Image

import rso_lidar as rl

PICTURES = Path(__file__).resolve().parent / "pictures"
EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "tdrs_approach.toml"
CAMERAS, CAMERA_FRAME = EXAMPLE.with_name("companion_camera.toml"), 16  # by day, beside the Earth
WIDTH, HEIGHT, FLOWN = 1280, 800, 20
PATIENCE_S = 120.0
MOST_BYTES = 145_000
SOFTWARE_GL = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # the same on each machine
CONNECTED = "window.socket && window.socket.connected"
BUSY = "[...document.querySelectorAll('.q-spinner, .q-inner-loading')].some(e => e.checkVisibility())"


@contextmanager
def start_studio(folder: Path) -> Iterator[str]:
    """Start the studio on a folder, and give its address with the token."""
    command = [sys.executable, "-m", "rso_lidar", "studio", str(folder), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield next(line.split()[1] for line in process.stdout if line.startswith("address"))
        finally:
            process.terminate()


def wait_until_still(page: Any) -> bytes:
    """Return a screenshot of a page once nothing is under way, and two of them a second apart are equal."""
    before, end = b"", time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        page.wait_for_timeout(1000)
        if page.evaluate(BUSY):
            continue
        now: bytes = page.screenshot()
        if now == before:
            return now
        before = now
    raise SystemExit(f"the page was not still within {PATIENCE_S:g} s")


def move_to_end(page: Any, slider: str) -> None:
    """Move a slider to its last step, by mouse and keyboard."""
    box = page.locator(slider).bounding_box()
    page.mouse.click(box["x"] + box["width"] - 1, box["y"] + box["height"] / 2)
    page.keyboard.press("ArrowRight")


def draw_page(page: Any, place: Path) -> Path:
    """Write a screenshot, of 256 colours where all of them would make it too large."""
    page.mouse.move(WIDTH - 2, HEIGHT - 2)  # no button looks pointed at
    page.evaluate("document.activeElement.blur()")
    with Image.open(io.BytesIO(wait_until_still(page))) as taken:
        drawn = taken.convert("RGB")
    drawn.save(place, optimize=True)
    if place.stat().st_size > MOST_BYTES:
        drawn.quantize(256, dither=Image.Dither.NONE).save(place, optimize=True)
    return place


def draw_pages(page: Any, url: str, folder: Path, ending: str) -> list[Path]:
    """Draw Build, See, a camera on See, and Run.

    Parameters
    ----------
    page : of the browser.
    url : of the studio.
    folder : of the pictures.
    ending : of their names, before the suffix.
    """
    page.goto(url)
    page.wait_for_function(CONNECTED)
    page.goto(f"{urljoin(url, '/')}?file={EXAMPLE.name}")
    page.wait_for_function("/[0-9] warning/.test(document.querySelector('[data-test=verdict]')?.innerText)")
    if page.locator("[data-test=guide-close]").count():
        page.click("[data-test=guide-close]")
    page.click('[data-test="table-lidar.laser"]')
    drawn = [draw_page(page, folder / f"studio_build{ending}.png")]

    page.click("[data-test=page-see]")
    wait_until_still(page)
    move_to_end(page, "[data-test=time]")
    drawn.append(draw_page(page, folder / f"studio_see{ending}.png"))

    shown = f"?file={CAMERAS.name}&page=see&figure=camera&view=lidar&frame={CAMERA_FRAME}"
    page.goto(urljoin(url, "/") + shown)
    page.locator("[data-test=camera-image] img").wait_for(timeout=PATIENCE_S * 1e3)
    drawn.append(draw_page(page, folder / f"studio_camera{ending}.png"))

    page.goto(f"{urljoin(url, '/')}?file={EXAMPLE.name}&page=run")
    if not ending:  # the first tab makes the recording, and shows it by itself
        count = rl.Scenario.load(EXAMPLE).time.n_frames
        page.get_by_label("Frames").first.fill(f"{count - FLOWN}:{count}")
        page.keyboard.press("Tab")
        page.click("[data-test=start]")
        page.get_by_text("complete").first.wait_for(timeout=PATIENCE_S * 1e3)
    else:
        page.locator("[data-test=recordings] tbody .q-checkbox").first.click()
    page.locator("[data-test=frame-A] img").wait_for(timeout=PATIENCE_S * 1e3)
    move_to_end(page, "[data-test=slider]")
    return [*drawn, draw_page(page, folder / f"studio_run{ending}.png")]


def draw_studio(folder: Path) -> list[Path]:
    """Draw all pages in both schemes.

    Parameters
    ----------
    folder : of the pictures; existing ones are replaced.
    """
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as parent, sync_playwright() as playwright:
        missions = Path(parent, "missions")
        missions.mkdir()
        for example in (EXAMPLE, CAMERAS):
            shutil.copy(example, missions)
        program = os.environ.get("CHROMIUM") or shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=program, args=list(SOFTWARE_GL))
        drawn = []
        with start_studio(missions) as url:
            for scheme, ending in (("light", ""), ("dark", "_dark")):
                page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme=scheme)
                drawn += draw_pages(page, url, folder, ending)
                page.close()
        browser.close()
    return drawn


if __name__ == "__main__":
    for written in draw_studio(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES):
        print(f"{written} ({written.stat().st_size / 1e3:.0f} kB)")
