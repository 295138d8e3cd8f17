"""`rso-lidar disperse`: a mission flown many times with errors, by runs and by linear covariance."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import (
    Dark,
    Engine,
    Overwrite,
    ScenarioFile,
    Scheduler,
    Seed,
    Settings,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
    choose_scheme,
    join_settings,
)
from rso_lidar.cli.progress import count_steps
from rso_lidar.cli.terminal import echo, to_one_line
from rso_lidar.files import check_writable
from rso_lidar.interruption import set_advice
from rso_lidar.picture import RESULT_SUFFIXES
from rso_lidar.processes import open_executor
from rso_lidar.scenario import Scenario
from rso_lidar.study import disperse as disperse_mission


def disperse(
    file: ScenarioFile,
    runs: Annotated[int, typer.Option("--runs", min=2, max=1_000_000, help="Number of runs.")] = 1000,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture (.png, .pdf, .svg) or table of the runs (.csv); left out, a picture in the working folder.",
        ),
    ] = None,
    tubes: Annotated[Path | None, typer.Option("--tubes", help="Table of the spreads over time (.csv).")] = None,
    target: Annotated[str | None, typer.Option("--target", metavar="NAME", help="Target (the one approached).")] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    seed: Seed = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Fly a mission many times with errors.

    The table [dispersion] of the scenario holds the errors. An interrupted command continues where it stopped.
    """
    output = check_writable(output or Path(f"{file.stem}_disperse.png"), RESULT_SUFFIXES, overwrite=overwrite)
    if tubes is not None:
        tubes = check_writable(tubes, (".csv",), overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    by = choose_scheduler(engine, scheduler)
    scenario = Scenario.load(file, join_settings(settings, seed), trust_code=trust_code, trust_fmu=trust_fmu)
    working = output.with_name(f".{output.stem}.runs")
    set_advice(lambda: to_one_line(f"finished runs are kept beside {output}; the same command goes on"))
    with count_steps("dispersing", "run") as step, open_executor(workers, scheduler=by) as executor:
        dispersed_mission = disperse_mission(
            scenario, runs, target=target, working=working, on_runs=step, executor=executor
        )
    dispersed_mission.save(output, scheme)
    if tubes is not None:
        dispersed_mission.save_tubes(tubes)
    if dispersed_mission.kept is not None:
        dispersed_mission.kept.unlink(missing_ok=True)
    for line in dispersed_mission.describe().splitlines():
        echo(line)
    for place in (output, *([tubes] if tubes is not None else [])):
        echo(f"{place}")
