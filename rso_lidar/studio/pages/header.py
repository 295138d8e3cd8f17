"""The header: the name of the document, the choice of the page, the guide, and light or dark; and the menu of documents."""

from __future__ import annotations

from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.scenario import SHORTEST_EXAMPLE, find_examples
from rso_lidar.studio.document import EditConflictError, list_documents
from rso_lidar.studio.model.file_summary import KINDS, MESHES, MOST_UPLOAD_BYTES, keep_upload
from rso_lidar.studio.pages.choosers import choose_unit
from rso_lidar.studio.pages.elements import (
    ask,
    draw_button,
    draw_icon_button,
    draw_list,
    mark,
    open_dialog,
    read_memory,
    tell_errors,
)
from rso_lidar.studio.pages.guide import Guide
from rso_lidar.studio.state import BrowserTab

_PAGES = ("build", "see", "run")
_SCHEMES = {None: "brightness_auto", True: "dark_mode", False: "light_mode"}


def draw_header(tab: BrowserTab, guide: Guide) -> ui.tabs:
    """Draw the header, and return the choice among the pages; a folder without scenarios starts the guide."""
    ui.label("rso_lidar studio").classes("text-base font-medium whitespace-nowrap")
    with ui.tabs().props("dense no-caps") as chosen:
        for name in _PAGES:
            mark(ui.tab(name, label=name.capitalize()), f"page-{name}")
    tab.page_chosen.subscribe(chosen.set_value)
    ui.space()
    title = mark(ui.label().classes("text-sm truncate"), "title")

    def show_title() -> None:
        title.text = tab.document.title + (" (edited)" if tab.document.is_changed else "")

    show_title()
    tab.document_changed.subscribe(show_title)
    draw_button("Guide", guide.start, "guide-start", "flat color=white")
    dark = ui.dark_mode({"dark": True, "light": False}.get(read_memory("scheme")))

    def change_scheme() -> None:
        dark.value = {None: True, True: False, False: None}[dark.value]
        scheme.props(f"icon={_SCHEMES[dark.value]}")
        kept = {None: "auto", True: "dark", False: "light"}[dark.value]
        ui.context.client.run_javascript(f"remember('scheme', '{kept}')")

    label = "Light, dark, or as the system has it"
    scheme = draw_icon_button(_SCHEMES[dark.value], label, change_scheme, "scheme", "color=white")
    if not list_documents(tab.workspace.folder):
        ui.context.client.on_connect(guide.start)
    return chosen


def draw_menu(tab: BrowserTab) -> None:
    """Draw the menu of documents: new, open, save, upload, undo and redo."""

    def change(action: str) -> None:
        getattr(tab.document, action)()  # of the document that is shown then

    actions = {"New": open_templates, "Open": _open_list, "Save": _save, "Save as": _ask_name, "Upload": _open_upload}
    icons = ("note_add", "folder_open", "save", "save_as", "upload_file")
    bar = ui.row(wrap=False).classes("w-full items-center gap-1 px-2 py-1 studio-menu")
    with bar.props("role=toolbar aria-label=Document"):
        for (label, action), icon in zip(actions.items(), icons, strict=True):
            draw_button(label, partial(action, tab), label.lower().replace(" ", "-"), f"flat icon={icon}")
        ui.space()
        undo = draw_button("Undo", partial(change, "undo"), "undo", "flat icon=undo")
        redo = draw_button("Redo", partial(change, "redo"), "redo", "flat icon=redo")

    def show_history() -> None:
        undo.set_enabled(tab.document.can_undo)
        redo.set_enabled(tab.document.can_redo)

    show_history()
    tab.document_changed.subscribe(show_history)


def open_templates(tab: BrowserTab) -> None:
    """Open the dialog with the examples, which a new scenario begins with."""

    def take(text: str, companions: list[Path]) -> None:
        absent = [
            name for name in (path.name for path in companions) if not (tab.workspace.folder.path / name).exists()
        ]
        tab.show(tab.workspace.new_document(text))
        dialog.close()
        if absent:
            words = f"the example needs {', '.join(absent)}: `rso-lidar new` writes it with its files"
            ui.notify(words, type="warning")

    rows = [
        (example.name, example.summary, partial(take, example.text, example.companions))
        for example in find_examples().values()
    ]
    empty = (
        "empty",
        "The keys that a scenario must have, and a plate 300 m away.",
        partial(take, SHORTEST_EXAMPLE, []),
    )
    with open_dialog("New scenario from an example", "w-[720px]") as dialog:
        draw_list([empty, *rows], "template", "/studio/examples/{}.png")


def _open_list(tab: BrowserTab) -> None:
    """Open the dialog with the scenarios of the folder."""

    def take(name: str) -> None:
        with tell_errors():
            tab.show(tab.workspace.open_document(name))
            dialog.close()

    with open_dialog("Scenarios of the folder") as dialog:
        draw_list(((name, "", partial(take, name)) for name in list_documents(tab.workspace.folder)), "open")


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

    with open_dialog("Save as", "w-[420px]") as dialog:
        name = ui.input("File name", value=tab.document.name or "scenario.toml").classes("w-full")
        mark(name, "file-name", "autofocus dense outlined").on("keydown.enter", save)
        problem = ui.label().classes("text-negative").props("role=alert")
        with ui.row():
            draw_button("Save", save, "save-name", "unelevated")
            replace = draw_button("Replace", partial(save, overwrite=True), "replace-file")
            draw_button("Cancel", dialog.close, look="flat")
        replace.set_visibility(False)


async def _save(tab: BrowserTab) -> None:
    """Save the document; where another program changed the file, ask what to keep."""
    document = tab.document
    if not document.name:
        _ask_name(tab)
        return
    with tell_errors("not saved: "):
        try:
            document.save()  # not in a thread: its listeners draw
            ui.notify(f"saved {document.name}", type="positive")
        except EditConflictError as error:
            answers = {"keep-mine": "Keep mine", "take-disk": "Take the file's", "other": "Save under another name"}
            answer = await ask(str(error), answers)
            if answer == "keep-mine":
                document.save(overwrite=True)
            elif answer == "take-disk":
                document.reload()
            elif answer == "other":
                _ask_name(tab)


async def take_upload(tab: BrowserTab, event: Any) -> None:
    """Keep an uploaded file in the folder after its reader has checked it, or say what is wrong with it."""
    name = PurePosixPath(str(event.file.name).replace("\\", "/")).name
    with tell_errors():
        content = await event.file.read()
        ui.notify(await run.io_bound(keep_upload, tab.workspace.folder, name, content) or name, type="positive")
        if name.endswith(MESHES):
            await choose_unit(tab, "", name)


def _open_upload(tab: BrowserTab) -> None:
    """Open the dialog for uploads into the folder."""
    most = f"at most {MOST_UPLOAD_BYTES >> 20} MB"
    with open_dialog("Upload into the folder") as dialog:
        ui.label(f"Meshes, element sets, tables, scenarios: {', '.join(KINDS)}; {most}.").classes("text-sm")
        ui.upload(
            auto_upload=True, multiple=True, max_file_size=MOST_UPLOAD_BYTES, on_upload=partial(take_upload, tab),
            on_rejected=lambda: ui.notify(f"{most}, and the endings above", type="negative"),
        ).props(f"accept='{','.join(KINDS)}'")  # fmt: skip
        draw_button("Close", dialog.close, look="flat")
