"""Edits of TOML texts at one place, which keep the comments and the layout of everything else."""

from __future__ import annotations

import copy
import datetime
import tomllib
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.part import parse_toml
from rso_lidar.studio.model.problem_place import split_place

_Steps = tuple[str | int, ...]


def set_value(text: str, place: str, value: Any) -> str:
    r"""Set the value at a place of a TOML text; tables on the way are made. Needs tomlkit, of the extra `studio`.

    Parameters
    ----------
    place : dotted key, such as ``target[0].motion.file``; an index one past the end appends an entry

    Returns
    -------
    str

    Raises
    ------
    ScenarioError
        If the text is not TOML, or the value cannot be placed without a change elsewhere.

    >>> print(set_value("[time]\nduration_s = 10 # short", "time.duration_s", 20))
    [time]
    duration_s = 20 # short
    """
    return _edit(text, place, value)


def remove_value(text: str, place: str) -> str:
    """Remove the value, table or entry at a place of a TOML text; of a list, the last entry takes the list with it.

    Parameters
    ----------
    place : as for `set_value`

    Returns
    -------
    str

    Raises
    ------
    ScenarioError
        If the text is not TOML, or nothing is at the place.
    """
    return _edit(text, place, None)


def _edit(text: str, place: str, value: Any) -> str:
    """Set or remove (None) the value at a place, and check that nothing else changed.

    Parameters
    ----------
    place : as for `set_value`
    """
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    expected, steps = copy.deepcopy(parse_toml(text, "the text", ScenarioError)), split_place(place)
    try:
        _apply(expected, steps, value)
        whole: Any = tomlkit.parse(text)
        here = whole
        for k, step in enumerate(steps[:-1]):
            if isinstance(step, str) and step not in here:
                here[step] = _make_item(here, steps[: k + 1], {})
            here = here[step]
        last = steps[-1]
        if value is None:
            del here[last]
        elif isinstance(last, int) and last == len(here):
            here.append(_make_item(here, steps, value))
        else:
            here[last] = _make_item(here, steps, value)
        if isinstance(last, int) and not len(here):  # the list has become empty
            _apply(whole, steps[:-1], None)
            _apply(expected, steps[:-1], None)
        new_text = tomlkit.dumps(whole)
        if tomllib.loads(new_text) != expected:
            raise ValueError("other keys would change")
    except (TOMLKitError, KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError):
        raise ScenarioError(f"{place:.80}: cannot be changed in the form here; edit the text") from None
    return str(new_text)


def _apply(tables: Any, steps: _Steps, value: Any) -> None:
    """Set or remove (None) the value at a place of tables."""
    for step in steps[:-1]:
        tables = tables.setdefault(step, {}) if isinstance(step, str) else tables[step]
    if value is None:
        del tables[steps[-1]]
    elif isinstance(tables, list) and steps[-1] == len(tables):
        tables.append(value)
    else:
        tables[steps[-1]] = value


def _make_item(here: Any, steps: _Steps, value: Any) -> Any:
    """Return a value as tomlkit has it: a table of its own near the root, an inline table further inside.

    Parameters
    ----------
    here : table or list that is to hold it
    """
    import tomlkit

    near = len(steps) <= 2 and not isinstance(here, tomlkit.items.InlineTable | tomlkit.items.Array)
    if isinstance(value, dict):
        table: Any = tomlkit.table() if near else tomlkit.inline_table()
        for key, inner in value.items():
            table[key] = _make_item(table, (*steps, key, ""), inner)
        return table
    if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value) and len(steps) == 1:
        entries = tomlkit.aot()
        for entry in value:
            entries.append(_make_item(entries, (*steps, 0), entry))
        return entries
    if isinstance(value, list):
        array = tomlkit.array()
        for entry in value:
            array.append(_make_item(array, (*steps, "", ""), entry))
        return array
    if isinstance(value, datetime.datetime) and value.utcoffset() == datetime.timedelta(0):
        return tomlkit.value(value.replace(tzinfo=None).isoformat() + "Z")
    return tomlkit.item(value)
