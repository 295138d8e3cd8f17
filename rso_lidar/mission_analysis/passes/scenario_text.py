"""The scenario file of one encounter, with both element sets inline and the PTU pointed at the object."""

from __future__ import annotations

import math

from rso_lidar import units
from rso_lidar.errors import ScenarioError, make_printable
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M, keep_out_radius_m, select_rtn_corridors
from rso_lidar.mission_analysis.passes.pass_geometry import Encounter
from rso_lidar.mission_analysis.passes.pass_table import Encounters
from rso_lidar.mission_analysis.passes.scenario_lines import (
    choose_run,
    name_target,
    write_cautions,
    write_motion,
    write_scenario,
    write_size,
)


def scenario_text(table: Encounters, number: int) -> str:
    """Write the scenario file (TOML) of one encounter.

    The scenario covers the time in the lidar's reach, or else the time within the distance limit. It lasts at most 20
    minutes about the closest approach. The follower's +x points at the object at the closest approach. Its pan axis
    is then the axis about which the line of sight turns.

    Parameters
    ----------
    table : the encounters
    number : row of the encounter, from 1

    Returns
    -------
    str
        TOML, which `Scenario.loads` reads.

    Raises
    ------
    ScenarioError
        For a row that does not exist, and for objects that are docked to the follower.
    """
    if not table.rows:
        raise ScenarioError(f"scenario {number}: no encounter to write; search a greater range or more days")
    if not 1 <= number <= len(table.rows):
        raise ScenarioError(
            f"scenario {number}: there are {len(table.rows)} rows; give a number from 1 to {len(table.rows)}"
        )
    row = table.rows[number - 1]
    _check_separate(table, number)
    reach_s = row.span_s if math.isfinite(row.span_s[0]) else (row.stay.enter_s, row.stay.leave_s)
    start_utc, duration_s = choose_run(table.start_utc, reach_s, row.time_s)
    at_utc = row.closest_at(table.start_utc)
    lines = [
        *map(make_printable, _write_facts(table, number)),  # a foreign name must not end a comment's line
        *map(make_printable, _write_warnings(table, row)),
        *write_scenario(
            f"{row.label} past {row.follower_label}, {row.range_m / units.KM:.3g} km",
            row.norad_id % 2**31,
            start_utc,
            duration_s,
            (row.name, row.norad_id),
            (write_motion(row.elements, row.states[1], at_utc), write_motion(row.follower, row.states[0], at_utc)),
            row.states,
            table.lidar,
            max_slew_deg_s=table.max_slew_deg_s,
            slew_source="the rate of the drive is the limit that was asked about",
            size=write_size(table.light),
        ),
        *_write_constraints(table, name_target(row.name, row.norad_id)),
    ]
    return "\n".join(lines)


def _check_separate(table: Encounters, number: int) -> None:
    """Raise `ScenarioError` for a docked object, and for one with the follower's elements at the closest approach."""
    row = table.rows[number - 1]
    whom = f"{row.label} and {row.follower_label}"
    if row.docked:
        raise ScenarioError(f"scenario {number}: {whom} are docked or one object: {row.docked}; give another row")
    if row.range_m < TOGETHER_M:
        raise ScenarioError(
            f"scenario {number}: at the closest approach the catalogue gives {whom} the same elements, so that they are "
            "docked there or one object; give another row, or a span after they part"
        )


def _write_facts(table: Encounters, number: int) -> list[str]:
    """Write the comments that describe the encounter and its accuracy."""
    row = table.rows[number - 1]
    light = "in sunlight" if row.sunlit_fraction >= 0.5 else "in the Earth's shadow"
    phase = "" if math.isnan(row.phase_deg) else f", {row.phase_deg:.0f} deg between Sun and follower at the object"
    inside = f"{row.inside_s:,.1f} s" + ("" if row.entered and row.left else " and more")
    return [
        f"# {row.label}{f' (NORAD {row.norad_id})' if row.name and row.norad_id else ''} past {row.follower.label}:",
        f"# row {number} of {len(table.rows)}, of {' '.join(table.title.split())}.",
        f"# Closest approach {row.closest_utc}: {row.range_m / units.KM:.3f} km at {row.speed_m_s:.1f} m/s, {light}{phase}.",
        f"# It is within {table.within_m / units.KM:g} km for {inside}, in the lidar's reach for {row.lidar_s:,.1f} s; the "
        f"line of sight turns at {row.slew_deg_s:.3g} deg/s.",
        *_write_ages(row),
        "# A plausible encounter, not a prediction.",
    ]


def _write_ages(row: Encounter) -> list[str]:
    """Write the comments on element sets and their ages, and on trajectories that a scenario cannot hold."""
    ages = {"object": row.age_days, "follower": row.follower_age_days}
    known = {who: days for who, days in ages.items() if math.isfinite(days)}
    lines = [
        f"# The {who} has a trajectory of its own. Here it flies by two-body motion from its state at the closest approach."
        for who in ages
        if who not in known
    ]
    if known:
        who = "Both fly by element sets" if len(known) == 2 else f"The {next(iter(known))} flies by an element set"
        parts = ", ".join(f"the {role}'s {_format_age(days)}" for role, days in known.items())
        lines += [
            f"# {who}, which are good to about a kilometre at their epochs and worse away from them:",
            f"# {parts} the closest approach.",
        ]
    return lines


def _format_age(days: float) -> str:
    """Format the age of elements as days before or after."""
    return f"{abs(days):.1f} days {'before' if days >= 0.0 else 'after'}"


def _write_warnings(table: Encounters, row: Encounter) -> list[str]:
    lines = write_cautions(row.range_m, table.reach_m, row.slew_deg_s, table.max_slew_deg_s)
    if row.breaks:
        lines.append(f"# BEWARE: at the closest approach it violates [constraints]: {', '.join(row.breaks)}.")
    return lines


def _write_constraints(table: Encounters, name: str) -> list[str]:
    """Write the constraints for this target, without corridors in axes that an element set does not determine."""
    if table.constraints is None:
        return []
    import tomli_w

    tree = table.constraints.model_dump(exclude={"keep_out_m", "corridor"}, exclude_unset=True, exclude_none=True)
    radius_m = keep_out_radius_m(table.constraints)
    if radius_m is not None:
        tree["keep_out_m"] = radius_m
    corridors = [corridor.replace(target=name) for corridor in select_rtn_corridors(table.constraints)]
    if corridors:
        tree["corridor"] = [corridor.model_dump(exclude_unset=True, exclude_none=True) for corridor in corridors]
    return [tomli_w.dumps({"constraints": tree})] if tree else []
