"""The queue of jobs: commands that wait, run in processes of their own, and end."""

from __future__ import annotations

from rso_lidar.studio.folder import Folder


class JobQueue:
    """Jobs in the order in which they were given."""

    def __init__(self, folder: Folder) -> None:
        self.folder = folder

    def close(self) -> None:
        """End."""
