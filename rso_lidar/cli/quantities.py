"""Lengths and times in options, each with its unit or UTC offset."""

import datetime
import re

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError

_LENGTHS_M = {"m": 1.0, "km": units.KM}


def parse_length_m(option: str, text: str) -> float:
    """Parse a length with its unit, such as ``50km``, and return it in metres."""
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([A-Za-z]*)\s*", text)
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        number = float("nan")
    if not found or not np.isfinite(number):
        raise ScenarioError(f"{option} {text}: is not a length; write for example 50km or 500m")
    if not found[2]:
        raise ScenarioError(f"{option} {text}: has no unit; write {text.strip()}km or {text.strip()}m")
    if found[2] not in _LENGTHS_M:
        raise ScenarioError(f"{option} {text}: unknown unit '{found[2]}' (known: {', '.join(_LENGTHS_M)})")
    return number * _LENGTHS_M[found[2]]


def parse_instant(option: str, text: str) -> datetime.datetime:
    """Parse a time with its UTC offset, in a year that element sets can have."""
    try:
        at = datetime.datetime.fromisoformat(text.strip())
    except ValueError:
        raise ScenarioError(f"{option} {text}: is no time; write for example 2026-05-07T00:00:00Z") from None
    if at.tzinfo is None:
        raise ScenarioError(f"{option} {text}: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 1957 <= at.year <= 2056:
        raise ScenarioError(f"{option} {text}: element sets are of 1957 to 2056; correct the year")
    return at.astimezone(datetime.UTC)
