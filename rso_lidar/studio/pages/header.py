"""The header: the name of the document, the choice of the page, the guide, and light or dark; and the menu of documents."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import events, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.scenario.examples import SHORTEST, find_companions, find_examples, summarize_example
from rso_lidar.studio.documents.document import EditConflictError, list_documents
from rso_lidar.studio.pages.guide import Guide
from rso_lidar.studio.state import BrowserTab

_PAGES = ("build", "see", "run")
_SCHEMES = {None: "brightness_auto", True: "dark_mode", False: "light_mode"}


def draw_header(tab: BrowserTab, guide: Guide) -> ui.tabs:
    """Draw the header, and return the choice among the pages; a folder without scenarios starts the guide."""
    ui.label("rso_lidar studio").classes("text-base font-medium whitespace-nowrap")
    with ui.tabs().props("dense no-caps") as chosen:
        for name in _PAGES:
            ui.tab(name, label=name.capitalize()).props(f'data-test="page-{name}"').mark(f"page-{name}")
    tab.page_chosen.subscribe(chosen.set_value)
    ui.space()
    title = ui.label().classes("text-sm truncate").mark("title").props('data-test="title"')

    def show_title() -> None:
        title.text = tab.document.title + (" (edited)" if tab.document.is_changed else "")

    show_title()
    tab.document_changed.subscribe(show_title)
    ui.button("Guide", on_click=guide.start).props('flat dense no-caps color=white data-test="guide-start"').mark(
        "guide-start"
    )
    dark = ui.dark_mode(None)
    scheme = ui.button(icon=_SCHEMES[None]).props('flat dense round color=white aria-label="Light or dark"')

    def change_scheme() -> None:
        dark.value = {None: True, True: False, False: None}[dark.value]
        scheme.props(f"icon={_SCHEMES[dark.value]}")

    scheme.on_click(change_scheme).tooltip("Light, dark, or as the system has it")
    if not list_documents(tab.workspace.folder):
        ui.context.client.on_connect(guide.start)
    return chosen


def draw_menu(tab: BrowserTab, save: Callable[[Callable[[], Any]], Any], upload: Callable[[], None]) -> None:
    """Draw the menu of documents: new, open, save, undo and redo.

    Parameters
    ----------
    tab : whose document it changes.
    save : saves the document, and calls what it is given where a name is missing.
    upload : opens the dialog for uploads.
    """

    async def save_now() -> None:
        await save(lambda: _ask_name(tab))

    with (
        ui.row(wrap=False)
        .classes("w-full items-center gap-1 px-2 py-1 studio-menu")
        .props("role=toolbar aria-label=Document")
    ):
        for label, icon, deed in (
            ("New", "note_add", lambda: _open_templates(tab)),
            ("Open", "folder_open", lambda: _open_list(tab)),
            ("Save", "save", save_now),
            ("Save as", "save_as", lambda: _ask_name(tab)),
            ("Upload", "upload_file", upload),
        ):
            name = label.lower().replace(" ", "-")
            ui.button(label, icon=icon, on_click=deed).props(f'flat dense no-caps data-test="{name}"').mark(name)
        ui.space()
        undo = ui.button("Undo", icon="undo", on_click=tab.document.undo)
        redo = ui.button("Redo", icon="redo", on_click=tab.document.redo)
        for button, name in ((undo, "undo"), (redo, "redo")):
            button.props(f'flat dense no-caps data-test="{name}"').mark(name)

    def show_history() -> None:
        undo.set_enabled(tab.document.can_undo)
        redo.set_enabled(tab.document.can_redo)

    def press(event: events.KeyEventArguments) -> None:
        if event.action.keydown and event.modifiers.ctrl and not event.action.repeat:
            if event.key == "z" and not event.modifiers.shift:
                tab.document.undo()
            elif event.key == "y" or (event.key in ("z", "Z") and event.modifiers.shift):
                tab.document.redo()

    show_history()
    tab.document_changed.subscribe(show_history)
    ui.keyboard(on_key=press)  # not while a text is typed, which has an undo of its own; the script below saves
    ui.add_head_html(
        "<script>addEventListener('keydown', e => {"
        " if (e.ctrlKey && e.key === 's') { e.preventDefault(); document.querySelector('[data-test=save]')?.click(); } });"
        "</script>"
    )


def _open_templates(tab: BrowserTab) -> None:
    """Open the dialog with the examples, which a new scenario begins with."""
    with ui.dialog() as dialog, ui.card().classes("w-[720px] max-w-full"):
        ui.label("New scenario from an example").classes("text-lg font-medium")
        with ui.list().props("separator dense").classes("w-full"):
            for name, path in find_examples().items():
                text = path.read_text(encoding="utf-8")
                item = ui.item(on_click=lambda text=text, path=path: _take(tab, text, path, dialog))
                with item.props(f'data-test="template-{name}"').mark(f"template-{name}"), ui.item_section():
                    ui.item_label(name)
                    ui.item_label(summarize_example(text)).props("caption")
            with ui.item(on_click=lambda: _take(tab, SHORTEST, None, dialog)), ui.item_section():
                ui.item_label("shortest")
                ui.item_label("The keys that a scenario must have, and a plate 300 m away.").props("caption")
    dialog.open()


def _take(tab: BrowserTab, text: str, path: Any, dialog: ui.dialog) -> None:
    """Show an example, or an empty text, as a new document.

    Parameters
    ----------
    tab : that shows it.
    text, path : of the example; None for no example.
    dialog : which is closed.
    """
    needed = [one.name for one in find_companions(text, path.parent)] if path else []
    absent = [name for name in needed if not (tab.workspace.folder.path / name).exists()]
    tab.show(tab.workspace.new_document(text))
    dialog.close()
    if absent:
        ui.notify(f"the example needs {', '.join(absent)}: `rso-lidar new` writes it with its files", type="warning")


def _open_list(tab: BrowserTab) -> None:
    """Open the dialog with the scenarios of the folder."""

    def take(name: str) -> None:
        try:
            tab.show(tab.workspace.open_document(name))
            dialog.close()
        except (RsoLidarError, OSError) as error:
            ui.notify(str(error), type="negative", multi_line=True)

    with ui.dialog() as dialog, ui.card().classes("w-[520px]"):
        ui.label("Scenarios of the folder").classes("text-lg font-medium")
        with ui.list().props("separator dense").classes("w-full"):
            for name in list_documents(tab.workspace.folder):
                with ui.item(on_click=lambda name=name: take(name)).mark(f"open-{name}"), ui.item_section():
                    ui.item_label(name)
    dialog.open()


def _ask_name(tab: BrowserTab) -> None:
    """Ask for the name of the file, and save under it."""

    def save(*, overwrite: bool = False) -> None:
        try:
            tab.workspace.save_as(tab.document, (name.value or "").strip(), overwrite=overwrite)
        except EditConflictError as error:
            problem.text = f"{error}; press Replace to write over it"
            replace.set_visibility(True)
        except (RsoLidarError, OSError) as error:
            problem.text = str(error)
        else:
            dialog.close()
            ui.notify(f"saved {tab.document.name}", type="positive")

    with ui.dialog() as dialog, ui.card().classes("w-[420px]"):
        name = ui.input("File name", value=tab.document.name or "scenario.toml").props(
            'autofocus dense outlined data-test="file-name"'
        ).classes("w-full").mark("file-name").on("keydown.enter", save)  # fmt: skip
        problem = ui.label().classes("text-negative").props("role=alert")
        with ui.row():
            ui.button("Save", on_click=save).props('data-test="save-name"').mark("save-name")
            replace = ui.button("Replace", on_click=lambda: save(overwrite=True)).props("outline").mark("replace-file")
            ui.button("Cancel", on_click=dialog.close).props("flat")
        replace.set_visibility(False)
    dialog.open()
