"""`rso-lidar camera`: the simulated data sheet of a camera, and a camera of your own fitted to measurements."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli import camera_fit, camera_waveforms
from rso_lidar.cli.arguments import (
    CameraName,
    Dark,
    Overwrite,
    Settings,
    TrustCode,
    TrustFmu,
    choose_scheme,
    load_camera,
)
from rso_lidar.cli.default_command import default_to
from rso_lidar.cli.terminal import echo
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import CameraDataSheet, data_sheet
from rso_lidar.scenario import load_presets

app = typer.Typer(
    cls=default_to("datasheet"), rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True
)


@app.callback()
def camera() -> None:
    """Print a camera's data sheet, or fit a camera to measurements.

    `camera FILE` is `camera datasheet FILE`.
    """


def datasheet(
    camera: CameraName,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            help="Page (.html), picture (.png), figures and curve (.json) or curve (.csv); may be repeated.",
        ),
    ] = None,
    trials: Annotated[
        int, typer.Option("--trials", min=50, max=1_000_000, help="Trials of each level of light.")
    ] = 4000,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Print the simulated data sheet of a camera with its lens and its own pulse.

    It states NEP, noise, threshold, false alarms, photons for detection, range sigma and bias, walk, saturation and defects.
    Each figure has its origin, a closed form or a number of trials, and its uncertainty.
    """
    places = [check_writable(place, CameraDataSheet.SUFFIXES, overwrite=overwrite) for place in output or ()]
    scheme = choose_scheme(dark, places)
    sheet = data_sheet(
        load_camera(camera, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu), trials=trials
    )
    if settings and camera in load_presets():
        sheet = replace(sheet, camera=f"{camera} with {', '.join(settings)}")  # it is not the camera of that name
    for place in places:
        sheet.save(place, overwrite=overwrite, scheme=scheme)
    echo(sheet.table())
    for place in places:
        echo(place)


app.command("datasheet")(datasheet)
app.command("fit")(camera_fit.fit)
app.command("waveforms")(camera_waveforms.waveforms)
