"""Options of a live view, which `run` and `serve` share."""

from functools import partial
from typing import Annotated

import typer

from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.loop import LiveView, QueuedView, RerunView
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
LiveOrigin = Annotated[
    list[str] | None,
    typer.Option(
        "--live-origin",
        metavar="ORIGIN",
        help="Let web pages of this origin watch, too, such as http://localhost:8080; several times for several.",
    ),
]


def open_live_view(
    scenario: Scenario, live: bool, address: str | None, viewer: str | None, origins: list[str] | None
) -> QueuedView | None:
    """Open a live view where one is asked for, and print where it is."""
    if not live and address is None and viewer is None and not origins:
        return None
    if viewer not in (None, "foxglove", "rerun"):
        raise ScenarioError(f"--live-with {viewer:.40}: no such viewer (known: foxglove, rerun)")
    if viewer == "rerun" and origins:
        raise ScenarioError("--live-origin: does not apply to rerun; leave it out, or show frames with foxglove")
    place = () if address is None else (address,)
    view: QueuedView
    if viewer == "rerun":
        view = RerunView(scenario, *place)
    else:
        view = LiveView(scenario, *place, origins=origins or (), log=partial(echo, err=True))
    how = f"rerun {view.url}" if viewer == "rerun" else "in Lichtblick or Foxglove: a connection, Foxglove WebSocket"
    echo(f"live view   {view.url} ({how})", err=True)
    return view


def report_live_view(view: QueuedView | None) -> None:
    """Print how many frames a live view has shown, if there is one."""
    if view is not None:
        echo(f"live view   {view.shown:,} frames shown, {view.dropped:,} dropped")
