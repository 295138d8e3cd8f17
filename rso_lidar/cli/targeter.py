"""`rso-lidar targeter`: impulses and times of a scenario that reach goals within limits."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import (
    Dark,
    Engine,
    Overwrite,
    Scheduler,
    TrustCode,
    Workers,
    choose_scheduler,
    choose_scheme,
    refuse_inputs,
)
from rso_lidar.cli.terminal import echo
from rso_lidar.files import check_writable
from rso_lidar.processes import open_executor
from rso_lidar.study import SolvedPlan, Targeter, solve_targeter


def targeter(
    file: Annotated[Path, typer.Argument(metavar="TARGETER", help="Targeter file (TOML).")],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write: solved scenario (.toml), table (.csv, .json), picture (.png); again for more.",
        ),
    ] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    trust_code: TrustCode = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Find fields at which a flight meets goals and limits.

    The flight has the motion and forces of the scenario. With `minimize`, the plan of least delta-v nearby is found.
    """
    places = [check_writable(place, SolvedPlan.SUFFIXES, overwrite=overwrite) for place in output or ()]
    scheme = choose_scheme(dark, places)
    by = choose_scheduler(engine, scheduler)
    asked = Targeter.load(file)
    refuse_inputs(places, [file, asked.scenario_file()])
    with open_executor(workers, scheduler=by) as executor:
        plan = solve_targeter(asked, executor=executor, trust_code=trust_code)
    for place in places:
        plan.save(place, scheme)
    echo(plan.describe())
    for place in places:
        echo(place)
