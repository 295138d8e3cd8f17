"""Measure the studio: its start, the preview of a frame, frames of a recording, and its memory while it is used."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

import rso_lidar as rl
from benchmarks.clock import fresh, quartiles, seconds
from benchmarks.growth import resident_mb
from benchmarks.report import Findings, Target, table
from benchmarks.startup import ENVIRONMENT, EXAMPLES, IMPORT

SCENARIO = EXAMPLES / "tdrs_approach.toml"
LEEWAY_S = 0.1  # of a preview, over 1.5 flashes: drawing, and the report of a pixel
KEEP = ("waveforms", "taps")
THREADS = 6  # as many as asyncio gives two cores
TABS, EDITS, MOVES, FLIGHTS = 10, 500, 100, 4


def run(*, quick: bool) -> Findings:
    """Return two tables: times in turns, and the memory of one process as it is used."""
    start, bound = started(2 if quick else 5)
    preview, flash = fresh(previewed, 5 if quick else 15)
    frames = fresh(replayed, 50)
    held = fresh(used, 10 if quick else 1)
    limit = 1.5 * flash + LEEWAY_S
    rows = [
        ("start to page: until the page with its token has come [s]", quartiles(start)),
        ("beside: 3 × `rso-lidar --help`, and `import nicegui.ui` [s]", quartiles(bound)),
        ("preview of the last frame: flash, image, pixel, scene in space [ms]", quartiles(1e3 * preview, ".0f")),
        ("beside: one flash of it [ms]", quartiles(1e3 * flash, ".0f")),
        ("slider over a recording: frames read and drawn [1/s]", quartiles(1.0 / frames, ".1f")),
    ]
    targets = [
        _bounded("studio: start to page, over 3 × `rso-lidar --help` and NiceGUI's import", start / bound),
        _bounded("studio: preview at 300 m, over 1.5 flashes and 100 ms", preview / limit),
    ]
    blocks = {
        "studio": table(("what", "median (quartiles)"), rows),
        "studio memory": table(("after", "resident [MB]"), [(what, f"{size:,.0f}") for what, size in held]),
    }
    return Findings(blocks, targets)


def _bounded(what: str, ratios: np.ndarray) -> Target:
    return Target(what, "at most 1", quartiles(ratios), float(np.median(ratios)) <= 1.0)


def started(turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the seconds of starts of the studio, and of what they are compared with, in turns after a first one."""
    listing, importing = [sys.executable, "-m", "rso_lidar", "--help"], IMPORT.format("nicegui.ui")
    found = []
    for _ in range(turns + 1):
        helped = seconds(lambda: subprocess.run(listing, check=True, capture_output=True, env=ENVIRONMENT))
        told = subprocess.run(
            [sys.executable, "-c", importing], check=True, capture_output=True, text=True, env=ENVIRONMENT
        )
        found.append((_start_s(), 3.0 * helped + float(told.stdout)))
    ours, theirs = np.array(found[1:]).T
    return ours, theirs


def _start_s() -> float:
    """Return the seconds from the start of a process until its page has come."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, SCENARIO.name).write_bytes(SCENARIO.read_bytes())
        command = [sys.executable, "-m", "rso_lidar", "studio", folder, "--no-browser"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
            try:
                assert process.stdout is not None
                address = urlsplit(next(line.split()[1] for line in process.stdout if line.startswith("address")))
                asked = HTTPConnection("127.0.0.1", address.port or 0)
                asked.request("GET", f"/?{address.query}")
                answer = asked.getresponse()
                answer.read()
                cookie = (answer.headers["set-cookie"] or "").partition(";")[0]
                asked.request("GET", "/", headers={"Cookie": cookie})
                answer = asked.getresponse()
                if answer.status != 200 or b"rso_lidar studio" not in answer.read():
                    raise SystemExit(f"the studio answers {answer.status} instead of its page")
                return time.perf_counter() - begun
            finally:
                process.kill()


def _preview(flight: Any, row: int) -> Any:
    """Make what the page See shows of a row, and return its frame."""
    from rso_lidar.mission_analysis import report_pixel
    from rso_lidar.studio.model.flight_scenes import VIEWS
    from rso_lidar.studio.model.frame_image import draw_image

    VIEWS["target"](flight, row).pack()
    frame = flight.frame(row, KEEP)
    draw_image(frame)
    brightest = divmod(int(frame.intensity_counts.argmax()), frame.valid.shape[1])
    report_pixel(frame, flight.moments[row].lidar, brightest)
    return frame


def previewed(turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the seconds of previews of the last frame, and of flashes of it, in turns, warm."""
    from rso_lidar.studio.model.flight import PreviewFlight

    flight = PreviewFlight(rl.Scenario.load(SCENARIO))
    row = len(flight.numbers) - 1
    works: tuple[Callable[[], Any], ...] = (lambda: _preview(flight, row), lambda: flight.frame(row))
    found = np.array([[seconds(work) for work in works] for _ in range(turns + 2)])[2:]
    return found[:, 0], found[:, 1]


def replayed(count: int) -> np.ndarray:
    """Return the seconds to read and draw each of the last frames of a recording."""
    from rso_lidar.studio.model.frame_image import draw_image

    scenario = rl.Scenario.load(SCENARIO)
    last = scenario.time.n_frames
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "run.h5")
        rl.save(file, rl.simulate(scenario, frames=range(last - count, last)))
        with rl.open(file) as recording:
            draw_image(recording[0])
            return np.array([seconds(lambda k=k: draw_image(recording[k])) for k in range(count)])


def used(divisor: int) -> list[tuple[str, float]]:
    """Return the memory [MB] of a process that does what a studio does for several tabs, after each kind of use."""
    return list(_use(divisor))


def _use(divisor: int) -> Iterator[tuple[str, float]]:
    from rso_lidar.studio.model.flight import PreviewFlight
    from rso_lidar.studio.model.text_assessment import assess
    from rso_lidar.studio.state import Workspace

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(THREADS) as threads:
        Path(folder, SCENARIO.name).write_bytes(SCENARIO.read_bytes())
        workspace = Workspace(Path(folder))
        document = workspace.open_document(SCENARIO.name)
        yield "the start", resident_mb()

        def fly() -> Any:
            found = assess(document.text, workspace.folder, document.title)
            assert found.scenario is not None
            return PreviewFlight.of(found.text, found.scenario)

        flight = threads.submit(fly).result()
        last = len(flight.numbers)
        yield "one flight", resident_mb()
        shown: dict[int, Any] = {}

        def show(move: int) -> None:
            shown[move % TABS] = _preview(flight, last - 1 - move % last)

        moves = MOVES // divisor
        for part in (1, 2, 3):
            list(threads.map(show, range((part - 1) * moves, part * moves)))
            yield f"{part * moves:,} moves of the slider, in {TABS} tabs", resident_mb()
        edits = EDITS // divisor
        for part in (1, 2):
            for k in range(edits):
                document.set("lidar.laser.energy_mj", 1.0 + 0.001 * (k + edits * part))
                if k % 100 == 0:
                    threads.submit(assess, document.text, workspace.folder, document.title).result()
            yield f"{part * edits:,} edits", resident_mb()
        flights = max(FLIGHTS // divisor, 2)
        for part in (1, 2, 3):
            for k in range(flights):
                document.set("lidar.laser.energy_mj", 2.0 + k + 100 * part)
                flight = threads.submit(fly).result()
                list(threads.map(show, range(TABS)))
            yield f"{part * flights} flights of edited scenarios, each shown in {TABS} tabs", resident_mb()
