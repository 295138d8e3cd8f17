"""The text of one scenario while it is edited, with its history, its draft and its file."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.files import check_writable, read_bytes, write_atomically
from rso_lidar.part.toml_edits import remove_value, set_value
from rso_lidar.part.toml_text import MOST_BYTES, parse_toml, split_place
from rso_lidar.studio.root_folder import Folder

_MOST_STEPS, _MOST_CHARACTERS = 300, 20_000_000  # of the history
_LONGEST_FOR_FORMS = 300_000  # characters; tomlkit parses about 1 MB in 10 s
_PAUSE_S = 1.0  # edits of one kind that follow each other faster are one step of the history
UNSAVED = "unsaved.toml"  # the name of the draft of the first document without one


class EditConflictError(RsoLidarError, RuntimeError):
    """A file that another program changed since it was read, or that exists already."""


class Document:
    """The TOML text of one scenario: what the editor and the forms both change.

    `listeners` are called after each change. `notice` is a line for the user about how the document was opened.
    """

    def __init__(self, folder: Folder, text: str, name: str = "", draft_name: str = UNSAVED) -> None:
        """Hold a text.

        Parameters
        ----------
        folder : of the studio.
        text : of the scenario.
        name : of its file; empty for none.
        draft_name : after which the draft of a document without a file is named.
        """
        self.folder, self.name, self._text, self._draft_name = folder, name, text, draft_name
        self.listeners: set[Callable[[], None]] = set()
        self.notice = ""
        self._past: list[str] = []
        self._future: list[str] = []
        self._last = ("", 0.0)  # kind and instant of the last edit
        self._line_end = "\n"  # of the file; the text has "\n"
        self._saved_text, self._drafted = "", text
        self._digest, self._stamp = "", (0, 0)  # of the file as read or written last; empty for no file
        self._parsed: tuple[str, dict[str, Any], bool] = ("", {}, True)

    @classmethod
    def open(cls, folder: Folder, name: str) -> Self:
        """Read the document of a file, or of the draft that is left of it."""
        made = cls(folder, "", name)
        draft = made._draft_path()
        if made._path().exists() or not draft.is_file():
            made._load()
        if draft.is_file():
            try:
                head, _, text = _decode(draft).partition("\n")
            except ScenarioError as error:
                made.notice = f"{name}: the draft of the last session cannot be read and is ignored: {error}"
                return made
            if text != made._text:
                made._text = made._drafted = text
                made._digest = head.rpartition(" ")[2] if made._digest else ""
                made.notice = f"{name}: unsaved edits of the last session were restored; undo or reload drops them"
                made._past.append(made._saved_text)
        return made

    @property
    def title(self) -> str:
        """Name of the file, or a word for a text that has none."""
        return self.name or "unsaved"

    @property
    def text(self) -> str:
        """The text."""
        return self._text

    @property
    def is_changed(self) -> bool:
        """Whether the text differs from the file as it was read or saved last."""
        return self._text != self._saved_text

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
        return self._parsed[2] and len(self._text) <= _LONGEST_FOR_FORMS

    def tables(self) -> dict[str, Any]:
        """Return the tables of the text, or of the last text that was TOML."""
        text, tables, _ = self._parsed
        if text != self._text:
            try:
                self._parsed = self._text, parse_toml(self._text, self.title, ScenarioError), True
            except ScenarioError:
                self._parsed = self._text, tables, False
        return self._parsed[1]

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

    def save(self, *, overwrite: bool = False) -> None:
        """Write the text to its file, and remove the draft.

        Raises
        ------
        EditConflictError
            If the file was changed by others since it was read, unless `overwrite` is set.
        RsoLidarError
            If it cannot be written.
        """
        if not self.name:
            raise ScenarioError("the scenario has no name yet; give one under Save as")
        if not overwrite and self._digest_on_disk() != self._digest:
            raise EditConflictError(f"{self.name}: was changed on disk meanwhile")
        self._write(self._path())
        self._remember(self._text)
        self._drop_draft()
        self._show(self._text)

    def save_as(self, name: str, *, overwrite: bool = False) -> None:
        """Write the text under another name, which the document then has.

        Raises
        ------
        EditConflictError
            If there is a file of that name, or others changed its own, unless `overwrite` is set.
        RsoLidarError
            If the name is not allowed, or the file cannot be written.
        """
        place = self.folder.resolve(name, (".toml",))
        if name == self.name:
            self.save(overwrite=overwrite)
            return
        if place.exists() and not overwrite:
            raise EditConflictError(f"{name}: exists already")
        self._write(place)
        self._drop_draft()
        self.name = name
        self._remember(self._text)
        self._show(self._text)

    def reload(self) -> None:
        """Replace the text by that on disk; undo brings the edits back."""
        before = self._text
        self._load()
        self._text, text = before, self._text
        self._drop_draft()
        self.set_text(text, "whole")

    def changed_on_disk(self) -> bool:
        """Return whether another program changed or removed the file since it was read or saved."""
        if not self._digest or _stamp(self._path()) == self._stamp:
            return False
        now = self._digest_on_disk()
        if now == self._digest:
            self._stamp = _stamp(self._path())
        return now != self._digest

    def keep_draft(self) -> None:
        """Write unsaved edits beside the file, where the next session finds them."""
        text = self._text
        if text == self._drafted:
            return
        if text == self._saved_text:
            self._drop_draft()
        else:
            _write(self._draft_path(), f"# draft of {self._digest or 'none'}\n{text}")
        self._drafted = text

    def _path(self) -> Path:
        return self.folder.resolve(self.name, (".toml",))

    def _draft_path(self) -> Path:
        place = self.folder.resolve(self.name or self._draft_name, (".toml",))
        return self.folder.require_inside(place.with_name(f".{place.name}.draft"))

    def _drop_draft(self) -> None:
        self.notice, self._drafted = "", self._text
        with suppress(OSError):
            self._draft_path().unlink(missing_ok=True)

    def _load(self) -> None:
        """Read the file."""
        text = _decode(self._path())
        self._line_end = "\r\n" if "\r\n" in text else "\n"
        self._text = text.replace("\r\n", "\n")
        self._remember(self._text)

    def _write(self, path: Path) -> None:
        _write(path, self._text.replace("\n", self._line_end))

    def _remember(self, text: str) -> None:
        self._saved_text, self._drafted, self._stamp = text, text, _stamp(self._path())
        self._digest = self._digest_on_disk()

    def _digest_on_disk(self) -> str:
        path = self._path()
        if not path.is_file():
            return ""
        return hashlib.sha256(read_bytes(path, MOST_BYTES, ScenarioError)).hexdigest()


def list_documents(folder: Folder) -> list[str]:
    """List the scenario files of a folder, and the drafts that have no file yet."""
    drafts = [path.name.removesuffix(".draft")[1:] for path in folder.path.glob(".*.toml.draft")]
    return sorted({*folder.list_files((".toml",)), *drafts})


def _decode(path: Path) -> str:
    """Read a text without changing its line ends."""
    try:
        return read_bytes(path, MOST_BYTES, ScenarioError, "scenario file (.toml)").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path.name}: is not UTF-8 text; save it as UTF-8") from None


def _write(path: Path, text: str) -> None:
    check_writable(path, overwrite=True)
    try:
        content = text.encode()
    except UnicodeEncodeError:
        raise ScenarioError(f"{path.name}: not written: it contains half a character; delete and retype it") from None
    if len(content) > MOST_BYTES:
        raise ScenarioError(
            f"{path.name}: not written: {len(content):,} bytes, and at most {MOST_BYTES:,} can be read again"
        )
    with write_atomically(path) as draft:
        draft.write_bytes(content)


def _stamp(path: Path) -> tuple[int, int]:
    with suppress(OSError):
        status = path.stat()
        return status.st_mtime_ns, status.st_size
    return 0, 0
