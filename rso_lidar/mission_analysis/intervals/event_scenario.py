"""The scenario file of one event, with both motions inline and the PTU pointed at the object."""

from __future__ import annotations

import datetime

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, make_printable
from rso_lidar.mission_analysis.intervals.event_table import Events
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M
from rso_lidar.mission_analysis.passes.pass_geometry import reach_m
from rso_lidar.mission_analysis.passes.pass_table import Encounters
from rso_lidar.mission_analysis.passes.scenario_lines import (
    choose_run,
    write_cautions,
    write_motion,
    write_scenario,
    write_size,
)
from rso_lidar.orbit import ElementSet


def event_scenario_text(table: Events, number: int) -> str:
    """Write the scenario file (TOML) of one event.

    It covers the event, at most 20 minutes about the least range. Element sets fly by SGP4; a trajectory flies by two-body
    motion from its state at the least range. The follower's +x points at the object then, and the PTU tracks it.

    Parameters
    ----------
    table : the events
    number : row of the event, from 1

    Returns
    -------
    str
        TOML, which `Scenario.loads` reads.

    Raises
    ------
    ScenarioError
        For a row that does not exist, and for objects at one place.
    """
    if not table.rows:
        raise ScenarioError(f"scenario {number}: no event to write; loosen the expression, or search more days")
    if not 1 <= number <= len(table.rows):
        raise ScenarioError(
            f"scenario {number}: there are {len(table.rows)} rows; give a number from 1 to {len(table.rows)}"
        )
    row = table.rows[number - 1]
    if row.nearest_m < TOGETHER_M:
        raise ScenarioError(
            f"scenario {number}: {row.label} and {row.follower_label} are at one place; give another row"
        )
    start_utc, duration_s = choose_run(table.start_utc, (row.from_s, row.to_s), row.nearest_s)
    at_utc = table.start_utc.astimezone(datetime.UTC) + datetime.timedelta(seconds=row.nearest_s)
    own, target = row.states
    line, rate = target.position_m - own.position_m, target.velocity_m_s - own.velocity_m_s
    slew_deg_s = float(np.linalg.norm(np.cross(line, rate)) / np.sum(line**2)) / units.DEG
    limit_deg_s = Encounters.MAX_SLEW_DEG_S
    facts = [
        f"# {row.event}: {row.follower_label} and {row.label}, {row.begin_utc} to {row.end_utc}:",
        f"# row {number} of {len(table.rows)}, of {' '.join(table.title.split())},",
        f"# when {table.expressions[row.event]}.",
        f"# Least range {row.nearest_m / units.KM:.3f} km at {row.nearest_utc}, at {row.speed_m_s:.1f} m/s; "
        f"lit {100.0 * row.lit_fraction:.0f} % of the event.",
        *(
            f"# The {who} has a trajectory of its own. Here it flies by two-body motion from its state at the least range."
            for who, entry in zip(("follower", "object"), row.entries, strict=True)
            if not isinstance(entry, ElementSet)
        ),
    ]
    lines = [
        *map(make_printable, facts),  # a foreign name must not end a comment's line
        *write_cautions(row.nearest_m, reach_m(table.lidar), slew_deg_s, limit_deg_s),
        *write_scenario(
            f"{row.label} seen from {row.follower_label}, {row.nearest_m / units.KM:.3g} km",
            row.norad_id % 2**31,
            start_utc,
            duration_s,
            (row.name, row.norad_id),
            (write_motion(row.entries[1], target, at_utc), write_motion(row.entries[0], own, at_utc)),
            row.states,
            table.lidar,
            max_slew_deg_s=limit_deg_s,
            slew_source="the rate of the drive is assumed",
            size=write_size(table.light),
        ),
    ]
    return "\n".join(lines)
