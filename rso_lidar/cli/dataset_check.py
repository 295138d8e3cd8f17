"""`rso-lidar dataset check`: check a specification before a dataset is made, or its folder afterwards."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import TrustCode, TrustFmu
from rso_lidar.cli.progress import announce_compiling
from rso_lidar.cli.terminal import echo
from rso_lidar.dataset import check_folder, check_spec


def check(
    path: Annotated[Path, typer.Argument(metavar="SPEC|FOLDER", help="Specification (TOML), or folder of a dataset.")],
    samples: Annotated[
        int,
        typer.Option("--samples", min=0, max=10_000, help="Number of samples of a folder to make again and compare."),
    ] = 4,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="Compare sizes, not hashes, and make no sample again; of a specification, fly an eighth of the samples.",
        ),
    ] = False,
    files: Annotated[
        Path | None,
        typer.Option(
            "--files", metavar="FOLDER", help="Folder in which relative paths of meshes and orbit files start."
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed that chooses these samples.")] = 0,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
) -> None:
    """Check a specification (sizes, time, balance, leaks) or a folder (hashes, random samples made again bit for bit).

    The exit status is 1 if a shard of a folder is damaged or missing, or a frame differs.
    """
    with announce_compiling():
        if not path.is_dir():
            echo(check_spec(path, quick=quick, trust_code=trust_code, trust_fmu=trust_fmu).describe())
            return
        report = check_folder(
            path, samples=samples, quick=quick, files=files, seed=seed, trust_code=trust_code, trust_fmu=trust_fmu
        )
    echo(report.describe())
    if report.problems:
        raise typer.Exit(1)
