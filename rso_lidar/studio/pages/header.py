"""The header: name of the document, its menu, the choice of the page, and light or dark."""

from __future__ import annotations

from nicegui import ui

from rso_lidar.studio.state import BrowserTab


def draw_header(tab: BrowserTab) -> ui.tabs:
    """Draw the header, and return the choice among the pages."""
    ui.label("rso_lidar studio").classes("text-lg font-medium")
    with ui.tabs() as chosen:
        for name in ("build", "see", "run"):
            ui.tab(name, label=name.capitalize())
    tab.page_chosen.subscribe(chosen.set_value)
    ui.space()
    return chosen
