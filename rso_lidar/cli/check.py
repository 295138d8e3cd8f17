"""`rso-lidar check`: whether a scenario is sound, and what it means."""

import typer

from rso_lidar.cli.scenarios import ScenarioFile, Settings
from rso_lidar.scenario import Scenario


def check(file: ScenarioFile, settings: Settings = None) -> None:
    """Validate a scenario and print orbit, geometry, optics, link budget and warnings."""
    scenario = Scenario.load(file, tuple(settings or ()))
    typer.echo(scenario.describe())
