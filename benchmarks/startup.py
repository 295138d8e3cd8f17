"""How long a person waits before anything happens: import, --help, the first frame of a scenario from the shell."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.clock import seconds
from benchmarks.report import Findings, Target, table

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
IMPORTED = "import time; start = time.perf_counter(); import rso_lidar; print(time.perf_counter() - start)"


def run(*, quick: bool) -> Findings:
    """Return minimum and median of several starts, each in a process of its own, taken in turns."""
    python = sys.executable
    with tempfile.TemporaryDirectory() as folder:

        def first_frame(name: str) -> list[str]:
            output = str(Path(folder, f"{name}.h5"))
            file = str(EXAMPLES / f"{name}.toml")
            return [python, "-m", "rso_lidar", "run", file, "-o", output, "--frames", "0:1", "--overwrite"]

        starts = {
            "`python -c pass`, the interpreter alone": ([python, "-c", "pass"], None),
            "`import rso_lidar`, inside a process": ([python, "-c", IMPORTED], 0.4),
            "`rso-lidar --help`": ([python, "-m", "rso_lidar", "--help"], 0.6),
            "first frame of a scenario, `tdrs_approach`": (first_frame("tdrs_approach"), 1.5),
            "first frame of a scenario, `bench_plate`": (first_frame("bench_plate"), 1.5),
        }
        found: dict[str, list[float]] = {what: [] for what in starts}
        for turn in range(4 if quick else 8):
            for what, (command, _) in starts.items():
                took = _took(command)
                if turn:  # the first writes the caches
                    found[what].append(took)
    rows = [(what, f"{min(took):.2f}", f"{np.median(took):.2f}") for what, took in found.items()]
    targets = []
    for what, (_, wanted) in starts.items():
        if wanted is not None:
            middle = float(np.median(found[what]))
            measured = f"{middle:.2f} s (least {min(found[what]):.2f} s)"
            targets.append(Target(what, f"under {wanted:g} s", measured, middle < wanted))
    return Findings({"startup": table(("start", "least [s]", "median [s]"), rows)}, targets)


def _took(command: list[str]) -> float:
    """Return the seconds of a process, or those that it measured itself."""
    made: list[subprocess.CompletedProcess[str]] = []
    took = seconds(lambda: made.append(subprocess.run(command, check=True, capture_output=True, text=True)))
    said = made[0].stdout if command[-1] == IMPORTED else ""
    return float(said) if said else took
