"""The page Run: a form that starts jobs, the queue, the recordings of the folder, and a viewer of their frames."""

from __future__ import annotations

import glob
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import fastapi
from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.export.reader.status import RecordingStatus
from rso_lidar.export.registry import FORMATS
from rso_lidar.scenario.tables.world import parse_frames
from rso_lidar.studio.jobs.queue import KINDS, Job, JobRequest
from rso_lidar.studio.pages.frame_viewer import FrameViewer
from rso_lidar.studio.root_folder import RECORDINGS
from rso_lidar.studio.state import BrowserTab, Workspace

_USUAL_HZ = 20.0  # frames/s of the shipped approach on two cores, until a run of this studio has been measured
_FROM_SCENARIO = ("run", "timeline", "budget", "trade", "dataset")
_RESULTS = tuple({suffix for kind in KINDS.values() for suffix in kind.makes if suffix})


def add_routes(application: fastapi.FastAPI, workspace: Workspace) -> None:
    """Add the route of results: files of the folder, downloaded, or shown as pages without scripts."""

    @application.get("/studio/results/{name:path}")
    def send_result(name: str) -> fastapi.Response:
        try:
            path = workspace.folder.resolve(name, _RESULTS)
        except RsoLidarError as error:
            return fastapi.Response(str(error), 404, media_type="text/plain")
        if not path.is_file():
            return fastapi.Response(f"{name}: is not in the folder", 404, media_type="text/plain")
        shown = path.suffix in (".html", ".png", ".gif", ".mp4")
        return fastapi.responses.FileResponse(
            path,
            filename=path.name,
            content_disposition_type="inline" if shown else "attachment",
            headers={"content-security-policy": "sandbox"},
        )


class RunPage:
    """The page of one tab."""

    def __init__(self, tab: BrowserTab) -> None:
        self.tab, self.jobs, self.folder = tab, tab.workspace.jobs, tab.workspace.folder
        self._rows: dict[Job, tuple[Any, ...]] = {}
        self._was_active, self._is_listing, self._awaited = True, False, ""
        with ui.row(wrap=False).classes("w-full p-4 gap-4 items-start"):
            with ui.column().classes("w-[400px] shrink-0 gap-4"):
                self._draw_form()
                ui.label("Jobs").classes("text-base font-medium")
                self._list = ui.column().classes("w-full gap-2").mark("jobs").props('data-test="jobs"')
                ui.label("Recordings").classes("text-base font-medium")
                columns = [
                    {"name": key, "label": label, "field": key, "align": "left"}
                    for key, label in (("name", "Name"), ("frames", "Frames"), ("state", "State"), ("size", "MB"))
                ]
                self._table = ui.table(
                    columns=columns, rows=[], row_key="name", selection="single",
                    on_select=lambda event: self._open(event.selection),
                ).classes("w-full").props('dense flat data-test="recordings" no-data-label="No recording yet"')  # fmt: skip
            with ui.column().classes("grow min-w-0 gap-2"):
                self._viewer = FrameViewer(self.folder)
                self._draw_actions()
        tab.document_changed.subscribe(self._describe)
        tab.assessed.subscribe(self._describe)
        ui.timer(1.0, self._tick)

    def _draw_form(self) -> None:
        with ui.card().classes("w-full gap-2"):
            self._kind = ui.select({key: KINDS[key].title for key in _FROM_SCENARIO}, value="run", label="Job",
                                   on_change=self._describe).classes("w-full").props("dense")  # fmt: skip
            self._output = (
                ui.input("Name of the result").classes("w-full").props('dense data-test="output"').mark("output")
            )
            with ui.row(wrap=False).classes("w-full gap-2") as self._options:
                self._frames = ui.input("Frames", placeholder="all; A:B", on_change=self._describe).props("dense")
                self._seed = ui.input("Seed", placeholder="file's").props("dense")
                self._keep = ui.input("Keep", placeholder="photons,…").props("dense")
                self._frames.tooltip("A:B makes frames A to B - 1; empty makes all")
                self._seed.tooltip("random seed of all noise, instead of that of the file")
                self._keep.tooltip("intermediate products to record: photons, waveforms, oversampled, prediction")
            self._note = ui.label().classes("text-sm")
            self._start = ui.button("Start", on_click=self._begin).props('data-test="start"').mark("start")

    def _draw_actions(self) -> None:
        with ui.row().classes("gap-2"):
            for kind, suffix in (("sheet", ".png"), ("animate", ".gif"), ("curves", ".png"), ("track", ".png")):
                ui.button(
                    KINDS[kind].title, on_click=lambda kind=kind, suffix=suffix: self._make(kind, f"_{kind}{suffix}")
                ).props(f'outline dense no-caps data-test="{kind}"').mark(kind)
            with ui.dropdown_button("Export", auto_close=True).props("outline dense no-caps"):
                for form in FORMATS.values():
                    if form.suffixes[0] == RECORDINGS[0]:
                        continue  # the recording itself
                    ui.item(
                        f"{form.name} ({form.suffixes[0]})",
                        on_click=lambda form=form: self._make("export", form.suffixes[0]),
                    ).tooltip(f"lost: {form.loses}")

    def _describe(self) -> None:
        """Update the default name, and what a start would do."""
        kind, document = KINDS[self._kind.value], self.tab.document
        stem = Path(document.name or "scenario.toml").stem
        if self._output.value in ("", getattr(self, "_proposed", "")):
            of_kind = "" if self._kind.value in ("run", "dataset", "trade") else f"_{self._kind.value}"
            self._proposed = f"{stem}{of_kind}{kind.makes[0]}"
            self._output.set_value(self._proposed)
        self._options.set_visibility(self._kind.value == "run")
        found = self.tab.assessment
        problem = "" if found is None or self._kind.value in ("trade", "dataset") else found.problem or found.refusal
        if problem:
            text = problem
        elif self._kind.value == "run" and found is not None and found.scenario is not None:
            frames = found.scenario.time
            try:
                count = len(frames.choose_frames(parse_frames((self._frames.value or "").strip() or None)))
            except RsoLidarError as error:
                text = problem = str(error)
            else:
                rate = next((job.rate_hz for job in reversed(self.jobs.jobs) if job.rate_hz), _USUAL_HZ)
                of = f"{count:,} of {frames.n_frames:,} frames in all"
                text = f"{of}; some {max(count / rate, 1):,.0f} s, and 15 s more at the very first start"
        else:
            text = f"{document.title}: {kind.title.lower()}"
        self._note.set_text(text)
        self._start.set_enabled(not problem)

    async def _begin(self) -> None:
        """Save the document if the user agrees, and start the job of the form."""
        document = self.tab.document
        on_disk = None
        if document.name:
            try:
                on_disk = await run.io_bound(self.folder.resolve(document.name, (".toml",)).read_text, encoding="utf-8")
            except (OSError, RsoLidarError) as error:
                ui.notify(f"{document.name}: cannot be read ({error}); save it again", type="negative")
                return
        if on_disk != document.text:
            if not document.name:
                ui.notify("the scenario has no file yet; give it a name under Save as", type="warning")
                return
            with ui.dialog() as dialog, ui.card():
                ui.label(f"{document.title} has changes that are not saved; a job runs the file.")
                with ui.row():
                    ui.button("Save and start", on_click=lambda: dialog.submit(True)).mark("save-and-start")
                    ui.button("Cancel", on_click=lambda: dialog.submit(False)).props("flat")
            if not await dialog:
                return
            try:
                document.save()
            except RsoLidarError as error:
                ui.notify(f"{error}; save it with the button above", type="negative")
                return
        values = {"frames": self._frames.value, "seed": self._seed.value, "keep": self._keep.value}
        values = {key: (value or "").strip() for key, value in values.items()} if self._kind.value == "run" else {}
        await self._add(JobRequest(self._kind.value, document.name, self._output.value.strip(), **values))

    async def _make(self, kind: str, ending: str) -> None:
        """Start a job on the recording that is shown."""
        if not self._viewer.name:
            ui.notify("choose a recording in the list first", type="warning")
            return
        await self._add(JobRequest(kind, self._viewer.name, f"{self._viewer.name.rpartition('.')[0]}{ending}"))

    async def _add(self, request: JobRequest) -> None:
        """Queue a job; where its output exists, or an interrupted run left frames, ask first."""
        try:
            output = self.folder.resolve(request.output, KINDS[request.kind].makes)
            has_frames = any(output.parent.glob(f"{glob.escape(output.name)}.tmp-*")) or (
                request.kind == "dataset" and output.exists()
            )
            if output.exists() or has_frames:
                with ui.dialog() as dialog, ui.card():
                    ui.label(f"{request.output}: " + ("has frames of an interrupted run" if has_frames else "exists"))
                    with ui.row():
                        if has_frames:
                            ui.button("Resume", on_click=lambda: dialog.submit("resume"))
                        if request.kind != "dataset":
                            ui.button("Replace", on_click=lambda: dialog.submit("overwrite")).mark("replace")
                        ui.button("Cancel", on_click=lambda: dialog.submit(None)).props("flat")
                answer = await dialog
                if answer is None:
                    return
                request = replace(request, resume=answer == "resume", overwrite=answer == "overwrite")
            self.jobs.add(request)
            self._awaited = request.output if request.kind == "run" else self._awaited
        except RsoLidarError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        self._was_active = True
        self._draw_jobs()

    def _draw_jobs(self) -> None:
        """Update the rows of the queue; rows are made and removed only where the list has changed."""
        for job in [job for job in self._rows if job not in self.jobs.jobs]:
            self._rows.pop(job)[0].delete()
        for job in list(self.jobs.jobs):
            if job not in self._rows:
                with self._list:
                    self._rows[job] = self._draw_row(job)
            _, state, bar, message, stop, resume, remove, result = self._rows[job]
            left = (
                f", {job.rate_hz:.1f}/s, {(job.total - job.done) / job.rate_hz:,.0f} s left"
                if job.rate_hz and job.is_active
                else ""
            )
            count = f" {job.done:,}/{job.total:,}{left}" if job.total and job.state != "done" else ""
            state.set_text(f"{job.state}{count}")
            bar.set_value(1.0 if job.state == "done" else min(job.done / job.total, 1.0) if job.total else 0.0)
            message.set_text(job.message)
            stop.set_visibility(job.is_active)
            resume.set_visibility(job.state in ("failed", "stopped"))
            remove.set_enabled(not job.is_active)  # it stays in its place, where no other button was just now
            result.set_visibility(job.state == "done" and job.request.output.endswith(_RESULTS))

    def _draw_row(self, job: Job) -> tuple[Any, ...]:
        with ui.card().classes("w-full p-2 gap-1") as row:
            with ui.row(wrap=False).classes("w-full items-center gap-1"):
                ui.label(f"{KINDS[job.request.kind].title}: {job.request.output}").classes("font-medium grow truncate")
                stop = ui.button(icon="stop", on_click=lambda: self._do(self.jobs.stop, job))
                resume = ui.button(icon="play_arrow", on_click=lambda: self._do(self.jobs.resume, job))
                remove = ui.button(icon="close", on_click=lambda: self._do(self.jobs.remove, job))
                for button, word in ((stop, "Stop"), (resume, "Resume"), (remove, "Remove from the list")):
                    button.props(f'flat dense round size=sm aria-label="{word}" data-test="{word.split()[0].lower()}"')
                    button.mark(word.split()[0].lower()).tooltip(word)
            bar = ui.linear_progress(0.0, show_value=False).props("instant-feedback aria-label=Progress")
            state = ui.label().classes("text-sm").mark("job-state").props('data-test="job-state" role=status')
            message = ui.label().classes("text-sm break-words opacity-80")
            result = ui.link("Open the result", f"/studio/results/{quote(job.request.output)}", new_tab=True).classes(
                "text-sm"
            )
        return row, state, bar, message, stop, resume, remove, result

    def _do(self, deed: Callable[[Job], object], job: Job) -> None:
        self._was_active = True
        try:
            deed(job)
        except RsoLidarError as error:
            ui.notify(str(error), type="negative")
        self._draw_jobs()

    async def _tick(self) -> None:
        """Update the page once a second while something runs, and once afterwards."""
        if self._is_listing or not (self._was_active or self.jobs.is_active or self._viewer.is_following):
            return
        self._was_active, self._is_listing = (
            self.jobs.is_active or (self._was_active and self._viewer.is_following),
            True,
        )
        try:
            self._draw_jobs()
            found = await run.io_bound(self.tab.workspace.recordings.read)
            if found is not None:
                rows = [self._describe_recording(status) for status in found]
                if rows != self._table.rows:
                    self._table.rows = rows
                self._viewer.offer([row["name"] for row in rows])
                await self._show_awaited(rows)
                await self._viewer.refresh()
        finally:
            self._is_listing = False

    async def _show_awaited(self, rows: list[dict[str, Any]]) -> None:
        """Show the recording of the run that was started last, as soon as it has a frame."""
        begun = [row for row in rows if row["name"] == self._awaited and row["frames"]]
        if begun:
            self._awaited, self._table.selected = "", begun
            await self._viewer.open(begun[0]["name"])

    def _describe_recording(self, status: RecordingStatus) -> dict[str, Any]:
        name = status.output.relative_to(self.folder.path).as_posix()
        size = status.file.stat().st_size / 1e6 if status.file.exists() else 0.0
        state = "complete" if status.complete else "running" if status.running else "interrupted"
        return {"name": name, "frames": status.frames, "state": state, "size": f"{size:.1f}"}

    async def _open(self, selection: list[dict[str, Any]]) -> None:
        if selection:
            await self._viewer.open(selection[0]["name"])


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    RunPage(tab)._describe()
