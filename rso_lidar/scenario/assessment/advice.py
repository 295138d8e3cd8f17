"""Warnings about settings that are allowed but probably not intended, as `check` prints them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rso_lidar import detector, units
from rso_lidar.detector import DetectorTraits, find_saturation_photons
from rso_lidar.motion import advise_on_motion, find_plan
from rso_lidar.optics import sun_photons_per_s_m2
from rso_lidar.part import name_object, python_objects
from rso_lidar.scenario.assessment.compliance import list_violations
from rso_lidar.scenario.assessment.environment import LOUDER, advise_on_environment
from rso_lidar.scenario.assessment.interreflection import advise_on_second_bounce
from rso_lidar.scenario.assessment.multiple_returns import advise_on_separations
from rso_lidar.scenario.assessment.other_sensors import advise_on_sensors
from rso_lidar.scenario.assessment.smear import advise_on_exposure
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview, TargetGeometry, boresight_light_fraction, preview_mission
from rso_lidar.scenario.preview.monte_carlo import try_pixels
from rso_lidar.scenario.preview.returns import cast_attitudes
from rso_lidar.ties import find_first_least

_LIGHT_TIME_M = 0.01
_SAME_BENCH = 0.02  # relative difference of pulse and wavelength from those of a calibration
_MOST_LAG = 0.5  # pointing lag over half the field, from which a target begins to leave the field
_WHOLLY = 0.75  # fraction of the run: an approach may leave the field at its end without a warning
_SELDOM = 0.5  # detection probability of the brightest pixel below which a warning is given
_DIM = 0.01  # light on the boresight, relative to a laser at the lens, below which a warning is given


def advise(mission: Mission, preview: Preview | None = None) -> list[str]:
    """List one warning for each setting that is allowed but probably not intended.

    `preview` is the mission's preview, where the caller has one already.
    """
    preview = preview or preview_mission(mission)
    lines = list(preview.warnings)
    lines += _advise_on_drive(mission, preview)
    lines += _advise_on_field(mission, preview)
    lines += _advise_on_plans(mission)
    lines += _advise_on_window(mission, preview)
    lines += detector.advise(mission.instrument.detector, mission.instrument.laser.pulse_fwhm_s)
    lines += _advise_on_calibration(mission)
    lines += advise_on_separations(mission, preview)
    lines += _advise_on_lens(mission)
    lines += _advise_on_sunlight(mission)
    lines += _advise_on_missing_sun(mission)
    lines += _advise_on_earthshine(mission)
    lines += _advise_on_parallax(mission, preview)
    lines += _advise_on_brightness(mission, preview)
    lines += advise_on_second_bounce(mission, preview)
    lines += _advise_on_light_time(mission, preview)
    lines += advise_on_exposure(mission, preview)
    lines += advise_on_environment(mission, preview, mission.constraints)
    lines += advise_on_sensors(mission, preview)
    if mission.constraints is not None:
        lines += list_violations(mission.constraints, mission, preview)
    lines += _advise_on_python_objects(mission)
    if not mission.target:
        lines.append("no [[target]]: frames will contain false triggers only")
    return lines


def _advise_on_python_objects(mission: Mission) -> list[str]:
    """List the Python objects of a mission, which a recording names but does not contain."""
    return [
        f"{name_object(given)} is a Python object: a recording names it and cannot rebuild it; to fly the recorded "
        "scenario again, give the object again with replace(...)"
        for given in python_objects(mission)
    ]


def _advise_on_calibration(mission: Mission) -> list[str]:
    """Warn of constants, a pulse and a wavelength that differ from those of the calibration that the lidar states."""
    calibration, laser = mission.lidar.calibration, mission.lidar.laser
    if calibration is None:
        return []
    lines = []
    if changed := calibration.list_overridden(mission.instrument.detector):
        names = ", ".join(f"lidar.detector.{name}" for name in changed)
        lines.append(
            f"{names} {'is' if len(changed) == 1 else 'are'} not as the calibration '{calibration.name}' has it; leave it "
            "out to use the fitted value"
        )
    for what, unit, own, bench in (
        ("pulse_fwhm_ns", "ns", laser.pulse_fwhm_ns, calibration.pulse_fwhm_ns),
        ("wavelength_nm", "nm", laser.wavelength_nm, calibration.wavelength_nm),
    ):
        if abs(own / bench - 1.0) > _SAME_BENCH:
            lines.append(
                f"the calibration '{calibration.name}' was measured at {bench:g} {unit}, and lidar.laser.{what} is {own:g}; "
                "fitted constants may differ there"
            )
    return lines


def _advise_on_drive(mission: Mission, preview: Preview) -> list[str]:
    """Warn of a PTU whose drive does not keep up with its demand."""
    half_rad = 0.5 * min(mission.lidar.receiver.fov_rad, mission.lidar.laser.divergence_rad)
    if preview.pointing_lag_rad is None or not preview.pointing_lag_rad.max() > _MOST_LAG * half_rad:
        return []
    at = int(np.argmax(preview.pointing_lag_rad))
    lag_deg = preview.pointing_lag_rad[at] / units.DEG
    return [
        f"ptu: the drive is up to {lag_deg:.3g}° behind its demand, at {preview.time_s[at]:g} s, "
        f"and half the field or beam is {half_rad / units.DEG:.3g}°; give the response a higher max_rate_deg_s, "
        "max_acceleration_deg_s2 or bandwidth, or turn the follower"
    ]


def _advise_on_plans(mission: Mission) -> list[str]:
    """Warn of plans that a failure leads into the keep-out sphere, and of slews and maneuvers that never begin."""
    lines = []
    end_s = mission.span[1]
    for body in mission.bodies:
        plan = find_plan(body, mission.bodies, mission.time.start_utc)
        keep_out_m = getattr(body.motion, "keep_out_m", 0.0)
        if plan is not None and keep_out_m > 0.0 and (safe_m := plan.passive_safety_m()) < keep_out_m:
            lines.append(
                f"{body.name}.motion: if thrust stops at the worst instant it drifts to {safe_m:.3g} m, inside its "
                f"keep-out sphere of {keep_out_m:g} m; choose another path, or fly it slower"
            )
        for place in ("attitude", "motion"):
            lines += [f"{body.name}.{place}: {line}" for line in advise_on_motion(getattr(body, place), end_s)]
    return lines


def _advise_on_field(mission: Mission, preview: Preview) -> list[str]:
    """Warn of targets outside the field of view, and of a lidar inside a target's bounding sphere."""
    lines = []
    for target, geometry in zip(mission.target, preview.targets, strict=True):
        share = float(np.mean(geometry.in_field))
        if share < 1.0:
            first = float(preview.time_s[np.argmin(geometry.in_field)])
            how = (
                "never in the field of view"
                if share == 0.0
                else f"out of the field of view {1 - share:.0%} of the time"
            )
            lines.append(
                f"target {geometry.name}: {how}, first at {first:g} s; turn the follower, or track it with [ptu]"
            )
        elif float(np.mean(geometry.all_in_field)) < _WHOLLY and target.terrain is None:
            first = int(np.argmin(geometry.all_in_field))
            lines.append(
                f"target {geometry.name}: part of it is outside the field of view "
                f"{np.mean(~geometry.all_in_field):.0%} of the time, first at {preview.time_s[first]:g} s, "
                f"{geometry.range_m[first]:.0f} m away; if all of it is to be seen, stay farther off or widen the field"
            )
        if float(geometry.range_m.min()) < geometry.radius_m and target.terrain is None:
            lines.append(f"target {geometry.name}: the lidar comes within its bounding sphere; mind the trajectory")
    return lines


def _advise_on_window(mission: Mission, preview: Preview) -> list[str]:
    """Warn of targets outside the ranges at which the detector sees anything."""
    lines = []
    for geometry in preview.targets:
        traits = [mission.lidar.at(float(time_s)).detector.traits for time_s in preview.time_s]
        opens, closes = (
            np.array([getattr(detector_traits, name) for detector_traits in traits])
            for name in ("sees_from_m", "sees_to_m")
        )
        outside = (geometry.range_m < opens) | (geometry.range_m > closes)
        near, far = float(geometry.range_m.min()), float(geometry.range_m.max())
        if traits[0].is_gated:
            lines += _advise_on_gate(geometry, opens, closes, _name_window_keys(traits[0]))
        elif outside.any():
            lines.append(
                f"target {geometry.name}: its range ({near:.0f} to {far:.0f} m) leaves the armed window "
                f"({opens[0]:g} to {closes[0]:g} m), where nothing is detected; set {_name_window_keys(traits[0])}"
            )
    return lines


def _name_window_keys(traits: DetectorTraits) -> str:
    """Name the settings that place the window of a detector."""
    return f"{traits.window_keys} of lidar.detector" if traits.window_keys else "the window of lidar.detector"


def _advise_on_gate(geometry: TargetGeometry, opens: np.ndarray, closes: np.ndarray, keys: str) -> list[str]:
    """Warn of a range gate [m] (time) that misses a target or cuts a part of it off."""
    out = (geometry.farthest_m < opens) | (geometry.nearest_m > closes)
    cut = (geometry.nearest_m < opens) | (geometry.farthest_m > closes)
    where = f"target {geometry.name}: the range gate ({opens[0]:.1f} to {closes[0]:.1f} m at first)"
    if out.any():
        return [
            f"{where} misses it {np.mean(out):.0%} of the time; set {keys}, plan gate_delay_ns in lidar.schedule "
            "(6.671 ns a metre of range, less half the width), or command it"
        ]
    if cut.any():
        deep_m = float((geometry.farthest_m - geometry.nearest_m).max())
        return [
            f"{where} cannot contain it whole {np.mean(cut):.0%} of the time: it is up to {deep_m:.1f} m deep and the gate "
            f"{closes[0] - opens[0]:.1f} m; widen or shift it with {keys}"
        ]
    return []


def _advise_on_sunlight(mission: Mission) -> list[str]:
    """Warn of the noise that sunlight on the brightest material causes."""
    lidar = mission.instrument
    receiver = lidar.receiver
    sun = not mission.is_local or mission.world.sun_direction is not None
    if receiver.filter_width_nm is None or not sun or not mission.surfaces:
        return []
    brdf = max(
        float(
            material.mean_brdf_per_sr(np.array(1.0), np.array(0.5), np.array(0.5))
        )  # Sun and lidar 60 degrees apart, away from a glint
        for surface in mission.surfaces
        for material in surface.materials
    )
    per_m2 = sun_photons_per_s_m2(lidar.laser.wavelength_m, receiver.filter_width_nm * units.NM)
    rate = per_m2 * receiver.aperture_area_m2 * receiver.transmission * brdf * receiver.pixel_tangent**2
    louder = detector.noise_growth(lidar.detector, rate)
    if louder < LOUDER:
        return []
    return [
        f"sunlight on the brightest material makes the noise of a pixel that it fills {louder:.2f} times that in the dark "
        f"({rate:.2g} photons/s): more false triggers, and less precision than in the dark; narrow "
        "lidar.receiver.filter_width_nm"
    ]


def _advise_on_lens(mission: Mission) -> list[str]:
    """Warn of lens files that were exported for another wavelength than the laser's."""
    laser, receiver = mission.instrument.laser, mission.instrument.receiver
    bands = [band for part in (receiver.psf, receiver.distortion) if part is not None for band in part.read_bands()]
    return [
        f"lidar.receiver: {Path(file).name} is for {shortest_m / units.NM:.0f} to {longest_m / units.NM:.0f} nm and the "
        f"laser is at {laser.wavelength_nm:g} nm; export the lens at the laser's wavelength"
        for file, shortest_m, longest_m in bands
        if not 0.95 * shortest_m <= laser.wavelength_m <= 1.05 * longest_m
    ]


def _advise_on_missing_sun(mission: Mission) -> list[str]:
    """Warn of a filter for sunlight in a world without a Sun."""
    if mission.lidar.receiver.filter_width_nm is None or not mission.is_local or mission.world.sun_direction:
        return []
    return [
        "lidar.receiver.filter_width_nm asks for sunlight, and this local world has no Sun; set world.sun_direction, or "
        "leave the filter out"
    ]


def _advise_on_earthshine(mission: Mission) -> list[str]:
    """Warn of Earthshine that neither receiver nor camera collects, and of two albedos of one Earth."""
    albedo, receiver = mission.world.earth_albedo, mission.lidar.receiver
    if albedo is None:
        return []
    if receiver.filter_width_nm is not None:
        of_glare = None if receiver.glare is None else receiver.glare.earth_albedo
        if of_glare in (None, albedo):
            return []
        return [
            f"world.earth_albedo is {albedo:g} and lidar.receiver.glare.earth_albedo {of_glare:g}: the Earth has one "
            "albedo; set both alike"
        ]
    if mission.camera:
        return []
    return [
        "world.earth_albedo asks for light of the Earth on targets, and the receiver collects no steady light; set "
        "lidar.receiver.filter_width_nm, or leave it out"
    ]


def _advise_on_parallax(mission: Mission, preview: Preview) -> list[str]:
    """Warn of a laser beside the lens whose beam misses the boresight at the nearest target."""
    lines = []
    for geometry in preview.targets:
        nearest_m = float(geometry.range_m.min())
        laser = mission.instrument.at(float(preview.time_s[find_first_least(geometry.range_m)])).laser
        if nearest_m > 0.0 and boresight_light_fraction(laser, nearest_m) < _DIM:
            lines.append(
                f"target {geometry.name}: at {nearest_m:.1f} m the beam of a laser "
                f"{np.linalg.norm(laser.offset_m):.3g} m from the lens passes beside the boresight; "
                "shorten lidar.laser.offset_m or widen divergence_deg"
            )
    return lines


def _advise_on_brightness(mission: Mission, preview: Preview) -> list[str]:
    """Warn of targets that are too dim or too bright at their nearest epoch, in their attitude there."""
    lines = []
    for number, geometry in enumerate(preview.targets):
        row = find_first_least(geometry.range_m)
        nearest_m, time_s = float(geometry.range_m[row]), float(preview.time_s[row])
        if nearest_m < 1e-3:
            continue
        (returns,) = casts = cast_attitudes(mission, preview, number, row, most=1)
        photons = float(np.median(returns.photons)) if returns.pixel.size else 0.0
        traits, full = (
            mission.lidar.detector.traits,
            find_saturation_photons(mission.lidar.detector, mission.lidar.pulse),
        )
        most = float(returns.photons.max(initial=0.0))
        if photons >= full or most >= traits.clipped_range_photons:
            spoilt = int((returns.photons >= traits.clipped_range_photons).sum())
            what = (
                f"half of its pixels or more saturate ({photons:,.0f} photons in the median pixel)"
                if photons >= full
                else f"some of its pixels saturate ({most:,.0f} photons in the brightest)"
            )
            error = f", and the range of {spoilt} is off by decimetres" if spoilt else ""
            cures = ["lower lidar.laser.energy_mj or the aperture", *filter(None, [traits.strong_return_cure])]
            lines.append(f"target {geometry.name}: at {nearest_m:.0f} m {what}{error}; {', or '.join(cures)}")
            continue
        armed = mission.instrument.at(time_s).detector.traits
        if not returns.pixel.size or not armed.sees_from_m < nearest_m < armed.sees_to_m:
            continue  # other warnings cover this
        probability = try_pixels(mission, casts, 1.0, time_s).probability
        if probability < _SELDOM:
            lines.append(
                f"target {geometry.name}: at {nearest_m:.0f} m, the nearest, even its brightest pixel is found with a "
                f"probability of only {probability:.2f}; come nearer, or raise lidar.laser.energy_mj or the aperture"
            )
    return lines


def _advise_on_light_time(mission: Mission, preview: Preview) -> list[str]:
    """Warn where light time is left out and would change a range noticeably."""
    lines: list[str] = []
    if mission.world.light_time:
        return lines
    for geometry in preview.targets:
        shift = geometry.light_time_m
        if shift > _LIGHT_TIME_M:
            lines.append(
                f"target {geometry.name}: light time would change its range by up to {shift * 100:.1f} cm, "
                "and poses are simultaneous at emission; set world.light_time = true"
            )
    return lines
