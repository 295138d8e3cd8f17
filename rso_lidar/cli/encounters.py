"""`rso-lidar encounters`: close approaches of one object to others, or of any two."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from rso_lidar.cli.arguments import (
    Camera,
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
from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.files import check_suffix, check_writable, write_text
from rso_lidar.picture import FIGURE_SUFFIXES, save_figure
from rso_lidar.scenario import Constraints, Finding, Lidar, Scenario, load_presets
from rso_lidar.study import Encounters, ViewedPlate, scenario_text
from rso_lidar.study import encounters as find

_GREATEST_KEEP_OUT_M = 1e7
_ORDERS = ("range", "time", "speed")
_ARGUMENTS = (
    "within",
    "start",
    "days",
    "max_slew",
    "target_size",
    "reflectance",
    "flash_rate",
)  # which are options too
_NAMING = 5  # columns that identify an encounter and its range
# Columns in order of importance, for terminals that are too narrow for all of them.
_TELLING = (
    *(
        "#",
        "follower",
        "object",
        "closest approach, UTC",
        "range, km",
        "Pc",
        "found",
        "breaks",
        "light",
        "usable, s",
        "speed, m/s",
    ),
    *(
        "norad",
        "photons",
        "pixels",
        "lidar, s",
        "phase, deg",
        "slew, deg/s",
        "clear, s",
        "inside, s",
        "Moon, deg",
        "limb, deg",
        "age, d",
    ),
)
_USED = ("#", "Pc", "by", "Foster", "3-D", "sigma, m", "Mahalanobis", "greatest Pc", "radius, m")


def encounters(
    catalog: Annotated[
        list[Path],
        typer.Argument(
            metavar="CATALOG...",
            help="Files of element sets (TLE, OMM), orbits (OEM, OPM, CSV) and scenarios (TOML): all bodies in them.",
        ),
    ],
    within: Annotated[str, typer.Option("--within", help="Greatest range, with its unit: 50km, 500m.")],
    start: Annotated[str, typer.Option("--start", help="Begin, such as 2026-05-07T00:00:00Z.")],
    follower: Annotated[
        str | None,
        typer.Option(
            "--follower", metavar="ID|FILE", help="Object with the lidar: catalogue number, name, or its file."
        ),
    ] = None,
    all_pairs: Annotated[
        bool, typer.Option("--all-pairs", help="Every two objects, the lidar on the first, instead of --follower.")
    ] = False,
    days: Annotated[float, typer.Option("--days", help="Length of the search [days].")] = 1.0,
    lidar: Camera = "long_range_1064",
    target_size: Annotated[
        str | None,
        typer.Option(
            "--target-size",
            metavar="LENGTH",
            help="Side of the plate that is looked at, and of --scenario's target (1m, assumed).",
        ),
    ] = None,
    reflectance: Annotated[
        float | None, typer.Option("--reflectance", help="Lambertian reflectance of the plate (0.3, assumed).")
    ] = None,
    flash_rate: Annotated[
        float | None,
        typer.Option(
            "--flash-rate", metavar="HZ", help="Flashes a second (the scenario's of --lidar, else 1, assumed)."
        ),
    ] = None,
    sun_exclusion: Annotated[
        float | None, typer.Option("--sun-exclusion", metavar="DEG", help="Exclusion angle about the Sun (deg).")
    ] = None,
    moon_exclusion: Annotated[
        float | None, typer.Option("--moon-exclusion", metavar="DEG", help="Exclusion angle about the Moon (deg).")
    ] = None,
    earth_exclusion: Annotated[
        float | None,
        typer.Option("--earth-exclusion", metavar="DEG", help="Exclusion angle about the Earth's limb (deg)."),
    ] = None,
    keep_out: Annotated[
        str | None, typer.Option("--keep-out", metavar="LENGTH", help="Keep-out radius, with its unit: 500m.")
    ] = None,
    radius: Annotated[
        str | None,
        typer.Option(
            "--radius", metavar="LENGTH", help="Combined hard-body radius, with its unit: 10m. Adds Pc to the table."
        ),
    ] = None,
    hard_body: Annotated[
        list[str] | None,
        typer.Option(
            "--hard-body", metavar="OBJECT=MODEL|LENGTH", help="Radius of one object: its model's, or a length, as 2m."
        ),
    ] = None,
    covariance: Annotated[
        list[str] | None,
        typer.Option(
            "--covariance",
            metavar="[OBJECT=]FILE",
            help="Covariances: OEM, OPM, CDM, element sets with their history, or a table by age (CSV).",
        ),
    ] = None,
    sunlit: Annotated[bool, typer.Option("--sunlit", help="Only objects in sunlight at the closest approach.")] = False,
    min_duration: Annotated[
        float, typer.Option("--min-duration", metavar="S", help="Least duration of a stay (s).")
    ] = 0.0,
    max_slew: Annotated[
        float, typer.Option("--max-slew", metavar="DEG_S", help="Greatest rate of the line of sight (deg/s).")
    ] = Encounters.MAX_SLEW_DEG_S,
    sort: Annotated[
        str, typer.Option("--sort", help="Order: range, time or speed.", autocompletion=lambda: list(_ORDERS))
    ] = "range",
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Greatest number of rows.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write all columns to this file (.csv).")] = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw range over time to this file (.png).")] = None,
    scenario: Annotated[
        int | None, typer.Option("--scenario", metavar="N", help="Write the scenario of row N to the file of -o.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File to write: the table (.csv, .json), a picture (.png) or, with --scenario, .toml.",
        ),
    ] = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """List close approaches of one object to others, or of any two."""
    if (follower is None) != all_pairs:
        wrong = (
            "needs the object with the lidar" if follower is None else "--follower and --all-pairs exclude each other"
        )
        raise ScenarioError(f"encounters: {wrong}; give --follower or --all-pairs")
    json: Path | None = None
    if scenario is None and output is not None:  # the suffix says what is meant
        suffix = output.suffix.lower()
        if suffix == ".csv" and csv is None:
            csv, output = output, None
        elif suffix == ".json":
            json, output = output, None
        elif suffix in FIGURE_SUFFIXES and plot is None:
            plot, output = output, None
        elif suffix != ".toml":
            check_suffix(output, (".csv", ".json", *FIGURE_SUFFIXES, ".toml"))
            raise ScenarioError(f"-o {output}: --{'csv' if suffix == '.csv' else 'plot'} names another; leave one out")
    scheme = choose_scheme(dark, [plot])
    if (scenario is None) != (output is None):
        raise ScenarioError("--scenario and -o go together; give the row's number and the file to write")
    if sort not in _ORDERS:
        raise ScenarioError(f"--sort {sort}: unknown order{did_you_mean(sort, _ORDERS)} (known: {', '.join(_ORDERS)})")
    within_m, start_utc = parse_length_m("--within", within), parse_instant("--start", start)
    chosen = check_settings(settings, (*catalog, follower, lidar))
    camera, asked, finding, rate_hz = _load_camera(lidar, chosen)
    with name_options(*_ARGUMENTS):
        plate = ViewedPlate(
            None if target_size is None else parse_length_m("--target-size", target_size),
            reflectance,
            rate_hz if flash_rate is None else flash_rate,
        )
    angles = {"sun": sun_exclusion, "moon": moon_exclusion, "earth": earth_exclusion}
    asked = _choose_constraints(asked, angles, None if keep_out is None else parse_length_m("--keep-out", keep_out))
    if not min_duration >= 0.0:
        raise ScenarioError(f"--min-duration {min_duration:g}: is not a duration; give 0 or more seconds")
    places = (("--csv", csv, ".csv"), ("--plot", plot, ""), ("-o", output, ".toml"), ("-o", json, ".json"))
    for option, place, suffix in places:
        if place is not None:
            if suffix and place.suffix.lower() != suffix:
                raise ScenarioError(f"{option} {place}: is written as {suffix[1:].upper()}; end its name with {suffix}")
            check_writable(place, FIGURE_SUFFIXES if option == "--plot" else (), overwrite=overwrite)
    sources = _name_sources(covariance)
    stated = [source if isinstance(source, str) else source[1] for source in sources or ()]
    refuse_inputs((csv, plot, output, json), (*catalog, follower, lidar, *stated))
    radius_m = None if radius is None else parse_length_m("--radius", radius)
    named = [_split_name("--hard-body", text) for text in hard_body or ()]
    bodies = dict(named)
    if len(bodies) < len(named):
        raise ScenarioError("--hard-body: names an object twice; give one value for each")
    with name_options(*_ARGUMENTS):
        table = find(
            catalog[0] if len(catalog) == 1 else catalog,
            Path(follower) if follower is not None and Path(follower).is_file() else follower,
            within_m=within_m,
            start_utc=start_utc,
            days=days,
            lidar=camera,
            lidar_name=lidar,
            max_slew_deg_s=max_slew,
            constraints=asked,
            sunlit=sunlit,
            min_duration_s=min_duration,
            sort=sort,  # type: ignore[arg-type]
            limit=limit,
            plate=plate,
            finding=finding,
            radius_m=radius_m,
            hard_bodies=bodies or None,
            covariances=sources,
            settings=chosen,
            trust_code=trust_code,
            trust_fmu=trust_fmu,
        )
    print_encounters(table)
    if csv is not None:
        echo(f"{table.csv(csv, overwrite=overwrite)}")
    if json is not None:
        echo(f"{table.json(json, overwrite=overwrite)}")
    if plot is not None and not all(row.docked for row in table.rows):
        echo(f"{save_figure(table.figure(), plot, scheme=scheme)}")
    elif plot is not None:
        echo("no picture written: no encounter to draw", err=True)
    # Last: a row without a scenario, such as docked craft, costs neither the table nor the files above.
    if scenario is not None and output is not None and (table.rows or scenario < 1):
        echo(f"{write_text(output, scenario_text(table, scenario), overwrite=overwrite)}")
    elif scenario is not None:
        echo("no scenario written")


def print_encounters(table: Encounters) -> None:
    """Print the table of encounters in the columns that fit."""
    heads, rows = table.cells()
    PrintedTable(
        table.title, heads, rows, table.TEXT_HEADS, _TELLING, _NAMING, table.notes(), "no encounter found"
    ).print()
    heads, rows = table.collision_cells()
    if rows:
        PrintedTable("what was used for Pc", heads, rows, table.TEXT_HEADS, _USED, 4, (), "").print()


def _split_name(option: str, text: str) -> tuple[str, str]:
    """Split the name of an object from what an option says of it."""
    name, equals, rest = (part.strip() for part in text.partition("="))
    if not (name and equals and rest):
        raise ScenarioError(f"{option} {text}: needs an object and a value; write for example 25544=2m")
    return name, rest


def _name_sources(texts: list[str] | None) -> list[Any] | None:
    """Return the sources of covariances of the options: files, with the name of an object where one is given."""
    if not texts:
        return None
    return [text if "=" not in text or Path(text).is_file() else _split_name("--covariance", text) for text in texts]


def _load_camera(
    text: str, settings: tuple[str, ...]
) -> tuple[Lidar, Constraints | None, Finding | None, float | None]:
    """Load a camera by name, or camera, constraints, finding and frames per second of a scenario file with settings."""
    camera, asked = load_lidar(text, settings)
    if text in load_presets():
        return camera, asked, None, None
    scenario = Scenario.load(text, settings)
    return camera, asked, scenario.finding, scenario.time.frame_rate_hz


def _choose_constraints(
    asked: Constraints | None, angles_deg: Mapping[str, float | None], keep_out_m: float | None
) -> Constraints | None:
    """Return the constraints of a scenario file, overridden by those of the options.

    Parameters
    ----------
    angles_deg : angles of options, by name [deg]
    keep_out_m : keep-out distance of an option [m]
    """
    changes: dict[str, Any] = {}
    for name, angle in angles_deg.items():
        if angle is not None:
            if not 0.0 < angle < 180.0:
                raise ScenarioError(
                    f"--{name}-exclusion {angle:g}: is not an angle to keep; give degrees over 0, under 180"
                )
            changes[f"{name}_exclusion_deg"] = angle
    if keep_out_m is not None:
        if not 0.0 < keep_out_m <= _GREATEST_KEEP_OUT_M:
            raise ScenarioError(f"--keep-out: {keep_out_m:g} m is not a radius; give more than 0 and at most 10,000 km")
        changes["keep_out_m"] = keep_out_m
    return (asked or Constraints()).replace(**changes) if changes else asked
