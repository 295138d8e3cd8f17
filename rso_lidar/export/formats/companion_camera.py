"""Cameras beside the lidar, as the scenario of a recording states them: intrinsics, bands, sensor and exposure.

The scenario's text has every key, because it is resolved. The pinhole and the gain follow from the keys in closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, warn
from rso_lidar.export.formats.camera import PinholeCamera
from rso_lidar.export.layout.datasets import compute_lidar_poses
from rso_lidar.part import parse_toml
from rso_lidar.pose import build_rotation, quaternion_xyzw
from rso_lidar.records import Frame
from rso_lidar.units import DEG, MM, UM

_TERMS = ("k1", "k2", "p1", "p2", "k3")  # in the order of OpenCV
_SENSOR = ("bits", "black_level_counts", "full_well_electrons", "read_noise_electrons", "dark_electrons_per_s")
_SHUTTER = ("start_ms", "row_delay_us")
_OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # x, y, z, w: optical axes (z ahead, x right) in those of a mount (x ahead, y left)


@dataclass(frozen=True)
class CompanionCamera:
    """A camera beside the lidar: shape of its images, its pinhole, and what else a reader of its counts must know.

    `shape` has rows, columns and bands. `sensor` holds converter, wells, noise and shutter, with the names of the scenario.
    `electrons_per_count` is the gain. `position_m` and `quaternion_xyzw` are the pose carrier_from_camera, in the axes of
    `carrier`; those of the camera have x right, y down and z along the boresight.
    """

    name: str
    shape: tuple[int, int, int]
    pinhole: PinholeCamera
    bands: tuple[Mapping[str, Any], ...]
    electrons_per_count: float
    sensor: Mapping[str, Any]
    carrier: str
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float]

    def describe(self) -> dict[str, Any]:
        """Return the camera as a table that JSON can hold; `cx` and `cy` are 0 at the centre of the first pixel."""
        rows, cols, _ = self.shape
        col, row = self.pinhole.centre_px
        return {
            "name": self.name,
            "carrier": self.carrier,
            "position_m": list(self.position_m),
            "quaternion_xyzw": list(self.quaternion_xyzw),
            "width": cols,
            "height": rows,
            "fx": self.pinhole.focal_px,
            "fy": self.pinhole.focal_px,
            "cx": col,
            "cy": row,
            "distortion_model": "plumb_bob",
            "distortion": dict(zip(_TERMS, self.pinhole.distortion, strict=True)),
            "bands": [dict(band) for band in self.bands],
            "electrons_per_count": self.electrons_per_count,
            **self.sensor,
        }


def read_cameras(place: Path, first: Frame) -> dict[str, CompanionCamera]:
    """Read the cameras that have images in a frame, by name, from the scenario of its recording.

    Raises
    ------
    RecordingError
        If the scenario does not describe a camera as its images are.
    """
    described = {camera.name: camera for camera in list_cameras(place, first.source.scenario)} if first.camera else {}
    for name, image in first.camera.items():
        shape = image.intensity_counts.shape
        if name not in described:
            raise _find_fault(place, name, "it is missing")
        if described[name].shape != shape:
            raise _find_fault(place, name, f"its images have the shape {shape}, not {described[name].shape}")
    return {name: described[name] for name in first.camera}


def list_cameras(place: Path, scenario: str) -> list[CompanionCamera]:
    """List the cameras of a resolved scenario.

    Parameters
    ----------
    place : that messages name
    scenario : its text, from `Source.scenario`

    Returns
    -------
    list of CompanionCamera
        in the order of the scenario.

    Raises
    ------
    RecordingError
        If the text of the scenario is cut short or altered.
    """
    cameras = []
    for number, table in enumerate(parse_toml(scenario, "recording", RecordingError).get("camera", [])):
        try:
            cameras.append(_read_camera(place, table))
        except (KeyError, TypeError, ValueError) as error:
            name = table.get("name", str(number)) if isinstance(table, dict) else str(number)
            raise _find_fault(place, name, repr(error)) from None
    return cameras


def _find_fault(place: Path, camera: str, what: str) -> RecordingError:
    """Return the error for a recording whose scenario does not describe one of its cameras."""
    return RecordingError(
        f"{place}: camera '{camera}': the recording's scenario does not describe it ({what}); export the recording that was "
        "simulated"
    )


def check_images(place: Path, frame: Frame, cameras: dict[str, CompanionCamera]) -> None:
    """Raise a `RecordingError` unless a frame has the images of the first frame's cameras."""
    if {name: image.intensity_counts.shape for name, image in frame.camera.items()} != {
        c.name: c.shape for c in cameras.values()
    }:
        raise RecordingError(
            f"{place}: frame {frame.index}: its cameras or their images differ from the first frame's; write it to another "
            "place"
        )


def compute_camera_poses(frame: Frame, camera: str) -> dict[str, np.ndarray]:
    """Compute the matrix (4, 4) of camera_from_<name> for every node at the flash, by name."""
    lidar_from = compute_lidar_poses(frame.truth.poses)
    rotation, position = lidar_from[camera][:3, :3], lidar_from[camera][:3, 3]
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = rotation.T, -rotation.T @ position
    return {name: np.eye(4) if name == camera else inverse @ matrix for name, matrix in lidar_from.items()}


def _read_camera(place: Path, table: Mapping[str, Any]) -> CompanionCamera:
    """Convert the table of a camera."""
    lens, sensor = table["lens"], table["sensor"]
    rows, cols, bands = lens["n_rows"], lens["n_cols"], len(table["bands"])
    if "focal_length_mm" in lens:
        focal_px = lens["focal_length_mm"] * MM / (lens["pixel_pitch_um"] * UM)
    else:
        focal_px = 0.5 * cols / math.tan(0.5 * lens["fov_deg"] * DEG)
    gain = sensor.get("electrons_per_count")
    if gain is None:  # a full well is the greatest count
        gain = sensor["full_well_electrons"] / (2 ** sensor["bits"] - 1 - sensor["black_level_counts"])
    distortion = _read_distortion(place, table["name"], lens.get("distortion"))
    mount = table["mount"]
    rotation = build_rotation(mount.get("quaternion_xyzw"), mount.get("euler_zyx_deg")) * build_rotation(_OPTICAL, None)
    x, y, z = (float(value) for value in mount["position_m"])
    qx, qy, qz, qw = quaternion_xyzw(rotation).tolist()
    return CompanionCamera(
        table["name"],
        (rows, cols, bands),
        PinholeCamera(focal_px, (0.5 * (cols - 1), 0.5 * (rows - 1)), distortion, 0.0),
        tuple(table["bands"]),
        gain,
        {key: sensor[key] for key in _SENSOR} | {key: table[key] for key in _SHUTTER},
        table["carrier"],
        (x, y, z),
        (qx, qy, qz, qw),
    )


def _read_distortion(
    place: Path, camera: str, table: Mapping[str, Any] | None
) -> tuple[float, float, float, float, float]:
    """Return k1, k2, p1, p2, k3; zeros with a warning where only a file outside the recording states them."""
    if table is not None and table["type"] != "brown_conrady":
        warn(
            f"{place}: camera '{camera}': its distortion is that of a file, which the recording does not hold, so it is "
            "exported as a pinhole; give a brown_conrady distortion to export it"
        )
        table = None
    k1, k2, p1, p2, k3 = (float(table[term]) if table else 0.0 for term in _TERMS)
    return k1, k2, p1, p2, k3
