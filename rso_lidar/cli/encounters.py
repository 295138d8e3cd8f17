"""`rso-lidar encounters`: all close approaches of one object of a catalogue to the others."""

import datetime
import re
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import picture, units
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.picture.encounters import encounter_figure
from rso_lidar.picture.output import FIGURE_SUFFIXES, checked
from rso_lidar.scenario import Lidar, Scenario
from rso_lidar.scenario.lidar import presets
from rso_lidar.study import Encounters, scenario_text
from rso_lidar.study import encounters as find
from rso_lidar.study.encounters import MAX_SLEW_DEG_S, checked_output, write_text

_LENGTHS_M = {"m": 1.0, "km": units.KM}
_ORDERS = ("range", "time", "speed")


def encounters(
    catalog: Annotated[Path, typer.Argument(metavar="CATALOG", help="File of element sets (TLE, or OMM).")],
    follower: Annotated[str, typer.Option("--follower", metavar="ID", help="Catalogue number or name.")],
    within: Annotated[str, typer.Option("--within", help="Greatest range, with its unit: 50km, 500m.")],
    start: Annotated[str, typer.Option("--start", help="Begin, such as 2026-05-07T00:00:00Z.")],
    days: Annotated[float, typer.Option("--days", help="How many days to look at.")] = 1.0,
    lidar: Annotated[
        str, typer.Option("--lidar", metavar="PRESET|FILE", help="Camera by name, or a scenario file with one.")
    ] = "long_range_1064",
    sunlit: Annotated[bool, typer.Option("--sunlit", help="Only objects in sunlight at the closest approach.")] = False,
    min_duration: Annotated[float, typer.Option("--min-duration", metavar="S", help="Only stays so long [s].")] = 0.0,
    max_slew: Annotated[
        float, typer.Option("--max-slew", metavar="DEG_S", help="How fast the line of sight may turn [deg/s].")
    ] = MAX_SLEW_DEG_S,
    sort: Annotated[str, typer.Option("--sort", help="Order: range, time or speed.")] = "range",
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Only the first so many rows.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write all columns to this file (.csv).")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw range over time to this file (.png).")] = None,
    scenario: Annotated[
        int | None, typer.Option("--scenario", metavar="N", help="Write the scenario of row N to the file of -o.")
    ] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Scenario file to write (.toml).")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace outputs that exist.")] = False,
) -> None:
    """List all close approaches of one object to all others of a catalogue."""
    if (scenario is None) != (output is None):
        raise ScenarioError("--scenario and -o go together: give the row's number and the file to write")
    if sort not in _ORDERS:
        raise ScenarioError(f"--sort {sort}: unknown order{did_you_mean(sort, _ORDERS)} (known: {', '.join(_ORDERS)})")
    within_m, start_utc = _length_m(within), _instant(start)
    camera = _lidar(lidar)
    for place in (csv, plot, output):
        if place is not None:
            checked_output(place, overwrite=overwrite)
    if plot is not None:
        checked(plot, FIGURE_SUFFIXES)
    table = find(
        catalog,
        follower,
        within_m=within_m,
        start_utc=start_utc,
        days=days,
        lidar=camera,
        lidar_name=lidar,
        max_slew_deg_s=max_slew,
        sunlit=sunlit,
        min_duration_s=min_duration,
        sort=sort,  # type: ignore[arg-type]
        limit=limit,
    )
    text = scenario_text(table, scenario) if scenario is not None and (table.rows or scenario < 1) else None
    _show(table)
    if csv is not None:
        typer.echo(f"{table.csv(csv, overwrite=overwrite)}")
    if plot is not None and table.rows:
        typer.echo(f"{_draw(table, plot)}")
    if text is not None and output is not None:
        typer.echo(f"{write_text(output, text, overwrite=overwrite)}")
    elif scenario is not None:
        typer.echo("no scenario written")


def _show(table: Encounters) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal or not table.rows:
        typer.echo(table.table())
        return
    heads, rows = table.cells()
    shown = Table(title=table.title, box=None, header_style="bold", title_justify="left")
    for head in heads:
        shown.add_column(head, justify="left" if head in ("object", "closest approach, UTC") else "right")
    for row in rows:
        shown.add_row(*row)
    console.print(shown, markup=False)
    for line in table.notes():
        console.print(line, markup=False, highlight=False)


def _draw(table: Encounters, place: Path) -> Path:
    start = np.datetime64(table.start_utc.astimezone(datetime.UTC).replace(tzinfo=None), "ms")
    figure = encounter_figure(
        start + np.array([round(1e3 * row.time_s) for row in table.rows]).astype("timedelta64[ms]"),
        np.array([row.range_m for row in table.rows]),
        np.array([row.speed_m_s for row in table.rows]),
        np.array([row.sunlit_fraction >= 0.5 for row in table.rows]),
        [row.label for row in table.rows],
        table.within_m,
        table.reach_m[1],
        f"Encounters of {table.follower.name or table.follower.label}",
        f"{len(table.rows):,} encounters within {table.within_m / units.KM:g} km of {table.screened:,} objects   ·   "
        f"{table.start_utc:%Y-%m-%d %H:%M} UTC + {table.days:g} days   ·   element sets are good to a kilometre",
    )
    return picture.save_figure(figure, place)


def _length_m(text: str) -> float:
    """Return a length with its unit, such as ``50km`` [m]."""
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*([A-Za-z]*)\s*", text)
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        number = float("nan")
    if not found or not np.isfinite(number):
        raise ScenarioError(f"--within {text}: is no length; write for example 50km or 500m")
    if not found[2]:
        raise ScenarioError(f"--within {text}: has no unit; write {text.strip()}km or {text.strip()}m")
    if found[2] not in _LENGTHS_M:
        raise ScenarioError(f"--within {text}: unknown unit '{found[2]}' (known: {', '.join(_LENGTHS_M)})")
    return number * _LENGTHS_M[found[2]]


def _instant(text: str) -> datetime.datetime:
    try:
        instant = datetime.datetime.fromisoformat(text.strip())
    except ValueError:
        raise ScenarioError(f"--start {text}: is no time; write for example 2026-05-07T00:00:00Z") from None
    if instant.tzinfo is None:
        raise ScenarioError(f"--start {text}: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 1957 <= instant.year <= 2056:
        raise ScenarioError(f"--start {text}: element sets are of 1957 to 2056; correct the year")
    return instant.astimezone(datetime.UTC)


def _lidar(text: str) -> Lidar:
    """Return the camera of that name, or that of a scenario file."""
    if text in presets():
        return Lidar(preset=text)  # type: ignore[call-arg]
    if Path(text).suffix.lower() == ".toml" or Path(text).exists():
        return Scenario.load(text).instrument
    raise ScenarioError(
        f"--lidar {text}: no camera of that name{did_you_mean(text, presets())} (known: {', '.join(presets())}; or a "
        "scenario file)"
    )
