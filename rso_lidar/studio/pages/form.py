"""The form of one table: an input for each field, and inner tables that open below it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from nicegui import ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.part import Part
from rso_lidar.studio.model import form_fields
from rso_lidar.studio.model.form_fields import FieldForm
from rso_lidar.studio.model.problem_place import is_at
from rso_lidar.studio.pages.choosers import find_chooser
from rso_lidar.studio.pages.elements import draw_button, mark, tell_errors
from rso_lidar.studio.state import BrowserTab

_DEEPEST = 5  # levels of inner tables in one form; deeper ones are edited in the text


class TableForm:
    """The form of the table at one place of the document."""

    def __init__(
        self,
        tab: BrowserTab,
        cls: type[Part],
        place: str,
        skip: Callable[[str], bool],
        reveal: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Draw the form.

        Parameters
        ----------
        skip : whether the inner table at a place has a form of its own elsewhere
        reveal : called with the place of a field that takes the focus
        """
        self._tab, self._skip, self._reveal = tab, skip, reveal
        self._inputs: dict[str, tuple[FieldForm, Any]] = {}
        self._shown: dict[str, Any] = {}  # values of the document as they were shown last
        self._draw(cls, place, 0)
        self.update()

    def update(self) -> None:
        """Show the values of the document that have changed, and of what is left empty those in force.

        Another field keeps what is being typed in it, although an edit or an assessment comes meanwhile.
        """
        document, assessment = self._tab.document, self._tab.assessment
        scenario = assessment.scenario if assessment and assessment.text == document.text else None
        for place, (field, widget) in self._inputs.items():
            value = document.get(place)
            is_choice = isinstance(widget, ui.select)
            shown = (None if value is None else str(value)) if is_choice else form_fields.show_value(value)
            if isinstance(value, bool):
                shown = str(value).lower()
            is_new = shown != self._shown.get(place, widget.value)
            self._shown[place] = shown
            if is_new and widget.value != shown and not (widget.value in ("", None) and shown in ("", None)):
                widget.value = shown
            in_force = field.show_default(scenario, place) if value is None else ""
            wrong = (
                assessment.problem
                if assessment and assessment.text == document.text and is_at(assessment.place, place)
                else None
            )
            if widget.error != wrong and (wrong or widget.value == shown):
                widget.error = wrong
            if is_choice:
                options = dict(widget.options) | {None: field.name_default(in_force)} if in_force else widget.options
                if options != widget.options:
                    widget.set_options(options, value=widget.value)
            elif widget.props.get("placeholder") != in_force[:80]:
                widget.props["placeholder"] = in_force[:80]
                widget.update()

    def focus(self, place: str) -> bool:
        """Move the focus to a field, if the form has it."""
        field_place = next((name for name in self._inputs if is_at(place, name) or name.startswith(f"{place}.")), None)
        if field_place is None:
            return False
        self._inputs[field_place][1].run_method("focus")
        return True

    def _draw(self, cls: type[Part], place: str, depth: int) -> None:
        for field in form_fields.list_fields(cls):
            here = f"{place}.{field.key}".lstrip(".")
            if field.kind in form_fields.SCALARS:
                self._draw_field(cls, field, here)
            elif not self._skip(here):
                self._draw_table(field, here, depth)

    def _draw_field(self, cls: type[Part], field: FieldForm, place: str) -> None:
        label = f"{field.key} [{field.unit}]" if field.unit else field.key
        words = " ".join(filter(None, (field.meaning, f"({field.bounds})" if field.bounds else "")))
        with ui.column().classes("w-full gap-0 studio-field"):
            with ui.row(wrap=False).classes("w-full items-center gap-1"):
                widget: Any
                if field.kind in ("choice", "flag"):
                    left = field.name_default(field.default)
                    names = ("true", "false") if field.kind == "flag" else tuple(field.choices)
                    widget = ui.select({None: left, **dict(zip(names, names, strict=True))}, label=label)
                    widget.on_value_change(partial(self._commit, field, place, widget))
                else:
                    widget = ui.input(label).on("change", lambda: self._commit(field, place, widget))
                    widget.props('autocomplete="off" spellcheck="false" stack-label')
                mark(widget.classes("grow"), f"field-{place}", "dense outlined")
                widget.props["aria-description"] = words
                widget.on("focus", partial(self._reveal, place))
                if field.required:
                    widget.props("aria-required=true")
                if chooser := find_chooser(cls, field.key):
                    table = place.rpartition(".")[0]
                    draw_button(chooser.title, partial(chooser.open, self._tab, table), f"choose-{place}")
            ui.label(words + (" Required." if field.required else "")).classes("text-xs opacity-80 ml-1")
            self._inputs[place] = (field, widget)

    def _commit(self, field: FieldForm, place: str, widget: Any, *_: Any) -> None:
        """Put what the user typed into the document; an empty field takes its default."""
        document, typed = self._tab.document, widget.value
        text = typed.strip() if isinstance(typed, str) else typed
        try:
            value = None if text in (None, "") else form_fields.parse_value(field.kind, text)
            if value == document.get(place) and type(value) is type(document.get(place)):
                return
            document.remove(place) if value is None else document.set(place, value)
        except RsoLidarError as error:
            if isinstance(widget, ui.input):
                widget.error = str(error)
            else:
                ui.notify(str(error), type="negative", multi_line=True)

    def _draw_table(self, field: FieldForm, place: str, depth: int) -> None:
        """Draw an inner table: closed where it is not set, with its type to choose where there are several."""
        value = self._tab.document.get(place)
        head = field.key + (f": {value['type']}" if isinstance(value, Mapping) and "type" in value else "")
        state = "" if value is not None else " (required)" if field.required else " (default)"
        with ui.expansion(f"{head}{state}", value=value is not None and depth < 2).classes("w-full studio-table"):
            ui.label(field.meaning).classes("text-xs opacity-80")
            if depth >= _DEEPEST:
                ui.label("Edit this table in the text.").classes("text-sm")
            elif field.kind == "entries":
                self._draw_entries(field, place, value, depth)
            else:
                self._draw_variant(field, place, value, depth)

    def _draw_variant(self, field: FieldForm, place: str, value: Any, depth: int) -> None:
        """Draw a table with the choice of its type, and what it holds."""
        chosen = field.choose(value)
        with ui.row(wrap=False).classes("w-full items-center gap-1"):
            if field.kind == "variant":
                draw_type(self._tab, field, place, value)
            elif value is None:
                draw_button("Set", partial(change_document, self._tab, "set", place, {}))
            if chooser := next((candidate for cls in field.classes if (candidate := find_chooser(cls, ""))), None):
                draw_button(chooser.title, partial(chooser.open, self._tab, place))
            if value is not None and not field.required:
                draw_button("Remove", partial(change_document, self._tab, "remove", place), look="flat")
        if isinstance(value, str):
            ui.label(f"“{value}” of the catalogue").classes("text-sm")
        elif value is not None and chosen is not None:
            self._draw(chosen, place, depth + 1)

    def _draw_entries(self, field: FieldForm, place: str, value: Any, depth: int) -> None:
        """Draw a list of tables, or the name that stands for one."""
        chooser = next((candidate for cls in field.classes if (candidate := find_chooser(cls, ""))), None)
        with ui.row(wrap=False).classes("w-full items-center gap-1"):
            if isinstance(value, str):
                ui.label(f"“{value}”, by name").classes("text-sm")
            if chooser is not None:
                draw_button(chooser.title, partial(chooser.open, self._tab, place), f"choose-{place}")
            if isinstance(value, str):
                draw_button("Remove", partial(change_document, self._tab, "remove", place), look="flat")
        for number, entry in enumerate(value if isinstance(value, list) else []):
            chosen, here = field.choose(entry), f"{place}[{number}]"
            with ui.row().classes("items-center"):
                ui.label(f"{field.key} {number + 1}").classes("font-medium")
                draw_button("Remove", partial(change_document, self._tab, "remove", here), look="flat")
            if chosen is not None:
                self._draw(chosen, here, depth + 1)
        draw_add(self._tab, field, place)


def draw_type(tab: BrowserTab, field: FieldForm, place: str, value: Any) -> None:
    """Draw the choice of the type of a table, which replaces the table."""
    names = {name: f"{name}: {what}"[:90] for name, what in field.choices.items()}
    tag = value.get("type", field.usual) if isinstance(value, Mapping) else None
    select = ui.select(names, value=tag if tag in names else None, label="type", with_input=True).classes("grow")
    mark(select, f"type-{place}", "dense outlined").on_value_change(
        lambda event: change_document(tab, "set", place, {"type": event.value}) if event.value else None
    )


def draw_add(tab: BrowserTab, field: FieldForm, place: str) -> None:
    """Draw the button that adds an entry to a list of tables, with the choice of its type where there are several."""
    if len(field.classes) == 1:
        draw_button(f"Add {field.key}", partial(_add_entry, tab, field, place, field.classes[0]), f"add-{place}")
        return
    with mark(ui.dropdown_button(f"Add {field.key}", auto_close=True), f"add-{place}", "outline dense no-caps"):
        for cls in field.classes:
            ui.item(str(cls.model_fields["type"].default), on_click=partial(_add_entry, tab, field, place, cls))


def _add_entry(tab: BrowserTab, field: FieldForm, place: str, cls: type[Part]) -> None:
    """Add an entry with a free name, and its type where it has one; the check says what else it needs."""
    change_document(tab, "add_entry", place, form_fields.make_entry(cls, field.key, tab.document.get(place) or []))


def change_document(tab: BrowserTab, action: str, place: str, *value: Any) -> None:
    """Change the document of a tab, or say why that is not possible.

    Parameters
    ----------
    action : name of a method of `Document`
    """
    with tell_errors():
        getattr(tab.document, action)(place, *value)
