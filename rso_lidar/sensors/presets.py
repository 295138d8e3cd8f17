"""Shipped sensors by name."""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rso_lidar.errors import did_you_mean


@cache
def load_sensor_presets() -> dict[str, dict[str, Any]]:
    """Load the shipped sensors by name, as TOML tables of `[[sensor]]` with a line `what`."""
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


def merge_preset(kind: str | None, given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a table with the values of its preset where it has none; without a preset, the table itself.

    Parameters
    ----------
    kind : `type` of the sensor
    """
    name = given.get("preset")
    if not isinstance(name, str):
        return given
    known = {each: table for each, table in load_sensor_presets().items() if table["type"] == kind}
    if name not in known:
        raise ValueError(f"preset: no {kind} '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    return {key: value for key, value in known[name].items() if key != "what"} | dict(given)
