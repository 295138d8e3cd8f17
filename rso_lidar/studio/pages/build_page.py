"""The page Build: the tables of a scenario, the form of one of them, and the text with the result of its check."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from nicegui import events, run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.scenario import Scenario
from rso_lidar.studio.model.form_fields import FieldForm, find_field, find_part, iterate_tables, list_fields
from rso_lidar.studio.model.problem_place import find_line, split_place
from rso_lidar.studio.model.text_assessment import describe
from rso_lidar.studio.pages.elements import draw_button, draw_splitter, mark
from rso_lidar.studio.pages.form import TableForm, change_document, draw_add, draw_type
from rso_lidar.studio.pages.header import draw_menu, open_templates
from rso_lidar.studio.state import BrowserTab

_NESTED = "lidar"  # its tables have forms of their own, because they are long
_DISK_S = 2.0


class BuildPage:
    """The page of one tab: the document seen as forms and as text."""

    def __init__(self, tab: BrowserTab) -> None:
        self._tab, self._place = tab, tab.selection.get("table", "")
        self._here = ""  # place whose line is marked, because it was chosen in the form
        self._shape: Any = None
        self._form: TableForm | None = None
        self._last_message = ""
        outer = draw_splitter("tables", 200, (120, 400)).classes("studio-build")
        with outer.before:
            tables = ui.column().classes("studio-column studio-tables gap-0")
            with mark(tables, "tables", 'role=navigation aria-label="Tables of the scenario"'):
                self._tables = ui.column().classes("w-full gap-0")
        with outer.after:
            inner = draw_splitter("form", 440, (280, 900)).classes("h-full")
        with inner.before, mark(ui.column().classes("studio-column studio-form gap-2"), "form"):
            self._title = ui.label().classes("text-base font-medium")
            self._fields = ui.column().classes("w-full gap-2")
        with inner.after, ui.column().classes("studio-column studio-text gap-0"):
            text, take = tab.document.text, self._take_text
            editor = ui.codemirror(text, language="TOML", theme="githubLight", on_change=take, line_wrapping=False)
            self._editor = mark(editor.classes("w-full grow studio-editor"), "editor")
            self._editor.props["aria-label"] = "Text of the scenario"
            self._draw_check()
        tab.document_changed.subscribe(self._show_document)
        tab.assessed.subscribe(self._show_check)
        tab.warned.subscribe(self._show_check)
        tab.field_chosen.subscribe(self._go_to)
        ui.timer(_DISK_S, self._watch_disk)
        ui.on("studio_dark", lambda event: self._editor.set_theme("githubDark" if event.args else "githubLight"))

    def _draw_check(self) -> None:
        result = ui.column().classes("w-full gap-1 p-2 studio-check")
        with mark(result, "check", "role=status aria-live=polite"):
            with ui.row(wrap=False).classes("w-full items-center gap-2"):
                self._icon = ui.icon("hourglass_empty")
                self._verdict = mark(ui.label("Checking").classes("grow break-words"), "verdict")
                self._to_field = draw_button("Go to it", self._go_to_problem, "go-to-problem")
                self._more = draw_button("Describe", self._describe, "describe")
            self._warnings = mark(ui.column().classes("w-full gap-1"), "warnings")
            self._description = mark(ui.label().classes("studio-description"), "description")
            self._description.set_visibility(False)

    # ------------------------------------------------------------------------------------------------- the document

    def _take_text(self, event: events.ValueChangeEventArguments) -> None:
        self._tab.document.set_text(str(event.value or ""))

    def _show_document(self) -> None:
        """Show another text: values in place, and the form anew only where tables came, went or changed their type."""
        document = self._tab.document
        self._notify_once(document.notice, "info")
        if self._editor.value != document.text:
            self._editor.value = document.text
        shape = (id(document), document.outline())
        if shape != self._shape:
            self._shape = shape
            self._draw_tables()
            self._draw_form()
        elif self._form:
            self._form.update()

    def _draw_tables(self) -> None:
        self._tables.clear()
        with self._tables:
            for label, place, present in self._iterate_tables():
                name, is_chosen = f"table-{place or 'scenario'}", place == self._place
                item = draw_button(label, partial(self._choose, place), name, "flat align=left")
                item.classes("w-full" + (" studio-chosen" if is_chosen else "") + ("" if present else " studio-absent"))
                if is_chosen:
                    item.props("aria-current=true")
            with ui.column().classes("p-2 gap-1"):
                for field in list_fields(Scenario):
                    if field.kind == "entries":
                        draw_add(self._tab, field, field.key)

    def _iterate_tables(self) -> Iterator[tuple[str, str, bool]]:
        yield "scenario", "", True
        yield from iterate_tables(Scenario, self._tab.document.tables(), _NESTED)

    def _choose(self, place: str) -> None:
        self._place = place
        self._tab.select("table", place)
        self._draw_tables()
        self._draw_form()
        self._reveal(place)

    def _reveal(self, place: str) -> None:
        """Scroll the text to a place, and mark its line."""
        self._here = place
        line = find_line(self._tab.document.text, place) if place else 1
        if line:
            self._editor.reveal_line(line)
        self._mark_lines()

    def _mark_lines(self) -> None:
        """Mark the line that was chosen in the form, and that of the problem."""
        assessment = self._tab.assessment
        problem = assessment.line if assessment else None
        here = find_line(self._tab.document.text, self._here) if self._here else None
        marks = ((here, "studio-here-line"), (problem, "studio-bad-line"))
        lines = [{"kind": "line", "line": line, "class": name} for line, name in marks if line]
        if self._editor.decorations != lines:
            self._editor.decorations = lines

    def _draw_form(self) -> None:
        """Draw the form of the chosen table."""
        own = {place for _, place, _ in self._iterate_tables()}
        if self._place not in own:
            self._place = ""
        document, steps = self._tab.document, split_place(self._place)
        self._title.text = self._place or "scenario"
        self._fields.clear()
        self._form = None
        with self._fields:
            if not document.is_toml:
                ui.label(
                    "The text is not TOML, or too long for forms; correct it at the right; the forms return."
                ).classes("text-negative")
                return
            if not document.text.strip():
                with ui.row().classes("items-center gap-2 studio-empty"):
                    mark(ui.label("An empty scenario. Most begin with an example."), "empty")
                    draw_button("Choose an example", partial(open_templates, self._tab), look="unelevated")
            cls = find_part(Scenario, document.tables(), steps) if steps else Scenario
            field = find_field(Scenario, document.tables(), steps)
            if field is not None:
                ui.label(field.meaning).classes("text-sm opacity-80")
                self._draw_choice(field, steps)
            if cls is not None:
                self._form = TableForm(
                    self._tab, cls, self._place, lambda place: not self._place or place in own, self._reveal
                )

    def _draw_choice(self, field: FieldForm, steps: tuple[str | int, ...]) -> None:
        """Draw the choice of the type of the table, and the buttons that add, copy and remove it."""
        tab, place = self._tab, self._place
        value = tab.document.get(place)
        with ui.row().classes("w-full items-center"):
            if field.kind == "variant":
                draw_type(tab, field, place, value)
            elif value is None:
                draw_button(f"Set {field.key}", partial(change_document, tab, "set", place, {}), f"set-{place}")
            if isinstance(steps[-1], int) and isinstance(value, Mapping):
                draw_button("Copy", partial(self._copy, field.key, dict(value)))
            if value is not None and (isinstance(steps[-1], int) or not field.required):
                draw_button("Remove", partial(change_document, tab, "remove", place), "remove", "flat")

    def _copy(self, key: str, table: dict[str, Any]) -> None:
        if "name" in table:
            table["name"] = f"{table['name']}_copy"
        change_document(self._tab, "add_entry", key, table)

    # ---------------------------------------------------------------------------------------------------- the check

    def _show_check(self) -> None:
        """Show the verdict on the text, and mark its line."""
        assessment = self._tab.assessment
        if assessment is None:
            return
        warnings = self._tab.warnings
        if warnings is None:
            self._description.set_visibility(False)
        self._verdict.text = assessment.tell(warnings)
        look = ("warning", "text-warning") if warnings else ("check_circle", "text-positive")
        if assessment.is_blank or assessment.refusal:
            icon, colour = "info", "opacity-80"
        else:
            icon, colour = look if assessment.is_ready else ("error", "text-negative")
        self._icon.props(f"name={icon}").classes(replace=colour)
        self._warnings.clear()
        with self._warnings:
            for line in warnings or []:
                ui.label(line).classes("text-sm break-words studio-warning")
        self._to_field.set_visibility(bool(assessment.place or assessment.line))
        self._more.set_visibility(assessment.is_ready)
        self._mark_lines()
        if self._form:
            self._form.update()

    async def _describe(self) -> None:
        """Show what `rso-lidar check` prints; it takes some seconds."""
        assessment = self._tab.assessment
        if assessment is None or assessment.scenario is None:
            return
        self._more.props("loading")
        self._description.text = "Describing: some seconds; longer at the first start, which compiles the kernels."
        self._description.set_visibility(True)
        text = await run.io_bound(describe, assessment.scenario)
        self._more.props(remove="loading")
        if text and assessment is self._tab.assessment:
            self._description.text = text

    def _go_to_problem(self) -> None:
        assessment = self._tab.assessment
        if assessment and assessment.line:
            self._editor.reveal_line(assessment.line)
        if assessment and assessment.place:
            self._go_to(assessment.place)

    def _go_to(self, place: str) -> None:
        """Show the form that has the field at a place, and move the focus there."""
        places = (table_place for _, table_place, _ in self._iterate_tables())
        own = max(
            (table_place for table_place in places if f"{place}.".startswith((f"{table_place}.", f"{table_place}["))),
            key=len,
            default="",
        )
        if own != self._place or self._form is None:
            self._choose(own)
        if self._form:
            self._form.focus(place)

    async def _watch_disk(self) -> None:
        """Keep a draft of unsaved edits, and tell of changes that another program made to the file."""
        document = self._tab.document
        try:
            await run.io_bound(document.keep_draft)
            if await run.io_bound(document.changed_on_disk):
                if not document.is_changed:
                    document.reload()
                    ui.notify(f"{document.title}: was changed on disk, and is shown as it is now", type="info")
                else:
                    self._notify_once(
                        f"{document.title}: another program changed the file; Save asks whose text to keep"
                    )
        except (RsoLidarError, OSError) as error:
            self._notify_once(str(error))

    def _notify_once(self, text: str, kind: Any = "warning") -> None:
        """Show a message, but not again while it is the last one."""
        if text and text != self._last_message:
            self._last_message = text
            ui.notify(text, type=kind, multi_line=True, timeout=8000)


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    draw_menu(tab)
    BuildPage(tab)
