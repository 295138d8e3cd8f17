"""The scenario file of a conjunction data message: both objects by their states, and the PTU pointed at the other one."""

from __future__ import annotations

import datetime
import math

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, make_printable
from rso_lidar.mission_analysis.passes.conjunction_assessment import ConjunctionAssessment
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M
from rso_lidar.mission_analysis.passes.pass_geometry import reach_m
from rso_lidar.mission_analysis.passes.scenario_lines import (
    LONGEST_RUN_S,
    SHORTEST_RUN_S,
    write_cautions,
    write_motion,
    write_scenario,
)
from rso_lidar.orbit import ConjunctionObject, format_utc
from rso_lidar.scenario import Lidar

MAX_SLEW_DEG_S = 30.0  # of the drive that the file gives


def conjunction_scenario_text(
    conjunction: ConjunctionAssessment, follower: int = 1, *, lidar: Lidar | None = None, seed: int = 0
) -> str:
    """Write the scenario file (TOML) of a conjunction.

    Both objects move by two-body motion from the states of the message. The run covers the time in the lidar's reach, or
    else ten seconds, about the closest approach, and at most 20 minutes. The follower's +x points at the other object at
    the closest approach.

    Parameters
    ----------
    conjunction : the assessed message
    follower : which object carries the lidar, 1 or 2

    Other Parameters
    ----------------
    lidar : instrument (None: the preset ``long_range_1064``)
    seed : of all noise

    Returns
    -------
    str
        TOML, which `Scenario.loads` reads.

    Raises
    ------
    ScenarioError
        For another object than 1 or 2, and for states that are equal.
    """
    if isinstance(follower, bool) or follower not in (1, 2):
        raise ScenarioError(f"follower: {follower!r:.40}: a conjunction has two objects; give 1 or 2")
    if conjunction.miss_m < TOGETHER_M:
        raise ScenarioError("conjunction: both states are equal, so there is no line of sight; correct the message")
    message = conjunction.message
    pair = (message.first, message.second)
    own, other = pair[follower - 1], pair[2 - follower]
    if lidar is None:
        lidar = Lidar(preset="long_range_1064")  # type: ignore[call-arg]
    near_m, far_m = reach_m(lidar)
    start_utc, duration_s = _choose_time(conjunction, far_m)
    slew_deg_s = conjunction.speed_m_s / conjunction.miss_m / units.DEG
    lines = [
        *map(make_printable, _write_facts(conjunction, own, other)),
        *write_cautions(conjunction.miss_m, (near_m, far_m), slew_deg_s, MAX_SLEW_DEG_S),
        *write_scenario(
            f"{other.label} past {own.label}",
            seed,
            start_utc,
            duration_s,
            (other.name, other.norad_id),
            (write_motion(other, other.state, message.tca_utc), write_motion(own, own.state, message.tca_utc)),
            (own.state, other.state),
            lidar,
            max_slew_deg_s=MAX_SLEW_DEG_S,
            slew_source="assumed",
        ),
    ]
    return "\n".join(lines)


def _write_facts(conjunction: ConjunctionAssessment, own: ConjunctionObject, other: ConjunctionObject) -> list[str]:
    """Write the comments that describe the conjunction."""
    message = conjunction.message
    known = f" {message.message_id}" if message.message_id else ""
    by = f" of {message.originator}" if message.originator else ""
    sigma_m = [
        math.sqrt(float(np.trace(state.covariance[:3, :3]))) for state in (conjunction.first, conjunction.second)
    ]
    lines = [
        f"# {other.label} past {own.label}, from conjunction data message{known}{by}.",
        f"# Closest approach {format_utc(message.tca_utc, 0.0)}: {conjunction.miss_m:,.1f} m at "
        f"{conjunction.speed_m_s:,.1f} m/s.",
        f"# One standard deviation of position is {sigma_m[0]:,.0f} m for {message.first.label} and {sigma_m[1]:,.0f} m "
        f"for {message.second.label}.",
        "# Both move by two-body motion from the states of the message; this is its mean, and not what will happen.",
    ]
    if conjunction.foster is not None:
        lines.append(
            f"# Probability of collision by Foster: {conjunction.foster:.3g}, for a hard-body radius of "
            f"{conjunction.radius_m:g} m."
        )
    return lines


def _choose_time(conjunction: ConjunctionAssessment, reach: float) -> tuple[datetime.datetime, float]:
    """Return start (a whole second), and duration [s] for a reach [m]."""
    inside_m = math.sqrt(max(reach**2 - conjunction.miss_m**2, 0.0))
    half_s = inside_m / conjunction.speed_m_s if conjunction.speed_m_s > 0.0 else LONGEST_RUN_S
    half_s = min(max(half_s, 0.5 * SHORTEST_RUN_S), 0.5 * LONGEST_RUN_S)
    tca_utc = conjunction.message.tca_utc
    start_utc = (tca_utc - datetime.timedelta(seconds=half_s)).replace(microsecond=0)
    return start_utc, float(math.ceil(2.0 * half_s) + 1)
