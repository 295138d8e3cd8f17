"""Finished runs of dispersions, kept in a file from which an interrupted study continues."""

from __future__ import annotations

import hashlib
import importlib.metadata
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RunError
from rso_lidar.files import read_arrays, write_atomically
from rso_lidar.scenario import Scenario
from rso_lidar.study.dispersions.mission_disperser import Block
from rso_lidar.study.dispersions.start_errors import resolve_start_errors

_MOST_BYTES = 2**36  # of all finished runs, which the study holds in memory: 5 million runs of 600 samples


def identify_runs(scenario: Scenario, target: str) -> str:
    """Return eight hex digits that identify the runs of a scenario: SHA-256 of it, of the target and of the version.

    Covariances that files state are part of it, because the files may change.
    """
    version = importlib.metadata.version("rso-lidar"), scenario.source.versions["arithmetic"]
    resolved = resolve_start_errors(scenario, target)
    stated = () if resolved is scenario.dispersion else (repr(resolved),)
    return hashlib.sha256("\0".join((scenario.source.scenario, target, *version, *stated)).encode()).hexdigest()[:8]


def read_blocks(path: Path) -> dict[int, Block]:
    """Read the finished blocks of a file; a damaged one has none."""
    blocks: dict[int, Block] = {}
    try:
        for name, values in read_arrays(path, RunError, most_bytes=_MOST_BYTES).items():
            begin, _, column = name.partition(":")
            blocks.setdefault(int(begin), {})[column] = values
    except (RunError, ValueError):
        return {}
    return blocks


def write_blocks(path: Path, blocks: dict[int, Block]) -> None:
    """Write the finished blocks, whole or not at all."""
    columns: dict[str, Any] = {
        f"{begin}:{name}": value for begin, block in blocks.items() for name, value in block.items()
    }
    with write_atomically(path) as draft, draft.open("wb") as file:
        np.savez(file, **columns)
