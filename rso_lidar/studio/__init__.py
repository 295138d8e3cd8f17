"""The studio: a scenario built, seen and flown in a browser (extra `studio`), over the public API and the command line."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.studio.server import open_studio
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "open_studio",
]

__dir__ = limit_dir(__name__)
