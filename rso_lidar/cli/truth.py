"""`rso-lidar truth`: true motion without rendering, as a table, a picture, an ephemeris or a globe file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from rso_lidar import orbit, picture
from rso_lidar.cli.arguments import Dark, Overwrite, ScenarioFile, Settings, TrustCode, TrustFmu, choose_scheme
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.evaluation import choose_globe_samples, write_globe
from rso_lidar.files import check_writable, write_columns
from rso_lidar.mission_analysis import (
    draw_trajectory,
    find_umbras,
    fly_open_loop,
    sample_between_impulses,
    tabulate_run,
)
from rso_lidar.motion import write_aem
from rso_lidar.orbit import write_oem
from rso_lidar.picture import FIGURE_SUFFIXES, angles_figure, inertial_figure, ptu_figure
from rso_lidar.pose import ROOT
from rso_lidar.scenario import Scenario

FIGURES = ("relative", "orbit", "angles", "ptu")
SUFFIXES = (*FIGURE_SUFFIXES, ".csv", ".oem", ".aem", ".czml")
STEPPED = ("angles", "ptu")  # figures that show where the PTU really points


def truth(
    file: ScenarioFile,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="What to write: .png, .pdf, .svg, .csv, .oem, .aem or .czml, by its suffix."
        ),
    ],
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="KIND",
            help="Of a picture: relative, orbit, angles or ptu.",
            autocompletion=lambda: list(FIGURES),
        ),
    ] = None,
    body: Annotated[
        str | None,
        typer.Option("--body", metavar="NAME", help="Body of an .oem or .aem (the follower); target of a picture."),
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
    output = check_writable(output, SUFFIXES, overwrite=overwrite)
    suffix = output.suffix.lower()
    kind = _choose_kind(figure, suffix)
    scheme = choose_scheme(dark, [output])
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    frames = np.arange(0, scenario.time.n_frames, _compute_stride(every_s, scenario))
    frames = np.union1d(frames, scenario.time.n_frames - 1)  # the last frame too, so that a table covers the whole run
    if suffix in FIGURE_SUFFIXES:
        picture.save_figure(_draw_figure(scenario, kind, body, frames), output, scheme=scheme)
    elif suffix == ".csv":
        table = tabulate_run(scenario, *fly_open_loop(scenario, frames))
        write_columns(output, table)
    else:
        if scenario.is_local:
            raise ScenarioError(f"{output.name}: a local world has no Earth to give positions about; write a .csv")
        if suffix == ".czml":
            place, _ = fly_open_loop(scenario, frames[choose_globe_samples(frames.size)])
            targets = [target.name for target in scenario.target]
            write_globe(output, scenario.name, scenario.time.start_utc, targets, place)
        else:
            _write_ephemeris(scenario, output, suffix, body, frames)
    echo(f"{output}")


def _choose_kind(figure: str | None, suffix: str) -> str:
    if figure is None:
        return FIGURES[0]
    if suffix not in FIGURE_SUFFIXES:
        raise ScenarioError(f"--figure {figure}: is for pictures; end the output with .png, or leave --figure out")
    if figure not in FIGURES:
        guess = did_you_mean(figure, FIGURES)
        raise ScenarioError(f"--figure {figure}: no such picture{guess} (known: {', '.join(FIGURES)})")
    return figure


def _compute_stride(every_s: float | None, scenario: Scenario) -> int:
    """Compute the number of frames between two rows."""
    if every_s is None:
        return 1
    if not 0.0 < every_s < np.inf:
        raise ScenarioError(f"--every {every_s:g}: needs seconds above 0")
    step_s = 1.0 / scenario.time.frame_rate_hz
    if every_s < step_s * (1.0 - 1e-9):
        raise ScenarioError(
            f"--every {every_s:g}: frames are {step_s:g} s apart; give at least that, or --set time.frame_rate_hz"
        )
    return round(every_s / step_s)


def _check_name(name: str, known: list[str]) -> str:
    if name not in known:
        raise ScenarioError(
            f"--body {name}: no body has that name{did_you_mean(name, known)} (known: {', '.join(known)})"
        )
    return name


def _draw_figure(scenario: Scenario, kind: str, body: str | None, frames: np.ndarray) -> Any:
    """Draw one of the figures.

    Parameters
    ----------
    scenario : to be drawn.
    kind : name of the figure.
    body : of a figure of one body.
    frames : numbers of the frames (time).
    """
    if kind == "ptu" and scenario.ptu is None:
        raise ScenarioError("--figure ptu: the scenario has no PTU; add [ptu], or draw another figure")
    if not scenario.target and kind != "orbit":
        raise ScenarioError(f"--figure {kind}: the scenario has no target; add a [[target]]")
    targets = [target.name for target in scenario.target]
    target = _check_name(body, targets) if body else next(iter(targets), None)
    place, angles = fly_open_loop(scenario, frames, drive=kind in STEPPED)
    if kind == "orbit":
        return inertial_figure(place, scenario.name, shadows_s=find_umbras(scenario))
    if kind == "ptu":
        assert scenario.ptu is not None
        response = scenario.ptu.response
        return ptu_figure(
            (place.time_s, angles),
            scenario.name,
            travel_rad=response.travel_rad,
            max_rate_rad_s=getattr(response, "max_rate_rad_s", None),
        )
    if kind == "angles":
        edges = scenario.instrument.at(0.0).receiver.field_edge
        half = float(np.arctan(np.min(edges)))
        shadow = find_umbras(scenario).get(target or "")
        return angles_figure(place, target, scenario.name, half_field_rad=half, shadow_s=shadow)
    return draw_trajectory(scenario, place, target)


def _write_ephemeris(scenario: Scenario, output: Path, suffix: str, body: str | None, frames: np.ndarray) -> None:
    """Write the motion of a body as OEM, or its attitude as AEM.

    Parameters
    ----------
    scenario : with the body.
    output : path of the file.
    suffix : ``.oem`` or ``.aem``.
    body : name of the body or axes.
    frames : numbers of the frames (time).
    """
    from scipy.spatial.transform import Rotation

    wanted = body or "follower"
    place, _ = fly_open_loop(scenario, frames, drive=suffix == ".aem" and wanted in ("ptu", "lidar"))
    name = _check_name(wanted, list(place.states if suffix == ".oem" else place.poses))
    if suffix == ".oem":
        at, states, breaks_s = sample_between_impulses(scenario, name, place.time_s)
        write_oem(output, name, name, at, states, breaks_s=breaks_s, overwrite=True)
        return
    epochs = orbit.Epochs(scenario.time.start_utc, place.time_s)
    turned = np.broadcast_to(place.pose(ROOT, name).rotation.as_matrix(), (place.time_s.size, 3, 3))
    write_aem(output, name, name, epochs, Rotation.from_matrix(turned), overwrite=True)
