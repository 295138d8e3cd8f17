"""Rotations of real objects by name."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rso_lidar.errors import did_you_mean

_PLACES = {"direction", "quaternion_xyzw"}  # a user's choice of one replaces the preset's other


@cache
def load_spin_presets() -> dict[str, dict[str, Any]]:
    """Load the rotations of real objects by name, as tables of an attitude with a line `what`.

    Returns
    -------
    dict
        Tables by name; `what` states what is sourced, with how much confidence, and what is assumed

    Examples
    --------
    >>> sorted(load_spin_presets())
    ['bs_3a', 'cz3b_stage', 'dead_geo', 'envisat_2013', 'envisat_2017']
    """
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


def merge_spin_preset(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a table with the values of its preset where it has none; without a preset, the table itself."""
    name, known = given.get("preset"), load_spin_presets()
    if not isinstance(name, str):
        return given
    if name not in known:
        raise ValueError(f"preset: no rotation '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})")
    left_out = {"what", *(_PLACES if _PLACES & set(given) else ())}
    return {key: value for key, value in known[name].items() if key not in left_out} | dict(given)
