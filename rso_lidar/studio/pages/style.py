"""Style of the pages: colours, widths and focus rings, for light and dark."""

from __future__ import annotations

from nicegui import ui

_CSS = """
.studio-header { background: #14304f; }
body.body--dark .studio-header { background: #0c1c2e; }
.studio-pages { background: transparent; }
.studio-pages .q-panel { padding: 0; }
:focus-visible { outline: 2px solid #2f81f7; outline-offset: 2px; }
.q-field__hint, .q-field__messages { opacity: 1; }
"""


def add_style() -> None:
    """Add the style to the page of this client."""
    ui.colors(primary="#1f6feb", secondary="#4b7a9f", accent="#b35900", positive="#1a7f37", negative="#c62828")
    ui.add_css(_CSS)
