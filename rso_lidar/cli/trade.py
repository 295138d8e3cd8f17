"""`rso-lidar trade`: trade studies, as a table and a report; an interrupted study can continue."""

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import (
    Dark,
    Engine,
    Overwrite,
    Scheduler,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
    choose_scheme,
)
from rso_lidar.cli.progress import announce_compiling, show_progress
from rso_lidar.cli.terminal import echo, to_one_line
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.export import check_parquet
from rso_lidar.files import check_suffix, check_writable, write_atomically
from rso_lidar.interruption import set_advice
from rso_lidar.picture import Scheme
from rso_lidar.processes import open_executor
from rso_lidar.study import Study, Trade, TradeRun


def trade(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).")],
    output: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--output",
            metavar="PATH",
            help="Folder (made/ creates it), or .csv, .html or .parquet; left out, the working folder. Table and report go "
            "beside each other.",
        ),
    ] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    min_detection_fraction: Annotated[
        float | None,
        typer.Option(
            "--min-detection-fraction",
            metavar="SHARE",
            help="Least share of pixels on target that report, from which a point is ranked (else the study's).",
        ),
    ] = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Run a trade study of scenario fields against figures of merit.

    The results are a table (.csv) and a report (.html).
    """
    by = choose_scheduler(engine, scheduler)
    study = Study.load(file)
    if min_detection_fraction is not None:
        if not 0.0 <= min_detection_fraction <= 1.0:
            raise ScenarioError(
                f"--min-detection-fraction {min_detection_fraction:g}: is not a fraction of pixels; give 0 (rank all) to 1"
            )
        study = study.replace(min_detection_fraction=min_detection_fraction)
    new = output is not None and output.endswith(("/", os.sep)) and not os.path.lexists(Path(output))
    places = _choose_outputs(file, output, new=new)
    if not new:
        places = [check_writable(place, Trade.SUFFIXES, overwrite=overwrite) for place in places]
    for place in places:
        if place.suffix.lower() == ".parquet":
            check_parquet(place)
    run = TradeRun(study, working=places[0], trust_code=trust_code, trust_fmu=trust_fmu)
    if new:
        _make_folder(places[0].parent)
    kept = run.kept
    assert kept is not None  # it has a place to be kept beside
    others = run.list_other_files()
    if others and not kept.exists():
        echo(f"starting again: {', '.join(others)} is of another study, scenario or version", err=True)
    set_advice(
        lambda: to_one_line(f"{run.n_done:,} of {run.n_rows:,} runs are kept in {kept}; the same command goes on")
    )
    with open_executor(workers, scheduler=by) as executor, run:
        if run.n_done:
            echo(f"continuing after {run.n_done:,} of {run.n_rows:,} runs")
        with announce_compiling(), show_progress(run.n_rows, run.n_done, "trading", of="run") as bar:
            finished_trade = run.finish(lambda *_: bar.advance(), executor=executor)
        _write(finished_trade, places, choose_scheme(dark))
        set_advice(lambda: to_one_line(f"the outputs {', '.join(map(str, places))} are written"))
        kept.unlink(missing_ok=True)
    echo(finished_trade.describe())
    for place in places:
        echo(f"{place}")


def _choose_outputs(file: Path, given: str | None, *, new: bool) -> list[Path]:
    """Return the paths of the table, of the report, and of a second table if one is requested."""
    try:
        output = Path(given or ".").expanduser()
    except RuntimeError:
        raise RecordingError(f"{given}: cannot be written here (there is no such user); choose another place") from None
    if new or output.is_dir():
        stem = output / file.stem
        return [stem.with_name(f"{stem.name}{suffix}") for suffix in (".csv", ".html")]
    check_suffix(output, Trade.SUFFIXES)
    places = [output.with_suffix(".csv"), output.with_suffix(".html")]
    return [*places, output] if output.suffix.lower() == ".parquet" else places


def _make_folder(folder: Path) -> None:
    """Make a folder inside an existing one."""
    try:
        folder.mkdir()
    except FileNotFoundError:
        raise RecordingError(f"{folder}: there is no folder {folder.parent}; create it first") from None
    except OSError as error:
        raise RecordingError(f"{folder}: no folder can be made there ({error.strerror}); choose another") from None


def _write(finished_trade: Trade, places: list[Path], scheme: Scheme) -> None:
    """Write all outputs under temporary names, and rename them when the last is complete."""
    with ExitStack() as drafts:
        for place in places:
            finished_trade.save(drafts.enter_context(write_atomically(place)), scheme)
