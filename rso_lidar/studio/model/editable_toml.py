"""The text of a TOML file while it is edited: by its places or as a whole, with comments kept, and with a history."""

from __future__ import annotations

import copy
import datetime
import time
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.part import parse_toml
from rso_lidar.studio.model.problem_place import split_place

_MOST_STEPS, _MOST_CHARACTERS = 300, 20_000_000  # of the history
_LONGEST_FOR_EDITS = 300_000  # characters; tomlkit parses about 1 MB in 10 s
_PAUSE_S = 1.0  # edits of one kind that follow each other faster are one step of the history
_Steps = tuple[str | int, ...]


class EditableToml:
    """A TOML text that is edited. `listeners` are called after each change."""

    def __init__(self, text: str) -> None:
        self._text = text
        self.listeners: set[Callable[[], None]] = set()
        self._past: list[str] = []
        self._future: list[str] = []
        self._last = ("", 0.0)  # kind and instant of the last edit
        self._parsed: tuple[str, dict[str, Any], bool] = ("", {}, True)

    @property
    def title(self) -> str:
        """What the text is called at the start of messages."""
        return "the text"

    @property
    def text(self) -> str:
        """The text."""
        return self._text

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to undo."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is an undone edit."""
        return bool(self._future)

    @property
    def is_toml(self) -> bool:
        """Whether the text is TOML, so that forms can change it."""
        self.tables()
        return self._parsed[2] and len(self._text) <= _LONGEST_FOR_EDITS

    def tables(self) -> dict[str, Any]:
        """Return the tables of the text, or of the last text that was TOML."""
        text, tables, _ = self._parsed
        if text != self._text:
            try:
                self._parsed = self._text, parse_toml(self._text, self.title, ScenarioError), True
            except ScenarioError:
                self._parsed = self._text, tables, False
        return self._parsed[1]

    def outline(self) -> Any:
        """Return the structure of the tables: their keys and entries, with types and names, in a form to be compared."""
        return _outline(self.tables())

    def get(self, place: str) -> Any:
        """Return the value at a place, or None."""
        here: Any = self.tables()
        for step in split_place(place):
            try:
                here = here[step]
            except (KeyError, IndexError, TypeError):
                return None
        return here

    def set_text(self, text: str, kind: str = "text") -> None:
        """Replace the text; edits of the same kind that follow each other fast are undone together."""
        if text == self._text:
            return
        now = time.monotonic()
        if kind == "whole" or self._last[0] != kind or now - self._last[1] > _PAUSE_S:
            self._past.append(self._text)
            while len(self._past) > _MOST_STEPS or sum(map(len, self._past)) > _MOST_CHARACTERS:
                del self._past[0]
        self._last = (kind, now)
        self._future.clear()
        self._show(text)

    def undo(self) -> None:
        """Undo the last edit."""
        if self._past:
            self._future.append(self._text)
            self._last = ("", 0.0)
            self._show(self._past.pop())

    def redo(self) -> None:
        """Make the last undone edit again."""
        if self._future:
            self._past.append(self._text)
            self._last = ("", 0.0)
            self._show(self._future.pop())

    def _show(self, text: str) -> None:
        self._text = text
        for listener in list(self.listeners):
            listener()

    def set(self, place: str, value: Any) -> None:
        """Set the value at a place; tables on the way are made. Comments and layout of all else stay.

        Raises
        ------
        ScenarioError
            If the text is not TOML, or the value cannot be placed.
        """
        self._require_toml()
        self.set_text(set_value(self._text, place, value), place)

    def remove(self, place: str) -> None:
        """Remove the value, table or entry at a place; nothing happens where there is none."""
        if self.get(place) is not None:
            self._require_toml()
            self.set_text(set_value(self._text, place, None), place)

    def add_entry(self, place: str, table: dict[str, Any]) -> None:
        """Add an entry at the end of the list of tables at a place, which is made where there is none, or a name."""
        entries = value if isinstance(value := self.get(place), list) else None
        self.set(f"{place}[{len(entries)}]" if entries else place, table if entries else [table])

    def _require_toml(self) -> None:
        if not self.is_toml:
            raise ScenarioError("the text is not valid TOML, or too long for forms; correct it in the editor first")


def _outline(tables: Any) -> Any:
    """Return the structure of tables: keys of tables and lists of tables, and their types and names."""
    if isinstance(tables, Mapping):
        return tuple(
            (key, _outline(value) if isinstance(value, dict | list) else value if key in ("type", "name") else 0)
            for key, value in sorted(tables.items())
            if isinstance(value, dict | list) or key in ("type", "name")
        )
    if isinstance(tables, list):
        return tuple(_outline(table) for table in tables if isinstance(table, dict))
    return 0


def set_value(text: str, place: str, value: Any) -> str:
    r"""Set (None: remove) the value at a place of a TOML text, and nothing else. Needs tomlkit, of the extra `studio`.

    Tables on the way are made. The last entry that is removed takes its list with it.

    Parameters
    ----------
    place : dotted key, such as ``target[0].motion.file``; an index one past the end appends an entry

    Raises
    ------
    ScenarioError
        If the text is not TOML, nothing is at the place, or the value cannot be placed without a change elsewhere.

    >>> print(set_value("[time]\nduration_s = 10 # short", "time.duration_s", 20))
    [time]
    duration_s = 20 # short
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
    """Return a value as tomlkit has it: a table of its own near the root, an inline table further inside."""
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
