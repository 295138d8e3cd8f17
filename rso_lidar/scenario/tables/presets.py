"""Cameras by name: shipped ones, and those that a user's preset file describes."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.files import read_text
from rso_lidar.part import MOST_TOML_BYTES, parse_toml
from rso_lidar.shipped import find

PRESET_SUFFIX = ".toml"
_TABLES = ("laser", "receiver", "detector", "calibration")


@cache
def load_presets() -> dict[str, dict[str, Any]]:
    """Load the shipped cameras by name, as TOML tables of `[lidar]` with a line `what`."""
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


def load_preset_file(name: str, folder: Path | None = None) -> dict[str, Any]:
    """Load the tables of `[lidar]` in a preset file.

    Parameters
    ----------
    name : path of the file
    folder : start of relative paths (None: the working folder); the shipped data are searched after it

    Returns
    -------
    dict
        TOML tables by key: laser, receiver, detector, calibration. Files that stand beside the preset have their paths from
        `folder`.

    Raises
    ------
    ScenarioError
        If there is no such file, it cannot be read, or it holds something else.
    """
    path = find(name, folder)
    if path is None:
        beside = f"beside the scenario ({folder})" if str(folder or ".") != "." else "in the working folder"
        raise ScenarioError(f"no preset file '{name}' {beside}; check the name")
    tables = parse_toml(
        read_text(path, MOST_TOML_BYTES, ScenarioError, "preset file (.toml)"), path.name, ScenarioError
    )
    if not tables or (unknown := sorted(set(tables) - set(_TABLES))):
        what = f"has '{unknown[0]}'" if tables else "is empty"
        raise ScenarioError(
            f"{path.name}: is not a preset file: it {what} (known: {', '.join(_TABLES)}); write one with "
            "`rso-lidar camera fit`"
        )
    return _place_files(tables, Path(name).parent, path.parent)


def _place_files(tables: dict[str, Any], named: Path, folder: Path) -> dict[str, Any]:
    """Return the tables of a preset; files that stand beside it, in `folder`, get the folder that the scenario names."""
    result: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            result[key] = _place_files(value, named, folder)
        elif isinstance(value, str) and (key == "file" or key.endswith("_file")) and (folder / value).is_file():
            result[key] = str(named / value)
        else:
            result[key] = value
    return result
