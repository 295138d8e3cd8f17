"""Sun, Moon, Earth and eclipses in words: lines of a description, and warnings."""

from __future__ import annotations

import numpy as np

from rso_lidar import detector, optics, units
from rso_lidar.motion import Body, Chief
from rso_lidar.optics import STRAY_BODIES, veil_on_axis
from rso_lidar.orbit import Eclipse, Epochs, earth_angular_radius_rad, find_eclipses
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.mission.moon_missions import list_lunar_bodies
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import (
    SkyGeometry,
    compute_sky_geometry,
    line_height_over_moon_m,
    line_of_sight_height_m,
    tabulate_environment,
)
from rso_lidar.scenario.tables.constraints import Constraints
from rso_lidar.ties import find_first_greatest, find_first_least

_NEAR_DEG = 5.0  # outside of the field: a baffle blocks little of a Sun that is nearer
_ECLIPSES_S = 30 * units.DAY_S  # span from the start in which eclipses are searched
_MOST_LISTED = 3
_EPOCHS = 8  # evenly over the run, beside those at which a body is nearest
LOUDER = 1.05  # noise in sunlight or stray light over noise in the dark, from which a warning is given


def describe_environment(mission: Mission, preview: Preview) -> list[str]:
    """Describe Sun, Earth and Moon off the boresight, beta angles, phase angles and eclipses."""
    table = tabulate_environment(mission, preview)
    around = compute_sky_geometry(mission, preview)
    lines = []
    if "sun_angle_rad" in table:
        lines.append(f"sun         {_format_course(table['sun_angle_rad'], preview.time_s, ' off the boresight')}")
    if "earth_limb_angle_rad" in table and np.all(np.isfinite(table["earth_radius_rad"])):
        radius = _format_ends(table["earth_radius_rad"])
        limb = _format_course(table["earth_limb_angle_rad"], preview.time_s, " off the boresight")
        covers = around.earth_in_field
        cut = f"; in the field {np.mean(covers):.0%} of the time ({around.earth_side})" if covers.any() else ""
        lines.append(f"earth       limb {limb}; radius of its disk {radius}{cut}")
    if "moon_angle_rad" in table:
        lines.append(f"moon        {_format_course(table['moon_angle_rad'], preview.time_s, ' off the boresight')}")
    for target in mission.target:
        phase = table.get(f"{target.name}_phase_angle_rad")
        if phase is not None:
            lines.append(
                f"  phase     {target.name}: {_format_course(phase, preview.time_s)} (0°: the Sun is behind the lidar)"
            )
    bodies = [body for body in mission.bodies if body.orbits]
    for body in [body for body in bodies if body.name != "follower"] or bodies:
        beta = _format_ends(table[f"{body.name}_beta_rad"])
        lines.append(f"  eclipse   {body.name}: beta {beta}; {_describe_eclipses(mission, body)}")
    return lines


def advise_on_environment(mission: Mission, preview: Preview, constraints: Constraints | None = None) -> list[str]:
    """List warnings about Sun and Earth near the boresight, and about targets behind the Earth.

    A Sun near the field is not reported where `constraints` set an exclusion angle: then they decide.
    """
    around, glare = compute_sky_geometry(mission, preview), mission.lidar.receiver.glare
    near = constraints is None or constraints.sun_exclusion_deg is None
    simulated = () if glare is None else glare.sources
    lines = _advise_on_sun(preview, around, near=near, simulated="sun" in simulated)
    if mission.lidar.receiver.filter_width_nm is not None and "earth" not in simulated:
        lines += _advise_on_earth(preview, around) + _advise_on_moon(mission, preview, around)
    lines += advise_on_glare(mission, preview, around)
    return lines + _advise_on_line_of_sight(mission, preview, around)


def _advise_on_sun(preview: Preview, around: SkyGeometry, *, near: bool, simulated: bool) -> list[str]:
    """Warn of the Sun in the field of view, and near it, by whether frames show the Sun and its glare."""
    if around.sun_m is None:
        return []
    to_sun = around.sun_m - around.position_m
    disc = np.arcsin(units.SUN_RADIUS_M / np.sqrt(np.sum(to_sun**2, axis=-1)))
    outside = np.where(around.sun_seen, around.outside_field_rad(to_sun) - disc, np.inf)
    inside = outside <= 0.0
    if inside.any():
        return [
            f"the Sun is in the field of view {describe_share(inside, preview.time_s)}: it blinds a real sensor, and "
            f"{'frames show its light, not the damage' if simulated else 'no frame shows that'}; turn the boresight away, "
            "or start at another time"
        ]
    worst = int(np.argmin(outside))
    if not near or simulated or outside[worst] >= _NEAR_DEG * units.DEG:
        return []
    return [
        f"the Sun comes within {outside[worst] / units.DEG:.2f}° of the field of view at {preview.time_s[worst]:g} s, and "
        "stray light is not in the frames; add [lidar.receiver.glare], or state the baffle's exclusion angle as "
        "constraints.sun_exclusion_deg"
    ]


def _advise_on_earth(preview: Preview, around: SkyGeometry) -> list[str]:
    covers = around.earth_in_field
    if not covers.any():
        return []
    return [
        f"the Earth's disk is in the field of view {describe_share(covers, preview.time_s)} ({around.earth_side}): "
        "lidar.receiver.filter_width_nm asks for sunlight, but that which the Earth scatters is not in the frames; add "
        "[lidar.receiver.glare], or look away from the Earth"
    ]


def _advise_on_moon(mission: Mission, preview: Preview, around: SkyGeometry) -> list[str]:
    """Warn of the Moon's disk in the field of view of a follower that orbits about it."""
    if around.moon_m is None or "follower" not in list_lunar_bodies(mission.bodies):
        return []
    radius = earth_angular_radius_rad(around.moon_m - around.position_m, units.MOON_RADIUS_M)
    covers = around.outside_field_rad(around.moon_m - around.position_m) <= radius
    if not covers.any():
        return []
    return [
        f"the Moon's disk is in the field of view {describe_share(covers, preview.time_s)}: lidar.receiver.filter_width_nm "
        "asks for sunlight, but that which the Moon scatters is not in the frames; look away from the Moon"
    ]


def _advise_on_line_of_sight(mission: Mission, preview: Preview, around: SkyGeometry) -> list[str]:
    """Warn of targets hidden by the Earth, or by the Moon about which the follower orbits."""
    lines = []
    for target in mission.target if around.earth else ():
        blocked = line_of_sight_height_m(preview, target.name) < 0.0
        if blocked.any():
            lines.append(
                f"target {target.name}: the Earth stands between it and the lidar "
                f"{describe_share(blocked, preview.time_s)}, and frames show it all the same; start when it is in sight"
            )
        over_moon_m = line_height_over_moon_m(mission, preview, target.name)
        if over_moon_m is not None and (hidden := over_moon_m < 0.0).any():
            lines.append(
                f"target {target.name}: the Moon stands between it and the lidar {describe_share(hidden, preview.time_s)}, "
                "and frames show it all the same; start when it is in sight"
            )
    return lines


def describe_share(mask: np.ndarray, time_s: np.ndarray) -> str:
    """Describe how often a mask (time) is true, and when first."""
    return f"{np.mean(mask):.0%} of the time, first at {time_s[np.argmax(mask)]:g} s"


def _format_ends(angle: np.ndarray) -> str:
    return f"{angle[0] / units.DEG:.2f} -> {angle[-1] / units.DEG:.2f}°"


def _format_course(angle: np.ndarray, time_s: np.ndarray, off: str = "") -> str:
    """Format the first, last and least value of an angle (time) [rad] at times (time) [s]."""
    worst = find_first_least(angle)
    return f"{_format_ends(angle)}{off}, least {angle[worst] / units.DEG:.2f}° at {time_s[worst]:g} s"


def _describe_eclipses(mission: Mission, body: Body) -> str:
    """Describe the passages through umbra and penumbra, from when to when."""
    start_utc, end_s = mission.span
    searched_s = min(end_s, _ECLIPSES_S)
    eclipses = find_eclipses(Chief(mission.bodies, body.name), Epochs(start_utc, np.array([0.0, searched_s])))
    span = f" in the first {searched_s / units.DAY_S:g} days" if searched_s < end_s else ""
    if not eclipses:
        return f"no eclipse{span}"
    listed = [_describe_eclipse(eclipse) for eclipse in eclipses]
    if len(listed) > _MOST_LISTED:
        listed = [listed[0], f"... {len(listed) - 2} more ...", listed[-1]]
    filtered = mission.lidar.receiver.filter_width_nm is not None
    unlit = ", and then no sunlight on it" * filtered
    return f"{len(eclipses)} eclipse{'s' * (len(eclipses) > 1)}{span}: {'; '.join(listed)}{unlit}"


def _describe_eclipse(eclipse: Eclipse) -> str:
    partial = _describe_passage("penumbra", eclipse.penumbra_from_s, eclipse.penumbra_to_s)
    return (
        f"{_describe_passage('umbra', eclipse.umbra_from_s, eclipse.umbra_to_s)}, {partial}"
        if eclipse.is_total
        else partial
    )


def _describe_passage(what: str, begins_s: float, ends_s: float) -> str:
    """Describe one passage through a shadow by its ends [s since start_utc], infinite where outside the run."""
    if np.isinf(begins_s) and np.isinf(ends_s):
        return f"{what} all the time"
    begins = f"from {begins_s:.3f} s" if np.isfinite(begins_s) else "from before the first frame"
    ends = f"to {ends_s:.3f} s" if np.isfinite(ends_s) else "to after the last"
    return f"{what} {begins} {ends}"


def advise_on_glare(mission: Mission, preview: Preview, around: SkyGeometry) -> list[str]:
    """Warn of stray light that makes pixels noisier, at the worst of a few epochs; nothing without glare."""
    if mission.lidar.receiver.glare is None:
        return []
    if mission.is_local and mission.world.sun_direction is None:
        return [
            "lidar.receiver.glare is of Sun, Earth and Moon, and this local world has none of them; set "
            "world.sun_direction, or leave the glare out"
        ]
    if mission.is_local and "sun" not in mission.lidar.receiver.glare.sources:
        return [
            "lidar.receiver.glare.sources has no Sun, and this local world has no Earth and no Moon: frames have no glare; "
            'add "sun", or leave the glare out'
        ]
    nearest = [around.sun_angle_rad, around.earth_limb_angle_rad, around.moon_angle_rad]
    rows = [find_first_least(angle) for angle in nearest if angle is not None and np.all(np.isfinite(angle))]
    rows += np.linspace(0, len(preview.time_s) - 1, _EPOCHS).round().astype(int).tolist()
    light = np.zeros((len(rows), len(STRAY_BODIES)))
    image = np.zeros(len(rows))
    for number, row in enumerate(rows):
        truth = preview.truth.at(int(row))
        lidar = mission.instrument.at(float(truth.time_s))
        moon_m = mission.moon_position_m(float(truth.time_s))
        sky = optics.see_sky(lidar.laser, lidar.receiver, truth, moon_m, has_earth=not mission.is_local)
        if sky is not None:
            light[number], image[number] = veil_on_axis(sky, lidar.receiver), sky.image_photons_per_s.max()
    worst = find_first_greatest(light.sum(axis=1) + image)
    total = float(light[worst].sum() + image[worst])
    louder = detector.noise_growth(mission.instrument.detector, total)
    if louder < LOUDER:
        return []
    body = STRAY_BODIES[find_first_greatest(light[worst])]
    what = (
        "light of the sky in the field"
        if image[worst] > light[worst].sum()
        else f"glare, mostly of the {body.title()},"
    )
    return [
        f"{what} makes the noise of a pixel {louder:.2f} times that in the dark at {preview.time_s[rows[worst]]:g} s "
        f"({total:.2g} photons/s); turn the boresight away, add lidar.receiver.glare.baffle, or narrow "
        "lidar.receiver.filter_width_nm"
    ]
