"""`rso-lidar studio`: a scenario built, seen and flown in a browser."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.terminal import echo
from rso_lidar.loop import parse_address
from rso_lidar.studio import open_studio


def studio(
    folder: Annotated[
        Path, typer.Argument(metavar="[FOLDER]", help="Folder of scenarios and recordings, the only one it uses.")
    ] = Path(),
    at: Annotated[
        str, typer.Option("--at", metavar="HOST:PORT", help="Address to listen at; with port 0 a free one.")
    ] = "127.0.0.1:0",
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Build, see and fly scenarios in a browser. It needs the extra studio, and works without a network."""
    open_studio(folder, parse_address(at, "--at"), opens_browser=browser, tell=echo)
