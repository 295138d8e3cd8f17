"""`rso-lidar fmu`: the instrument of a scenario as a Functional Mock-up Unit."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Overwrite, ScenarioFile, Settings, TrustCode, TrustFmu
from rso_lidar.cli.terminal import echo
from rso_lidar.loop import write_fmu
from rso_lidar.scenario import Scenario


def fmu(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="FMU to write (.fmu).")],
    version: Annotated[int, typer.Option("--fmi", min=2, max=3, help="Version of FMI.")] = 2,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    overwrite: Overwrite = False,
) -> None:
    """Write the instrument of a scenario as an FMU.

    It runs in the Python of the machine that loads it, which needs rso_lidar.
    """
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    echo(write_fmu(scenario, output, version=version, overwrite=overwrite))
