"""Cameras on the follower beside the lidar: images of targets, sky and laser light on a passive sensor."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.imaging.camera import AutoExposure, Band, Camera, CameraLens
    from rso_lidar.imaging.exposure import Flash, NaturalLight, read_image, take_image
    from rso_lidar.imaging.image_sensor import ImageSensor
    from rso_lidar.imaging.stars import StarCatalogue, load_stars
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "AutoExposure",
    "Band",
    "Camera",
    "CameraLens",
    "Flash",
    "ImageSensor",
    "NaturalLight",
    "StarCatalogue",
    "load_stars",
    "read_image",
    "take_image",
]

__dir__ = limit_dir(__name__)
