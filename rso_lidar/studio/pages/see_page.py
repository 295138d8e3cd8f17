"""The page See."""

from __future__ import annotations

import fastapi
from nicegui import ui

from rso_lidar.studio.state import BrowserTab, Workspace


def add_routes(application: fastapi.FastAPI, workspace: Workspace) -> None:
    """Add the binary routes of frames and point clouds."""


def draw(tab: BrowserTab) -> None:
    """Draw the page for one tab of the browser."""
    ui.label("See")
