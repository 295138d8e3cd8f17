"""`rso-lidar timeline`: one encounter frame by frame, as a picture or a table, without rendering frames."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar.cli.arguments import (
    Dark,
    Engine,
    Overwrite,
    ScenarioFile,
    Scheduler,
    Settings,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
    choose_scheme,
    name_options,
)
from rso_lidar.cli.terminal import echo
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import Timeline
from rso_lidar.mission_analysis import timeline as timeline_of
from rso_lidar.picture import RESULT_SUFFIXES
from rso_lidar.processes import open_executor
from rso_lidar.scenario import Scenario
from rso_lidar.ties import find_first_least


def timeline(
    file: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture (.png, .pdf, .svg) or table (.csv); left out, a picture in the working folder.",
        ),
    ] = None,
    every_s: Annotated[
        float | None,
        typer.Option("--every", metavar="S", help="Seconds from row to row, in whole frames; and the last frame."),
    ] = None,
    target: Annotated[str | None, typer.Option("--target", metavar="NAME", help="Target (the first).")] = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Draw or tabulate one encounter, frame by frame.

    Columns: range, rates, Sun, PTU, field, pixels, photons and detection.
    """
    output = check_writable(output or Path(f"{file.stem}_timeline.png"), RESULT_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    by = choose_scheduler(engine, scheduler)
    scenario = Scenario.load(file, tuple(settings or ()), trust_code=trust_code, trust_fmu=trust_fmu)
    with name_options("every_s"), open_executor(workers, scheduler=by) as executor:
        history = timeline_of(scenario, target, every_s=every_s, executor=executor)
    history.save(output, scheme)
    mirrored = any(
        material.is_retro
        for surface in scenario.surfaces
        if surface.body == history.target
        for material in surface.materials
    )
    for line in _summarise(history, mirrored, scenario.finding.describe()):
        echo(line)
    echo(f"{output}")


_LIKELY = 0.9  # probability of detection from which a frame counts in the summary


def _summarise(history: Timeline, mirrored: bool, finding: str) -> list[str]:
    """Summarise the encounter in a few lines."""
    table = history.table
    time_s, range_m = table["time_s"], table["range_m"]
    nearest = find_first_least(range_m)
    lines = [
        f"{history.target}: {time_s.size:,} frames, {range_m[0]:,.1f} -> {range_m[-1]:,.1f} m, "
        f"least {range_m[nearest]:,.1f} m at {time_s[nearest]:g} s",
        f"in the field  wholly {np.mean(table['in_field_fraction'] >= 0.999):.0%} of the frames, "
        f"in part {np.mean(table['in_field_fraction'] > 0.0):.0%}",
    ]
    if "sunlit_fraction" in table:
        lines.append(f"sunlit        {np.mean(table['sunlit_fraction'] >= 0.5):.0%} of the frames")
    if "pan_demand_rad" in table:
        stands = {
            word: int(np.sum(table[f"pan_{name}"] | table[f"tilt_{name}"]))
            for word, name in (("beyond its travel", "beyond_travel"), ("at its greatest rate", "at_greatest_rate"))
        }
        lines.append("ptu           " + ", ".join(f"{word} at {count:,} frames" for word, count in stands.items()))
    lines.append(
        f"light         {_format_span(table['target_pixels'], '.0f')} pixels, "
        f"{_format_span(table['brightest_photons'], ',.0f')} photons "
        f"in the brightest{' (its retro-reflectors counted)' * mirrored}, "
        f"found with probability {_format_span(table['detection_probability'], '.2f')}"
    )
    likely = table["detection_probability"] >= _LIKELY
    if likely.any() and not likely.all():
        frames = f"{np.mean(likely):.0%} of the frames, at {_format_span(range_m[likely], ',.1f')} m"
        lines.append(f"detection     of the brightest pixel, with a probability of {_LIKELY:g} or more: {frames}")
    elif not likely.any():
        lines.append(f"detection     the brightest pixel never reaches a probability of {_LIKELY:g}")
    is_found = table["found_probability"] >= _LIKELY
    where = f", at {_format_span(range_m[is_found], ',.1f')} m" if is_found.any() and not is_found.all() else ""
    lines.append(
        f"found         the whole target ({finding}): with a probability of {_LIKELY:g} or more at "
        f"{np.mean(is_found):.0%} of the frames{where}"
    )
    return lines


def _format_span(values: np.ndarray, form: str) -> str:
    return f"{values.min():{form}} to {values.max():{form}}"
