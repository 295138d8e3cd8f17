"""Sensors of the spacecraft beside the lidar: gyros, accelerometers, GNSS, star trackers, telemetry of actuators."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.sensors.actuator_telemetry import ThrusterTelemetry, WheelTelemetry
    from rso_lidar.sensors.choice import (
        BEFORE_ALL_S,
        AnySensor,
        DescribedSensor,
        Sensor,
        describe_sensor,
        find_impairments,
        measure_samples,
        read_schedule,
    )
    from rso_lidar.sensors.gnss import Gnss, RelativeGnss
    from rso_lidar.sensors.inertial import Accelerometer, Gyro
    from rso_lidar.sensors.random_errors import draw_normals, make_key
    from rso_lidar.sensors.sensor_part import OutageWindow, RandomOutage, load_sensor_presets
    from rso_lidar.sensors.star_tracker import StarTracker
    from rso_lidar.sensors.suite import SensorSuite
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "BEFORE_ALL_S",
    "Accelerometer",
    "AnySensor",
    "DescribedSensor",
    "Gnss",
    "Gyro",
    "OutageWindow",
    "RandomOutage",
    "RelativeGnss",
    "Sensor",
    "SensorSuite",
    "StarTracker",
    "ThrusterTelemetry",
    "WheelTelemetry",
    "describe_sensor",
    "draw_normals",
    "find_impairments",
    "load_sensor_presets",
    "make_key",
    "measure_samples",
    "read_schedule",
]

__dir__ = limit_dir(__name__)
