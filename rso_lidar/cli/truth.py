"""`rso-lidar truth`: true motion without rendering, as a table, a picture, an ephemeris or a globe file."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import (
    Dark,
    Overwrite,
    ScenarioFile,
    Settings,
    TrustCode,
    TrustFmu,
    choose_scheme,
    name_options,
)
from rso_lidar.cli.terminal import echo
from rso_lidar.mission_analysis import TRUTH_FIGURES, check_truth_output, save_truth
from rso_lidar.scenario import Scenario


def truth(
    file: ScenarioFile,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="What to write: .png, .pdf, .svg, .csv, .oem, .opm, .aem, .bsp, .bc or .czml, by suffix.",
        ),
    ],
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="KIND",
            help=f"Of a picture: {', '.join(TRUTH_FIGURES[:-1])} or {TRUTH_FIGURES[-1]}.",
            autocompletion=lambda: list(TRUTH_FIGURES),
        ),
    ] = None,
    body: Annotated[
        str | None,
        typer.Option(
            "--body",
            metavar="NAME",
            help="Body of an .oem, .opm, .aem, .bsp or .bc (the follower); target of a picture.",
        ),
    ] = None,
    every_s: Annotated[
        float | None,
        typer.Option(
            "--every",
            metavar="S",
            help="Seconds from row to row, in whole frames; and the last frame.",
        ),
    ] = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Write or draw the true motion without rendering frames.

    It holds the poses of all bodies and where the PTU points.
    """
    scheme = choose_scheme(dark, [output])
    with name_options("figure"):
        check_truth_output(output, figure=figure, overwrite=overwrite)
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    with name_options("body", "every_s"):
        place = save_truth(
            scenario, output, figure=figure, body=body, every_s=every_s, scheme=scheme, overwrite=overwrite
        )
    echo(f"{place}")
