"""Names for completion in a shell: quick to find, and empty where they cannot be found."""

from collections.abc import Iterable
from typing import get_args

from rso_lidar.craft import ObjectClass, ShapeFamily, Stabilisation
from rso_lidar.errors import RsoLidarError
from rso_lidar.export.registry import FORMATS
from rso_lidar.orbit.sets.catalog import REGIMES
from rso_lidar.scenario.tables.presets import load_presets
from rso_lidar.scene.library.catalogue import models, own_models
from rso_lidar.shipped import shipped


def _begins(words: Iterable[str], incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


def camera_names(incomplete: str) -> list[str]:
    """Return the shipped cameras; where none fits, the shell offers files."""
    return _begins(load_presets(), incomplete)


def example_names(incomplete: str) -> list[str]:
    """Return the shipped examples."""
    return _begins(sorted(file.stem for file in shipped("examples").glob("*.toml")), incomplete)


def format_names(incomplete: str) -> list[str]:
    """Return the formats that recordings are written in."""
    return _begins(FORMATS, incomplete)


def model_names(incomplete: str) -> list[str]:
    """Return the shipped models and those of the user's library."""
    return _begins(sorted({*models(), *own_model_names(incomplete)}), incomplete)


def own_model_names(incomplete: str) -> list[str]:
    """Return the models of the user's library."""
    try:
        return _begins(sorted(own_models()), incomplete)
    except (RsoLidarError, OSError):  # commands report a damaged library
        return []


def regime_names(incomplete: str) -> list[str]:
    """Return the regimes of orbits."""
    return _begins(REGIMES, incomplete)


def class_names(incomplete: str) -> list[str]:
    """Return the classes of objects."""
    return _begins(get_args(ObjectClass), incomplete)


def shape_names(incomplete: str) -> list[str]:
    """Return the families of shapes."""
    return _begins(get_args(ShapeFamily), incomplete)


def stabilisation_names(incomplete: str) -> list[str]:
    """Return the ways in which craft are stabilised."""
    return _begins(get_args(Stabilisation), incomplete)
