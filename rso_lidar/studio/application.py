"""The application of the studio: its one page, with a header and the three pages Build, See and Run under it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fastapi
from nicegui import ui

from rso_lidar.studio.access import AccessControl
from rso_lidar.studio.pages import build_page, choosers, run_page, see_page
from rso_lidar.studio.pages.guide import Guide
from rso_lidar.studio.pages.header import draw_header
from rso_lidar.studio.state import BrowserTab, Workspace

_RECONNECT_S = 300.0  # for which a page waits for its server: a large file keeps it busy, and laptops sleep
_BESIDE = Path(__file__).parent / "pages"  # style and scripts
_PAGES = {"build": build_page.draw, "see": see_page.draw, "run": run_page.draw}


def build_application(workspace: Workspace, *, token: str, hosts: frozenset[str] | None, port: int) -> AccessControl:
    """Build the ASGI application of the studio.

    Parameters
    ----------
    token, hosts, port : as in `AccessControl`
    """
    outer = fastapi.FastAPI(openapi_url=None)
    choosers.add_routes(outer)
    see_page.add_routes(outer, workspace)
    run_page.add_routes(outer, workspace)
    ui.run_with(
        outer, root=make_root(workspace), title="rso_lidar studio", dark=None, language="en-US",
        show_welcome_message=False, reconnect_timeout=_RECONNECT_S,
    )  # fmt: skip
    return AccessControl(outer, token=token, hosts=hosts, port=port)


def make_root(workspace: Workspace) -> Callable[[], Any]:
    """Return the function that draws the page for one tab of the browser."""

    def root() -> None:
        ui.colors(primary="#1f6feb", secondary="#4b7a9f", accent="#b35900", positive="#1a7f37", negative="#c62828")
        ui.add_css(_BESIDE / "style.css")
        for name in ("memory.js", "names.js", "shortcuts.js"):
            ui.add_head_html(f"<script>{(_BESIDE / name).read_text(encoding='utf-8')}</script>")
        client = ui.context.client
        selection = dict(client.request.query_params)
        tab = BrowserTab(workspace, workspace.first_document(selection.get("file", "")), selection)
        guide = Guide(tab)
        with ui.header().classes("studio-header"):
            chosen = draw_header(tab, guide)
        first = selection.get("page") if selection.get("page") in _PAGES else "build"
        with ui.tab_panels(chosen, value=first, keep_alive=True).classes("w-full studio-pages"):
            for name, draw in _PAGES.items():
                with ui.tab_panel(name).classes(f"studio-{name}-page"):
                    draw(tab)
        chosen.on_value_change(lambda event: tab.select("page", str(event.value)))
        show = "show_document_in_address({})"
        tab.document_changed.subscribe(lambda: client.run_javascript(show.format(json.dumps(tab.document.address))))
        keep = "show_in_address({}, {})"
        tab.selected.subscribe(lambda key, value: client.run_javascript(keep.format(*map(json.dumps, (key, value)))))
        client.on_connect(tab.open)
        client.on_delete(tab.close)

    return root
