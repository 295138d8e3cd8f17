"""`rso-lidar parameters`: all parameters of a scenario, as a table, CSV, JSON or SysML v2."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Overwrite, ScenarioFile, Settings, TrustCode, TrustFmu
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import ParameterTable, list_parameters
from rso_lidar.scenario import Scenario
from rso_lidar.study import Requirements, write_requirements


def parameters(
    file: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Table (.csv, .json) or SysML v2 text (.sysml); none, printed."),
    ] = None,
    requirements: Annotated[
        Path | None,
        typer.Option(
            "--requirements", metavar="REQS", help="Requirements file (TOML) whose requirements .sysml holds too."
        ),
    ] = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    overwrite: Overwrite = False,
) -> None:
    """List all parameters of a scenario, and figures derived. Each has its unit, meaning, default and source."""
    if output is not None:
        output = check_writable(output, ParameterTable.SUFFIXES, overwrite=overwrite)
    if requirements is not None and (output is None or output.suffix.lower() != ".sysml"):
        raise ScenarioError("--requirements: goes with -o FILE.sysml; `rso-lidar requirements` verifies them")
    table = list_parameters(Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu))
    if output is None:
        echo(table.table())
        return
    more = [] if requirements is None else write_requirements(Requirements.load(requirements), table)
    table.save(output, overwrite=overwrite, more=more)
    echo(
        f"{len(table.parameters)} parameters, {sum(parameter.is_derived for parameter in table.parameters)} of them derived"
    )
    echo(output)
