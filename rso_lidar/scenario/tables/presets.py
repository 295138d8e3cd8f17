"""Shipped cameras by name."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any


@cache
def load_presets() -> dict[str, dict[str, Any]]:
    """Load the shipped cameras by name, as TOML tables of `[lidar]` with a line `what`."""
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))
