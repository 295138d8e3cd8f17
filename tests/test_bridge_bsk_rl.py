"""The inspection task of bsk_rl, observed by frames: their ranges are Basilisk's. Needs `pip install bsk-rl`."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

FILE = Path(__file__).resolve().parents[1] / "examples" / "bridges" / "bsk_rl" / "inspection.py"


def test_the_example_compiles():
    assert compile(FILE.read_text(encoding="utf-8"), FILE.name, "exec").co_names


@pytest.mark.slow
def test_a_hop_by_frames_ends_at_the_stand_off():
    """By Clohessy and Wiltshire two radial impulses end at rest at the stand-off, as far as the median is the centre."""
    pytest.importorskip("bsk_rl", reason="bsk_rl is not installed: pip install bsk-rl")
    example = SimpleNamespace(**runpy.run_path(str(FILE), run_name="example"))
    try:
        rows = np.array(list(example.fly()))
    except FileNotFoundError as error:
        pytest.skip(f"Basilisk cannot load its files: {error}")
    _, returns, median_m, true_m, reward = rows.T
    assert returns.min() >= 4
    nearer_m = true_m - median_m
    assert nearer_m.min() > -0.1 and nearer_m.max() < 1.0  # half of the longest side; the noise of a median is 2 cm
    assert abs(true_m[-1] - example.STAND_OFF_M) < 2.0 and reward[-1] > 0.0
