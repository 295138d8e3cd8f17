"""The text of one scenario while it is edited, with its draft and its file."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path
from threading import RLock
from typing import Self

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.files import check_writable, read_bytes, write_atomically
from rso_lidar.part import MOST_TOML_BYTES
from rso_lidar.studio.model.editable_toml import EditableToml
from rso_lidar.studio.model.root_folder import Folder

UNSAVED = "unsaved.toml"  # the name of the draft of the first document without one


class EditConflictError(RsoLidarError, RuntimeError):
    """A file that another program changed since it was read, or that exists already."""


class Document(EditableToml):
    """The TOML text of one scenario: what the editor and the forms both change.

    `notice` is a line for the user about how the document was opened.
    """

    def __init__(self, folder: Folder, text: str, name: str = "", draft_name: str = UNSAVED) -> None:
        """Hold a text.

        Parameters
        ----------
        draft_name : after which the draft of a document without a file is named
        """
        super().__init__(text)
        self.folder, self.name, self._draft_name = folder, name, draft_name
        self.notice = ""
        self._line_end = "\n"  # of the file; the text has "\n"
        self._saved_text, self._drafted = "", text
        self._digest, self._stamp = "", (0, 0)  # of the file as read or written last; empty for no file
        self._draft_lock = RLock()  # each tab keeps the draft, in a thread of its own

    @classmethod
    def open(cls, folder: Folder, name: str) -> Self:
        """Read the document of a file, or of the draft that is left of it."""
        document = cls(folder, "", name)
        draft = document._draft_path()
        if document._path().exists() or not draft.is_file():
            document._load()
        if draft.is_file():
            try:
                head, _, text = _decode(draft).partition("\n")
            except ScenarioError as error:
                document.notice = f"{name}: the draft of the last session cannot be read and is ignored: {error}"
                return document
            if text != document._text:
                document._text = document._drafted = text
                document._digest = head.rpartition(" ")[2] if document._digest else ""
                document.notice = f"{name}: unsaved edits of the last session were restored; undo or reload drops them"
                document._past.append(document._saved_text)
        return document

    @property
    def title(self) -> str:
        """Name of the file, or a word for a text that has none."""
        return self.name or "unsaved"

    @property
    def address(self) -> str:
        """Name by which it is opened, which a document without a file has too."""
        return self.name or self._draft_name

    @property
    def is_changed(self) -> bool:
        """Whether the text differs from the file as it was read or saved last."""
        return self._text != self._saved_text

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
        if not self._path().is_file():
            self._saved_text = self._digest = self._drafted = ""
            raise ScenarioError(f"{self.name}: was removed by another program; Save writes it again")
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

    def is_as_on_disk(self) -> bool:
        """Return whether the file holds the text."""
        return self._path().is_file() and _decode(self._path()).replace("\r\n", "\n") == self._text

    def keep_draft(self) -> None:
        """Write unsaved edits beside the file, where the next session finds them."""
        with self._draft_lock:
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
        place = self.folder.resolve(self.address, (".toml",))
        return self.folder.require_inside(place.with_name(f".{place.name}.draft"))

    def _drop_draft(self) -> None:
        with self._draft_lock, suppress(OSError):
            self.notice, self._drafted = "", self._text
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
        return hashlib.sha256(read_bytes(path, MOST_TOML_BYTES, ScenarioError)).hexdigest() if path.is_file() else ""


def list_documents(folder: Folder) -> list[str]:
    """List the scenario files of a folder, and the drafts that have no file yet."""
    drafts = [path.name.removesuffix(".draft")[1:] for path in folder.path.glob(".*.toml.draft")]
    return sorted({*folder.list_files((".toml",)), *drafts})


def _decode(path: Path) -> str:
    """Read a text without changing its line ends."""
    try:
        return read_bytes(path, MOST_TOML_BYTES, ScenarioError, "scenario file (.toml)").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path.name}: is not UTF-8 text; save it as UTF-8") from None


def _write(path: Path, text: str) -> None:
    check_writable(path, overwrite=True)
    try:
        content = text.encode()
    except UnicodeEncodeError:
        raise ScenarioError(f"{path.name}: not written: it contains half a character; delete and retype it") from None
    if len(content) > MOST_TOML_BYTES:
        size = f"{len(content):,} bytes, and at most {MOST_TOML_BYTES:,} can be read again"
        raise ScenarioError(f"{path.name}: not written: {size}")
    with write_atomically(path) as draft:
        draft.write_bytes(content)


def _stamp(path: Path) -> tuple[int, int]:
    with suppress(OSError):
        status = path.stat()
        return status.st_mtime_ns, status.st_size
    return 0, 0
