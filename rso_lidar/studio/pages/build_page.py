"""The page Build."""

from __future__ import annotations

from nicegui import ui

from rso_lidar.studio.state import BrowserTab


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    ui.label("Build")
