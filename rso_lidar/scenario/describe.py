"""A scenario in some twenty lines for a person."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.motion import Tle, utc_text
from rso_lidar.motion.kepler import elements
from rso_lidar.scenario.advice import advice
from rso_lidar.scenario.preview import Preview, Sight, filled_pixel_photons, preview

if TYPE_CHECKING:
    from rso_lidar.scenario.scenario import Scenario


def describe(scenario: Scenario) -> str:
    """Return orbit, geometry, optics, link budget and warnings of a scenario, as lines of text."""
    seen = preview(scenario)
    time = scenario.time
    lines = [
        f"{scenario.name}",
        f"time        {time.n_frames} frames at {time.frame_rate_hz:g} Hz, {_span(scenario)}; seed {scenario.seed}",
    ]
    for number, sight in enumerate(seen.sights):
        lines += _target_lines(scenario, number, sight, seen)
    lines.append(f"follower    {_motion(scenario, len(scenario.target), seen)}")
    lines += _instrument_lines(scenario)
    for sight in seen.sights:
        lines += _budget_lines(scenario, sight)
    warned = advice(scenario, seen)
    lines += [f"warning     {line}" for line in warned] or ["warnings    none"]
    return "\n".join(lines)


def _span(scenario: Scenario) -> str:
    start, end = scenario.span
    return f"{utc_text(start, 0.0)} to {utc_text(start, end)}"


def _target_lines(scenario: Scenario, number: int, sight: Sight, seen: Preview) -> list[str]:
    target, surface = scenario.target[number], scenario.surfaces[number]
    size = surface.vertices[np.unique(surface.facets)]
    sides = " x ".join(f"{side:.2f}" for side in size.max(axis=0) - size.min(axis=0))
    dropped = f", {surface.mesh.degenerate} degenerate dropped" if surface.mesh.degenerate else ""
    parts = len(surface.mesh.part_names)
    off = sight.off_boresight_rad.max() / units.DEG
    return [
        f"target      {target.name}: model {target.model}, {sides} m, {len(surface.facets):,} facets{dropped}, "
        f"{parts} part{'s' * (parts > 1)}, {len(set(surface.materials))} material{'s' * (len(set(surface.materials)) > 1)}",
        f"  motion    {_motion(scenario, number, seen)}",
        f"  range     {_ends(sight.range_m, 'm', 1)}, least {sight.range_m.min():.1f} m at "
        f"{seen.time_s[np.argmin(sight.range_m)]:g} s; rate {_ends(sight.range_rate_m_s, 'm/s', 3)}, "
        f"light time {sight.light_time_m / units.MM:.3f} mm",
        f"  sight     at most {off:.3f}° off boresight, in the field {np.mean(sight.in_field):.0%} of the time",
    ]


def _motion(scenario: Scenario, number: int, seen: Preview) -> str:
    body = scenario.bodies[number]
    motion = body.motion
    text: str = motion.type
    if isinstance(motion, Tle):
        sets = motion.elements(scenario.time.start_utc)
        text += (
            f" {sets.norad_id} {sets.name}, {motion.epoch_age_days(scenario.epochs(np.array([0]))):.1f} days from epoch"
        )
    if getattr(motion, "relative_to", None):
        text += f" relative to {motion.relative_to}"  # type: ignore[union-attr]
    attitude = body.attitude.type if body.attitude else "as its motion"
    if body.orbits:
        state = seen.states[body.name]
        orbit = elements(state.position_m[0], state.velocity_m_s[0])
        text += (
            f"; a {orbit.semi_major_axis_m / units.KM:.1f} km, e {orbit.eccentricity:.5f}, "
            f"i {orbit.inclination_rad / units.DEG:.3f}°, period {orbit.period_s / 60.0:.1f} min"
        )
    return f"{text}; attitude {attitude}"


def _ends(values: np.ndarray, unit: str, digits: int) -> str:
    return f"{values[0]:.{digits}f} -> {values[-1]:.{digits}f} {unit}"


def _instrument_lines(scenario: Scenario) -> list[str]:
    laser, receiver = scenario.lidar.laser, scenario.lidar.receiver
    ptu = "none, the lidar looks along the follower's +x"
    if scenario.ptu:
        point = scenario.ptu.point
        ptu = f"{point.type}{' ' + point.at if point.type == 'track' else ''}, response {scenario.ptu.response.type}"
    return [
        f"ptu         {ptu}",
        f"laser       {laser.wavelength_nm:g} nm, {laser.energy_mj:g} mJ ({laser.photons:.3g} photons), "
        f"{laser.pulse_fwhm_ns:g} ns, {laser.divergence_deg:g}° {laser.footprint}",
        f"receiver    {receiver.n_rows} x {receiver.n_cols} pixels, field {receiver.fov_rad / units.DEG:.3f}°, "
        f"IFOV {receiver.ifov_rad * 1e6:.1f} µrad, f {receiver.focal_length_m / units.MM:.1f} mm, "
        f"aperture {receiver.aperture_m / units.MM:.1f} mm, transmission {receiver.transmission:g}, "
        f"{receiver.rays_per_pixel} rays per pixel",
        f"detector    {scenario.lidar.detector.type}, 95 % at {scenario.lidar.detector.reference_photons:g} photons, "
        f"armed {scenario.lidar.detector.armed_from_m:g} to {scenario.lidar.detector.armed_to_m:g} m",
    ]


def _budget_lines(scenario: Scenario, sight: Sight) -> list[str]:
    lines = [
        f"budget      {sight.name}, a filled pixel on the boresight that faces the lidar, dimmest to brightest material:"
    ]
    for place, range_m in (("first", float(sight.range_m[0])), ("last", float(sight.range_m[-1]))):
        if range_m < 1e-3:
            lines.append(f"  {place:<9} the lidar is at the target's origin")
            continue
        ends = np.unique(np.round(filled_pixel_photons(scenario, sight.name, range_m), 6))
        detector = scenario.lidar.detector
        photons = " to ".join(f"{value:,.0f}" for value in ends)
        probability = " to ".join(f"{value:.3f}" for value in detector.detection_probability(ends))
        noise_m = detector.range_noise_m(ends, scenario.lidar.laser.pulse_fwhm_s)
        noise = " to ".join(f"{value / units.CM:.1f}" for value in noise_m)
        pixel_m = range_m * scenario.lidar.receiver.pixel_tangent
        lines.append(
            f"  {place:<9} {range_m:.0f} m: pixel {pixel_m:.3f} m, "
            f"target {2 * sight.radius_m / pixel_m:.0f} pixels across, "
            f"{photons} photons, P(detect) {probability}, range noise {noise} cm"
        )
    return lines
