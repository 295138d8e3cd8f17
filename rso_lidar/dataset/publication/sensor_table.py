"""The parameters of a sensor with their meanings, and which of them are assumed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part
from rso_lidar.scenario import Lidar

_MARK = "assumed"  # in the description of a field: its default has no source


class Parameter(NamedTuple):
    """One parameter of a sensor: its key in the scenario, its value, its meaning, and whether the value is assumed."""

    place: str
    value: str
    meaning: str
    is_assumed: bool


def list_parameters(lidar: str) -> list[Parameter]:
    """List the parameters of a sensor.

    Parameters
    ----------
    lidar : its table as JSON

    Returns
    -------
    list of Parameter
        Without meanings if the parts of this version cannot read the table, such as for a detector of the user's own.
    """
    table = json.loads(lidar)
    try:
        return list(_walk(Lidar.model_validate_json(lidar), "lidar"))
    except (ScenarioError, ValueError):
        return [Parameter(place, value, "", False) for place, value in _flatten(table, "lidar")]


def _walk(part: Part, place: str) -> Iterator[Parameter]:
    """Yield the parameters of a part and of the parts in it."""
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Part):
            yield from _walk(value, f"{place}.{name}")
        elif value is not None:
            meaning = " ".join((field.description or "").split())
            text = json.dumps(_simplify(value), ensure_ascii=False)
            yield Parameter(f"{place}.{name}", text, meaning, _MARK in meaning and value == field.default)


def _flatten(table: Any, place: str) -> Iterator[tuple[str, str]]:
    """Yield place and value of all entries of a table."""
    if isinstance(table, dict):
        for name, value in table.items():
            yield from _flatten(value, f"{place}.{name}")
    else:
        yield place, json.dumps(table, ensure_ascii=False)


def _simplify(value: Any) -> Any:
    """Convert a value of a part to a JSON value."""
    if isinstance(value, Part):
        return value.model_dump(mode="json", exclude_none=True)
    if isinstance(value, list | tuple):
        return [_simplify(element) for element in value]
    return value if isinstance(value, bool | int | float | str) else str(value)
