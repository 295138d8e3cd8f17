"""The text of one scenario while it is edited, with its history and its file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

from rso_lidar.studio.folder import Folder


class Document:
    """The TOML text of one scenario: what the editor and the forms both change."""

    def __init__(self, folder: Folder, text: str, name: str = "") -> None:
        self.folder, self.name, self._text = folder, name, text
        self.listeners: set[Callable[[], None]] = set()

    @classmethod
    def open(cls, folder: Folder, name: str) -> Self:
        """Read the document of a file."""
        return cls(folder, folder.resolve(name, (".toml",)).read_text(encoding="utf-8"), name)

    @property
    def title(self) -> str:
        """Name of the file, or a word for a text that has none."""
        return self.name or "unsaved"

    @property
    def text(self) -> str:
        """The text."""
        return self._text

    def set_text(self, text: str) -> None:
        """Replace the text."""
        if text != self._text:
            self._text = text
            for listener in list(self.listeners):
                listener()
