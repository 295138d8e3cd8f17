"""What is allowed and probably not meant: the warnings that `check` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.motion import Hill
from rso_lidar.motion.hill import validity
from rso_lidar.motion.kepler import elements
from rso_lidar.scenario.preview import Preview, filled_pixel_photons, preview

if TYPE_CHECKING:
    from rso_lidar.scenario.scenario import Scenario

_LIGHT_TIME_M = 0.01


def advice(scenario: Scenario, seen: Preview | None = None) -> list[str]:
    """Return one line for each thing that is allowed and probably not meant."""
    seen = seen or preview(scenario)
    lines = list(seen.warned)
    lines += _hill(scenario, seen)
    lines += _field(scenario, seen)
    lines += _window(scenario, seen)
    lines += _clipping(scenario, seen)
    lines += _light_time(seen)
    if not scenario.target:
        lines.append("there is no [[target]]: frames will hold false triggers only")
    return lines


def _hill(scenario: Scenario, seen: Preview) -> list[str]:
    lines = []
    for body in scenario.bodies:
        if not isinstance(body.motion, Hill):
            continue
        chief = seen.states[body.motion.relative_to]
        apart_m = seen.states[body.name].position_m - chief.position_m
        eccentricity = elements(chief.position_m[0], chief.velocity_m_s[0]).eccentricity
        lines += [f"{body.name}.motion: {line}" for line in validity(apart_m, eccentricity)]
    return lines


def _field(scenario: Scenario, seen: Preview) -> list[str]:
    lines = []
    for sight in seen.sights:
        share = float(np.mean(sight.in_field))
        if share < 1.0:
            first = float(seen.time_s[np.argmin(sight.in_field)])
            how = (
                "never in the field of view"
                if share == 0.0
                else f"out of the field of view {1 - share:.0%} of the time"
            )
            lines.append(f"target {sight.name}: {how}, first at {first:g} s; turn the follower, or track it with [ptu]")
        if float(sight.range_m.min()) < sight.radius_m:
            lines.append(f"target {sight.name}: the lidar comes within its bounding sphere; mind the trajectory")
    return lines


def _window(scenario: Scenario, seen: Preview) -> list[str]:
    detector = scenario.lidar.detector
    lines = []
    for sight in seen.sights:
        near, far = float(sight.range_m.min()), float(sight.range_m.max())
        if far > detector.armed_to_m or near < detector.armed_from_m:
            lines.append(
                f"target {sight.name}: its range ({near:.0f} to {far:.0f} m) leaves the armed window "
                f"({detector.armed_from_m:g} to {detector.armed_to_m:g} m), where nothing is detected; "
                "set lidar.detector.armed_from_m and armed_to_m"
            )
    return lines


def _clipping(scenario: Scenario, seen: Preview) -> list[str]:
    lines = []
    for sight in seen.sights:
        nearest_m = float(sight.range_m.min())
        if nearest_m < 1e-3:
            continue
        dimmest, _ = filled_pixel_photons(scenario, sight.name, nearest_m)
        if float(scenario.lidar.detector.counts(np.array(dimmest))) >= scenario.lidar.detector.full_scale_counts:
            lines.append(
                f"target {sight.name}: at {nearest_m:.0f} m even its dimmest material clips the converter in a filled pixel "
                f"({dimmest:,.0f} photons); lower lidar.laser.energy_mj or the aperture"
            )
    return lines


def _light_time(seen: Preview) -> list[str]:
    lines = []
    for sight in seen.sights:
        shift = sight.light_time_m
        if shift > _LIGHT_TIME_M:
            lines.append(
                f"target {sight.name}: light time would change its range by up to {shift * 100:.1f} cm, "
                "and poses are simultaneous at emission"
            )
    return lines
