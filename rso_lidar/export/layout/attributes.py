"""Attributes of a recording and of its datasets, by the CF conventions 1.11."""

from __future__ import annotations

import datetime
import json
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.layout import sensor_samples
from rso_lidar.export.layout.datasets import TIME, Variable
from rso_lidar.export.layout.target_table import tabulate_targets
from rso_lidar.records import SCHEMA_VERSION, Frame, Source

AXES = (
    "inertial: GCRS, or the root of a local world. lidar: +z boresight, +x right (columns grow with it), +y down (rows "
    "grow with it). A point is range * line_of_sight, in lidar axes."
)
SCALES = {  # what the coordinate of a dimension means
    "row": "row of the focal plane, 0 at the top",
    "col": "column of the focal plane, 0 at the left",
    "return": "number of the return in its pixel, 0 the nearest",
    "sample": "number of the sample in its trace",
    "fine_row": "row of the oversampled image, 0 at the top",
    "fine_col": "column of the oversampled image, 0 at the left",
    "image_row": "row of the camera's image, 0 at the top",
    "image_col": "column of the camera's image, 0 at the left",
    "band": "number of the band, in the order of the scenario",
    "keypoint": "number of the keypoint, in the order of the targets and of their keypoints",
    "row_col": "0 for the row, 1 for the column",
}
_TIME_LINE = ("units", "calendar", "units_metadata", "comment")  # attributes of /time that other times have, too


def get_scale_meaning(path: str) -> str:
    """Return what the coordinate of a counted dimension means, such as that at ``sensors/gyro/sample``."""
    dim = path.rpartition("/")[2]
    if path.startswith(f"{sensor_samples.GROUP}/"):
        return "number of the sample in its frame" if dim == "sample" else f"number along {dim.replace('_', ' ')}"
    return SCALES[dim]


def get_array_attributes(variable: Variable, source: Source) -> dict[str, Any]:
    """Return the CF attributes of a dataset that grows by one entry per frame."""
    if variable.path == "time":
        return dict(get_time_attributes(source.start_utc))
    attributes: dict[str, Any] = {"units": variable.spec.unit, "long_name": variable.spec.meaning}
    if variable.is_series and variable.path.rpartition("/")[2] in sensor_samples.TIMES:
        attributes |= {name: get_time_attributes(source.start_utc)[name] for name in _TIME_LINE}
    if variable.path == "labels/target" and source.targets:
        attributes["flag_values"] = np.arange(len(source.targets), dtype=variable.spec.dtype)
        attributes["flag_meanings"] = " ".join(target.name for target in source.targets)
    return attributes


def get_sensor_attributes(frame: Frame) -> dict[str, str]:
    """Return the attribute of a recording that states its sensors; none where a frame has no sensors."""
    sensors = frame.observation.sensors
    return {"sensors": json.dumps(sensor_samples.describe_sensors(sensors), indent=1)} if sensors else {}


def get_group_attributes(frame: Frame) -> dict[str, dict[str, str]]:
    """Return the attributes of the groups of sensors, by path."""
    described = sensor_samples.describe_sensors(frame.observation.sensors)
    return {
        f"{sensor_samples.GROUP}/{name}": {"record": entry["record"], "long_name": entry["about"]}
        for name, entry in described.items()
    }


def get_root_attributes(source: Source) -> dict[str, Any]:
    """Return the attributes of a recording as a whole."""
    seed: Any = np.int64(source.seed) if abs(source.seed) < 2**63 else str(source.seed)
    return {
        "Conventions": "CF-1.11",
        "title": source.title,
        "history": f"simulated by rso_lidar {source.versions.get('rso_lidar', 'unknown')}",
        "schema_version": np.int64(SCHEMA_VERSION),
        "rso_lidar_version": source.versions.get("rso_lidar", "unknown"),
        "versions": json.dumps(dict(source.versions)),
        "scenario": source.scenario,
        "seed": seed,
        "start_utc": source.start_utc,
        "targets": json.dumps(tabulate_targets(source.targets), indent=1),
        "quaternion_order": "xyzw",
        "axes": AXES,
    }


def get_time_attributes(start_utc: str) -> dict[str, str]:
    """Return the CF attributes of /time.

    The units name the start without an offset, because netCDF tools expect that form.
    """
    try:
        start = datetime.datetime.fromisoformat(start_utc)
    except ValueError:
        raise RecordingError(
            f"start_utc: '{start_utc}' is not an ISO 8601 instant; write 2024-09-17T12:00:00Z"
        ) from None
    if start.tzinfo is not None:
        start = start.astimezone(datetime.UTC).replace(tzinfo=None)
    return {
        "units": f"seconds since {start.isoformat(sep=' ')}",
        "calendar": "standard",
        "units_metadata": "leap_seconds: none",  # CF 1.12, sec. 4.4.3: every day of this time line has 86400 s
        "standard_name": "time",
        "axis": "T",
        "long_name": TIME.meaning,
        "comment": "elapsed SI seconds since start_utc (UTC); a leap second during the run is an ordinary second, so "
        "the calendar time that a reader derives is one second ahead of UTC after it",
    }
