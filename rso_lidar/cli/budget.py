"""`rso-lidar budget`: closed-form link budget of a pixel that the target fills."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Overwrite, Settings, parse_length_m
from rso_lidar.cli.completion import list_cameras
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import check_writable
from rso_lidar.scenario import Lidar, Scenario
from rso_lidar.scenario.mission.validation import validate_toml
from rso_lidar.scenario.tables.presets import load_presets
from rso_lidar.study import budget as worked_out
from rso_lidar.study.budgets.range_budget import SUFFIXES


def budget(
    camera: Annotated[
        str,
        typer.Argument(
            metavar="FILE|PRESET", help="Scenario file (TOML), or a camera by name.", autocompletion=list_cameras
        ),
    ],
    range_: Annotated[
        str | None, typer.Option("--range", metavar="A:B", help="From and to, with their unit: 100m:5km.")
    ] = None,
    material: Annotated[
        list[str] | None,
        typer.Option("--material", help="Catalogue name, reflectance (0.3), or BRDF table (.csv); may be repeated."),
    ] = None,
    tilt_deg: Annotated[
        list[float] | None, typer.Option("--tilt-deg", metavar="DEG", help="Tilt of the facet; may be repeated.")
    ] = None,
    divergence_deg: Annotated[
        list[float] | None,
        typer.Option("--divergence-deg", metavar="DEG", help="Full angle of the beam; may be repeated."),
    ] = None,
    probability: Annotated[float, typer.Option("--probability", help="Of detection, to solve for the range.")] = 0.95,
    target_m: Annotated[
        str | None,
        typer.Option("--target-m", metavar="A[,B,C]", help="Side of a square target, or three sides of a box (m)."),
    ] = None,
    facet_m2: Annotated[
        float | None, typer.Option("--facet-m2", metavar="M2", help="Area of a facet that may not fill a pixel (m2).")
    ] = None,
    settings: Settings = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Picture (.png) or table (.csv).")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Compute photons, detection and precision against range.

    The values are in closed form, for a pixel filled by the target.
    """
    if output is not None:
        output = check_writable(output, SUFFIXES, overwrite=overwrite)
    made = worked_out(
        _load_camera(camera, tuple(settings or ())),
        range_m=None if range_ is None else _parse_range_m(range_),
        materials=material or None,
        tilt_deg=tilt_deg or 0.0,
        divergence_deg=divergence_deg or None,
        probability=probability,
        target_m=None if target_m is None else _parse_sides_m(target_m),
        facet_m2=facet_m2,
    )
    if settings and camera in load_presets():
        made = replace(made, camera=f"{camera} with {', '.join(settings)}")  # it is not the camera of that name
    if output is not None:
        made.save(output, overwrite=overwrite)
    echo(made.table())
    if output is not None:
        echo(f"{output}")


def _load_camera(text: str, settings: tuple[str, ...]) -> Lidar | Scenario | str:
    if text in load_presets():
        return validate_toml(Lidar, f'[lidar]\npreset = "{text}"', text, settings, table="lidar") if settings else text
    if Path(text).suffix.lower() == ".toml" or Path(text).exists():
        return Scenario.load(text, settings)
    raise ScenarioError(
        f"{text}: no camera of that name{did_you_mean(text, load_presets())} (known: {', '.join(load_presets())}; "
        "or a scenario file)"
    )


def _parse_range_m(text: str) -> tuple[float, float]:
    ends = text.split(":")
    if len(ends) != 2:
        raise ScenarioError(f"--range {text}: is not a range; write for example 100m:5km")
    return parse_length_m("--range", ends[0]), parse_length_m("--range", ends[1])


def _parse_sides_m(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise ScenarioError(f"--target-m {text}: are not lengths; write 2.5, or 4,3,2") from None
