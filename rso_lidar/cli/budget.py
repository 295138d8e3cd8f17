"""`rso-lidar budget`: closed-form link budget of a pixel that the target fills, and how far a whole body is found."""

from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from rso_lidar.cli.arguments import (
    CameraName,
    Dark,
    Engine,
    Overwrite,
    Scheduler,
    Settings,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
    choose_scheme,
    load_camera,
    parse_length_m,
)
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import find_range
from rso_lidar.picture import RESULT_SUFFIXES, Scheme
from rso_lidar.processes import open_executor
from rso_lidar.scenario import Finding, Lidar, Scenario, load_presets
from rso_lidar.study import budget as worked_out


def budget(
    camera: CameraName,
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
    probability: Annotated[
        float | None,
        typer.Option("--probability", help="Of detection, to solve for the range (0.95; 0.9 with --find)."),
    ] = None,
    target_m: Annotated[
        str | None,
        typer.Option("--target-m", metavar="A[,B,C]", help="Side of a square target, or three sides of a box (m)."),
    ] = None,
    facet_m2: Annotated[
        float | None, typer.Option("--facet-m2", metavar="M2", help="Area of a facet that may not fill a pixel (m2).")
    ] = None,
    find: Annotated[
        str | None,
        typer.Option(
            "--find",
            metavar="BODY",
            help="Instead, solve how far a whole body is found: a target, a model (cubesat_3u), or the path of a mesh.",
        ),
    ] = None,
    pixels: Annotated[
        int | None, typer.Option("--pixels", metavar="M", help="With --find: least pixels that report the body.")
    ] = None,
    flashes: Annotated[
        str | None,
        typer.Option("--flashes", metavar="K/N", help="With --find: they do so in K of N flashes, such as 2/3."),
    ] = None,
    attitudes: Annotated[
        str | None,
        typer.Option("--attitudes", metavar="N|run", help="With --find: number of attitudes, or those of the run."),
    ] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Picture (.png) or table (.csv).")] = None,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Compute photons, detection and precision against range.

    The values are in closed form, for a pixel filled by the target. With --find, solve how far a body is found.
    """
    if output is not None:
        output = check_writable(output, RESULT_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    of_pixel = {
        "--material": material,
        "--tilt-deg": tilt_deg,
        "--divergence-deg": divergence_deg,
        "--target-m": target_m,
        "--facet-m2": facet_m2,
    }
    by = choose_scheduler(engine, scheduler)
    of_body = {"--pixels": pixels, "--flashes": flashes, "--attitudes": attitudes}
    of_body |= {"--workers": workers, "--engine": by and engine}
    for name, given in (of_body if find is None else of_pixel).items():
        if given is not None and given != []:
            cure = "leave it out, or add --find" if find is None else "leave it out, or leave out --find"
            raise ScenarioError(f"{name}: is for {'a whole body' if find is None else 'one pixel'}; {cure}")
    loaded = load_camera(camera, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    if find is not None:
        with open_executor(workers, scheduler=by) as executor:
            _find(
                loaded,
                find,
                probability=0.9 if probability is None else probability,
                range_m=None if range_ is None else _parse_range_m(range_),
                pixels=pixels,
                flashes=flashes,
                attitudes=attitudes,
                executor=executor,
                output=output,
                scheme=scheme,
            )
        return
    link_budget = worked_out(
        loaded,
        range_m=None if range_ is None else _parse_range_m(range_),
        materials=material or None,
        tilt_deg=tilt_deg or 0.0,
        divergence_deg=divergence_deg or None,
        probability=0.95 if probability is None else probability,
        target_m=None if target_m is None else _parse_sides_m(target_m),
        facet_m2=facet_m2,
    )
    if settings and camera in load_presets():
        changed = f"{camera} with {', '.join(settings)}"  # it is not the camera of that name
        link_budget = replace(link_budget, camera=changed)
    if output is not None:
        link_budget.save(output, overwrite=overwrite, scheme=scheme)
    echo(link_budget.table())
    if output is not None:
        echo(f"{output}")


def _find(
    camera: Lidar | Scenario | str,
    body: str,
    *,
    probability: float,
    range_m: tuple[float, float] | None,
    pixels: int | None,
    flashes: str | None,
    attitudes: str | None,
    executor: Executor | None,
    output: Path | None,
    scheme: Scheme,
) -> None:
    """Solve how far a body is found, and print and write the answer.

    Parameters
    ----------
    camera, body, probability, range_m, executor : as for `find_range`
    output : picture or table, None for neither
    """
    finding = camera.finding if isinstance(camera, Scenario) else Finding()
    if pixels is not None:
        if not 1 <= pixels <= 100_000:
            raise ScenarioError(f"--pixels {pixels}: is not a number of pixels; give 1 to 100000")
        finding = finding.replace(pixels=pixels)
    if flashes is not None:
        needed, of, every = flashes.partition("/")
        if not of or not (needed.isascii() and every.isascii() and needed.isdigit() and every.isdigit()):
            raise ScenarioError(f"--flashes {flashes}: is not k of n; write for example 2/3")
        if not 1 <= int(needed) <= int(every) <= 1000:
            raise ScenarioError(f"--flashes {flashes}: is not k of n; give 1 to n of at most 1000 flashes")
        finding = finding.replace(needed=int(needed), flashes=int(every))
    in_run = attitudes == "run"
    chosen: dict[str, Any] = {"probability": probability, "range_m": range_m, "in_run": in_run, "executor": executor}
    if attitudes is not None and not in_run:
        if not (attitudes.isascii() and attitudes.isdigit()) or not 1 <= int(attitudes) <= 100_000:
            raise ScenarioError(f"--attitudes {attitudes}: is not a number of attitudes; give 1 to 100000, or run")
        chosen["attitudes"] = int(attitudes)
    found_range = find_range(camera, body, finding=finding, **chosen)
    echo(found_range.table())
    if output is not None:
        found_range.save(output, scheme)
        echo(f"{output}")


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
