"""`rso-lidar camera waveforms`: raw waveforms of a real flash lidar beside those of a simulated camera."""

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
from rso_lidar.evaluation import WaveformComparison, compare_waveforms
from rso_lidar.files import check_writable


def waveforms(
    camera: CameraName,
    data: Annotated[
        Path, typer.Option("--data", metavar="RECORDING", help="Folder of a PixSet recording, or its ..._ftrr.zip.")
    ],
    output: Annotated[
        list[Path] | None, typer.Option("-o", "--output", help="Page (.html) or picture (.png); may be repeated.")
    ] = None,
    flashes: Annotated[int, typer.Option("--flashes", min=1, max=200, help="Most flashes of the recording.")] = 20,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Compare raw waveforms of a real flash lidar with a simulated camera.

    Noise, pulse shape and saturation of a recording of Leddar PixSet stand beside those of the camera's simulated chain.
    """
    places = [check_writable(place, WaveformComparison.SUFFIXES, overwrite=overwrite) for place in output or ()]
    scheme = choose_scheme(dark, places)
    lidar = load_instrument(camera, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    with announce_compiling():
        compared = compare_waveforms(data, lidar, flashes=flashes)
    for place in places:
        compared.save(place, overwrite=overwrite, scheme=scheme)
    echo(compared.table())
    for place in places:
        echo(place)
