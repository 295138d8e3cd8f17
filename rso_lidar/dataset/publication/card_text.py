"""Sentences about a dataset that its card and its Croissant description share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.shards.layout import name_camera_array

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset

CARD = "README.md"
LIMITS = (
    "All frames are simulated. No real measurement was used or compared with, so a result on them does not prove the same "
    "result on a real sensor.",
    "Materials of most models are chosen by the appearance of surfaces, not measured; so intensities are uncertain.",
    "Models are simplified; the table of models states the confidence in each.",
    "Numbers of the instrument that no publication states are assumed; the table of the sensor marks them.",
    "Poses follow the laws of the specification, not the statistics of missions, and the frequencies of classes are chosen.",
)
CAMERA_LIMIT = (
    "Images of cameras have light that met one surface, from Sun, Earth and laser. Clouds, moonlight on targets and mosaics "
    "of colour filters are not simulated; numbers of the image sensor that the scenario does not state are assumed."
)
PAPER = (
    "Fuller, L., Karl, R., Jr., Anderson, B., Lee-Roller, M.: Development of a versatile LiDAR point cloud simulation "
    "testbed for advanced RSO algorithms"
)


def describe_dataset(data: Dataset) -> str:
    """Describe a dataset in one or two sentences."""
    total = sum(len(data.split(name)) for name in data.splits)
    splits = ", ".join(f"{len(data.split(name)):,} {name}" for name in data.splits)
    n_rows, n_cols = data.split(data.splits[0]).read([0], ["range_m"])["range_m"].shape[1:]
    beside = " and ".join(f"{name} ({' x '.join(map(str, _find_shape(data, name)))})" for name in data.cameras)
    cameras = f" Beside the lidar are the cameras {beside}: rows, columns and bands." if beside else ""
    return (
        f"{total:,} simulated frames ({splits}) of a flash lidar with {n_rows} x {n_cols} pixels that looks at spacecraft: "
        f"range, intensity and labels of {len(data.classes)} classes. Each frame has the class, pose, box and range of its "
        f"target, and for each pixel the true range, the expected photons and the part of the target.{cameras}"
    )


def _find_shape(data: Dataset, camera: str) -> tuple[int, ...]:
    """Return rows, columns and bands of the images of a camera."""
    name = name_camera_array(camera, "intensity_counts")
    shape: tuple[int, ...] = data.split(data.splits[0]).read([0], [name])[name].shape[1:]
    return shape


def list_limits(data: Dataset) -> tuple[str, ...]:
    """List the known limits of a dataset, as sentences."""
    return (*LIMITS, CAMERA_LIMIT) if data.cameras else LIMITS


def cite(data: Dataset, attribution: Attribution) -> str:
    """Return how to cite a dataset."""
    who = ", ".join(attribution.creators) or "Anonymous"
    where = f" {attribution.url}" if attribution.url else ""
    return f"{who}: {data.spec.name} (dataset {data.constants.sha256[:12]}, made with rso_lidar).{where}"
