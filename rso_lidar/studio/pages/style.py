"""Style of the pages: colours, widths and focus rings, for light and dark."""

from __future__ import annotations

from nicegui import ui

_CSS = """
.studio-header { background: #14304f; padding: 0 16px; min-height: 48px; align-items: center; gap: 16px; }
body.body--dark .studio-header { background: #0c1c2e; }
.nicegui-content { padding: 0; }
.studio-pages { background: transparent; }
.studio-build-page { padding: 0; gap: 0; }
.studio-see-page { padding: 8px 12px; gap: 10px; overflow: hidden; }
.studio-run-page { padding: 0; }
.studio-menu { border-bottom: 1px solid #8884; }
.studio-build { height: calc(100vh - 92px); }
.studio-column { height: 100%; overflow: auto; border-right: 1px solid #8884; }
.studio-tables { width: 200px; flex: none; padding: 4px 0; }
.studio-tables .q-btn { border-radius: 0; }
.studio-chosen { background: #1f6feb22; font-weight: 600; }
.studio-absent { color: #5f636b !important; font-style: italic; }
body.body--dark .text-positive { color: #3fb950 !important; }
body.body--dark .text-negative { color: #ff7b72 !important; }
body.body--dark .studio-absent { color: #aeb3bc !important; }
.studio-form { width: 440px; flex: none; padding: 12px; }
.studio-text { flex: 1 1 0; min-width: 0; border-right: none; overflow: hidden; flex-wrap: nowrap; }
.studio-editor { min-height: 0; overflow: hidden; }
.studio-check { border-top: 1px solid #8884; max-height: 45%; overflow: auto; flex: none; }
.studio-description { white-space: pre-wrap; font-family: monospace; font-size: 12px; }
.studio-table { border: 1px solid #8884; border-radius: 4px; }
.studio-gallery { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: 8px; width: 100%; }
.studio-guide { position: fixed; right: 24px; bottom: 24px; width: 360px; z-index: 3000; border: 2px solid #1f6feb; }
.studio-pointed { outline: 3px solid #f0883e; outline-offset: -3px; }
.studio-bad-line { background: #e5393533; }
:focus-visible { outline: 2px solid #2f81f7; outline-offset: 2px; }
"""


def add_style() -> None:
    """Add the style to the page of this client."""
    ui.colors(primary="#1f6feb", secondary="#4b7a9f", accent="#b35900", positive="#1a7f37", negative="#c62828")
    ui.add_css(_CSS)
