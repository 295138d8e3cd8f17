"""`rso-lidar camera fit`: constants of a detector and its pixels fitted to measurements, and a preset with their origin."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import (
    CameraName,
    Dark,
    Overwrite,
    Settings,
    TrustCode,
    TrustFmu,
    choose_scheme,
    load_instrument,
)
from rso_lidar.cli.progress import announce_compiling
from rso_lidar.cli.terminal import echo
from rso_lidar.detector import MAPS_SUFFIX
from rso_lidar.evaluation import FIT_REPORT_SUFFIXES, CurvesFile, fit_camera, save_fit_report
from rso_lidar.files import check_writable

_PRESET_SUFFIX = ".toml"


def fit(
    camera: CameraName,
    data: Annotated[Path, typer.Option("--data", metavar="CURVES", help="Curves file (TOML): the measured tables.")],
    output: Annotated[
        list[Path] | None,
        typer.Option("-o", "--output", help="Preset (.toml), report (.html), or picture (.png); may be repeated."),
    ] = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Fit constants of a camera's detector to measured curves, maps of its pixels and raw waveforms.

    Maps are written beside the preset, as an NPZ file of the same name. A report is written of any fit that converges. Where
    the detector cannot have given the measurements, the fit is rejected, no preset is written, and the exit status is 2.
    """
    known = (_PRESET_SUFFIX, *FIT_REPORT_SUFFIXES)
    places = [check_writable(place, known, overwrite=overwrite) for place in output or ()]
    scheme = choose_scheme(dark, places)
    lidar = load_instrument(camera, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    curves = CurvesFile.load(data)
    for place in places:
        if place.suffix.lower() == _PRESET_SUFFIX and curves.pixel_constants:  # before the fit, as for the other files
            check_writable(place.with_suffix(MAPS_SUFFIX), overwrite=overwrite)
    with announce_compiling():
        fitted = fit_camera(lidar, curves)
    reports = [place for place in places if place.suffix.lower() != _PRESET_SUFFIX]
    for place in reports:
        save_fit_report(fitted, place, overwrite=overwrite, scheme=scheme)
    echo(fitted.table())
    for place in reports:
        echo(place)
    fitted.check_accepted()
    for place in places:
        if place not in reports:
            echo(fitted.save_preset(place, overwrite=overwrite))
            if (beside := fitted.place_maps(place)) is not None:
                echo(beside)
