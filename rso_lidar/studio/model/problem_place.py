"""The place in a text that the message of an error is about."""

from __future__ import annotations

import re

from rso_lidar.errors import ScenarioError
from rso_lidar.part import find_line, parse_toml

_PLACE = re.compile(r"([A-Za-z_][\w-]*(?:\[\d+\]|\.[\w-]+)*): ")


def locate_problem(message: str, text: str) -> tuple[str, int | None]:
    """Return the place that a message names, as a TOML key, and its line in the text (None: unknown).

    Parameters
    ----------
    message : of an error that `Scenario.loads` raises, without the title of the text
    text : TOML of the scenario
    """
    if found := re.search(r"\(at line (\d+), column \d+\)", message):
        return "", int(found[1])
    found = _PLACE.match(message)
    place = found[1] if found else ""
    if unknown := re.search(r"(?:^|: )unknown key '([^']+)'", message):
        place = f"{place}.{unknown[1]}".lstrip(".")
    first, _, rest = place.partition(".")
    if found := re.match(r"target (\S+): ", message):  # messages of loaded bodies have names, not numbers
        first, rest = found[1], ""
    names = _list_targets(text)
    if first in names:
        place = f"target[{names.index(first)}].{rest}".rstrip(".")
    return place, find_line(text, place)


def is_at(place: str, field: str) -> bool:
    """Return whether a place is that of a field, or of a number of the vector in it.

    Parameters
    ----------
    place, field : TOML keys
    """
    return field in (place, re.sub(r"\[\d+\]$", "", place))


def _list_targets(text: str) -> list[str]:
    try:
        tables = parse_toml(text, "", ScenarioError).get("target", [])
    except ScenarioError:
        return []
    return [str(one.get("name")) if isinstance(one, dict) else "" for one in tables] if isinstance(tables, list) else []
