"""Docked craft: objects that element sets cannot separate from the follower over the whole span of a screening."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rso_lidar import units
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M
from rso_lidar.mission_analysis.passes.pass_geometry import Encounter
from rso_lidar.orbit import PairScreening, ScreeningResult
from rso_lidar.pose import rotate_vectors
from rso_lidar.rpo import rtn_matrix

# One standard deviation of a set at its epoch, radial and cross-track [m]: Flohrer, Krag & Klinkrad, Assessment and
# Categorization of TLE Orbit Errors for the US SSN Catalogue (AMOS 2008). Low confidence: the values are quoted from memory
# and were not checked in the paper. Sets of one object at successive epochs support them: 90 % of 340 pairs of ISS and CSS
# of 2026 agree within 85 m, radial and cross-track, over a revolution.
_RADIAL_M = {"leo": 102.0, "meo": 71.0, "geo": 359.0, "heo": 2252.0, "other": 102.0}
_ACROSS_M = {"leo": 126.0, "meo": 95.0, "geo": 83.0, "heo": 1421.0, "other": 126.0}
# The along-track error grows with age: 1 km at the epoch, and up to 3 km per day (docs/orbits.md).
_ALONG_M, _ALONG_M_DAY = 1e3, 3e3
_STEP_S = 120.0
_NEAR_M = 20e3  # a closest approach beyond this is never attributed to errors of the sets


def fold_docked(screened: ScreeningResult | PairScreening, rows: Sequence[Encounter]) -> list[Encounter]:
    """Merge the encounters of each docked object into one row with the reason, after all other rows.

    An object counts as docked if its position relative to the follower stays within the errors of both sets. This must
    hold over the whole span, or over the part in which both have a state. Along-track errors are 1 km and 3 km per day
    for each set. Radial and cross-track errors are one standard deviation of the difference. They are three standard
    deviations where the catalogue gives both the same elements for a part of the span. A formation with an ellipse of
    some hundred metres (TerraSAR-X and TanDEM-X) does not count.

    Returns
    -------
    list of Encounter
        The others unchanged, then the closest one of each docked object, with NaN for what a lidar would see.
    """
    reasons: dict[tuple[int, int], str | None] = {}
    others: list[Encounter] = []
    docked: dict[tuple[int, int], list[Encounter]] = {}
    for row in rows:
        pair = row.stay.lead, row.stay.which
        if pair not in reasons:
            reasons[pair] = _explain_docking(screened, *pair) if row.range_m < _NEAR_M else None
        if reasons[pair] is None:
            others.append(row)
        else:
            docked.setdefault(pair, []).append(row)
    return others + [_merge_stays(stays, str(reasons[pair])) for pair, stays in docked.items()]


def _merge_stays(stays: Sequence[Encounter], reason: str) -> Encounter:
    nearest = min(stays, key=lambda row: row.range_m)
    first, last = min(stays, key=lambda row: row.stay.enter_s), max(stays, key=lambda row: row.stay.leave_s)
    return replace(
        nearest,
        from_utc=first.from_utc,
        to_utc=last.to_utc,
        entered=first.entered,
        left=last.left,
        inside_s=sum(row.inside_s for row in stays),
        minima=sum(row.minima for row in stays),
        switches=sum(row.switches for row in stays),
        docked=reason,
        lidar_s=math.nan,
        slew_s=math.nan,
        clear_s=math.nan,
        usable_s=math.nan,
        photons=math.nan,
        target_pixels=math.nan,
        background_photons_per_s=math.nan,
        detection_probability=math.nan,
        best_probability=math.nan,
        found_probability=math.nan,
    )


def _explain_docking(screened: ScreeningResult | PairScreening, own_number: int, which: int) -> str | None:
    """Explain why two objects count as docked; None where they do not, and for trajectories that differ."""
    lead, objects = screened.follower, screened.objects
    time_s = np.append(np.arange(0.0, objects.duration_s, _STEP_S), objects.duration_s)
    own, there = np.full(len(time_s), own_number), np.full(len(time_s), which)
    position, velocity = lead.at(own, time_s)
    apart = rotate_vectors(
        np.swapaxes(rtn_matrix(position, velocity)[0], -1, -2), objects.at(there, time_s)[0] - position
    )
    known = np.isfinite(apart).all(axis=1)  # a trajectory may begin late or end early
    if not known.any():
        return None
    apart, own, there, time_s = apart[known], own[known], there[known], time_s[known]
    together = np.abs(apart).max(axis=1) < TOGETHER_M
    days = np.abs(lead.ages_days(own, time_s)) + np.abs(objects.ages_days(there, time_s))
    if together.all():
        return "the catalogue gives both the same elements" if np.isfinite(days).all() else "both have the same states"
    if not np.isfinite(days).all():  # only element sets have errors of a known size
        return None
    regime = lead.elements(own_number, 0.0).regime
    sigmas = (3.0 if together.any() else 1.0) * math.sqrt(2.0)  # of the difference of two sets
    most = np.abs(apart).max(axis=0)
    radial_m, across_m = sigmas * _RADIAL_M[regime], sigmas * _ACROSS_M[regime]
    along = np.abs(apart[:, 1]) <= 2.0 * _ALONG_M + _ALONG_M_DAY * days
    if most[0] > radial_m or most[2] > across_m or not along.all():
        return None
    along_km = (2.0 * _ALONG_M + _ALONG_M_DAY * float(days.max())) / units.KM
    same = (
        f"the catalogue gives both the same elements for {together.mean():.0%} of the time, and else "
        if together.any()
        else ""
    )
    return (
        f"{same}the sets differ by no more than their own errors: radial {most[0]:.0f} of {radial_m:.0f} m, along the track "
        f"{most[1] / units.KM:.2f} of up to {along_km:.1f} km, across {most[2]:.0f} of {across_m:.0f} m"
    )
