"""Measure what starting costs: import, `--help`, and the first frame of a scenario from the shell."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.clock import seconds
from benchmarks.report import Findings, Target, table

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
IMPORT = "import time; start = time.perf_counter(); import {}; print(time.perf_counter() - start)"
LIBRARIES = "numpy, scipy.spatial.transform, pydantic"  # what every use needs; import times are ratios to these
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


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
            f"`import {LIBRARIES}`, inside a process": ([python, "-c", IMPORT.format(LIBRARIES)], None),
            "`import rso_lidar`, inside a process": ([python, "-c", IMPORT.format("rso_lidar")], None),
            "`import rso_lidar` and first use of `rl.Scenario`": (
                [python, "-c", IMPORT.format("rso_lidar; rso_lidar.Scenario")],
                None,
            ),
            "`rso-lidar --help`": ([python, "-m", "rso_lidar", "--help"], None),
            "first frame of a scenario, `tdrs_approach`": (first_frame("tdrs_approach"), 1.5),
            "first frame of a scenario, `bench_plate`": (first_frame("bench_plate"), 1.5),
        }
        found: dict[str, list[float]] = {what: [] for what in starts}
        for turn in range(4 if quick else 8):
            for what, (command, _) in starts.items():
                took = _took(command)
                if turn:  # the first writes the caches
                    found[what].append(took)
    libraries, package, scenario, listing = (np.array(found[what]) for what in list(starts)[1:5])
    targets = [
        _ratio("`import rso_lidar`", package, libraries, 0.5),
        _ratio("`import rso_lidar` and first use of `rl.Scenario`", scenario, libraries, 2.5),
        _ratio("`rso-lidar --help`, the process", listing, libraries, 2.0),
    ]
    rows = [(what, f"{min(took):.2f}", f"{np.median(took):.2f}") for what, took in found.items()]
    for what, (_, wanted) in starts.items():
        if wanted is not None:
            middle = float(np.median(found[what]))
            measured = f"{middle:.2f} s (least {min(found[what]):.2f} s)"
            targets.append(Target(what, f"under {wanted:g} s", measured, middle < wanted))
    return Findings({"startup": table(("start", "least [s]", "median [s]"), rows)}, targets)


def _ratio(what: str, took: np.ndarray, libraries: np.ndarray, most: float) -> Target:
    """Return a target for the median of the ratios of starts that follow each other."""
    ratio = float(np.median(took / libraries))
    return Target(f"{what} over importing {LIBRARIES}", f"at most {most:g}", f"{ratio:.2f}", ratio <= most)


def _took(command: list[str]) -> float:
    """Return the seconds of a process, or those that it measured itself."""
    made: list[subprocess.CompletedProcess[str]] = []
    took = seconds(
        lambda: made.append(subprocess.run(command, check=True, capture_output=True, text=True, env=ENVIRONMENT))
    )
    said = made[0].stdout if "perf_counter" in command[-1] else ""
    return float(said) if said else took
