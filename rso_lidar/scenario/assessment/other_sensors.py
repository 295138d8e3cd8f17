"""The other sensors of a mission: a line about each, and warnings of what keeps them from their stated performance."""

from __future__ import annotations

import numpy as np

from rso_lidar import motion, sensors
from rso_lidar.orbit import earth_angular_radius_rad
from rso_lidar.pose import ROOT, length, quaternion_xyzw
from rso_lidar.records import BodyMotion
from rso_lidar.scenario.assessment.environment import describe_share
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import compute_sky_geometry
from rso_lidar.sensors import BEFORE_ALL_S


def describe_sensors(mission: Mission) -> list[str]:
    """Describe the other sensors, one per line."""
    return [f"sensor      {sensors.describe_sensor(sensor, mission.time.frame_rate_hz)}" for sensor in mission.sensor]


def advise_on_sensors(mission: Mission, preview: Preview) -> list[str]:
    """List warnings of the other sensors: blinded, without a sample in the run, or without a force to measure."""
    if not mission.sensor:
        return []
    lines = []
    end_s, followed = mission.span[1], _find_follower_motion(mission, preview)
    for sensor in mission.sensor:
        if not sensors.read_schedule(sensor).number_available(BEFORE_ALL_S, end_s):
            lines.append(
                f"sensor '{sensor.name}': no sample becomes available until the last frame, at {end_s:g} s; lower its "
                "phase_s or latency_s, or raise time.duration_s"
            )
        for it in sensors.find_impairments(sensor, followed):
            if it.when.any():
                share = describe_share(it.when, preview.time_s)
                lines.append(f"sensor '{sensor.name}': {it.what} {share}: {it.why}; {it.cure}")
    if not motion.states_specific_force(mission.follower, local=mission.is_local):
        lines += [
            f"sensor '{sensor.name}': measures no thrust, because follower.motion states only where the follower is; to "
            "have one, fly a proximity operation, `state_space`, or an FMU that states it"
            for sensor in mission.sensor
            if isinstance(sensor, sensors.Accelerometer)
        ]
    return lines


def _find_follower_motion(mission: Mission, preview: Preview) -> BodyMotion:
    """Find the motion of the follower at the epochs of a preview, as far as impairments depend on it."""
    around = compute_sky_geometry(mission, preview)
    position_m, shape = around.position_m, around.position_m.shape
    link = preview.truth.poses.link(ROOT, "follower")
    unread = np.broadcast_to(np.nan, shape)
    return BodyMotion(
        preview.time_s,
        position_m,
        unread,
        np.broadcast_to(quaternion_xyzw(link.rotation), (shape[0], 4)),
        np.broadcast_to(link.angular_velocity_rad_s, shape),
        unread,
        sun_direction=None if around.sun_m is None else _normalize(around.sun_m - position_m),
        moon_direction=None if around.moon_m is None else _normalize(around.moon_m - position_m),
        earth_direction=_normalize(-position_m) if around.earth else None,
        earth_angle_rad=earth_angular_radius_rad(position_m) if around.earth else None,
    )


def _normalize(vectors: np.ndarray) -> np.ndarray:
    unit: np.ndarray = vectors / length(vectors)[:, None]
    return unit
