"""Images of cameras in a recording: ``/camera/<name>/…``, what the sensor said beside what was really there.

The images of a camera have rows and columns of their own, whose dimensions are named `image_row` and `image_col`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

import numpy as np

from rso_lidar.records import ArraySpec, CameraImage, CameraLabels, Frame, Record, specs

GROUP = "camera"
_IMAGE = {"intensity": "intensity_counts", "exposure": "exposure_s"}  # name in the file, and in the record
_LABELS = {
    "electrons": "electrons",
    "target": "target",
    "part": "part",
    "range": "range_m",
    "filled_fraction": "filled_fraction",
}
_MORE_LABELS = {  # that not all recordings have
    "facet": "facet",
    "keypoint_px": "keypoint_px",
    "keypoint_range": "keypoint_range_m",
    "keypoint_visibility": "keypoint_visibility",
}
_DIMS = {"row": "image_row", "col": "image_col"}


def list_arrays(frame: Frame) -> dict[str, ArraySpec]:
    """List the arrays that a recording makes of the images of the cameras of a frame, by path."""
    array_specs = {}
    for camera in frame.camera:
        labels = frame.camera_labels[camera]
        more = {path: name for path, name in _MORE_LABELS.items() if getattr(labels, name) is not None}
        for record, fields in ((CameraImage, _IMAGE), (CameraLabels, _LABELS | more)):
            for path, name in fields.items():
                spec = specs(record)[name]
                dims = tuple(_DIMS.get(dim, dim) for dim in spec.dims)
                array_specs[f"{GROUP}/{camera}/{path}"] = dataclasses.replace(spec, dims=dims)
    return array_specs


def collect_arrays(frame: Frame) -> dict[str, np.ndarray]:
    """Collect the arrays of the images of a frame, by path."""
    arrays: dict[str, np.ndarray] = {}
    for camera, image in frame.camera.items():
        records: tuple[tuple[Record, Mapping[str, str]], ...]
        records = (image, _IMAGE), (frame.camera_labels[camera], _LABELS | _MORE_LABELS)
        for record, fields in records:
            arrays |= {
                f"{GROUP}/{camera}/{path}": value
                for path, name in fields.items()
                if (value := getattr(record, name)) is not None
            }
    return arrays


def list_cameras(paths: Iterable[str]) -> list[str]:
    """Return the names of the cameras of which there are images among the paths of a recording."""
    return [path.split("/")[1] for path in paths if path.startswith(f"{GROUP}/") and path.endswith("/intensity")]


def name_arrays(camera: str) -> dict[str, str]:
    """Return the path of each array that a camera may have, with the name of its field."""
    return {f"{GROUP}/{camera}/{path}": name for path, name in (_IMAGE | _LABELS | _MORE_LABELS).items()}


def restore_records(camera: str, arrays: Mapping[str, np.ndarray]) -> tuple[CameraImage, CameraLabels]:
    """Restore image and labels of a camera from those of its arrays that a recording has, by path."""
    image = {name: arrays[f"{GROUP}/{camera}/{path}"] for path, name in _IMAGE.items()}
    labels = {name: arrays[f"{GROUP}/{camera}/{path}"] for path, name in _LABELS.items()}
    more = {name: arrays[at] for path, name in _MORE_LABELS.items() if (at := f"{GROUP}/{camera}/{path}") in arrays}
    return CameraImage(**image), CameraLabels(**labels, **more)
