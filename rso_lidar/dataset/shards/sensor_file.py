"""The sensor file: data that are the same for all frames, such as names, lines of sight and symmetries."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.dataset.shards.shard_file import CONVENTIONS, hash_file
from rso_lidar.errors import DatasetError
from rso_lidar.export import check_declared_size, open_checked
from rso_lidar.files import write_atomically, write_text

SENSOR_FILE = "sensor.h5"
SENSOR_HASH = "sensor.h5.sha256"  # as `sha256sum` writes it; libhdf5 may read wrong numbers from a damaged file
_CAMERAS = "cameras"  # group of the cameras beside a sensor
_LISTS = ("classes", "models", "sensors", "part_classes", "splits")


class CameraConstants(NamedTuple):
    """A camera beside the lidar: its table as JSON, and the unit vectors (row, col, xyz) of its pixels in camera axes."""

    table: str
    line_of_sight: np.ndarray


@dataclass(frozen=True)
class Constants:
    """Names that the numbers of a dataset refer to, and the constants of its sensors.

    `model_parts` holds the part names of each model, and `symmetries` the symmetry of each model as a table, or None.
    `line_of_sight` (row, col, xyz) holds the unit vectors of each sensor in lidar axes, and `lidars` the table of each
    instrument as JSON. `file_sha256` holds the hash of each file that the scenario names, other than meshes. `cameras`
    holds the cameras beside each sensor by name.
    """

    sha256: str
    title: str
    classes: tuple[str, ...]
    models: tuple[str, ...]
    sensors: tuple[str, ...]
    part_classes: tuple[str, ...]
    splits: tuple[str, ...]
    model_parts: Mapping[str, tuple[str, ...]]
    symmetries: Mapping[str, Any]
    line_of_sight: Mapping[str, np.ndarray]
    lidars: Mapping[str, str]
    file_sha256: Mapping[str, str] = field(default_factory=dict)
    cameras: Mapping[str, Mapping[str, CameraConstants]] = field(default_factory=dict)


def write_constants(folder: Path, constants: Constants) -> None:
    """Write the sensor file, and its hash before it."""
    import h5py

    with write_atomically(folder / SENSOR_FILE, keep_suffix=False) as draft:
        with h5py.File(draft, "w", libver=("v110", "v110")) as file:
            file.attrs["Conventions"] = CONVENTIONS
            file.attrs["dataset_sha256"], file.attrs["title"] = constants.sha256, constants.title
            for name in _LISTS:
                file.attrs[name] = json.dumps(list(getattr(constants, name)))
            file.attrs["model_parts"] = json.dumps({name: list(parts) for name, parts in constants.model_parts.items()})
            file.attrs["file_sha256"] = json.dumps(dict(constants.file_sha256))
            file.attrs["symmetries"] = json.dumps(dict(constants.symmetries))
            for name in constants.sensors:
                group = file.create_group(f"sensors/{name}")
                group.attrs["lidar"] = constants.lidars[name]
                _write_sight(group, constants.line_of_sight[name], "lidar")
                if cameras := constants.cameras.get(name):
                    _write_cameras(group.create_group(_CAMERAS, track_order=True), cameras)
        write_text(folder / SENSOR_HASH, f"{hash_file(draft)}  {SENSOR_FILE}\n", overwrite=True)


def _write_cameras(group: Any, cameras: Mapping[str, CameraConstants]) -> None:
    """Write the cameras beside a sensor, by name, in the order of the scenario."""
    for name, entry in cameras.items():
        beside = group.create_group(name)
        beside.attrs["camera"] = entry.table
        _write_sight(beside, entry.line_of_sight, "camera", compression="gzip", shuffle=True)


def _write_sight(group: Any, line_of_sight: np.ndarray, axes: str, **options: Any) -> None:
    """Write the unit vectors (row, col, xyz) of pixels; `axes` names the axes in words."""
    array = group.create_dataset("line_of_sight", data=line_of_sight.astype("f8"), **options)
    array.attrs["units"], array.attrs["dims"] = "1", "row col xyz"
    array.attrs["long_name"] = f"unit vector of each pixel's centre in {axes} axes"


def read_constants(folder: Path) -> Constants:
    """Read the sensor file.

    Raises
    ------
    DatasetError
        If the folder is no dataset, or the file is damaged.
    """
    place = folder / SENSOR_FILE
    if not folder.is_dir() or not place.is_file():
        raise DatasetError(f"{folder}: is not the folder of a dataset; `rso-lidar dataset make` makes one")
    _check_hash(folder)
    try:
        with open_checked(place) as file:
            if file.attrs["Conventions"] != CONVENTIONS:
                raise DatasetError(
                    f"{place}: is of '{file.attrs['Conventions']}', and this rso_lidar reads '{CONVENTIONS}': upgrade "
                    "rso_lidar, or make the dataset again"
                )
            lists = {name: _load_names(file.attrs[name]) for name in _LISTS}
            groups = {name: file[f"sensors/{name}"] for name in lists["sensors"]}
            beside = {name: dict(group.get(_CAMERAS, {})) for name, group in groups.items()}
            for group in (*groups.values(), *(camera for cameras in beside.values() for camera in cameras.values())):
                check_declared_size(group["line_of_sight"])
            lidars = {name: str(group.attrs["lidar"]) for name, group in groups.items()}
            cameras = {name: {camera: _read_camera(beside[name][camera]) for camera in beside[name]} for name in beside}
            tables = [json.loads(file.attrs["symmetries"]), json.loads(file.attrs.get("file_sha256", "{}"))]
            texts = [*lidars.values(), *(camera.table for entries in cameras.values() for camera in entries.values())]
            for table in (*tables, *map(json.loads, texts)):
                if not isinstance(table, dict):
                    raise ValueError(f"{table!r:.40} is not a table")
            if missing := {*lists["models"]} - tables[0].keys():
                raise ValueError(f"no symmetry of {min(missing)}")
            return Constants(
                sha256=str(file.attrs["dataset_sha256"]),
                title=str(file.attrs["title"]),
                **lists,
                model_parts={name: tuple(parts) for name, parts in json.loads(file.attrs["model_parts"]).items()},
                symmetries=tables[0],
                file_sha256=tables[1],
                line_of_sight={name: np.asarray(group["line_of_sight"]) for name, group in groups.items()},
                lidars=lidars,
                cameras=cameras,
            )
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(
            f"{place}: is damaged ({' '.join(str(error).split()):.80}); delete it, and make with --resume"
        ) from None


def _read_camera(group: Any) -> CameraConstants:
    """Read a camera beside a sensor from its group."""
    return CameraConstants(str(group.attrs["camera"]), np.asarray(group["line_of_sight"]))


def _load_names(text: str) -> tuple[str, ...]:
    """Return the names in a list as JSON, or raise `ValueError` if it is another value."""
    names = json.loads(text)
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{text:.40} is not a list of names")
    return tuple(names)


def _check_hash(folder: Path) -> None:
    """Raise `DatasetError` if the sensor file differs from its hash; a folder without the hash is not checked."""
    place = folder / SENSOR_FILE
    try:
        stated = (folder / SENSOR_HASH).read_bytes().partition(b" ")[0]
    except FileNotFoundError:
        return
    except OSError as error:
        raise DatasetError(f"{folder / SENSOR_HASH}: cannot be read ({error.strerror}); check the folder") from None
    try:
        sha256 = hash_file(place)
    except OSError as error:
        raise DatasetError(f"{place}: cannot be read ({error.strerror}); check the folder") from None
    if stated != sha256.encode():
        raise DatasetError(
            f"{place}: is damaged: it differs from its hash in {SENSOR_HASH}; delete it, and make with --resume"
        )
