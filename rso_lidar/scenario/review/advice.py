"""What is allowed and probably not meant: the warnings that `check` prints."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rso_lidar import detector, motion, units
from rso_lidar.motion import Slew
from rso_lidar.optics import FieldDependentPsf, ZemaxDistortion, ZemaxPsf
from rso_lidar.optics.sunlight import sun_photons_per_s_m2
from rso_lidar.optics.tables import zemax
from rso_lidar.orbit import Numerical
from rso_lidar.part import name_object, python_objects
from rso_lidar.rpo import ProximityOperation
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview, Sight, parallax_share, preview
from rso_lidar.scenario.preview.returns import cast_attitudes
from rso_lidar.scenario.preview.trials import try_pixels
from rso_lidar.scenario.review.compliance import broken
from rso_lidar.scenario.review.environment import environment_advice
from rso_lidar.scenario.review.separations import separation_advice
from rso_lidar.ties import first_least

_LIGHT_TIME_M = 0.01
_BEHIND = 0.5  # of half the field: what is off by so much begins to leave it
_WHOLLY = 0.75  # of the time: less is more than the end of an approach
_LOUDER = 1.05  # times the noise in the dark
_SELDOM = 0.5  # probability of detection below which even the brightest pixel is missed more often than found
_DIM = 0.01  # of the light that a laser at the lens would send to the boresight


def advice(mission: Mission, seen: Preview | None = None) -> list[str]:
    """Return one line for each thing that is allowed and probably not meant."""
    seen = seen or preview(mission)
    lines = list(seen.warned)
    lines += _drive(mission, seen)
    lines += _field(mission, seen)
    lines += _plans(mission)
    lines += _window(mission, seen)
    lines += detector.advise(mission.lidar.detector, mission.instrument.laser.pulse_fwhm_s)
    lines += separation_advice(mission, seen)
    lines += _lens(mission)
    lines += _sun_noise(mission)
    lines += _sun(mission)
    lines += _beam(mission, seen)
    lines += _brightness(mission, seen)
    lines += _light_time(seen)
    lines += environment_advice(mission, seen, mission.constraints)
    if mission.constraints is not None:
        lines += broken(mission.constraints, mission, seen)
    lines += _python_objects(mission)
    if not mission.target:
        lines.append("there is no [[target]]: frames will hold false triggers only")
    return lines


def _python_objects(mission: Mission) -> list[str]:
    """List the Python objects of a mission, which a recording names but does not contain."""
    return [
        f"{name_object(given)} is a Python object: a recording names it and cannot rebuild it; to fly the recorded "
        "scenario again, give the object again with replace(...)"
        for given in python_objects(mission)
    ]


def _drive(mission: Mission, seen: Preview) -> list[str]:
    """Return where the PTU's drive does not keep up with what it is asked."""
    half_rad = 0.5 * min(mission.lidar.receiver.fov_rad, mission.lidar.laser.divergence_rad)
    if seen.behind_rad is None or not seen.behind_rad.max() > _BEHIND * half_rad:
        return []
    at = int(np.argmax(seen.behind_rad))
    return [
        f"ptu: the drive is up to {seen.behind_rad[at] / units.DEG:.3g}° behind what it is asked, at {seen.time_s[at]:g} s, "
        f"and half the field or beam is {half_rad / units.DEG:.3g}°; give the response a higher max_rate_deg_s, "
        "max_acceleration_deg_s2 or bandwidth, or turn the follower"
    ]


def _plans(mission: Mission) -> list[str]:
    """Return what is doubtful about plans: failures that lead into the keep-out sphere, turns that never come."""
    lines = []
    end_s = mission.span[1]
    for body in mission.bodies:
        flown, law = body.motion, body.attitude
        if isinstance(flown, ProximityOperation) and flown.keep_out_m > 0.0:
            chief = motion.Chief(mission.bodies, flown.relative_to, local=mission.local)
            safe_m = flown.plan(mission.time.start_utc, chief).passive_safety_m()
            if safe_m < flown.keep_out_m:
                lines.append(
                    f"{body.name}.motion: if thrust stops at the worst instant it drifts to {safe_m:.3g} m, inside its "
                    f"keep-out sphere of {flown.keep_out_m:g} m; choose another path, or fly it slower"
                )
        if isinstance(law, Slew) and law.at_s > end_s:
            lines.append(
                f"{body.name}.attitude: its slew begins at {law.at_s:g} s, after the last frame at {end_s:g} s; shift at_s"
            )
        if isinstance(flown, Numerical):
            late = [one for one in flown.maneuvers if getattr(one, "at_s", getattr(one, "from_s", 0.0)) > end_s]
            if late:
                lines.append(
                    f"{body.name}.motion: {len(late)} of its {len(flown.maneuvers)} maneuvers come after the last frame at "
                    f"{end_s:g} s; shift them"
                )
    return lines


def _field(mission: Mission, seen: Preview) -> list[str]:
    lines = []
    for target, sight in zip(mission.target, seen.sights, strict=True):
        share = float(np.mean(sight.in_field))
        if share < 1.0:
            first = float(seen.time_s[np.argmin(sight.in_field)])
            how = (
                "never in the field of view"
                if share == 0.0
                else f"out of the field of view {1 - share:.0%} of the time"
            )
            lines.append(f"target {sight.name}: {how}, first at {first:g} s; turn the follower, or track it with [ptu]")
        elif float(np.mean(sight.wholly)) < _WHOLLY and target.terrain is None:
            first = int(np.argmin(sight.wholly))
            lines.append(
                f"target {sight.name}: part of it is outside the field of view {np.mean(~sight.wholly):.0%} of the time, "
                f"first at {seen.time_s[first]:g} s, {sight.range_m[first]:.0f} m away; if all of it is to be seen, "
                "stay farther off or widen the field"
            )
        if float(sight.range_m.min()) < sight.radius_m and target.terrain is None:
            lines.append(f"target {sight.name}: the lidar comes within its bounding sphere; mind the trajectory")
    return lines


def _window(mission: Mission, seen: Preview) -> list[str]:
    lines = []
    for sight in seen.sights:
        traits = [mission.lidar.at(float(time_s)).detector.traits for time_s in seen.time_s]
        opens, closes = (np.array([getattr(one, name) for one in traits]) for name in ("sees_from_m", "sees_to_m"))
        outside = (sight.range_m < opens) | (sight.range_m > closes)
        near, far = float(sight.range_m.min()), float(sight.range_m.max())
        if traits[0].is_gated:
            lines += _gate(sight, opens, closes)
        elif outside.any():
            lines.append(
                f"target {sight.name}: its range ({near:.0f} to {far:.0f} m) leaves the armed window "
                f"({opens[0]:g} to {closes[0]:g} m), where nothing is detected; "
                "set lidar.detector.armed_from_m and armed_to_m"
            )
    return lines


def _gate(sight: Sight, opens: np.ndarray, closes: np.ndarray) -> list[str]:
    """Return what a range gate cuts off of a target."""
    out = (sight.farthest_m < opens) | (sight.nearest_m > closes)
    cut = (sight.nearest_m < opens) | (sight.farthest_m > closes)
    where = f"target {sight.name}: the range gate ({opens[0]:.1f} to {closes[0]:.1f} m at first)"
    if out.any():
        return [
            f"{where} misses it {np.mean(out):.0%} of the time; set lidar.detector.gate.delay_ns to 6.671 ns a metre "
            "of range less half the width, plan it in lidar.schedule, or command it"
        ]
    if cut.any():
        deep_m = float((sight.farthest_m - sight.nearest_m).max())
        return [
            f"{where} cannot contain it whole {np.mean(cut):.0%} of the time: it is up to {deep_m:.1f} m deep and the gate "
            f"{closes[0] - opens[0]:.1f} m; widen lidar.detector.gate.width_ns or shift delay_ns"
        ]
    return []


def _sun_noise(mission: Mission) -> list[str]:
    """Return what sunlight on the brightest material, facing the Sun, does to the noise."""
    lidar = mission.instrument
    receiver = lidar.receiver
    sun = not mission.local or mission.world.sun_direction is not None
    if receiver.filter_width_nm is None or not sun or not mission.surfaces:
        return []
    brdf = max(
        float(material.mean_brdf_per_sr(np.array(1.0), np.array(0.5), np.array(0.5)))  # 60 degrees apart, and no glint
        for surface in mission.surfaces
        for material in surface.materials
    )
    per_m2 = sun_photons_per_s_m2(lidar.laser.wavelength_m, receiver.filter_width_nm * units.NM)
    rate = per_m2 * receiver.aperture_area_m2 * receiver.transmission * brdf * receiver.pixel_tangent**2
    louder = detector.noise_growth(lidar.detector, rate)
    if louder < _LOUDER:
        return []
    return [
        f"sunlight on the brightest material makes the noise of a pixel that it fills {louder:.2f} times that in the dark "
        f"({rate:.2g} photons/s): more false triggers, and less precision than in the dark; narrow "
        "lidar.receiver.filter_width_nm"
    ]


def _lens(mission: Mission) -> list[str]:
    """Return what the lens files say of other wavelengths than the laser's."""
    laser, receiver = mission.instrument.laser, mission.instrument.receiver
    psfs = [one.psf for one in receiver.psf.fields] if isinstance(receiver.psf, FieldDependentPsf) else [receiver.psf]
    told = [(psf.file, zemax.read_huygens_psf(psf.file).wavelength_m) for psf in psfs if isinstance(psf, ZemaxPsf)]
    if isinstance(receiver.distortion, ZemaxDistortion):
        one_m = zemax.read_grid_distortion(receiver.distortion.file).wavelength_m
        told.append((receiver.distortion.file, (one_m, one_m) if one_m else None))
    return [
        f"lidar.receiver: {Path(file).name} is for {band[0] / units.NM:.0f} to {band[1] / units.NM:.0f} nm and the laser "
        f"is at {laser.wavelength_nm:g} nm; export the lens at the laser's wavelength"
        for file, band in told
        if band is not None and not 0.95 * band[0] <= laser.wavelength_m <= 1.05 * band[1]
    ]


def _sun(mission: Mission) -> list[str]:
    if mission.lidar.receiver.filter_width_nm is None or not mission.local or mission.world.sun_direction:
        return []
    return [
        "lidar.receiver.filter_width_nm asks for sunlight, and this local world has no Sun; set world.sun_direction, or "
        "leave the filter out"
    ]


def _beam(mission: Mission, seen: Preview) -> list[str]:
    """Return where a laser beside the lens does not light what the lens looks at."""
    lines = []
    for sight in seen.sights:
        nearest_m = float(sight.range_m.min())
        laser = mission.instrument.at(float(seen.time_s[first_least(sight.range_m)])).laser
        if nearest_m > 0.0 and parallax_share(laser, nearest_m) < _DIM:
            lines.append(
                f"target {sight.name}: at {nearest_m:.1f} m the beam of a laser {np.linalg.norm(laser.offset_m):.3g} m from "
                "the lens passes beside the boresight; shorten lidar.laser.offset_m or widen divergence_deg"
            )
    return lines


def _brightness(mission: Mission, seen: Preview) -> list[str]:
    """Return which targets are too dim or too bright at their nearest instant, as they stand there."""
    lines = []
    for number, sight in enumerate(seen.sights):
        row = first_least(sight.range_m)
        nearest_m, time_s = float(sight.range_m[row]), float(seen.time_s[row])
        if nearest_m < 1e-3:
            continue
        (returns,) = casts = cast_attitudes(mission, seen, number, row, most=1)
        photons = float(np.median(returns.photons)) if returns.pixel.size else 0.0
        if photons >= mission.lidar.detector.traits.saturation_photons:
            lines.append(
                f"target {sight.name}: at {nearest_m:.0f} m half of its pixels or more clip the converter "
                f"({photons:,.0f} photons in the median pixel); lower lidar.laser.energy_mj or the aperture"
            )
            continue
        armed = mission.instrument.at(time_s).detector.traits
        if not returns.pixel.size or not armed.sees_from_m < nearest_m < armed.sees_to_m:
            continue  # that is said elsewhere
        probability = try_pixels(mission, casts, 1.0, time_s).probability
        if probability < _SELDOM:
            lines.append(
                f"target {sight.name}: at {nearest_m:.0f} m, the nearest, even its brightest pixel is found with a "
                f"probability of only {probability:.2f}; come nearer, or raise lidar.laser.energy_mj or the aperture"
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
