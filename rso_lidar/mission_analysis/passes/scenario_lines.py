"""Scenario files that are written for encounters, line by line: motions, attitude, camera, and the names of targets."""

from __future__ import annotations

import datetime
import json
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from rso_lidar.errors import make_printable
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.orbit import ElementSet, Omm, State
from rso_lidar.part import Part
from rso_lidar.records import BodyState
from rso_lidar.rpo import rtn_axes
from rso_lidar.scenario import Lidar

# Patterns of an object's name. The model is a guess, as the file states.
_HINTS = (
    (r"\bDEB\b|DEBRIS|\bFRAG", "debris_plate"),
    (r"\bSL-16\b|ZENIT", "zenit_stage"),
    (r"\bR/B\b|ROCKET|STAGE|CENTAUR|BREEZE|FREGAT|\bH-2A\b|\bSL-\d|\bCZ-\d", "rocket_body"),
    (r"\bTDRS\b", "tdrs"),
    (r"ENVISAT", "envisat"),
    (r"INTELSAT|GALAXY|\bSES\b|EUTELSAT|ASTRA|MEV", "comsat"),
    (r"JUNO", "juno"),
)
LONGEST_RUN_S, SHORTEST_RUN_S = 1200.0, 10.0  # of a run
_MOST_FRAMES = 1250
_MARGIN_S = 5.0  # before and after the span of a run
_TAKEN = ("inertial", "follower", "ptu", "lidar", "sun_direction")


def write_scenario(
    title: str,
    seed: int,
    start_utc: datetime.datetime,
    duration_s: float,
    target: tuple[str, int],
    motions: tuple[str, str],
    states: tuple[BodyState, BodyState],
    lidar: Lidar,
    *,
    max_slew_deg_s: float,
    slew_source: str,
    size: Sequence[str] = (),
) -> list[str]:
    """Write the lines of a scenario whose PTU tracks one object from another.

    Parameters
    ----------
    target : name and catalogue number of the object that is seen, whose name tells its model
    motions : inline tables, of the object and of the follower
    states : of the follower and of the object at the closest approach, where the follower's +x points at the object
    max_slew_deg_s, slew_source : greatest rate of the drive [deg/s], and where it is from, in words
    size : lines of the size and material of the object
    """
    name, (model, why) = write_value(name_target(*target)), guess_model(target[0])
    pan, pitch, roll = choose_attitude(*states)
    rate_hz = max(rate for rate in (1.0, 2.0, 5.0, 10.0) if duration_s * rate <= _MOST_FRAMES)
    return [
        "version = 1",
        f"name    = {write_value(title)}",
        f"seed    = {seed}",
        "",
        "[time]",
        f"start_utc     = {start_utc:%Y-%m-%dT%H:%M:%SZ}",
        f"duration_s    = {duration_s:g}",
        f"frame_rate_hz = {rate_hz:g}",
        "",
        "[[target]]",
        f"name     = {name}",
        f"model    = {write_value(model)}   # {why}: size and material are as uncertain; put your own here",
        *size,
        f"motion   = {motions[0]}",
        'attitude = { type = "spin", axis = [0, 0, 1], rate_deg_s = 0.5 }   # assumed',
        "",
        "[follower]",
        f"motion   = {motions[1]}",
        f'attitude = {{ type = "rtn", euler_zyx_deg = [{pan:.4f}, {pitch:.4f}, {roll:.4f}] }}   # +x to it',
        "",
        f"[ptu]                                   # {slew_source}",
        f'point    = {{ type = "track", at = {name} }}',
        f'response = {{ type = "second_order", natural_hz = 4.0, damping = 0.7, max_rate_deg_s = {max_slew_deg_s:g} }}',
        "",
        write_lidar(lidar),
    ]


def choose_attitude(follower: BodyState, target: BodyState) -> tuple[float, float, float]:
    """Choose the attitude whose +x points at the target, with the axis about which the line of sight turns as +z.

    Parameters
    ----------
    follower, target : states at the closest approach, in the same inertial axes

    Returns
    -------
    tuple of float
        Intrinsic angles z, y, x [deg] of the follower's body in its rtn axes.
    """
    from scipy.spatial.transform import Rotation

    ahead, rate = target.position_m - follower.position_m, target.velocity_m_s - follower.velocity_m_s
    up = np.cross(ahead, rate)
    if np.linalg.norm(up) < max(1e-6 * float(np.linalg.norm(ahead) * np.linalg.norm(rate)), 1e-12):
        up = np.cross(follower.position_m, follower.velocity_m_s)
    if np.linalg.norm(np.cross(ahead, up)) == 0.0:
        return 90.0, 0.0, 0.0  # along the orbit normal, which leaves the roll open
    x = ahead / np.linalg.norm(ahead)
    y = np.cross(up, x)
    y /= np.linalg.norm(y)
    inertial_from_body = Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=1))
    inertial_from_rtn = rtn_axes(follower.position_m[None], follower.velocity_m_s[None])[0][0]
    angles = (inertial_from_rtn.inv() * inertial_from_body).as_euler("ZYX", degrees=True)
    return float(angles[0]), float(angles[1]), float(angles[2])


def write_motion(entry: Any, state: BodyState, at_utc: datetime.datetime) -> str:
    """Write the inline table of a motion: by SGP4 for an element set, else by two-body motion from a state.

    Parameters
    ----------
    state : its state in GCRS axes
    """
    if isinstance(entry, ElementSet):
        return write_elements(entry)
    place, speed = (tuple(float(part) for part in vector) for vector in (state.position_m, state.velocity_m_s))
    return write_part(State(epoch_utc=at_utc, position_m=place, velocity_m_s=speed))


def write_elements(elements: ElementSet) -> str:
    """Write the inline table of a motion by SGP4: the two lines of its element set, or the fields of its message."""
    if elements.line1 and elements.line2:
        named = f", name = {write_value(elements.name)}" if elements.name else ""
        first, second = write_value(elements.line1), write_value(elements.line2)
        return f'{{ type = "tle"{named}, lines = [\n    {first},\n    {second},\n] }}'
    return write_part(Omm.of(elements))


def write_part(part: Part) -> str:
    """Write a part without tables of its own as an inline table."""
    fields = part.model_dump(exclude_none=True)
    return "{ " + ", ".join(f"{key} = {write_value(value)}" for key, value in fields.items()) + " }"


def write_lidar(lidar: Lidar) -> str:
    """Write the table of a camera: the name of its preset, or the fields that were set."""
    import tomli_w

    tree: dict[str, Any] = lidar.model_dump(exclude_unset=True, exclude_none=True, mode="python")
    preset = lidar.preset
    if preset is not None and lidar == Lidar(preset=preset):  # type: ignore[call-arg]
        tree = {"preset": preset}  # the preset's own values need not be repeated
    return tomli_w.dumps({"lidar": tree})


def guess_model(name: str) -> tuple[str, str]:
    """Return a model of the catalogue for an object, and the reason for it."""
    for pattern, model in _HINTS:
        if re.search(pattern, name.upper()):
            return model, "guessed from the object's name"
    return "cubesat_3u", "a stand-in, for nothing in the object's name says what it is"


def name_target(name: str, norad_id: int) -> str:
    """Name a target after its object, or after its catalogue number where it has no name."""
    words = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    if not words:
        return f"norad_{norad_id}"
    return words if words[0].isalpha() and words not in _TAKEN else f"object_{words}"


def write_value(value: Any) -> str:
    """Write a value as TOML."""
    if isinstance(value, datetime.datetime):
        return value.astimezone(datetime.UTC).isoformat().replace("+00:00", "Z")
    return json.dumps(make_printable(value) if isinstance(value, str) else value, ensure_ascii=False)


def write_size(light: PlateLight | None) -> list[str]:
    """Write the size and material of the plate that a search was asked for; nothing where they were assumed."""
    lines = []
    if light is not None and light.plate.side_m is not None:
        lines.append(f"size_m   = {light.plate.side_m:g}   # longest side, that of the plate of the search")
    if light is not None and light.plate.reflectance is not None:
        reflectance = f"{light.plate.reflectance:g}"
        lines.append(f'material = {{ type = "lambertian", reflectance = {reflectance} }}   # of that plate')
    return lines


def choose_run(
    start_utc: datetime.datetime, span_s: tuple[float, float], about_s: float
) -> tuple[datetime.datetime, float]:
    """Choose start (a whole second) and duration [s] of a run over a span, at most 20 minutes about an instant.

    Parameters
    ----------
    start_utc : from which the seconds of the span and of the instant count
    """
    begin = max(span_s[0] - _MARGIN_S, about_s - 0.5 * LONGEST_RUN_S)
    end = max(min(span_s[1] + _MARGIN_S, about_s + 0.5 * LONGEST_RUN_S), begin + SHORTEST_RUN_S)
    first_utc = (start_utc.astimezone(datetime.UTC) + datetime.timedelta(seconds=begin)).replace(microsecond=0)
    return first_utc, float(math.ceil(end - begin) + 1)


def write_cautions(
    range_m: float, reach_m: tuple[float, float], slew_deg_s: float, most_slew_deg_s: float
) -> list[str]:
    """Write the comments that warn of a closest approach outside the lidar's reach, or too fast for the drive.

    Parameters
    ----------
    range_m : of the closest approach [m]
    reach_m : nearest and farthest range of the lidar for a facing plate of 1 m2 [m]
    slew_deg_s, most_slew_deg_s : rate of the line of sight there, and greatest rate of the drive [deg/s]
    """
    lines = []
    if not reach_m[0] <= range_m <= reach_m[1]:
        lines.append(
            f"# BEWARE: the closest approach is outside the lidar's reach ({reach_m[0]:,.0f} to {reach_m[1]:,.0f} m for a "
            "facing plate of 1 m2): frames there show false alarms at most."
        )
    if slew_deg_s > most_slew_deg_s:
        lines.append(
            f"# BEWARE: the line of sight turns at {slew_deg_s:,.3g} deg/s at the closest approach, more than the "
            f"{most_slew_deg_s:g} deg/s of the drive."
        )
    return lines
