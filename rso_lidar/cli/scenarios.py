"""Scenario files as arguments of commands, and options that change their fields."""

from pathlib import Path
from typing import Annotated

import typer

Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="PLACE=VALUE", help="Set a field, as lidar.laser.energy_mj=20.")
]
ScenarioFile = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
