"""Every array of every record says its dimensions, its unit and what it means, and its name ends in that unit."""

import dataclasses
import importlib
import re
from pathlib import Path

import numpy as np

from rso_lidar import records
from rso_lidar.records import Record, specs

ROOT = Path(__file__).resolve().parents[2]
UNIT_SUFFIX = {  # the unit as files spell it (CF conventions), and how a name ends that has it
    "m": "_m",
    "m2": "_m2",
    "m3": "_m3",
    "m-1": "_per_m",
    "s": "_s",
    "rad": "_rad",
    "m s-1": "_m_s",
    "rad s-1": "_rad_s",
    "m s-2": "_m_s2",
    "rad s-2": "_rad_s2",
    "N": "_n",
    "N m": "_n_m",
    "sr-1": "_per_sr",
    "s-1": "_per_s",
    "sr-1 m-2": "_per_sr_m2",
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


def test_records_have_prose_and_are_frozen():
    assert not [cls for cls in CLASSES if not cls.__doc__ or not cls.__dataclass_params__.frozen]
    assert not [cls for cls in CLASSES if cls.__doc__.startswith(f"{cls.__name__}(")], "dataclass wrote it, not we"


def test_arrays_without_a_statement_are_explained_in_the_docstring():
    fields = [(cls, field) for cls in CLASSES for field in dataclasses.fields(cls)]
    bare = [(cls, field) for cls, field in fields if "array" not in field.metadata and "ndarray" in str(field.type)]
    assert not [f"{cls.__name__}.{field.name}" for cls, field in bare if f"`{field.name}`" not in cls.__doc__]


def problems(name, spec):
    """Return what is wrong with the statement of an array."""
    suffix = next((ending for ending in SUFFIXES if name.endswith(ending)), "")
    checks = {
        "dims are words": all(re.fullmatch(r"…|[a-z][a-z_]*", dim) for dim in spec.dims),
        "dtype is of numbers": spec.dtype.kind in "fiub",
        "meaning is said": len(spec.meaning.split()) >= 2,
        "unit is known": spec.unit in UNIT_SUFFIX,
        "name ends in the unit": suffix == UNIT_SUFFIX.get(spec.unit),
    }
    return [check for check, kept in checks.items() if not kept]


def test_every_array_says_what_it_is():
    assert len(ARRAYS) > 50
    found = {f"{cls.__name__}.{name}": problems(name, specs(cls)[name]) for cls, name in ARRAYS}
    assert not {name: wrong for name, wrong in found.items() if wrong}


def test_a_bad_statement_is_seen():
    spec = specs(next(cls for cls, name in ARRAYS if name == "range_m"))["range_m"]
    assert problems("range_m", spec) == []
    assert problems("range_s", spec) == ["name ends in the unit"]
    assert problems("range_m", dataclasses.replace(spec, dims=("Ray 1",))) == ["dims are words"]
    assert problems("range_m", dataclasses.replace(spec, unit="furlong")) == ["unit is known", "name ends in the unit"]


def test_floating_point_alone_can_say_nan():
    """Where the prose promises NaN the dtype must be able to keep the promise."""
    for cls, name in ARRAYS:
        spec = specs(cls)[name]
        assert "NaN" not in spec.meaning or np.issubdtype(spec.dtype, np.floating), name
