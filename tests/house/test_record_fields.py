"""Every array of every record says its dimensions, its unit and what it means, and its name ends in that unit."""

import dataclasses
import importlib
import re
from pathlib import Path

import numpy as np
import pytest

from rso_lidar import records
from rso_lidar.records import Record, specs

ROOT = Path(__file__).resolve().parents[2]
UNIT_SUFFIX = {  # the unit as files spell it (CF conventions), and how a name ends that has it
    "m": "_m",
    "s": "_s",
    "rad": "_rad",
    "m s-1": "_m_s",
    "rad s-1": "_rad_s",
    "sr-1": "_per_sr",
    "s-1": "_per_s",
    "count": "_counts",
    "1": "",
}
SUFFIXES = sorted(filter(None, UNIT_SUFFIX.values()), key=len, reverse=True)


def classes():
    """Return every record class there is, in whatever room it lives."""
    for file in sorted((ROOT / "rso_lidar").rglob("*.py")):
        words = file.relative_to(ROOT).with_suffix("").parts
        if words[-1] not in ("__init__", "__main__"):
            importlib.import_module(".".join(words))
    found = {value for value in vars(records).values() if dataclasses.is_dataclass(value)}
    waiting = [Record]
    while waiting:
        waiting += (below := waiting.pop().__subclasses__())
        found.update(below)
    return sorted((cls for cls in found if cls.__module__.startswith("rso_lidar")), key=lambda cls: cls.__qualname__)


CLASSES = classes()
ARRAYS = [(cls, name) for cls in CLASSES for name in specs(cls)]


def test_the_records_of_the_walk_are_among_them():
    names = {cls.__name__ for cls in CLASSES}
    assert {"Truth", "Extent", "Rays", "Hits", "Photons", "Reading", "Labels", "Observation", "Frame"} <= names


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_record_has_prose_and_is_frozen(cls):
    assert cls.__doc__
    assert not cls.__doc__.startswith(f"{cls.__name__}("), "dataclass wrote that docstring, not we"
    assert cls.__dataclass_params__.frozen


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_array_without_a_statement_is_explained_in_the_docstring(cls):
    for field in dataclasses.fields(cls):
        if "array" not in field.metadata and "ndarray" in str(field.type):
            assert f"`{field.name}`" in cls.__doc__


@pytest.mark.parametrize(("cls", "name"), ARRAYS, ids=[f"{cls.__name__}.{name}" for cls, name in ARRAYS])
def test_array_says_what_it_is(cls, name):
    spec = specs(cls)[name]
    assert spec.dims
    assert all(re.fullmatch(r"…|[a-z][a-z_]*", dim) for dim in spec.dims)
    assert spec.dtype.kind in "fiub"
    assert len(spec.meaning.split()) >= 2
    assert spec.unit in UNIT_SUFFIX
    suffix = next((ending for ending in SUFFIXES if name.endswith(ending)), "")
    assert suffix == UNIT_SUFFIX[spec.unit], f"{name} is in {spec.unit!r}"


def test_floating_point_alone_can_say_nan():
    """Where the prose promises NaN the dtype must be able to keep the promise."""
    for cls, name in ARRAYS:
        spec = specs(cls)[name]
        assert "NaN" not in spec.meaning or np.issubdtype(spec.dtype, np.floating), name
