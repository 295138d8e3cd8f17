"""`rso-lidar conjunction`: miss distance and probability of collision of a CDM, and its scenario."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Camera, Overwrite, load_lidar, parse_length_m
from rso_lidar.cli.terminal import echo
from rso_lidar.files import check_writable, write_text
from rso_lidar.study import assess_conjunction, conjunction_scenario_text


def conjunction(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Conjunction data message (CCSDS CDM, KVN or XML).")],
    radius: Annotated[
        str | None,
        typer.Option("--radius", metavar="LENGTH", help="Combined hard-body radius, with its unit: 10m."),
    ] = None,
    samples: Annotated[
        int | None, typer.Option("--samples", min=0, help="Monte Carlo draws; 0: none. Else for some 1000 hits.")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(
            "--window",
            metavar="SECONDS",
            help="Time searched on each side of the closest approach, but for Foster. Else 8 sigma, to half a revolution.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the draws, and of the scenario.")] = 0,
    follower: Annotated[int, typer.Option("--follower", min=1, max=2, help="Object with the lidar: 1 or 2.")] = 1,
    lidar: Camera = "long_range_1064",
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write a scenario of it to this .toml.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Compute the probability of collision of a conjunction message."""
    if output is not None:
        output = check_writable(output, (".toml",), overwrite=overwrite)
    camera, _ = load_lidar(lidar)
    radius_m = None if radius is None else parse_length_m("--radius", radius)
    assessment = assess_conjunction(file, radius_m, samples=samples, seed=seed, window_s=window)
    text = None if output is None else conjunction_scenario_text(assessment, follower, lidar=camera, seed=seed)
    echo(assessment.text())
    if text is not None and output is not None:
        echo(f"{write_text(output, text, overwrite=overwrite)}")
