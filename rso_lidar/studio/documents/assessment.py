"""Assessment of a text: the scenario that it is, or what is wrong with it and where."""

from __future__ import annotations

from dataclasses import dataclass

from rso_lidar.errors import RsoLidarError
from rso_lidar.scenario import Scenario
from rso_lidar.studio.folder import Folder


@dataclass(frozen=True)
class Assessment:
    """A text with the scenario that it is; or with its first problem, the place of that as a TOML key, and its line."""

    text: str
    scenario: Scenario | None
    problem: str = ""
    place: str = ""
    line: int | None = None


def assess(text: str, folder: Folder, title: str) -> Assessment:
    """Assess a text; the files that it names must lie inside the folder, or be shipped."""
    try:
        return Assessment(text, Scenario.loads(text, folder=folder.path, where=title))
    except RsoLidarError as error:
        return Assessment(text, None, str(error))
