"""`rso-lidar events`: intervals in which conditions on a follower and other objects hold, over days."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from rso_lidar.cli.arguments import (
    Dark,
    Overwrite,
    Settings,
    TrustCode,
    TrustFmu,
    check_settings,
    choose_scheme,
    load_lidar,
    name_options,
    parse_instant,
    parse_length_m,
    refuse_inputs,
)
from rso_lidar.cli.table import PrintedTable
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable, write_text
from rso_lidar.orbit import GroundStation
from rso_lidar.scenario import Constraints, Finding, Lidar, Scenario, load_presets
from rso_lidar.study import Events, ViewedPlate, event_scenario_text
from rso_lidar.study import events as find

_ARGUMENTS = ("when", "start", "days", "min_duration", "target_size", "reflectance")  # which are options too
_NAMING = 6  # columns that identify an event
# Columns in order of importance, for what is too narrow for all of them.
_TELLING = (
    *("#", "follower", "object", "begin, UTC", "length, s", "event", "nearest, km", "lit, %", "phase, deg"),
    *("end, UTC", "farthest, km", "Sun, deg", "speed, m/s", "nearest, UTC"),
)


def events(
    catalog: Annotated[
        list[Path],
        typer.Argument(
            metavar="CATALOG...",
            help="Files of element sets (TLE, OMM), orbits (OEM, OPM, CSV) and scenarios (TOML): all bodies in them.",
        ),
    ],
    when: Annotated[
        list[str] | None,
        typer.Option(
            "--when",
            metavar="EXPRESSION",
            help="Conditions, as 'range < 50km and lit'; again for more, as 'NAME = EXPRESSION' (in the lidar's reach).",
        ),
    ] = None,
    follower: Annotated[
        str | None,
        typer.Option(
            "--follower",
            metavar="ID|FILE",
            help="Object with the lidar: catalogue number, name, or its file (of one scenario, its follower).",
        ),
    ] = None,
    all_pairs: Annotated[
        bool, typer.Option("--all-pairs", help="Every two objects, the lidar on the first, instead of --follower.")
    ] = False,
    start: Annotated[
        str | None,
        typer.Option("--start", help="Begin, such as 2026-05-07T00:00:00Z (that of the follower's scenario)."),
    ] = None,
    days: Annotated[float, typer.Option("--days", help="Length of the search [days].")] = 1.0,
    station: Annotated[
        list[str] | None,
        typer.Option(
            "--station",
            metavar="NAME=LAT,LON[,M[,DEG]]",
            help="Ground station: latitude and longitude [deg], height [m], least elevation [deg]; again for more.",
        ),
    ] = None,
    lidar: Annotated[
        str | None,
        typer.Option(
            "--lidar",
            metavar="PRESET|FILE",
            help="Camera by name, or a scenario file with one (the follower's, else long_range_1064).",
            autocompletion=lambda: list(load_presets()),
        ),
    ] = None,
    target_size: Annotated[
        str | None,
        typer.Option(
            "--target-size", metavar="LENGTH", help="Side of the plate of 'found' and 'pixels' (1m, assumed)."
        ),
    ] = None,
    reflectance: Annotated[
        float | None, typer.Option("--reflectance", help="Lambertian reflectance of the plate (0.3, assumed).")
    ] = None,
    keep_out: Annotated[
        str | None, typer.Option("--keep-out", metavar="LENGTH", help="Radius of 'keep_out', with its unit: 500m.")
    ] = None,
    min_duration: Annotated[
        float, typer.Option("--min-duration", metavar="S", help="Least duration of an event (s).")
    ] = 0.0,
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Greatest number of rows.")] = None,
    scenario: Annotated[
        int | None, typer.Option("--scenario", metavar="N", help="Write the scenario of row N to the .toml of -o.")
    ] = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write: table (.csv, .json), calendar (.ics), picture (.png), scenario (.toml); again for more.",
        ),
    ] = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """List the intervals in which conditions on two objects hold.

    The search covers days. Conditions are joined by and, or, not and parentheses. Range, speed, slew, sun, moon, limb,
    phase, angle(AXIS), elevation(STATION), pixels and found are compared with a number and its unit. Visible, sunlit,
    penumbra, umbra, lit, contact(STATION), field, beam, regard, keep_out, corridor and plume(ANGLE, RANGE) hold or do
    not. All words are in small letters.
    """
    if follower is not None and all_pairs:
        raise ScenarioError("events: --follower and --all-pairs exclude each other; leave one out")
    if follower is None and not all_pairs:
        if len(catalog) != 1 or catalog[0].suffix.lower() != ".toml":
            raise ScenarioError("events: needs the object with the lidar; give --follower or --all-pairs")
        follower = str(catalog[0])
    chosen = check_settings(settings, (*catalog, follower, lidar))
    outputs = _check_outputs(output or [], scenario, overwrite)
    refuse_inputs(outputs, (*catalog, follower, lidar))
    scheme = choose_scheme(dark, outputs)
    start_utc = None if start is None else parse_instant("--start", start)
    stations = [_parse_station(text) for text in station or ()]
    instrument = {} if lidar is None else _load_instrument(lidar, chosen)
    keep_out_m = None if keep_out is None else parse_length_m("--keep-out", keep_out)
    if keep_out_m is not None and not keep_out_m > 0.0:
        raise ScenarioError(f"--keep-out {keep_out}: is not a radius; give more than 0")
    with name_options(*_ARGUMENTS):
        plate = ViewedPlate(None if target_size is None else parse_length_m("--target-size", target_size), reflectance)
        table = find(
            catalog[0] if len(catalog) == 1 else catalog,
            Path(follower) if follower is not None and Path(follower).is_file() else follower,
            when,
            start_utc=start_utc,
            days=days,
            stations=stations,
            keep_out_m=keep_out_m,
            min_duration_s=min_duration,
            limit=limit,
            plate=plate,
            settings=chosen,
            trust_code=trust_code,
            trust_fmu=trust_fmu,
            **instrument,
        )
    print_events(table)
    for place in outputs:
        if place.suffix.lower() != ".toml":
            echo(f"{table.save(place, overwrite=overwrite, scheme=scheme)}")
    for place in outputs:  # last: a row without a scenario costs neither the table nor the files above
        if place.suffix.lower() == ".toml" and scenario is not None:
            echo(f"{write_text(place, event_scenario_text(table, scenario), overwrite=overwrite)}")


def print_events(table: Events) -> None:
    """Print the table of events in the columns that fit."""
    heads, rows = table.cells()
    PrintedTable(table.title, heads, rows, table.TEXT_HEADS, _TELLING, _NAMING, table.notes(), "no event found").print()


def _check_outputs(outputs: Sequence[Path], scenario: int | None, overwrite: bool) -> list[Path]:
    """Check that all outputs can be written, and that a scenario is among them if and only if a row is given."""
    places = [check_writable(place, (*Events.SUFFIXES, ".toml"), overwrite=overwrite) for place in outputs]
    if len(set(places)) < len(places):
        raise ScenarioError(f"-o {places[0]}: is given twice; name each output once")
    if (scenario is not None) != any(place.suffix.lower() == ".toml" for place in places):
        raise ScenarioError("--scenario and a .toml of -o go together; give the row's number and the file to write")
    return places


def _parse_station(text: str) -> GroundStation:
    """Parse a ground station, such as ``Graz=47.07,15.49,540,10``."""
    name, equals, rest = text.partition("=")
    try:
        numbers = [float(word) for word in rest.split(",")]
    except ValueError:
        numbers = []
    if not equals or not name.strip().replace("_", "").replace("-", "").isalnum() or not 2 <= len(numbers) <= 4:
        raise ScenarioError(
            f"--station {text}: is not a station; write a name of letters and digits, latitude, longitude, and height and "
            "least elevation if you like: Graz=47.07,15.49,540,10"
        )
    try:
        latitude_deg, longitude_deg, height_m, least_deg = (*numbers, 0.0, 0.0)[:4]
        return GroundStation(latitude_deg, longitude_deg, height_m, least_deg, name=name.strip())
    except ScenarioError as error:
        raise ScenarioError(f"--{error}") from None


def _load_instrument(text: str, settings: tuple[str, ...]) -> dict[str, Any]:
    """Load a camera by name, or camera, constraints and finding of a scenario file with settings."""
    camera: Lidar
    constraints: Constraints | None
    finding: Finding | None = None
    camera, constraints = load_lidar(text, settings)
    if text not in load_presets():
        finding = Scenario.load(text, settings).finding
    return {"lidar": camera, "lidar_name": text, "constraints": constraints, "finding": finding}
