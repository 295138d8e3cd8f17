"""The studio: a scenario built, seen and flown in a browser (extra `studio`), over the public API and the command line."""

from rso_lidar.public_names import limit_dir
from rso_lidar.studio.server import open_studio

__all__ = ["open_studio"]

__dir__ = limit_dir(__name__)
