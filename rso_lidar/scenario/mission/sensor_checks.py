"""Checks of the other sensors, the cameras and the PTU of a mission: against its bodies, and against each other."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from rso_lidar.errors import add_place, did_you_mean
from rso_lidar.imaging import Camera
from rso_lidar.motion import Body, count_dynamics
from rso_lidar.part import NAME_PATTERN
from rso_lidar.sensors import RelativeGnss, ThrusterTelemetry, WheelTelemetry, read_schedule


def check_sensors(sensors: Sequence[Any], targets: Sequence[Body], follower: Body) -> None:
    """Check names of sensors, and that what they measure exists.

    Raises
    ------
    ValueError
        If two have one name, a name cannot be that of a group in a recording, a schedule is not valid, or a target or
        dynamics is missing.
    """
    named = [sensor.name for sensor in sensors]
    for name in named:
        if not isinstance(name, str) or not re.fullmatch(NAME_PATTERN, name):
            raise ValueError(f"sensor: the name {name!r:.40} needs a letter followed by letters, digits, _ or -")
    if twice := [name for name in named if named.count(name) > 1]:
        raise ValueError(f"sensor: two have the name '{twice[0]}'; rename one")
    for sensor in sensors:
        with add_place(f"sensor '{sensor.name}'"):
            read_schedule(sensor)
    known = [target.name for target in targets]
    for sensor in sensors:
        if isinstance(sensor, RelativeGnss) and sensor.target not in known:
            guess = did_you_mean(sensor.target, known)
            raise ValueError(
                f"sensor '{sensor.name}': no target '{sensor.target}'{guess} (known: {', '.join(known) or 'none'})"
            )
        if isinstance(sensor, WheelTelemetry | ThrusterTelemetry):
            sensor.check_dynamics(count_dynamics(follower))


def check_cameras(cameras: Sequence[Camera], bodies: Sequence[Body], *, has_ptu: bool) -> None:
    """Check names and carriers of cameras.

    Raises
    ------
    ValueError
        If two axes have one name, or a camera is on a PTU that the scenario does not have.
    """
    taken = ["inertial", "lidar", "ptu"] + [
        name for body in bodies for name in (body.name, *(axes.name for axes in body.axes))
    ]
    for number, camera in enumerate(cameras):
        if camera.name in taken:
            raise ValueError(f"camera[{number}].name: '{camera.name}' are other axes already; rename the camera")
        taken.append(camera.name)
        if camera.carrier == "ptu" and not has_ptu:
            raise ValueError(f"camera {camera.name}: carrier is the ptu, and there is none; add [ptu]")


def check_tracked_name(tracked: str | None, bodies: Sequence[Body]) -> None:
    """Check that what the PTU tracks exists.

    Parameters
    ----------
    tracked : name of a body, or of axes that it declares; None where the PTU tracks nothing

    Raises
    ------
    ValueError
        If there is no such body.
    """
    known = [name for body in bodies for name in (body.name, *(axes.name for axes in body.axes)) if name != "follower"]
    if tracked is not None and tracked not in known:
        guess = did_you_mean(tracked, known)
        raise ValueError(f"ptu.point.at: no body is named '{tracked}'{guess} (known: {', '.join(known) or 'none'})")
