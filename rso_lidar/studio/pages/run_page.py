"""The page Run: a form that starts jobs, the queue, the recordings of the folder, and a viewer of their frames."""

from __future__ import annotations

import asyncio
import glob
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import fastapi
from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.export import FORMATS
from rso_lidar.studio.job_queue import KINDS, Job, JobRequest
from rso_lidar.studio.model.recording_list import RECORDINGS
from rso_lidar.studio.model.run_speed import RunSpeed, estimate_run
from rso_lidar.studio.model.text_assessment import Assessment
from rso_lidar.studio.pages.elements import (
    ask,
    draw_button,
    draw_icon_button,
    draw_splitter,
    draw_table,
    mark,
    tell_errors,
)
from rso_lidar.studio.pages.frame_viewer import FrameViewer
from rso_lidar.studio.state import BrowserTab, Workspace

_IDLE_TICKS = 5  # seconds between two looks at the folder while nothing runs
_FROM_SCENARIO = ("run", "timeline", "budget", "trade", "dataset")
_JOB_ACTIONS = ("Stop", "Resume", "Remove from the list")  # of the buttons of a job
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
        how, headers = "inline" if shown else "attachment", {"content-security-policy": "sandbox"}
        respond = fastapi.responses.FileResponse
        return respond(path, filename=path.name, content_disposition_type=how, headers=headers)


class RunPage:
    """The page of one tab."""

    def __init__(self, tab: BrowserTab) -> None:
        self.tab, self.jobs, self.folder = tab, tab.workspace.jobs, tab.workspace.folder
        self._rows: dict[Job, tuple[Any, ...]] = {}
        self._was_active, self._is_listing, self._awaited, self._ticks = (
            True,
            False,
            tab.selection.get("recording", ""),
            0,
        )
        self._speed: RunSpeed | None = None
        self._speed_of: Assessment | None = None
        self._is_measuring = False
        splitter = draw_splitter("jobs", 432, (300, 800)).classes("studio-run")
        with splitter.before, ui.column().classes("w-full p-4 gap-4"):
            self._draw_form()
            ui.label("Jobs").classes("text-base font-medium")
            self._list = mark(ui.column().classes("w-full gap-2"), "jobs")
            with self._list:
                self._no_job = ui.label("No job yet.").classes("text-sm studio-empty")
            ui.label("Recordings").classes("text-base font-medium")
            titles = {"name": "Name", "frames": "Frames", "state": "State", "size": "MB"}
            self._table = mark(draw_table(titles, self._open), "recordings")
            self._table.add_slot("no-data", '<div class="text-sm studio-empty">No recording in this folder yet.</div>')
        with splitter.after, ui.column().classes("w-full p-4 min-w-0 gap-2"):
            self._viewer = FrameViewer(self.folder)
            self._draw_actions()
        tab.document_changed.subscribe(self._describe)
        tab.assessed.subscribe(self._describe)
        tab.selected.subscribe(lambda key, _: self._describe() if key == "page" else None)
        tab.frames_proposed.subscribe(self._frames.set_value)
        ui.timer(1.0, self._tick)

    def _draw_form(self) -> None:
        with ui.card().classes("w-full gap-2"):
            titles = {key: KINDS[key].title for key in _FROM_SCENARIO}
            self._kind = ui.select(titles, value="run", label="Job", on_change=self._describe)
            self._output = mark(ui.input("Name of the result").classes("w-full"), "output", "dense")
            self._kind.classes("w-full").props("dense")
            with ui.row(wrap=False).classes("w-full gap-2") as self._options:
                self._frames = ui.input("Frames", placeholder="all; A:B", on_change=self._describe).props("dense")
                self._seed = ui.input("Seed", placeholder="file's").props("dense")
                self._keep = ui.input("Keep", placeholder="photons,…").props("dense")
                self._frames.tooltip("A:B makes frames A to B - 1; empty makes all")
                self._seed.tooltip("random seed of all noise, instead of that of the file")
                self._keep.tooltip("intermediate products to record: photons, waveforms, oversampled, prediction")
            self._note = ui.label().classes("text-sm")
            self._start = draw_button("Start", self._begin, "start", "unelevated")

    def _draw_actions(self) -> None:
        with mark(ui.row().classes("gap-2 items-center"), "actions") as self._actions:
            for kind, suffix in (("sheet", ".png"), ("animate", ".gif"), ("curves", ".png"), ("track", ".png")):
                draw_button(KINDS[kind].title, partial(self._make, kind, f"_{kind}{suffix}"), kind)
            with ui.dropdown_button("Export", auto_close=True).props("outline dense no-caps"):
                for file_format in FORMATS.values():
                    if file_format.suffixes[0] != RECORDINGS[0]:  # the recording itself
                        make = partial(self._make, "export", file_format.suffixes[0])
                        ui.item(f"{file_format.name} ({file_format.suffixes[0]})", on_click=make).tooltip(
                            f"lost: {file_format.loses}"
                        )
            self._no_choice = ui.label("Choose a recording first.").classes("text-sm studio-empty")
        self._enable_actions()

    def _enable_actions(self) -> None:
        """Enable what needs a recording where one is shown; where none is, say that one must be chosen."""
        for element in self._actions.default_slot.children:
            if isinstance(element, ui.button | ui.dropdown_button):
                element.set_enabled(bool(self._viewer.name))
        self._no_choice.set_visibility(not self._viewer.name)

    def _describe(self) -> None:
        """Update the default name, and what a start would do."""
        kind, document = KINDS[self._kind.value], self.tab.document
        stem = Path(document.name or "scenario.toml").stem
        if self._output.value in ("", getattr(self, "_proposed", "")):
            of_kind = "" if self._kind.value in ("run", "dataset", "trade") else f"_{self._kind.value}"
            self._proposed = f"{stem}{of_kind}{kind.makes[0]}"
            self._output.set_value(self._proposed)
        self._options.set_visibility(self._kind.value == "run")
        assessment = self.tab.assessment
        problem = (
            ""
            if assessment is None or self._kind.value in ("trade", "dataset")
            else assessment.problem or assessment.refusal
        )
        if not problem and not document.name:
            problem = "The scenario has no file yet: give it a name by “Save as” on the page Build."
        text = problem or f"{document.title}: {kind.title.lower()}"
        if not problem and self._kind.value == "run" and assessment is not None and assessment.scenario is not None:
            speed = self._speed if self._speed_of is assessment else None
            try:
                text = estimate_run(assessment.scenario, (self._frames.value or "").strip(), speed)
                if self._speed_of is not assessment:
                    asyncio.get_running_loop().create_task(self._measure_speed())
            except RsoLidarError as error:
                text = problem = str(error)
        self._note.set_text(text)
        self._start.set_enabled(not problem)

    async def _measure_speed(self) -> None:
        """Time some frames of the scenario while the page is shown and no job runs, for the estimate of a run."""
        assessment = self.tab.assessment
        is_shown = self.tab.selection.get("page") == "run"
        if (
            not is_shown
            or self._is_measuring
            or self.jobs.is_active
            or assessment is None
            or assessment.scenario is None
        ):
            return
        self._is_measuring, self._speed, self._speed_of = True, None, assessment
        try:
            with tell_errors():
                self._speed = await run.io_bound(RunSpeed.measure, assessment.text, assessment.scenario)
        finally:
            self._is_measuring = False
        self._describe()

    async def _begin(self) -> None:
        """Save the document if the user agrees, and start the job of the form."""
        document, question = self.tab.document, "{} has changes that are not saved; a job runs the file."
        with tell_errors("not started: "):
            if not await run.io_bound(document.is_as_on_disk):
                if not await ask(question.format(document.title), {"save-and-start": "Save and start"}):
                    return
                document.save()
            await self._add(self._read_form())

    def _read_form(self) -> JobRequest:
        """Return the request that the form holds."""
        values = {"frames": self._frames.value, "seed": self._seed.value, "keep": self._keep.value}
        values = {key: (value or "").strip() for key, value in values.items()} if self._kind.value == "run" else {}
        return JobRequest(self._kind.value, self.tab.document.name, self._output.value.strip(), **values)

    async def _make(self, kind: str, ending: str) -> None:
        """Start a job on the recording that is shown."""
        await self._add(JobRequest(kind, self._viewer.name, f"{self._viewer.name.rpartition('.')[0]}{ending}"))

    async def _add(self, request: JobRequest) -> None:
        """Queue a job; where its output exists, or an interrupted run left frames, ask first."""
        with tell_errors():
            output = self.folder.resolve(request.output, KINDS[request.kind].makes)
            has_frames = any(output.parent.glob(f"{glob.escape(output.name)}.tmp-*"))
            has_frames |= request.kind == "dataset" and output.exists()
            if output.exists() or has_frames:
                answers = {"resume": "Resume"} if has_frames else {}
                answers |= {} if request.kind == "dataset" else {"replace": "Replace"}
                state = "has frames of an interrupted run" if has_frames else "exists"
                answer = await ask(f"{request.output}: {state}", answers)
                if answer is None:
                    return
                request = replace(request, resume=answer == "resume", overwrite=answer == "replace")
            self.jobs.add(request)
            self._awaited = request.output if request.kind == "run" else self._awaited
            self._was_active = True
            self._draw_jobs()

    def _draw_jobs(self) -> None:
        """Update the rows of the queue; rows are made and removed only where the list has changed."""
        for job in [job for job in self._rows if job not in self.jobs.jobs]:
            self._rows.pop(job)[0].delete()
        self._no_job.set_visibility(not self.jobs.jobs)
        for job in list(self.jobs.jobs):
            if job not in self._rows:
                with self._list:
                    self._rows[job] = self._draw_row(job)
            _, state, bar, message, stop, resume, remove, result = self._rows[job]
            rate = job.rate_hz if job.is_active else 0.0
            left = f", {rate:.1f}/s, {(job.total - job.done) / rate:,.0f} s left" if rate else ""
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
                actions = {"stop": self.jobs.stop, "play_arrow": self.jobs.resume, "close": self.jobs.remove}
                stop, resume, remove = (
                    draw_icon_button(icon, label, partial(self._do, action, job), label.split()[0].lower(), "size=sm")
                    for (icon, action), label in zip(actions.items(), _JOB_ACTIONS, strict=True)
                )
            bar = ui.linear_progress(0.0, show_value=False).props("instant-feedback aria-label=Progress")
            state = mark(ui.label().classes("text-sm"), "job-state", "role=status")
            message = ui.label().classes("text-sm break-words opacity-80")
            result = ui.link("Open the result", f"/studio/results/{quote(job.request.output)}", new_tab=True)
        return row, state, bar, message, stop, resume, remove, result

    def _do(self, action: Callable[[Job], object], job: Job) -> None:
        self._was_active = True
        with tell_errors():
            action(job)
        self._draw_jobs()

    async def _tick(self) -> None:
        """Update the page once a second while something runs, and once afterwards."""
        self._ticks += 1
        is_idle = not (self._was_active or self.jobs.is_active or self._viewer.is_following)
        if self._is_listing or (is_idle and self._ticks % _IDLE_TICKS):
            return
        self._was_active = self.jobs.is_active or (self._was_active and self._viewer.is_following)
        self._is_listing = True
        try:
            self._draw_jobs()
            rows = await run.io_bound(self.tab.workspace.recordings.tabulate)
            if rows is not None:
                if rows != self._table.rows:
                    self._table.rows = rows
                self._viewer.offer([row["name"] for row in rows])
                begun = [row for row in rows if row["name"] == self._awaited and row["frames"]]
                if begun:  # the run that was started last is shown as soon as it has a frame
                    self._awaited, self._table.selected = "", begun
                    await self._open(begun)
                await self._viewer.refresh()
        finally:
            self._is_listing = False

    async def _open(self, selection: list[dict[str, Any]]) -> None:
        if selection:
            self.tab.select("recording", selection[0]["name"])
            await self._viewer.open(selection[0]["name"])
            self._enable_actions()


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    RunPage(tab)._describe()
