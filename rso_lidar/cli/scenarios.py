"""Scenario files that commands take, and fields of theirs set anew."""

from pathlib import Path
from typing import Annotated

import typer

Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="PLACE=VALUE", help="Set a field, as lidar.laser.energy_mj=20.")
]
ScenarioFile = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]
