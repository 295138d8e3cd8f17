"""The first start after an installation: a second process compiles the end of a flash while this one compiles its beginning.

numba compiles one loop at a time in a process, and all loops of a flash take some 20 s of one core. The two processes share
the folder of machine code. Where both want the same loop, one compiles it and the other waits.
"""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from rso_lidar import detector, kernels, optics, scene
from rso_lidar.records import Hits, Rays

_COMMAND = "from rso_lidar.first_start import compile_detection; compile_detection()"


@cache
def compile_ahead() -> subprocess.Popen[bytes] | None:
    """Start a process that compiles what the end of a flash needs; once, and only where nothing of it is on disk.

    Returns
    -------
    The process, which goes on by itself; None where there is nothing to compile, no place to keep it or no second core.
    """
    if kernels.has_machine_code() is not False or (os.cpu_count() or 1) < 2:
        return None
    if not Path(sys.executable or "").stem.startswith("python"):  # Python inside another program
        return None
    with suppress(OSError):
        null = subprocess.DEVNULL
        return subprocess.Popen([sys.executable, "-c", _COMMAND], stdin=null, stdout=null, stderr=null)
    return None


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
