"""Names for shell completion; a list is empty where its source cannot be read."""

from collections.abc import Iterable
from typing import get_args

from rso_lidar.errors import RsoLidarError
from rso_lidar.export import FORMATS
from rso_lidar.orbit import Catalog
from rso_lidar.records import ObjectClass, ShapeFamily, Stabilisation
from rso_lidar.scenario import find_examples, load_presets
from rso_lidar.scene import models, own_models


def _select(words: Iterable[str], incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


def list_cameras(incomplete: str) -> list[str]:
    """Return the shipped cameras; where none fits, the shell offers files."""
    return _select(load_presets(), incomplete)


def list_examples(incomplete: str) -> list[str]:
    """Return the shipped examples."""
    return _select(find_examples(), incomplete)


def list_formats(incomplete: str) -> list[str]:
    """Return the formats that recordings are written in."""
    return _select(FORMATS, incomplete)


def list_models(incomplete: str) -> list[str]:
    """Return the shipped models and those of the user's library."""
    return _select(sorted({*models(), *list_own_models(incomplete)}), incomplete)


def list_own_models(incomplete: str) -> list[str]:
    """Return the models of the user's library."""
    try:
        return _select(sorted(own_models()), incomplete)
    except (RsoLidarError, OSError):  # commands report a damaged library
        return []


def list_regimes(incomplete: str) -> list[str]:
    """Return the regimes of orbits."""
    return _select(Catalog.REGIMES, incomplete)


def list_classes(incomplete: str) -> list[str]:
    """Return the classes of objects."""
    return _select(get_args(ObjectClass), incomplete)


def list_shapes(incomplete: str) -> list[str]:
    """Return the families of shapes."""
    return _select(get_args(ShapeFamily), incomplete)


def list_stabilisations(incomplete: str) -> list[str]:
    """Return the ways in which craft are stabilised."""
    return _select(get_args(Stabilisation), incomplete)
