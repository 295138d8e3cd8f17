"""The first start after an installation: a second process compiles the end of a flash while this one compiles its beginning.

numba compiles one loop at a time in a process, and all loops of a flash take some 24 s of one core. The two processes share
the folder of machine code. If both need the same loop, one compiles it and the other waits.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from rso_lidar import detector, kernels, optics, scene
from rso_lidar.detector import multiply_rows
from rso_lidar.records import Hits, Rays

# -P: files of the current folder are not imported. The package is found wherever this process found it.
_COMMAND = (
    "-P",
    "-c",
    "import sys; sys.path.append(sys.argv[1]); "
    "from rso_lidar.simulation.first_start import compile_for_parent; compile_for_parent()",
    str(Path(__file__).parents[2]),
)


@cache
def compile_ahead() -> None:
    """Start a process that compiles what the end of a flash needs; once, and only if its slowest loop is not on disk.

    The process ends when it has finished, or when this one ends. No process is started where machine code cannot be kept.
    """
    if kernels.has_machine_code(multiply_rows) is not False:
        return
    if not Path(sys.executable or "").stem.startswith("python"):  # Python inside another program
        return
    null = subprocess.DEVNULL
    with suppress(OSError):
        process = subprocess.Popen([sys.executable, *_COMMAND], stdin=subprocess.PIPE, stdout=null, stderr=null)
        threading.Thread(target=_wait_for, args=(process,), daemon=True).start()


def _wait_for(process: subprocess.Popen[bytes]) -> None:
    """Wait for the second process, and close the pipe whose end tells it that this process has ended."""
    process.wait()
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()


def compile_for_parent() -> None:
    """Compile as the second process, which ends at the latest when standard input is closed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compile_detection()


def _end_with_parent() -> None:
    while os.read(0, 1):
        pass
    os._exit(1)


def compile_detection() -> None:
    """Collect, detect and label the light of a few invented hits, so that all loops behind the cast are compiled."""
    laser, receiver, gsfl = optics.Laser(), optics.Receiver(fov_deg=2.5, f_number=2.8), detector.Gsfl()
    pixel, weight = np.repeat([0, 1, 2], 2), np.full(6, 0.5)
    first = np.zeros(6, np.int64)
    rays = Rays(receiver.shape, np.tile([0.0, 0.0, 1.0], (6, 1)), pixel, weight)
    range_m = 1000.0 + np.array([0.0, 0.1, 0.0, 6.0, 0.0, 30.0])  # one pulse, two in rows that overlap, two apart
    hits = Hits(rays, np.arange(6), pixel, weight, first, first, first, range_m, np.ones(6), np.full(6, 0.1))
    photons = optics.collect(hits, laser, receiver, 0.0)
    detector.detect(photons, gsfl, np.random.default_rng(1))
    scene.label(hits, photons, gsfl.max_returns)
