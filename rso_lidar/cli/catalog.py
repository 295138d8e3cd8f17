"""`rso-lidar catalog`: contents and problems of a file of element sets, and selections from it."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import units
from rso_lidar.cli.arguments import Overwrite, parse_instant
from rso_lidar.cli.terminal import echo, to_one_line
from rso_lidar.errors import CatalogError, ScenarioError, did_you_mean
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.orbit import Catalog, ElementSet, SetSequence, read_element_sets
from rso_lidar.study import estimate_set_errors
from rso_lidar.units import format_count

_FIRST = 10  # problems shown without --problems


def catalog(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File of element sets (TLE, or OMM).")],
    name: Annotated[
        str | None, typer.Option("--name", metavar="GLOB", help="A part of the name, or with * and ? the whole of it.")
    ] = None,
    ids: Annotated[
        list[str] | None, typer.Option("--id", metavar="N", help="Catalogue number; again, or with commas, for more.")
    ] = None,
    regime: Annotated[
        str | None,
        typer.Option(
            "--regime",
            metavar="NAME",
            help="Orbits: leo, meo, geo, heo or other.",
            autocompletion=lambda: list(Catalog.REGIMES),
        ),
    ] = None,
    near: Annotated[
        str | None, typer.Option("--near", metavar="UTC", help="Epochs about this time, within --max-age-days.")
    ] = None,
    max_age_days: Annotated[
        float | None,
        typer.Option("--max-age-days", metavar="D", help="Greatest distance of an epoch from --near (days)."),
    ] = None,
    jumps: Annotated[bool, typer.Option("--jumps", help="Jumps of each --id from one set to the next.")] = False,
    errors: Annotated[
        bool, typer.Option("--errors", help="Differences between the sets of each --id by their age, as their errors.")
    ] = False,
    problems: Annotated[bool, typer.Option("--problems", help=f"All bad records, not the first {_FIRST}.")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write these sets: OMM as .json, .csv, .xml or .kvn, or .tle.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """List the objects of a catalogue, or write a selection of them. Bad records are listed too."""
    if (near is None) != (max_age_days is None):
        raise ScenarioError("--near and --max-age-days go together; give the time, and how far from it")
    if max_age_days is not None and not 0.0 <= max_age_days < math.inf:
        raise ScenarioError(f"--max-age-days {max_age_days:g}: is not an age; give 0 or more days")
    if regime is not None and regime not in Catalog.REGIMES:
        guess = did_you_mean(regime, Catalog.REGIMES)
        raise ScenarioError(f"--regime {regime}: unknown regime{guess or ';'} (known: {', '.join(Catalog.REGIMES)})")
    numbers = _parse_numbers(ids or [])
    for option, wanted in (("--jumps", jumps), ("--errors", errors)):
        if wanted and not numbers:
            raise ScenarioError(f"{option}: is about one object; name it with --id")
    if output is not None:
        output = check_writable(output, Catalog.SUFFIXES, overwrite=overwrite)
    at = None if near is None else parse_instant("--near", near)
    whole = Catalog.from_file(file)
    _check_known(whole, file, numbers)
    chosen = whole.filter(
        name=name,
        norad_id=numbers or None,
        regime=regime,  # type: ignore[arg-type]
        max_age_days=max_age_days,
        at=at,
    )
    objects = _group_objects(chosen)
    if output is not None and not chosen.sets:
        raise CatalogError(f"{file}: no good element set is left to write; loosen --name, --regime or --max-age-days")
    lines = _format_table(objects)
    if jumps:
        lines += [line for sets in objects for line in _describe_jumps(sets)]
    if errors:
        lines += [line for sets in objects for line in estimate_set_errors(sets).table().splitlines()]
    if output is not None:  # first, so that what cannot be written is all that is said
        _write(chosen, output)
    for line in (*lines, _summarise(file, whole, chosen, len(objects))):
        echo(line)
    shown = whole.problems if problems else whole.problems[:_FIRST]
    for problem in shown:
        echo(to_one_line(f"bad: {problem}"))
    if len(shown) < len(whole.problems):
        echo(f"and {len(whole.problems) - len(shown):,} more bad records; give --problems for all")
    if output is not None:
        echo(f"{output}")


def compute_heights_km(entry: ElementSet) -> tuple[float, float]:
    """Compute perigee and apogee heights [km] above the equatorial radius.

    Kepler's third law is applied to the mean motion of SGP4, as catalogues do. The result is within some 10 km of the
    osculating orbit.
    """
    per_second = 2.0 * math.pi * entry.mean_motion_rev_day / units.DAY_S
    axis_m = math.cbrt(units.EARTH_GM_M3_S2 / per_second**2)
    low, high = axis_m * (1.0 - entry.eccentricity), axis_m * (1.0 + entry.eccentricity)
    return (low - units.EARTH_RADIUS_M) / units.KM, (high - units.EARTH_RADIUS_M) / units.KM


def _parse_numbers(words: Sequence[str]) -> list[int]:
    """Parse the catalogue numbers of an option."""
    numbers = []
    for word in (word for option in words for word in option.replace(",", " ").split() or [option]):
        if not (word.isascii() and word.isdigit() and 0 < len(word) <= 9):
            raise ScenarioError(f"--id {word}: is not a catalogue number; give up to nine digits, such as 25544")
        numbers.append(int(word))
    return numbers


def _check_known(whole: Catalog, file: Path, numbers: Sequence[int]) -> None:
    """Check that catalogue numbers are in a file, and not in bad records only.

    Raises
    ------
    CatalogError
        For the first number that is not.
    """
    held = {entry.norad_id for entry in whole}
    for number in numbers:
        if number in held:
            continue
        bad = next((entry for entry in read_element_sets(file) if entry.norad_id == number and entry.problem), None)
        if bad is not None:
            raise CatalogError(str(bad.problem))
        guess = did_you_mean(str(number), map(str, held))
        raise CatalogError(f"{file}: no object {number} among {len(held):,}{guess or '; check the number'}")


def _group_objects(chosen: Catalog) -> list[list[ElementSet]]:
    """Group sets by object: objects in the order of the file, sets in the order of their epochs."""
    grouped: dict[object, list[ElementSet]] = {}
    for entry in chosen:
        grouped.setdefault(entry.identity, []).append(entry)
    return [sorted(sets, key=lambda entry: (entry.epoch_utc, entry.epoch_rest_ns)) for sets in grouped.values()]


def _format_table(objects: Sequence[Sequence[ElementSet]]) -> list[str]:
    """Format a table with one row per object, for its newest set."""
    if not objects:
        return ["no object found"]
    rows = [("name", "norad", "regime", "perigee x apogee, km", "incl, deg", "sets", "epoch, UTC")]
    for sets in objects:
        newest = sets[-1]
        low, high = compute_heights_km(newest)
        epochs = [f"{entry.epoch_utc:%Y-%m-%dT%H:%MZ}" for entry in sets]
        rows.append(
            (
                newest.name or "-",
                str(newest.norad_id),
                newest.regime,
                f"{low:,.0f} x {high:,.0f}",
                f"{newest.inclination_deg:.2f}",
                str(len(sets)),
                epochs[0] if len(sets) == 1 else f"{epochs[0]} to {epochs[-1]}",
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = (0, 2, 6)
    return [
        "  ".join(
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _describe_jumps(sets: Sequence[ElementSet]) -> list[str]:
    """Describe each switch from one set of an object to the next, a line each."""
    if len(sets) == 1:
        return [f"{sets[0].label}: one set, no jump"]
    lines = [f"{sets[0].label}: {len(sets)} sets, which give way to the next half-way between their epochs:"]
    for jump in SetSequence(tuple(sets)).jumps():
        size = f"jumps {jump.position_m:,.0f} m and {jump.velocity_m_s:.2f} m/s"
        lines.append(
            f"  {jump.at_utc:%Y-%m-%dT%H:%M:%SZ}  {'SGP4 has no state there' if math.isnan(jump.position_m) else size}"
        )
    return lines


def _summarise(file: Path, whole: Catalog, chosen: Catalog, count: int) -> str:
    """Summarise a file and the selection from it in one line."""
    left = "" if len(chosen) == len(whole) else f" ({len(chosen):,} of them requested)"
    return (
        f"{file.name}: {format_count(len(whole), 'good element set')}{left}, {format_count(count, 'object')}; "
        f"{format_count(whole.duplicates, 'duplicate')}, {format_count(len(whole.problems), 'bad record')}"
    )


def _write(chosen: Catalog, output: Path) -> None:
    """Write the sets completely or not at all."""
    with write_atomically(output) as draft:
        try:
            chosen.write(draft)
        except CatalogError as error:
            raise CatalogError(str(error).replace(str(draft), str(output))) from None
