"""The description of a mission in some twenty lines of text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rso_lidar import detector, units
from rso_lidar.detector import Trial
from rso_lidar.motion import Chief, find_flight, find_plan, summarize_motion
from rso_lidar.optics import Receiver
from rso_lidar.orbit import EARTH, elements_from_state, format_utc
from rso_lidar.part import kind_of
from rso_lidar.scenario.assessment.advice import advise
from rso_lidar.scenario.assessment.environment import describe_environment
from rso_lidar.scenario.assessment.interreflection import describe_second_bounce
from rso_lidar.scenario.assessment.multiple_returns import describe_separations
from rso_lidar.scenario.assessment.other_sensors import describe_sensors
from rso_lidar.scenario.assessment.smear import describe_exposure
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview, TargetGeometry, preview_mission
from rso_lidar.scenario.preview.monte_carlo import try_pixels
from rso_lidar.scenario.preview.returns import TargetReturns, cast_attitudes
from rso_lidar.scenario.preview.sky import about_center
from rso_lidar.scenario.preview.whole_target import find_in_run
from rso_lidar.ties import find_first_least

_PLACES = 32  # attitudes and places in the pixel grid over which a target is found or not
_AT_ORIGIN_M = 1e-3  # range below which the lidar is at the origin of a target
_MOST_IN_VERDICT = 3
_FEWEST_REPORTS = 100  # the standard error of a noise from quartiles is then 12 % (1.17 / sqrt n)


def describe(mission: Mission) -> str:
    """Describe a mission: verdict and warnings first, then orbit, geometry, optics and link budget, one per line."""
    preview = preview_mission(mission)
    time = mission.time
    lines = [
        f"time        {time.n_frames} frames at {time.frame_rate_hz:g} Hz, {_describe_span(mission)}; seed {mission.seed}",
    ]
    for number, geometry in enumerate(preview.targets):
        lines += _describe_target(mission, number, geometry, preview)
    lines.append(f"follower    {_describe_motion(mission, len(mission.target), preview)}")
    lines += _describe_plans(mission)
    lines += describe_environment(mission, preview)
    lines += _describe_instrument(mission, preview)
    lines += [f"camera      {camera.describe()}" for camera in mission.camera]
    lines += describe_sensors(mission)
    chances = {}
    for number, geometry in enumerate(preview.targets):
        chances[geometry.name] = _find_chances(mission, number, preview)
        lines += _describe_budget(mission, number, preview, chances[geometry.name])
    lines += describe_second_bounce(mission, preview)
    warned = advise(mission, preview)
    verdict = [f"verdict     {_describe_verdict(len(warned), chances)}", *(f"warning     {line}" for line in warned)]
    return "\n".join([mission.name, *verdict, *lines])


def _find_chances(mission: Mission, number: int, preview: Preview) -> dict[int, np.ndarray]:
    """Find the probability (attitude) that a target is found at the first and the last epoch, by row of the preview."""
    ends = {0, len(preview.time_s) - 1}
    apart = {row: float(preview.targets[number].range_m[row]) for row in sorted(ends)}
    return {
        row: find_in_run(mission, preview, number, row, _PLACES)
        for row, range_m in apart.items()
        if range_m >= _AT_ORIGIN_M
    }


def _describe_verdict(n_warnings: int, chances: Mapping[str, Mapping[int, np.ndarray]]) -> str:
    """Describe in a line whether a mission flies, and whether its targets are found at its ends.

    Parameters
    ----------
    chances : by target and row of the preview, the probability (attitude) of being found there
    """
    text = f"flies, with {n_warnings} warning{'s' * (n_warnings > 1)}" if n_warnings else "ready to fly, no warnings"
    for name, ends in list(chances.items())[:_MOST_IN_VERDICT]:
        means = [f"{probability.mean():.2f}" for probability in ends.values()]
        text += (
            f"; {name} is found with P {' at first and '.join(means)}{' at last' * (len(means) > 1)}" if means else ""
        )
    return text


def _describe_span(mission: Mission) -> str:
    start, end = mission.span
    return f"{format_utc(start, 0.0)} to {format_utc(start, end)}"


def _describe_target(mission: Mission, number: int, geometry: TargetGeometry, preview: Preview) -> list[str]:
    """Describe the surface and the geometry of a target."""
    target, surfaces = mission.target[number], mission.surfaces_of(number)
    surface = surfaces[0]
    corners = mission.corners_of(number).reshape(-1, 3)
    facets = sum(len(part_surface.facets) for part_surface in surfaces)
    sides = " x ".join(f"{side:.2f}" for side in corners.max(axis=0) - corners.min(axis=0))
    dropped = f", {surface.mesh.degenerate} degenerate dropped" if surface.mesh.degenerate else ""
    dropped += f", {surface.mesh.left_out} left out" if surface.mesh.left_out else ""
    parts = len(surface.mesh.part_names)
    off = geometry.off_boresight_rad.max() / units.DEG
    return [
        f"target      {target.name}: model {target.shape}, {sides} m, {facets:,} facets{dropped}, "
        f"{parts} part{'s' * (parts > 1)}, {len(set(surface.materials))} material{'s' * (len(set(surface.materials)) > 1)}",
        f"  motion    {_describe_motion(mission, number, preview)}",
        f"  range     {_format_ends(geometry.range_m, 'm', 1)}, least {geometry.range_m.min():.1f} m at "
        f"{preview.time_s[find_first_least(geometry.range_m)]:g} s; rate {_format_ends(geometry.range_rate_m_s, 'm/s', 3)}, "
        f"light time {geometry.light_time_m / units.MM:.3f} mm{' (simulated)' if mission.world.light_time else ''}",
        f"  sight     at most {off:.3f}° off boresight, its origin in the field {np.mean(geometry.in_field):.0%} of the "
        f"time, all of it {np.mean(geometry.all_in_field):.0%}",
    ]


def _describe_motion(mission: Mission, number: int, preview: Preview) -> str:
    """Describe the motion of a body, its orbit and its attitude."""
    body = mission.bodies[number]
    text = summarize_motion(body.motion, mission.time.start_utc)
    attitude = kind_of(body.attitude) if body.attitude else "as its motion"
    if body.orbits:
        state, center = about_center(mission, preview, body.name), Chief(mission.bodies, body.name).central_body
        orbit = elements_from_state(state.position_m[0], state.velocity_m_s[0], center)
        about = "" if center is EARTH else f" about {center.name}"
        text += (
            f";{about} a {orbit.semi_major_axis_m / units.KM:.1f} km, e {orbit.eccentricity:.5f}, "
            f"i {orbit.inclination_rad / units.DEG:.3f}°, period {orbit.period_s / 60.0:.1f} min"
        )
    return f"{text}; attitude {attitude}"


def _describe_plans(mission: Mission) -> list[str]:
    """Describe the cost and the passive safety of the mission's proximity operations."""
    lines = []
    for body in mission.bodies:
        plan = find_plan(body, mission.bodies, mission.time.start_utc)
        if plan is not None:
            flight = find_flight(body, mission.bodies, mission.time.start_utc)
            text = plan.describe() if flight is None else f"{plan.describe()}\n{flight.describe()}"
            lines += [f"{'plan' if k == 0 else '':<12}{line}" for k, line in enumerate(text.splitlines())]
    return lines


def _format_ends(values: np.ndarray, unit: str, digits: int) -> str:
    """Format the first and the last value."""
    first, last = (round(float(value), digits) + 0.0 for value in (values[0], values[-1]))  # no minus before a zero
    return f"{first:.{digits}f} -> {last:.{digits}f} {unit}"


def _describe_instrument(mission: Mission, preview: Preview) -> list[str]:
    laser, receiver = mission.lidar.laser, mission.lidar.receiver
    ptu = "none, the lidar looks along the follower's +x"
    if mission.ptu:
        point = mission.ptu.point
        ptu = f"{' '.join(filter(None, (point.type, point.tracked_name)))}, response {mission.ptu.response.type}"
    return [
        f"ptu         {ptu}{_describe_pointing_lag(preview)}",
        f"laser       {laser.wavelength_nm:g} nm, {laser.energy_mj:g} mJ ({laser.photons:.3g} photons), "
        f"{mission.instrument.laser.pulse_fwhm_s / units.NS:.3g} ns, {laser.divergence_deg:g}° {laser.footprint}",
        f"receiver    {receiver.n_rows} x {receiver.n_cols} pixels, field {receiver.fov_rad / units.DEG:.3f}°, "
        f"IFOV {receiver.ifov_rad / units.UM:.1f} µrad, f {receiver.focal_length_m / units.MM:.1f} mm, "
        f"aperture {receiver.aperture_m / units.MM:.1f} mm, transmission {receiver.transmission:g}, "
        f"{_describe_sampling(receiver)}",
        *_describe_optional_optics(mission),
        *describe_exposure(mission, preview),
        *_describe_detector(mission),
    ]


def _describe_sampling(receiver: Receiver) -> str:
    if receiver.rays_per_pixel is not None:
        return f"{receiver.rays_per_pixel} rays per pixel"
    return f"sampled to {100.0 * receiver.sampling_error:g} %"


def _describe_pointing_lag(preview: Preview) -> str:
    """Describe the greatest pointing lag of the drive; nothing where the drive was not simulated."""
    if preview.pointing_lag_rad is None:
        return ""
    return f", at most {preview.pointing_lag_rad.max() / units.DEG:.3f}° behind its demand"


def _describe_optional_optics(mission: Mission) -> list[str]:
    """Describe optional optics: laser offset, jitter, files, PSF, distortion, filter and schedule."""
    lidar = mission.lidar
    laser, receiver, schedule = lidar.laser, lidar.receiver, lidar.schedule
    beam, lens = [], []
    if laser.offset is not None:
        beam.append(f"{float(np.linalg.norm(laser.offset)):g} m from the lens")
    if laser.pulse_shape != "gaussian":
        beam.append(f"pulse {laser.pulse_file or laser.pulse_shape}")
    if laser.pattern_file is not None:
        beam.append(f"pattern {laser.pattern_file}")
    if laser.energy_jitter_fraction or laser.timing_jitter_ns:
        beam.append(f"jitter {laser.energy_jitter_fraction:.3g} of the energy, {laser.timing_jitter_ns:g} ns")
    if receiver.psf is not None:
        lens.append(f"PSF {receiver.psf.type}")
    if receiver.distortion is not None:
        lens.append(f"distortion {receiver.distortion.type}")
    if receiver.filter_width_nm is not None:
        lens.append(f"filter {receiver.filter_width_nm:g} nm, sunlight counts")
    if receiver.ghosts:
        lens.append(f"ghosts of {', '.join(f'{100.0 * ghost.fraction:.2g} %' for ghost in receiver.ghosts)}")
    if receiver.glare is not None:
        shade = f", baffle of {receiver.glare.baffle.length_mm:g} mm" if receiver.glare.baffle else ""
        lens.append(
            f"glare of {' '.join(receiver.glare.sources)}, {100.0 * receiver.glare.total_scatter:.2g} % scattered{shade}"
        )
    lines = [f"  beam      {', '.join(beam)}"] * bool(beam) + [f"  lens      {', '.join(lens)}"] * bool(lens)
    if schedule is not None:
        plans = [
            f"{name} {getattr(schedule, name)[0]:g} -> {getattr(schedule, name)[-1]:g}" for name in schedule.planned
        ]
        lines.append(
            f"schedule    {', '.join(plans)}; {schedule.interpolation}, {len(schedule.time_s)} entries, "
            f"{schedule.time_s[0]:g} to {schedule.time_s[-1]:g} s"
        )
    return lines


def _describe_detector(mission: Mission) -> list[str]:
    """Describe the detector. Separations of listed returns stand before the last line, which is about its window."""
    receiver = mission.lidar.receiver
    lines = detector.describe(mission.instrument.detector, receiver.n_rows * receiver.n_cols)
    if (calibration := mission.lidar.calibration) is not None:
        names = ", ".join(constant.name for constant in calibration.constants) or "maps of the pixels"
        fitted = f"  fitted    {names}: calibration '{calibration.name}' of {calibration.date_utc:%Y-%m-%d}"
        lines = [lines[0], fitted, *lines[1:]]
    first = max(len(lines) - 1, 1 if calibration is None else 2)
    lidar = mission.lidar
    foreign = detector.describe_foreign_constants(
        lidar.detector, lidar.pulse, lidar.laser.wavelength_m, lidar.unstated_settings
    )
    solved = [f"  constants {line}" for line in foreign]
    return [*lines[:first], *_describe_detection(mission), *solved, *describe_separations(mission), *lines[first:]]


def _describe_detection(mission: Mission) -> list[str]:
    """Describe the light that the detector needs from the laser's own pulse; nothing for one without a closed form."""
    lidar = mission.lidar
    photons = detector.find_photons(lidar.detector, lidar.pulse, np.array([0.5, 0.95]))
    if photons is None:
        return []
    half, most = (f"{n_photons:,.3g}" if n_photons < 100.0 else f"{n_photons:,.0f}" for n_photons in photons)
    words = [
        f"{share} % of the returns of {count} photons" for share, count in ((50, half), (95, most)) if count != "inf"
    ]
    return [
        f"  detects   {' and '.join(words) or 'nothing'}, in pulses of {lidar.laser.pulse_fwhm_s / units.NS:.3g} ns"
    ]


def _describe_budget(mission: Mission, number: int, preview: Preview, chances: Mapping[int, np.ndarray]) -> list[str]:
    """Describe photons, detection and range noise of the median and the brightest pixel of a target.

    Parameters
    ----------
    chances : by row of the preview, the probability (attitude) that the target is found
    """
    geometry = preview.targets[number]
    lines = [
        f"budget      {geometry.name}, of flashes cast onto it as it stands about these instants, median to brightest pixel:"
    ]
    ends = {0: "first"} if len(preview.time_s) == 1 else {0: "first", len(preview.time_s) - 1: "last"}
    for row, place in ends.items():
        range_m, time_s = float(geometry.range_m[row]), float(preview.time_s[row])
        if range_m < _AT_ORIGIN_M:
            lines.append(f"  {place:<9} the lidar is at the target's origin")
            continue
        pixel_m = range_m * mission.lidar.at(time_s).receiver.pixel_tangent
        across = geometry.across_m[row] / pixel_m
        size = f"{across:.0f}" if across >= 10.0 else f"{across:.1f}"
        casts = cast_attitudes(mission, preview, number, row)
        fill = float(np.mean([cast.brightest_fill for cast in casts]))
        chosen = [try_pixels(mission, casts, share, time_s) for share in (0.5, 1.0)]
        probability = _join_ends([f"{trial.probability:.3f}" for trial in chosen])
        noise = _format_range_noise(chosen)
        shift = _format_range_bias(chosen[1])
        alike = f"mean of {len(casts)} attitudes" if len(casts) > 1 else "one attitude"
        lines.append(
            f"  {place:<9} {range_m:.0f} m: pixel {pixel_m:.3f} m, target {size} pixels across, fills {fill:.0%} of its "
            f"brightest pixel; {_format_photons(casts)}, P(detect) {probability}, range noise {noise}{shift} ({alike})"
        )
        finding = _describe_finding(mission, chances[row])
        lines.append(f"  {'':<9} {finding}; {_describe_sampling_error(casts)}")
    return lines


def _describe_finding(mission: Mission, probability: np.ndarray) -> str:
    """Describe with which probability (attitude) a target is found about one epoch."""
    spread = f", {probability.min():.2f} to {probability.max():.2f}" if np.ptp(probability) > 0.01 else ""
    places = f"{_PLACES} attitudes and places in the pixel grid{spread}"
    dark = ", without sunlight" if mission.lidar.receiver.filter_width_nm is not None else ""
    return f"P(found) {probability.mean():.3f}: {mission.finding.describe()} ({places}{dark})"


def _describe_sampling_error(casts: Sequence[TargetReturns]) -> str:
    """Describe how well rays know the photons of the pixels: the median over attitudes, weighted by light."""
    errors = [cast.sampling_error for cast in casts if cast.sampling_error is not None]
    rays = np.mean([len(cast.hits.rays.pixel) for cast in casts])
    error = float(np.median(errors)) if errors else math.nan
    known = f"known to {100.0 * error:.1f} % (rms by light)" if error < 1.0 else "unknown"
    if error >= 1.0:  # the error of a glint that one ray in thousands meets is no number to calculate with
        known = "not known within a factor of 2 (few rays meet a glint or a retro-reflector)"
    return f"photons of a pixel {known} from {rays:,.0f} rays a flash"


def _format_photons(casts: Sequence[TargetReturns]) -> str:
    """Format the photons of the median and the brightest pixel: medians over attitudes, and their spread."""
    median, brightest = (np.array([cast.photons_at(share) for cast in casts]) for share in (0.5, 1.0))
    text = _join_ends([_format_count(np.median(values)) for values in (median, brightest)]) + " photons"
    if len(casts) < 2:
        return text
    spread = _join_ends([_format_count(value) for value in np.quantile(brightest, [0.1, 0.9])])
    return f"{text} (brightest {spread} in 8 of 10 attitudes)"


def _format_count(photons: float) -> str:
    """Format a mean number of photons; a detector that counts photons needs fewer than one."""
    return f"{photons:,.0f}" if photons >= 10.0 else f"{photons:.2g}"


def _join_ends(texts: Sequence[str]) -> str:
    return " to ".join(dict.fromkeys(texts))


def _format_range_noise(trials: Sequence[Trial]) -> str:
    """Format the range noise of the median and the brightest pixel; "none" for few reports, most of them false alarms."""
    reports = [len(trial.range_error_m) >= _FEWEST_REPORTS for trial in trials]
    words = [
        f"{trial.range_noise_m / units.CM:.1f}" if many else "none" for trial, many in zip(trials, reports, strict=True)
    ]
    return _join_ends(words) + " cm" * any(reports)


def _format_range_bias(trial: Trial) -> str:
    """Format the mean range error where it exceeds a tenth of the range noise and four standard errors; else nothing."""
    if len(trial.range_error_m) < _FEWEST_REPORTS:
        return ""
    standard_error_m = trial.range_noise_m / math.sqrt(len(trial.range_error_m))
    if abs(trial.range_bias_m) < max(0.1 * trial.range_noise_m, 4.0 * standard_error_m):
        return ""
    return f", shifted by {trial.range_bias_m / units.CM:+.1f} cm"
