"""The true motion of a scenario in a file: a table, a picture, an ephemeris, an attitude history or a globe."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import orbit, picture
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import check_writable, write_columns
from rso_lidar.mission_analysis.time_history.czml import choose_globe_samples, write_globe
from rso_lidar.mission_analysis.time_history.open_loop import (
    choose_rows,
    find_mission_plan,
    find_umbras,
    fly_open_loop,
    sample_between_impulses,
    tabulate_run,
)
from rso_lidar.motion import list_commands, write_aem
from rso_lidar.orbit import State, write_ck, write_oem, write_opm, write_spk
from rso_lidar.picture import FIGURE_SUFFIXES, LIGHT, Scheme, angles_figure, inertial_figure, ptu_figure
from rso_lidar.pose import ROOT
from rso_lidar.records import Truth
from rso_lidar.scenario import Scenario

TRUTH_FIGURES = ("relative", "orbit", "angles", "ptu")
_KERNELS = (".bsp", ".bc")
_FIRST_NUMBER = -900_001  # of bodies in kernels, in the order of the tree of axes; below those that NAIF has assigned
_SUFFIXES = (*FIGURE_SUFFIXES, ".csv", ".oem", ".opm", ".aem", ".czml", *_KERNELS)
_STEPPED = ("angles", "ptu")  # figures that show where the PTU really points


def save_truth(
    scenario: Scenario,
    path: str | Path,
    *,
    figure: str | None = None,
    body: str | None = None,
    every_s: float | None = None,
    scheme: Scheme = LIGHT,
    overwrite: bool = False,
) -> Path:
    """Write or draw the true motion of an open-loop run without rendering frames: all poses, and where the PTU points.

    Parameters
    ----------
    scenario : what is flown
    path : of the output: a picture (.png, .pdf, .svg), a table (.csv), an orbit (.oem), the state at the start (.opm), an
        attitude (.aem), a globe (.czml), or a SPICE kernel of an orbit (.bsp, type 13) or an attitude (.bc, with a .tf and
        a .tsc beside it)

    Other Parameters
    ----------------
    figure : of a picture, ``relative``, ``orbit``, ``angles`` or ``ptu`` (None: ``relative``)
    body : body of an .oem, .opm, .aem or kernel (None: the follower), or target of a picture (None: the first)
    every_s : time from row to row, in whole frames [s] (None: every frame). The last frame is written too
    scheme : of a picture, `LIGHT` or `DARK`
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    RecordingError
        For another suffix, or a path that cannot be written.
    ScenarioError
        For a figure, a body or an interval that the scenario does not have, and for a globe or an ephemeris of a local
        world.
    """
    output = check_truth_output(path, figure=figure, overwrite=overwrite)
    suffix, kind = output.suffix.lower(), figure or TRUTH_FIGURES[0]
    frames = choose_rows(scenario, every_s)
    if suffix in FIGURE_SUFFIXES:
        return picture.save_figure(_draw_figure(scenario, kind, body, frames), output, scheme=scheme)
    if suffix == ".csv":
        write_columns(output, tabulate_run(scenario, *fly_open_loop(scenario, frames)))
        return output
    if scenario.is_local:
        raise ScenarioError(f"{output.name}: a local world has no Earth to give positions about; write a .csv")
    if suffix == ".czml":
        place, _ = fly_open_loop(scenario, frames[choose_globe_samples(frames.size)])
        targets = [target.name for target in scenario.target]
        write_globe(output, scenario.name, scenario.time.start_utc, targets, place)
    else:
        _write_ephemeris(scenario, output, suffix, body, frames, overwrite=overwrite)
    return output


def check_truth_output(path: str | Path, *, figure: str | None = None, overwrite: bool = False) -> Path:
    """Check that `save_truth` can write an output, before a scenario is loaded for it.

    Parameters
    ----------
    path, figure, overwrite : as for `save_truth`

    Returns
    -------
    Path
        Of the output.

    Raises
    ------
    RecordingError
        For another suffix, or a path that cannot be written.
    ScenarioError
        For a figure that there is not.
    """
    output = check_writable(path, _SUFFIXES, overwrite=overwrite)
    if figure is None:
        return output
    if output.suffix.lower() not in FIGURE_SUFFIXES:
        raise ScenarioError(f"figure {figure}: is for pictures; end the output with .png, or leave it out")
    if figure not in TRUTH_FIGURES:
        guess = did_you_mean(figure, TRUTH_FIGURES)
        raise ScenarioError(f"figure {figure}: no such picture{guess} (known: {', '.join(TRUTH_FIGURES)})")
    return output


def _check_name(name: str, known: list[str]) -> str:
    if name not in known:
        raise ScenarioError(
            f"body {name}: no body has that name{did_you_mean(name, known)} (known: {', '.join(known)})"
        )
    return name


def _draw_figure(scenario: Scenario, kind: str, body: str | None, frames: np.ndarray) -> Any:
    """Draw one of the figures."""
    if kind == "ptu" and scenario.ptu is None:
        raise ScenarioError("figure ptu: the scenario has no PTU; add [ptu], or draw another figure")
    if not scenario.target and kind != "orbit":
        raise ScenarioError(f"figure {kind}: the scenario has no target; add a [[target]]")
    targets = [target.name for target in scenario.target]
    target = _check_name(body, targets) if body else next(iter(targets), None)
    place, angles = fly_open_loop(scenario, frames, drive=kind in _STEPPED)
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


def _write_ephemeris(
    scenario: Scenario, output: Path, suffix: str, body: str | None, frames: np.ndarray, *, overwrite: bool
) -> None:
    """Write the motion of a body (None: the follower) as OEM or SPK, its first state as OPM, its attitude as AEM or CK."""
    from scipy.spatial.transform import Rotation

    wanted = body or "follower"
    place, _ = fly_open_loop(scenario, frames, drive=suffix in (".aem", ".bc") and wanted in ("ptu", "lidar"))
    name = _check_name(wanted, list(place.poses if suffix in (".aem", ".bc") else place.states))
    number = _FIRST_NUMBER - list(place.poses).index(name)
    if suffix in (".oem", ".bsp"):
        at, states, breaks_s = sample_between_impulses(scenario, name, place.time_s)
        if suffix == ".bsp":
            write_spk(output, name, number, at, states, breaks_s=breaks_s, overwrite=True)
        else:
            write_oem(output, name, name, at, states, breaks_s=breaks_s, overwrite=True)
        return
    epochs = orbit.Epochs(scenario.time.start_utc, place.time_s)
    if suffix == ".opm":
        own = place.states[name]
        state = State(
            epoch_utc=scenario.time.start_utc + datetime.timedelta(seconds=float(place.time_s[0])),
            position_m=tuple(own.position_m[0].tolist()),
            velocity_m_s=tuple(own.velocity_m_s[0].tolist()),
        )
        write_opm(output, name, name, state, overwrite=True)
        return
    turned = np.broadcast_to(place.pose(ROOT, name).rotation.as_matrix(), (place.time_s.size, 3, 3))
    if suffix == ".bc":
        rate = np.broadcast_to(place.rates(ROOT, name)[1], (place.time_s.size, 3))
        write_ck(output, name, number, epochs, Rotation.from_matrix(turned), rate, overwrite=overwrite)
        return
    write_aem(output, name, name, epochs, Rotation.from_matrix(turned), overwrite=True)


def draw_trajectory(scenario: Scenario, flown: Truth, target: str | None = None) -> Any:
    """Draw the relative trajectory, with the impulses, the keep-out sphere and the delta-v of the follower's plan.

    Parameters
    ----------
    scenario : to be drawn
    flown : its truth at the instants drawn (time)
    target : name of the target that it is relative to (None: the first)

    Returns
    -------
    Figure
        Of matplotlib.
    """
    plan = find_mission_plan(scenario, target) if scenario.target else None
    if plan is None:
        return picture.orbit_figure(flown, target, title=scenario.name)
    commands = list_commands(scenario.bodies[-1], scenario.bodies, *scenario.span)
    return picture.orbit_figure(
        flown,
        target,
        impulses=[(command.time_s, command.delta_v_m_s) for command in commands],
        keep_out_m=getattr(scenario.bodies[-1].motion, "keep_out_m", 0.0) or None,
        delta_v_m_s=plan.delta_v_m_s,
        title=scenario.name,
    )
