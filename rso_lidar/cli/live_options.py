"""Options of a live view, which `run` and `serve` share."""

from typing import Annotated

import typer

from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.loop.live.live_view import LiveView
from rso_lidar.loop.live.queued_view import QueuedView
from rso_lidar.loop.live.rerun_view import RerunView
from rso_lidar.scenario import Scenario

Live = Annotated[
    bool, typer.Option("--live", help="Show frames live to viewers of the Foxglove protocol on this machine.")
]
LiveAt = Annotated[
    str | None, typer.Option("--live-at", metavar="HOST:PORT", help="Address of the live view (127.0.0.1:8765).")
]
LiveWith = Annotated[
    str | None, typer.Option("--live-with", metavar="VIEWER", help="Viewer of the live view: foxglove or rerun.")
]


def open_live_view(scenario: Scenario, live: bool, address: str | None, viewer: str | None) -> QueuedView | None:
    """Open a live view where one is asked for, and print where it is.

    Parameters
    ----------
    scenario : that is shown.
    live, address, viewer : the options; any of them asks for a view.
    """
    if not live and address is None and viewer is None:
        return None
    if viewer not in (None, "foxglove", "rerun"):
        raise ScenarioError(f"--live-with {viewer:.40}: no such viewer (known: foxglove, rerun)")
    made = RerunView if viewer == "rerun" else LiveView
    view = made(scenario) if address is None else made(scenario, address)
    how = f"rerun {view.url}" if viewer == "rerun" else "in Lichtblick or Foxglove: a connection, Foxglove WebSocket"
    echo(f"live view   {view.url} ({how})", err=True)
    return view


def report_live_view(view: QueuedView | None) -> None:
    """Print how many frames a live view has shown, if there is one."""
    if view is not None:
        echo(f"live view   {view.shown:,} frames shown, {view.dropped:,} dropped")
