"""`rso-lidar check`: whether a scenario is sound, and what it means."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.scenario import Scenario

Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="PLACE=VALUE", help="Set a field, as lidar.laser.energy_mj=20.")
]
ScenarioFile = Annotated[Path, typer.Argument(metavar="FILE", help="Scenario file (TOML).")]


def check(file: ScenarioFile, settings: Settings = None) -> None:
    """Validate a scenario and print orbit, geometry, optics, link budget and warnings."""
    scenario = Scenario.load(file, tuple(settings or ()))
    typer.echo(scenario.describe())
