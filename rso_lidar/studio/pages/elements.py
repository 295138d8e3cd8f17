"""Elements that the pages share: buttons, dialogs, lists and messages, each named for tests and the guide."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from nicegui import ui
from nicegui.element import Element

from rso_lidar.errors import RsoLidarError

E = TypeVar("E", bound=Element)
_CHECKBOX = '<q-checkbox v-model="props.selected" dense :aria-label="`Choose ${props.row.name}`" />'


class Slider(ui.slider):
    """A slider that moves in the browser before the server answers, so that no key is lost that is pressed meanwhile."""

    LOOPBACK = False


def mark(element: E, name: str, props: str = "") -> E:
    """Name an element for tests and for the guide, and return it.

    Parameters
    ----------
    name : as the mark of NiceGUI, and as `data-test` on the page
    """
    element.mark(name).props(props)
    element.props["data-test"] = name
    return element


def draw_button(text: str, action: Callable[..., Any], name: str = "", look: str = "outline") -> ui.button:
    """Draw a small button.

    Parameters
    ----------
    name : as for `mark`; empty for none
    """
    button = ui.button(text, on_click=action).props(f"dense no-caps {look}")
    return mark(button, name) if name else button


def draw_icon_button(icon: str, label: str, action: Callable[..., Any], name: str = "", look: str = "") -> ui.button:
    """Draw a button that shows an icon and names itself to screen readers.

    Parameters
    ----------
    name : as for `draw_button`
    """
    button = draw_button("", action, name or label, f"flat round {look}").tooltip(label)
    button.props["icon"], button.props["aria-label"] = icon, label
    return button


def draw_table(columns: Mapping[str, str], choose: Callable[[list[dict[str, Any]]], Any]) -> ui.table:
    """Draw a table without rows yet, of which a click anywhere on a row, or its box, chooses the row.

    Parameters
    ----------
    columns : titles by their keys, of which one is `name`
    choose : called with the chosen row in a list, which is empty where none is left
    """

    def take_click(event: Any) -> Any:
        table.selected = [row for row in table.rows if row["name"] == event.args]
        return choose(table.selected)

    table = ui.table(
        columns=[{"name": k, "field": k, "label": v, "align": "left", "sortable": True} for k, v in columns.items()],
        rows=[], row_key="name", selection="single", on_select=lambda event: choose(event.selection),
    ).classes("w-full studio-choice").props("dense flat hide-selected-banner")  # fmt: skip
    table.on("row-click", take_click, js_handler="(event, row) => emit(row.name)")
    table.add_slot("body-selection", _CHECKBOX)
    return table


def draw_list(rows: Iterable[tuple[str, str, Callable[[], Any]]], kind: str, picture: str = "") -> None:
    """Draw a list of things to choose from, with a picture at an address that holds the name, if one is given."""
    with ui.list().props("separator dense").classes("w-full"):
        for name, caption, action in rows:
            with mark(ui.item(on_click=action), f"{kind}-{name}"):
                if picture:
                    with ui.item_section().props("avatar"):
                        image = ui.image(picture.format(name)).classes("studio-thumbnail")
                        image.props(f'alt="Target of {name}" loading=lazy ratio=1 no-spinner fit=contain')
                with ui.item_section():
                    ui.item_label(name)
                    if caption:
                        ui.item_label(caption).props("caption")


def read_memory(key: str) -> str:
    """Return what the browser remembers under a key; `remember` of memory.js writes it."""
    request = ui.context.client.request
    return str(request.cookies.get(f"studio_{key}", "")) if request else ""


def draw_splitter(key: str, usual: int, limits: tuple[int, int], unit: str = "px") -> ui.splitter:
    """Draw two panels with a border that can be moved; the browser remembers the width of the first.

    Parameters
    ----------
    usual, limits : width of the first panel, and its least and greatest width [unit]
    unit : "px" or "%"
    """
    kept = read_memory(f"{key}_width")
    width = int(kept) if kept.isdecimal() and len(kept) < 5 and limits[0] <= int(kept) <= limits[1] else usual
    splitter = (
        ui.splitter(value=width, limits=limits).classes("w-full").props(f"unit={unit} separator-class=studio-border")
    )
    splitter.on("update:model-value", js_handler=f"(width) => remember('{key}_width', Math.round(width))")
    return splitter


def draw_skeleton(classes: str) -> ui.skeleton:
    """Draw the grey outline of a figure that is still being made."""
    return ui.skeleton("rect").classes(f"w-full {classes}").props("aria-hidden=true")


@contextmanager
def open_dialog(title: str, width: str = "w-[520px]") -> Iterator[ui.dialog]:
    """Open a dialog, and yield it while it is filled; it is deleted when it closes."""
    dialog = ui.dialog()
    dialog.on("hide", dialog.delete)
    dialog.props["aria-label"] = title
    with dialog, ui.card().classes(f"{width} max-w-full"):
        ui.label(title).classes("text-lg font-medium")
        yield dialog
    dialog.open()


def ask(question: str, answers: Mapping[str, str]) -> Awaitable[str | None]:
    """Ask a question, and return the name of the answer, or None where the user cancels."""
    with ui.dialog().props('aria-label="Question"') as dialog, ui.card():
        ui.label(question)
        with ui.row():
            for name, text in answers.items():
                draw_button(text, partial(dialog.submit, name), name)
            draw_button("Cancel", partial(dialog.submit, None), look="flat")
    return dialog


@contextmanager
def tell_errors(start: str = "") -> Iterator[None]:
    """Show an error of what is done in this context as a message, which begins with `start`, and continue after it."""
    try:
        yield
    except (RsoLidarError, OSError) as error:
        ui.notify(f"{start}{error}", type="negative", multi_line=True)
