"""`rso-lidar requirements`: a scenario, a study or a recording verified against a file of requirements."""

from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export
from rso_lidar.cli.arguments import (
    Engine,
    Overwrite,
    Scheduler,
    Settings,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
)
from rso_lidar.cli.progress import announce_compiling, count_steps
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable
from rso_lidar.part import parse_toml
from rso_lidar.processes import open_executor
from rso_lidar.scenario import Scenario, read_toml
from rso_lidar.study import Requirements, Study, VerificationMatrix, verify

_OF_STUDY = ("axis", "merits")  # keys that a study has, and no scenario


def requirements(
    file: Annotated[Path, typer.Argument(metavar="REQS", help="Requirements file (TOML).")],
    subject: Annotated[
        Path,
        typer.Argument(
            metavar="SUBJECT", help="Scenario (TOML), study (TOML), or recording (.h5, .nc, .zarr) to verify."
        ),
    ],
    output: Annotated[
        list[Path] | None, typer.Option("-o", "--output", help="Verification matrix (.csv, .json); may be repeated.")
    ] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    overwrite: Overwrite = False,
) -> None:
    """Verify requirements on a scenario, a study or a recording.

    The exit status is 0 if all are met, and 1 if one is not met or not shown.
    """
    places = [check_writable(place, VerificationMatrix.SUFFIXES, overwrite=overwrite) for place in output or ()]
    by = choose_scheduler(engine, scheduler)
    if subject.suffix.lower() != ".toml" and (workers is not None or by is not None):
        option = "--workers" if by is None else "--engine dask"
        raise ScenarioError(f"{option}: is for a scenario or a study; a recording is only read; leave it out")
    asked = Requirements.load(file)
    with open_executor(workers, scheduler=by) as executor:
        matrix = _verify(asked, subject, tuple(settings or ()), executor, trust_code=trust_code, trust_fmu=trust_fmu)
    for place in places:
        matrix.save(place, overwrite=overwrite)
    echo(matrix.table())
    for place in places:
        echo(place)
    if not matrix.is_met:
        raise typer.Exit(1)


def _verify(
    asked: Requirements,
    subject: Path,
    settings: tuple[str, ...],
    executor: Executor | None,
    *,
    trust_code: bool,
    trust_fmu: bool,
) -> VerificationMatrix:
    """Load the subject and verify the requirements on it.

    Parameters
    ----------
    trust_code, trust_fmu : as for `Scenario.load`, of a scenario or a study
    """
    is_toml = subject.suffix.lower() == ".toml"
    is_study = is_toml and any(key in parse_toml(read_toml(subject), subject.name, ScenarioError) for key in _OF_STUDY)
    if settings and (not is_toml or is_study):
        what = "study has its own set" if is_study else "recording cannot be changed"
        raise ScenarioError(f"--set: changes a scenario; a {what}; leave it out")
    if (trust_code or trust_fmu) and not is_toml:
        option = "--trust-code" if trust_code else "--trust-fmu"
        raise ScenarioError(f"{option}: is for a scenario or a study; a recording runs no code; leave it out")
    with announce_compiling():
        if not is_toml:
            with export.open(subject) as read, count_steps("reading", "frame") as step:
                return verify(asked, read, folder=subject.parent, on_step=step)
        if is_study:
            with count_steps("trading", "run") as step:
                return verify(
                    asked,
                    Study.load(subject),
                    executor=executor,
                    on_step=step,
                    trust_code=trust_code,
                    trust_fmu=trust_fmu,
                )
        with count_steps("simulating", "frame") as step:
            scenario = Scenario.load(subject, settings, trust_code=trust_code, trust_fmu=trust_fmu)
            return verify(asked, scenario, executor=executor, on_step=step)
