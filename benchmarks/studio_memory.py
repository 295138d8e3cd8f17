"""Memory of the studio over an hour of use in Chromium: `python -m benchmarks.studio_memory`.

A user works in one tab and leaves another one open. Each minute the user edits four fields, undoes two edits, moves the
slider of the page See, and visits the page Run. Every fifth minute starts a run, whose recording is then viewed.
Every tenth minute opens a new tab in place of the old one. `--speed 2` shortens the pauses, so that an hour of
use takes 30 minutes.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import report
from benchmarks.orbit import resident_mb
from benchmarks.report import Findings, table
from benchmarks.startup import ENVIRONMENT, EXAMPLES

SCENARIO = EXAMPLES / "tdrs_approach.toml"
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
PAUSE_S = 2.5  # of the user, between two actions
RUN_EVERY, TAB_EVERY, REPORT_EVERY = 5, 10, 5  # minutes of use
SETTLED_MIN = 20.0  # of use, after which memory should be flat: kernels and figures are loaded by then
WAIT_MS = 120_000


@dataclass(frozen=True)
class Sample:
    """Memory after some minutes of use: of the server, and of the scripts in the tab that stays open."""

    minutes: float
    actions: int
    server_mb: float
    scripts_mb: float


@contextmanager
def serve(folder: Path) -> Iterator[tuple[subprocess.Popen, str]]:
    """Start the studio on a folder, and yield its process and its address."""
    command = [sys.executable, "-m", "rso_lidar", "studio", str(folder), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        try:
            assert process.stdout is not None
            yield process, next(line.split()[1] for line in process.stdout if line.startswith("address"))
        finally:
            process.terminate()


class User:
    """A user who pauses between actions."""

    def __init__(self, context: Any, url: str, speed: float) -> None:
        self._context, self._url, self._pause_ms = context, url, 1e3 * PAUSE_S / speed
        self.actions, self._edits, self._runs = 0, 0, 0
        self.page = self.open_tab()

    def open_tab(self) -> Any:
        """Open a tab and wait for the verdict on its document."""
        page = self._context.new_page()
        page.goto(self._url)
        page.get_by_text("Ready to fly").wait_for()
        return page

    def replace_tab(self) -> None:
        """Close the tab and open another one."""
        self.page.close()
        self.page = self.open_tab()

    def _act(self, action: Any, *arguments: Any, **options: Any) -> None:
        action(*arguments, **options)
        self.actions += 1
        self.page.wait_for_timeout(self._pause_ms)

    def _find(self, test: str) -> Any:
        return self.page.locator(f'[data-test="{test}"]').first

    def edit(self) -> None:
        """Edit four fields, undo two edits, and save."""
        self._act(self._find("page-build").click)
        for name, least in (("lidar.laser.energy_mj", 40.0), ("lidar.receiver.f_number", 2.5)) * 2:
            self._edits += 1
            self._act(self._find(f"table-{name.rpartition('.')[0]}").click)
            field = self.page.locator(f'input[data-test="field-{name}"], [data-test="field-{name}"] input').first
            field.fill(f"{least + 0.001 * (self._edits % 500):.3f}")
            self._act(field.press, "Tab")
        for _ in range(2):
            self._act(self._find("undo").click)
        self._act(self._find("save").click)

    def look(self) -> None:
        """Move the slider of the page See, change the view, and look at the point cloud."""
        self._act(self._find("page-see").click)
        thumb = self.page.locator('[data-test="time"] [tabindex]').first
        for key in ("End", "ArrowLeft", "ArrowLeft", "Home", "PageUp", "ArrowRight"):
            self._act(thumb.press, key)
        for name in ("Orbit", "Target"):
            self._act(self._find("view").get_by_role("button", name=name, exact=True).click)
        for name in ("Point cloud", "Image"):
            self._act(self.page.get_by_role("tab", name=name, exact=True).click)

    def record(self) -> None:
        """Start a run of six frames, wait for it, and move the slider over it."""
        self._act(self._find("page-run").click)
        self._runs += 1
        name = f"run_{self._runs}.h5"
        self.page.get_by_label("Frames").first.fill("534:540")
        self._find("output").fill(name)
        self._act(self.page.keyboard.press, "Tab")
        self._act(self._find("start").click)
        row = self._find("recordings").locator("tbody tr").filter(has_text=re.compile(rf"\b{re.escape(name)}"))
        row.get_by_text("complete").wait_for()
        self._act(self.page.get_by_text(re.compile(rf"^{re.escape(name)}: ")).wait_for)
        for _ in range(5):
            self._act(self.page.locator('[data-test="slider"] [tabindex]').first.press, "ArrowRight")

    def visit_runs(self) -> None:
        """Look at the page Run."""
        self._act(self._find("page-run").click)


def count_scripts_mb(context: Any, page: Any) -> float:
    """Return the memory of the scripts in a tab [MB], after a garbage collection."""
    session = context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    used: float = session.send("Runtime.getHeapUsage")["usedSize"]
    session.detach()
    return used / 1e6


def use(minutes: int, speed: float) -> list[Sample]:
    """Use the studio, and return the memory every five minutes of use."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as parent, sync_playwright() as driver:
        folder = Path(parent)
        shutil.copy(SCENARIO, folder)
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        context.set_default_timeout(WAIT_MS)
        with serve(folder) as (process, url):
            user = User(context, url, speed)
            idle = user.open_tab()
            samples = []

            def take(minute: int) -> None:
                held = Sample(minute, user.actions, resident_mb(process.pid), count_scripts_mb(context, idle))
                samples.append(held)
                print(
                    f"{held.minutes:3.0f} min of use, {held.actions:5,d} actions: server {held.server_mb:5.0f} MB, "
                    f"scripts {held.scripts_mb:4.0f} MB",
                    file=sys.stderr, flush=True,
                )  # fmt: skip

            take(0)
            begun = time.monotonic()
            for minute in range(1, minutes + 1):
                user.edit()
                user.look()
                if minute % RUN_EVERY == 0:
                    user.record()
                else:
                    user.visit_runs()
                if minute % TAB_EVERY == 0:
                    user.replace_tab()
                user.page.wait_for_timeout(max(0.0, 1e3 * (begun + 60.0 * minute / speed - time.monotonic())))
                if minute % REPORT_EVERY == 0:
                    take(minute)
        browser.close()
    return samples


def fit_slope(samples: list[Sample]) -> float:
    """Return the growth of the server's memory [MB/h of use] once it has settled, by least squares."""
    late = [one for one in samples if one.minutes >= SETTLED_MIN]
    if len(late) < 2:
        return float("nan")
    return float(60.0 * np.polyfit([one.minutes for one in late], [one.server_mb for one in late], 1)[0])


def main() -> None:
    """Measure, print, and write the table into a page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio_memory", description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=int, default=60, help="of use (60)")
    parser.add_argument("--speed", type=float, default=1.0, help="minutes of use in one minute (1)")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the table between the markers of a page")
    chosen = parser.parse_args()
    samples = use(chosen.minutes, chosen.speed)
    rows = [
        (f"{one.minutes:.0f}", f"{one.actions:,}", f"{one.server_mb:,.0f}", f"{one.scripts_mb:,.0f}") for one in samples
    ]
    header = ("minutes of use", "actions", "server, resident [MB]", "scripts of a tab [MB]")
    block = (
        f"{table(header, rows)}\n\nGrowth after {SETTLED_MIN:.0f} minutes: {fit_slope(samples):.1f} MB per hour of use."
    )
    print(block)
    if chosen.write:
        report.write(chosen.write, "studio hour", Findings({"studio hour": block}))


if __name__ == "__main__":
    main()
