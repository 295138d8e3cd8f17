"""The text of a TOML file while it is edited: by its places or as a whole, with comments kept, and with a history."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.part import parse_toml
from rso_lidar.studio.model.problem_place import split_place
from rso_lidar.studio.model.toml_edits import remove_value, set_value

_MOST_STEPS, _MOST_CHARACTERS = 300, 20_000_000  # of the history
_LONGEST_FOR_EDITS = 300_000  # characters; tomlkit parses about 1 MB in 10 s
_PAUSE_S = 1.0  # edits of one kind that follow each other faster are one step of the history


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
            self.set_text(remove_value(self._text, place), place)

    def add_entry(self, place: str, table: dict[str, Any]) -> None:
        """Add an entry at the end of the list of tables at a place, which is made if it is missing."""
        entries = self.get(place)
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
