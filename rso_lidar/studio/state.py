"""State of the studio: what all tabs of the browser share, and what one of them shows."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

from nicegui import Event, run

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.scenario import parse_frames
from rso_lidar.studio.document import UNSAVED, Document, list_documents
from rso_lidar.studio.job_queue import FLIES_SCENARIO, KINDS, JobQueue, JobRequest
from rso_lidar.studio.model.recording_list import RecordingList
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.studio.model.text_assessment import Assessment, assess, check_study, list_warnings, load_flyable

_PAUSE_S = 0.3  # without a further edit, after which a text is assessed


class Workspace:
    """The folder, its open documents and its jobs: one for the process, shared by all tabs of the browser."""

    def __init__(self, path: Path) -> None:
        """Open a folder; raise `ScenarioError` if it is not a folder."""
        self.folder = Folder(path)
        self.jobs, self.recordings = JobQueue(self.folder, self._check_job), RecordingList(self.folder)
        self._documents: dict[str, Document] = {}
        self._unnamed: dict[str, Document] = {}  # by the name of their drafts

    def _check_job(self, request: JobRequest) -> int:
        """Assess the scenario of a job as its file is now, and return the number of frames of a run (0: unknown)."""
        path = self.folder.resolve(request.source, KINDS[request.kind].reads)
        if request.kind not in FLIES_SCENARIO:
            if path.suffix == ".toml":
                check_study(path, self.folder)
            return 0
        time = load_flyable(path, self.folder, request.source).time
        return len(time.choose_frames(parse_frames(request.frames or None)))

    def open_document(self, name: str) -> Document:
        """Return the document of a scenario file, the same one for all tabs.

        Raises
        ------
        ScenarioError
            If the name is not allowed, or the file cannot be read.
        """
        name = self._find_first_name(name)
        if name in self._unnamed:
            return self._unnamed[name]
        if name not in self._documents:
            self._documents[name] = Document.open(self.folder, name)
        return self._documents[name]

    def _find_first_name(self, name: str) -> str:
        """Return the name under which a file is open; links to one file are one document."""
        path = self.folder.resolve(name, (".toml",))
        if path.is_symlink() or any(parent.is_symlink() for parent in path.parents):
            return path.resolve().relative_to(self.folder.path).as_posix()
        return name

    def close(self) -> None:
        """End: keep the drafts of all open documents, and stop the jobs."""
        for document in (*self._documents.values(), *self._unnamed.values()):
            with suppress(RsoLidarError, OSError):
                document.keep_draft()
        self.jobs.close()

    def new_document(self, text: str) -> Document:
        """Return a document that has no file yet."""
        used = {*list_documents(self.folder), *self._unnamed}
        numbered = (UNSAVED.replace(".", f"_{number}.") for number in itertools.count(2))
        name = next(
            candidate for candidate in (UNSAVED, *itertools.islice(numbered, len(used) + 1)) if candidate not in used
        )
        self._unnamed[name] = Document(self.folder, text, draft_name=name)
        return self._unnamed[name]

    def first_document(self, wanted: str = "") -> Document:
        """Return the document that a new tab shows: the wanted one, else the first that can be read, or an empty text."""
        for name in ([wanted] if wanted else []) + list_documents(self.folder):
            with suppress(RsoLidarError, OSError):
                return self.open_document(name)
        return self.new_document("")

    def save_as(self, document: Document, name: str, *, overwrite: bool = False) -> None:
        """Save a document under another name, by which tabs that open the file find it.

        Raises
        ------
        RsoLidarError
            If the name is not allowed or taken, the file cannot be written, or another tab edits it.
        """
        other = self._documents.get(name)
        if other is not None and other is not document and other.is_changed:
            raise ScenarioError(f"{name}: is open with unsaved edits; save it, or give another name")
        document.save_as(name, overwrite=overwrite)
        self._documents = {
            key: open_document for key, open_document in self._documents.items() if open_document is not document
        }
        self._unnamed = {key: draft for key, draft in self._unnamed.items() if draft is not document}
        self._documents[name] = document


class BrowserTab:
    """One tab of the browser: its document, what `check` says of it, and events to which the pages subscribe.

    - `document_changed`: another text, or another document.
    - `assessed`: a new assessment; `assessment` holds it, and `warnings` is None until those of a valid text are known.
    - `warned`: they are known.
    - `field_chosen`: a page should show the field at a place, such as ``lidar.laser.energy_mj``.
    - `page_chosen`: another page is shown, by its name.
    - `selected`: another value of a key of `selection`, which the address of the page keeps over a reload.
    - `end_chosen`: the page See should show the last frame.
    - `frames_proposed`: the page Run should propose these frames, such as ``440:540:4``.
    """

    def __init__(
        self, workspace: Workspace, document: Document, selection: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self.workspace, self.document, self.selection = workspace, document, dict(selection)
        self.selected = Event[[str, str]]()
        self.assessment: Assessment | None = None
        self.warnings: list[str] | None = None
        self.document_changed, self.assessed, self.warned = Event[[]](), Event[[]](), Event[[]]()
        self.field_chosen, self.page_chosen = Event[[str]](), Event[[str]]()
        self.end_chosen, self.frames_proposed = Event[[]](), Event[[str]]()
        self._generation, self._warning = 0, asyncio.Lock()  # one text after the other: each takes seconds

    def select(self, key: str, value: str) -> None:
        """Note what is selected, so that a reload shows it again."""
        if self.selection.get(key, "") != value:
            self.selection[key] = value
            self.selected.emit(key, value)

    def show(self, document: Document) -> None:
        """Show another document; of this one, a draft is kept."""
        with suppress(RsoLidarError, OSError):
            self.document.keep_draft()
        self.document.listeners.discard(self._on_change)
        self.document = document
        for key in ("table", "frame", "pixel"):  # of the last document
            self.selection.pop(key, None)
        self._listen()

    def _listen(self) -> None:
        self.document.listeners.add(self._on_change)
        self._on_change()

    def open(self) -> None:
        """Begin, when the browser has connected."""
        self._listen()

    def close(self) -> None:
        """End: the browser has gone. The document stays with the workspace."""
        self._generation += 1
        self.document.listeners.discard(self._on_change)

    def _on_change(self) -> None:
        self._generation += 1
        self.document_changed.emit()
        asyncio.get_running_loop().create_task(self._assess(self._generation))

    async def _assess(self, generation: int) -> None:
        """Assess the text after a pause, unless it changes again."""
        await asyncio.sleep(_PAUSE_S if self.assessment else 0.0)
        if generation != self._generation:
            return
        assessment = await run.io_bound(assess, self.document.text, self.workspace.folder, self.document.title)
        if assessment is not None and generation == self._generation:
            self.assessment, self.warnings = assessment, None
            self.assessed.emit()
            await self._warn(assessment, generation)

    async def _warn(self, assessment: Assessment, generation: int) -> None:
        """List the warnings on a text that may be flown, unless it changes before its turn."""
        async with self._warning:
            if not assessment.is_ready or generation != self._generation:
                return
            lines = await run.io_bound(list_warnings, assessment, self.workspace.folder, self.document.title)
            if lines is not None and generation == self._generation:
                self.warnings = lines
                self.warned.emit()
