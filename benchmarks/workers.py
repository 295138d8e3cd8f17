"""How frames come from threads and from processes: one long run each, the start apart from what follows."""

import sys
import time
from typing import Any

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.report import Findings, table

SCENES = ("TDRS, 300 m", "TDRS, 3 km")
FRAMES = 800
WAYS: dict[str, dict[str, Any]] = {
    "1 thread": {"threads": 1},
    "2 threads": {"threads": 2},
    "1 worker": {"workers": 1},
    "2 workers": {"workers": 2},
    "4 workers": {"workers": 4},
}


def run(*, quick: bool) -> Findings:
    """Return frames per second of each way, the seconds to its first frame, and the ratio to one of its kind."""
    rows = []
    for name in SCENES:
        print(f"workers: {name}", file=sys.stderr)
        scenario = scenes.build(name).replace(time=scenes.time_of(FRAMES // (8 if quick else 1)))
        alone: dict[str, float] = {}
        for way, how in WAYS.items():
            first_s, rate = flown(scenario, how)
            kind = "threads" if "threads" in how else "workers"
            one = alone.setdefault(kind, rate)
            rows.append((name, way, f"{first_s:.2f}", f"{rate:.0f}", f"{rate / one:.2f}"))
    header = ("scene", "by", "first frame [s]", "then, frames/s", "against one")
    return Findings({"workers": table(header, rows, left=2)})


def flown(scenario: rl.Scenario, how: dict[str, Any]) -> tuple[float, float]:
    """Return the seconds to the first frame, and the frames per second of all that follow."""
    start = time.perf_counter()
    frames = rl.simulate(scenario, **how)
    next(frames)
    begun = time.perf_counter()
    made = sum(1 for _ in frames)
    return begun - start, made / (time.perf_counter() - begun)
